"""How a solve ended, in the model's words: what is violated, what binds, and when."""

from collections.abc import Sequence

import numpy as np

from gantrytau_optimica.ipopt import Solution
from gantrytau_optimica.program import Program
from gantrytau_optimica.trajectory import Trajectory

MEANING = {
    "dynamics": "the motion of {}",
    "algebraic": "{}",
    "continuity": "the continuity of {}",
    "path": "`{}`",
    "boundary": "`{}`",
    "step": "the largest step of {}",
    "border": "{}",
}
ORDER = ("boundary", "path", "step", "border", "continuity", "algebraic", "dynamics")


def report(program: Program, solution: Solution, phases: Sequence[Trajectory]) -> str:
    """Status, worst violations with their times, and the limits that bind."""
    horizon = ", ".join(
        f"{'horizon' if not p.phase.name else p.phase.name} {p.start_time:.6g} to {p.final_time:.6g} s"
        for p in phases
    )
    lines = [
        f"{program.problem.name}: {solution.status} after {solution.iterations} iterations, objective "
        f"{solution.objective:.8g}, {horizon}"
    ]
    violations = _violations(program, solution, phases)
    if not solution.success and violations:
        lines.append("Not met:")
        lines += [f"  {line}" for line in violations[:8]]
    binding = [line for phase in phases for line in _binding(program, solution, phase)]
    binding += _binding_numbers(program, solution)
    if binding:
        lines.append("At their limits:")
        lines += [f"  {line}" for line in binding[:12]]
    return "\n".join(lines)


def _violations(program: Program, solution: Solution, phases: Sequence[Trajectory]) -> list[str]:
    """What is not met, conditions of the user first: what the model does to meet them says less."""
    g = solution.constraints
    amount = np.maximum(program.lbg - g, g - program.ubg)
    amount = np.where(np.isfinite(g), amount, np.inf)
    found = []
    for group in program.groups:
        mine = amount[group.rows]
        worst = int(np.argmax(mine))
        if mine[worst] <= 1e-6:
            continue
        size, moment = mine[worst] * group.size, group.moments[worst]
        when = "" if np.isnan(moment) else f" at t = {phases[group.phase].times(moment):.4g} s"
        how = "is not finite" if np.isinf(size) else f"is off by {size:.3g}"
        found.append(
            (ORDER.index(group.kind), -size, f"{MEANING[group.kind].format(group.name)} {how}{when}")
        )
    return [text for _, _, text in sorted(found)]


def _binding(program: Program, solution: Solution, trajectory: Trajectory) -> list[str]:
    """Limits of one phase that are reached, with the intervals of time."""
    found: list[str] = []
    layout = trajectory.layout
    times = trajectory.times(layout.fractions)
    lower, upper = program.lbw * program.places.scale, program.ubw * program.places.scale
    for number, signal in enumerate(trajectory.phase.signals):
        places = layout.tracks[number].unknowns[:, -1] if number in layout.chains else layout.of(number)
        moments = trajectory.times(trajectory.mesh.borders[1:]) if number in layout.chains else None
        when = trajectory.times(layout.moment[places - layout.first]) if moments is None else moments
        value = solution.w[places]
        for word, bound in (("lower", lower[places]), ("upper", upper[places])):
            reached = _reached(value, bound)
            if np.any(reached):
                found.append(
                    f"{signal.words} {_intervals(reached, when)}"
                    if signal.words and signal.words != signal.name
                    else f"{signal.name} at its {word} limit {bound[reached][0]:.6g} {_intervals(reached, when)}"
                )
    number = program.places.layouts.index(layout)
    for group in program.groups:
        if group.kind != "path" or group.phase != number:
            continue
        for word, bound in (("lower", group.lower), ("upper", group.upper)):
            reached = _reached(solution.constraints[group.rows], np.full(group.rows.size, bound))
            if np.any(reached):
                found.append(f"`{group.name}` at its {word} limit {_intervals(reached, times)}")
    return found


def _binding_numbers(program: Program, solution: Solution) -> list[str]:
    found = []
    lower, upper = program.lbw * program.places.scale, program.ubw * program.places.scale
    for number, place in zip(program.problem.free, program.places.free, strict=True):
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
