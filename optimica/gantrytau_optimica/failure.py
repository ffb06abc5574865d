"""A solution in words: what stayed violated, which limits were active when, what was not a finite number."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from gantrytau_optimica.limits import rows_of

if TYPE_CHECKING:
    from gantrytau_optimica.solver import Solution

Array = NDArray[np.float64]


class Held(NamedTuple):
    """A quantity with bounds, at several times (s, sorted; NaN where there is none)."""

    name: str
    unit: str
    kind: str
    times: Array
    values: Array
    lower: Array
    upper: Array


def explain(solution: Solution, *, tolerance: float = 1e-6, most: int = 8) -> str:
    """Status and objective and, of an unsolved problem, what prevents a solution.

    tolerance: violation that counts, relative to the magnitude of bound and value.
    most: lines in each part.
    """
    lines = [
        f"{solution.status} after {solution.iterations} iterations, {solution.solve_seconds:.2f} s; "
        f"objective {solution.objective:.6g}"
    ]
    if not solution.success:
        for title, part in (
            ("not a finite number:", not_finite(solution)),
            ("violated:", violations(solution, tolerance)),
        ):
            if part:
                lines += [title, *(f"  {line}" for line in part[:most])]
                if len(part) > most:
                    lines.append(f"  and {len(part) - most} more")
    active = active_limits(solution)
    if active:
        lines += ["at their limits:", *(f"  {line}" for line in active[:most])]
        if len(active) > most:
            lines.append(f"  and {len(active) - most} more")
    return "\n".join(lines)


def violations(solution: Solution, tolerance: float = 1e-6) -> list[str]:
    """Limits, boundary conditions and equations that do not hold, the relatively worst first."""
    found = []
    for held in _held(solution):
        excess = np.maximum(np.maximum(held.lower - held.values, held.values - held.upper), 0.0)
        size = np.maximum(1.0, np.nanmax(np.abs(np.where(np.isfinite(held.values), held.values, 1.0))))
        worst = int(np.argmax(np.nan_to_num(excess)))
        if not excess[worst] > tolerance * size:
            continue
        when = "" if np.isnan(held.times[worst]) else f" at t = {_number(held.times[worst])} s"
        low, high, unit = held.lower[worst], held.upper[worst], _unit(held.unit)
        value = held.values[worst]
        if held.kind in ("derivative", "residual", "continuity"):
            what = {
                "derivative": f"{held.name} does not hold",
                "residual": f"equation {held.name} does not hold",
                "continuity": f"{held.name} jumps",
            }[held.kind]
            text = f"{what}: residual {value:.3g}{unit}{when}"
        elif low == high:
            text = f"{held.name} is {_number(value)}{unit}, required {_number(low)}{unit}{when}"
        else:
            side, bound = ("lower", low) if value < low else ("upper", high)
            text = (
                f"{held.name} is {_number(value)}{unit}{when}, beyond its {side} limit "
                f"{_number(bound)}{unit} by {excess[worst]:.3g}{unit}"
            )
        found.append((excess[worst] / size, text))
    return [text for _, text in sorted(found, key=lambda pair: -pair[0])]


def active_limits(solution: Solution, tolerance: float = 1e-4) -> list[str]:
    """Which limits were reached when, for example `force at its upper limit 1200 N from t = 0.38 s to 0.41
    s`.

    tolerance: distance from a limit that counts as reached, relative to its magnitude (at least one).
    """
    lines = []
    for held in _held(solution):
        if held.kind in ("derivative", "residual", "continuity"):
            continue
        for side, bound in (("lower", held.lower), ("upper", held.upper)):
            reached = np.abs(held.values - bound) <= tolerance * np.maximum(1.0, np.abs(np.nan_to_num(bound)))
            reached &= (held.lower < held.upper) & np.isfinite(bound)
            for first, last in _runs(reached):
                limit = "" if held.kind == "moving" else f" {_number(float(bound[first]))}{_unit(held.unit)}"
                if np.isnan(held.times[first]):
                    when = ""
                elif first == last:
                    when = f" at t = {_number(held.times[first])} s"
                else:
                    when = f" from t = {_number(held.times[first])} s to {_number(held.times[last])} s"
                lines.append(f"{held.name} at its {side} limit{limit}{when}")
    return lines


def not_finite(solution: Solution) -> list[str]:
    """Derivatives, residuals, limits and integrand that are no finite numbers, by name and time."""
    trajectory, problem = solution.trajectory, solution.transcription.problem
    times = trajectory.start + solution.transcription.layout.times.ravel() * (
        trajectory.final - trajectory.start
    )
    parts = [(f"der({x.name})", problem.ode[i]) for i, x in enumerate(problem.states)]
    names = problem.residual_names or [f"residual {i}" for i in range(len(problem.algebraics))]
    parts += [(f"equation {name}", problem.residuals[i]) for i, name in enumerate(names)]
    parts += [(row.name, row.expression) for row in rows_of(problem.path_limits, problem.parameters)]
    parts += [("integrand", ca.SX(problem.integrand))]
    values = trajectory.value(ca.vertcat(*(expression for _, expression in parts)), times)
    lines = []
    for (name, _), column in zip(parts, values.reshape(len(times), -1).T, strict=True):
        strange = np.flatnonzero(~np.isfinite(column))
        if len(strange):
            lines.append(
                f"{name} is {column[strange[0]]} at t = {_number(times[strange[0]])} s"
                + (f" and {len(strange) - 1} other points" if len(strange) > 1 else "")
            )
    return lines


def _held(solution: Solution) -> Iterator[Held]:
    """Everything that has bounds: signals and free numbers, then the rows of the program."""
    t = solution.transcription
    problem, layout = t.problem, t.layout
    trajectory = solution.trajectory
    lower, upper = t.variable_bounds.at(solution.parameters)
    for i, x in enumerate((*problem.signals, *problem.free)):
        mine = (
            np.flatnonzero(layout.owner == i)
            if i < len(problem.signals)
            else np.array([i - len(problem.signals)])
        )
        mine = mine[np.argsort(layout.moment[mine])]
        times = trajectory.start + layout.moment[mine] * (trajectory.final - trajectory.start)
        yield Held(x.name, x.unit, "bound", times, solution.variables[mine], lower[mine], upper[mine])
    lower, upper = t.row_bounds.at(solution.parameters)
    for group in t.groups:
        times = trajectory.start + group.moments * (trajectory.final - trajectory.start)
        kind = "moving" if group.moving else group.kind
        rows = group.rows
        yield Held(
            group.name,
            group.unit,
            kind,
            times,
            solution.rows[rows],
            lower[rows] / group.scale,
            upper[rows] / group.scale,
        )


def _runs(mask: NDArray[np.bool_]) -> Iterator[tuple[int, int]]:
    """First and last index of every run of true entries."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    yield from ((int(a), int(b) - 1) for a, b in zip(edges[::2], edges[1::2], strict=True))


def _number(value: Any) -> str:
    return f"{value:.5g}"


def _unit(unit: str) -> str:
    return f" {unit}" if unit and unit != "1" else ""
