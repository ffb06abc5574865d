"""Values of signals at single times, as expressions of the variables of the nonlinear program.

At relative time m = (t - start) / (final - start), in the element with borders a < b, a signal is the
Lagrange polynomial of its values at the nodes, taken at s = (m - a) / (b - a). Where m does not depend on
free numbers, element and s are numbers. Otherwise s is an expression of them and the element is that of
their values when the problem is transcribed: exact as long as the point stays in it, which `Place.strayed`
tells.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gantrytau_optimica.assembly import Block
from gantrytau_optimica.collocation import lagrange
from gantrytau_optimica.control_problem import ControlProblem, PointValue
from gantrytau_optimica.layout import Layout

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Place:
    """Where a point lies: its element, and its coordinate there."""

    element: int
    coordinate: float | ca.SX
    moment: (
        ca.Function | None
    )  # (free, parameters) -> relative time, of a point that moves between the elements

    def strayed(self, layout: Layout, free: Array, parameters: Array) -> bool:
        """Whether the point has left the element that it was placed in."""
        if self.moment is None:
            return False
        left, right = layout.borders[self.element], layout.borders[self.element + 1]
        moment = float(self.moment(free, parameters))
        return not left - 1e-9 <= moment <= right + 1e-9


def place(
    problem: ControlProblem, layout: Layout, point: PointValue, free: Array, parameters: Array
) -> Place:
    """Element and coordinate of a point, near the given values of free numbers and parameters."""
    last = len(layout.widths) - 1
    if isinstance(point.time, str):
        if point.time not in ("initial", "final"):
            raise ValueError(
                f"time of point {point.symbol}: found '{point.time}', expected 'initial' or 'final'"
            )
        return Place(0, 0.0, None) if point.time == "initial" else Place(last, 1.0, None)
    start, final = ca.SX(problem.start_time), ca.SX(problem.final_time)
    relative = (point.time - start) / (final - start)
    symbols = [
        ca.vertcat(*(x.symbol for x in problem.free)),
        ca.vertcat(*(ca.vec(x.symbol) for x in problem.parameters)),
    ]
    moment = ca.Function("moment", symbols, [relative], {"allow_free": False})
    found = float(moment(free, parameters))
    if not -1e-9 <= found <= 1 + 1e-9:
        raise ValueError(
            f"point {point.symbol}: its time lies at {found:.6g} of the horizon, expected 0 to 1"
        )
    element, s = (value[0] for value in layout.locate(np.array([min(max(found, 0.0), 1.0)])))
    random = np.random.default_rng(0)
    nearby = [
        float(
            moment(
                free + random.uniform(0.1, 0.3, len(free)),
                parameters + random.uniform(0.1, 0.3, len(parameters)),
            )
        )
        for _ in range(3)
    ]
    if np.allclose(nearby, found, rtol=0, atol=1e-12):
        return Place(int(element), float(s), None)
    coordinate = (relative - layout.borders[element]) / layout.widths[element]
    return Place(int(element), coordinate, moment)


def point_block(
    problem: ControlProblem, layout: Layout, places: list[Place], expression: ca.SX, nominal: Array, scatter
) -> Block:
    """A block of one copy: an expression of points, free numbers and parameters."""
    symbols: dict[int, ca.SX] = {}
    values = [
        _value(problem, layout, point, where, symbols)
        if ca.depends_on(expression, point.symbol)
        else point.symbol
        for point, where in zip(problem.points, places, strict=True)
    ]
    if problem.points:
        expression = ca.substitute([expression], [point.symbol for point in problem.points], values)[0]
    free = [number.symbol for number in problem.free]
    variables = np.array([*symbols, *range(len(free))], dtype=np.int64)
    gather = sparse.csr_matrix(
        (nominal[variables], (np.arange(len(variables)), variables)), shape=(len(variables), layout.size)
    )
    return Block(
        local=ca.vertcat(*symbols.values(), *free),
        parameters=ca.vertcat(*(ca.vec(item.symbol) for item in problem.parameters)),
        constants=ca.SX(0, 1),
        values=expression,
        constant_values=np.zeros((0, 1)),
        gather=gather,
        scatter=scatter,
    )


def _value(
    problem: ControlProblem, layout: Layout, point: PointValue, where: Place, symbols: dict[int, ca.SX]
) -> ca.SX:
    """The point's expression with every signal replaced by its polynomial; new variables join `symbols`."""
    olds, news = [], []
    for signal, track in zip(problem.signals, layout.tracks, strict=True):
        if not ca.depends_on(point.expression, signal.symbol):
            continue
        value = ca.SX(0)
        basis = lagrange(track.nodes[where.element], where.coordinate)
        for weight, variable in zip(basis, track.variables[where.element], strict=True):
            if isinstance(weight, float) and abs(weight) < 1e-14:
                continue
            symbol = symbols.setdefault(int(variable), ca.SX.sym(f"{signal.name}_{variable}"))
            value += symbol if isinstance(weight, float) and weight == 1.0 else weight * symbol
        olds.append(signal.symbol)
        news.append(value)
    if ca.depends_on(point.expression, problem.time):
        start, final = ca.SX(problem.start_time), ca.SX(problem.final_time)
        relative = layout.borders[where.element] + layout.widths[where.element] * where.coordinate
        olds.append(problem.time)
        news.append(start + relative * (final - start))
    return ca.substitute([point.expression], olds, news)[0] if olds else point.expression


def parameter_values(problem: ControlProblem, given: Mapping[str, object] | None = None) -> Array:
    """The parameters in one column: the given values, for the others those of the problem."""
    given = dict(given or {})
    columns = []
    for item in problem.parameters:
        value = np.asarray(given.pop(item.name, item.value), dtype=float).ravel()
        count = item.symbol.numel()
        if value.size not in (1, count):
            raise ValueError(f"{item.name}: {value.size} values, expected {count}")
        if not np.isfinite(value).all():
            raise ValueError(f"{item.name}: found {value.tolist()}, expected finite numbers")
        columns.append(np.broadcast_to(value, (count,)))
    if given:
        raise ValueError(
            f"'{next(iter(given))}' is no parameter of the problem; parameters are "
            + (", ".join(item.name for item in problem.parameters) or "none")
        )
    return np.concatenate(columns) if columns else np.zeros(0)
