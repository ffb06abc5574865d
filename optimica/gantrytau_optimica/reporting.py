"""How a solve ended, in the model's words: what is violated, what binds, and when."""

import numpy as np

from gantrytau_optimica.ipopt import Solution
from gantrytau_optimica.program import Program

MEANING = {
    "dynamics": "the motion of {}",
    "algebraic": "{}",
    "continuity": "the continuity of {}",
    "path": "`{}`",
    "boundary": "`{}`",
}


def report(name: str, program: Program, solution: Solution, horizon: tuple[float, float]) -> str:
    """Status, worst violations with their times, and the limits that bind."""
    lines = [
        f"{name}: {solution.status} after {solution.iterations} iterations, objective {solution.objective:.8g}, "
        f"horizon {horizon[0]:.6g} to {horizon[1]:.6g} s"
    ]
    violations = _violations(program, solution, horizon)
    if not solution.success and violations:
        lines.append("Not met:")
        lines += [f"  {line}" for line in violations[:8]]
    binding = _binding(program, solution, horizon)
    if binding:
        lines.append("At their limits:")
        lines += [f"  {line}" for line in binding[:12]]
    return "\n".join(lines)


def _violations(program: Program, solution: Solution, horizon: tuple[float, float]) -> list[str]:
    g = solution.constraints
    amount = np.maximum(program.lbg - g, g - program.ubg)
    amount = np.where(np.isfinite(g), amount, np.inf)
    worst: dict[tuple[str, str], tuple[float, float | None]] = {}
    for k in np.flatnonzero(amount > 1e-6):
        row = program.rows[k]
        key = (row.kind, row.name)
        if key not in worst or amount[k] > worst[key][0]:
            worst[key] = (float(amount[k]), row.fraction)
    found = []
    # conditions of the user first: what the model does to meet them says less
    order = ("boundary", "path", "continuity", "algebraic", "dynamics")
    for (kind, name), (size, fraction) in sorted(
        worst.items(), key=lambda m: (order.index(m[0][0]), -m[1][0])
    ):
        when = "" if fraction is None else f" at t = {_at(fraction, horizon):.4g} s"
        how = "is not finite" if np.isinf(size) else f"is off by {size:.3g}"
        found.append(f"{MEANING[kind].format(name)} {how}{when}")
    return found


def _at(fraction: float, horizon: tuple[float, float]) -> float:
    return horizon[0] + fraction * (horizon[1] - horizon[0])


def _binding(program: Program, solution: Solution, horizon: tuple[float, float]) -> list[str]:
    """Limits that are reached, with the intervals of time."""
    found: list[str] = []
    points = (
        program.places.mesh[:-1, None] + np.diff(program.places.mesh)[:, None] * program.places.scheme.points
    )
    times = np.array([_at(f, horizon) for f in points.ravel()])
    lower, upper = program.lbw * program.places.scale, program.ubw * program.places.scale
    problem = program.problem
    for signals, table in (
        (problem.states, program.places.states),
        (problem.algebraics, program.places.algebraics),
        (problem.inputs, program.places.inputs),
    ):
        for column, signal in enumerate(signals):
            places = table[..., column].ravel()
            value = solution.w[places]
            for word, bound in (("lower", lower[places]), ("upper", upper[places])):
                reached = _reached(value, bound)
                if np.any(reached):
                    found.append(
                        f"{signal.words} {_intervals(reached, times)}"
                        if signal.words and signal.words != signal.name
                        else f"{signal.name} at its {word} limit {bound[reached][0]:.6g} {_intervals(reached, times)}"
                    )
    rows: dict[str, list[int]] = {}
    for k, row in enumerate(program.rows):
        if row.kind == "path":
            rows.setdefault(row.name, []).append(k)
    for name, places in rows.items():
        g, low, high = solution.constraints[places], program.lbg[places], program.ubg[places]
        for word, bound in (("lower", low), ("upper", high)):
            reached = _reached(g, bound)
            if np.any(reached):
                found.append(f"`{name}` at its {word} limit {_intervals(reached, times)}")
    for number, place in zip(problem.free, program.places.free, strict=True):
        if number.held:
            continue
        for word, bound in (("lower", lower[place]), ("upper", upper[place])):
            if _reached(solution.w[place], bound):
                found.append(f"{number.name} at its {word} limit {bound:.6g}")
    return found


def _reached(value: np.ndarray, bound: np.ndarray) -> np.ndarray:
    with np.errstate(invalid="ignore"):
        return np.isfinite(bound) & (np.abs(value - bound) <= 1e-6 * np.maximum(1.0, np.abs(bound)))


def _intervals(reached: np.ndarray, times: np.ndarray) -> str:
    """The stretches of time in which something is reached: 'from t = 0.1 s to 0.3 s'."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], reached.astype(int), [0]])))
    spans = [(times[a], times[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    words = [f"at t = {a:.4g} s" if a == b else f"from t = {a:.4g} s to {b:.4g} s" for a, b in spans[:4]]
    return ", ".join(words) + (f" and {len(spans) - 4} more times" if len(spans) > 4 else "")
