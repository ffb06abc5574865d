"""Direct collocation: a control problem on a mesh becomes a nonlinear program.

    unknowns        free numbers p; per element the states at its start x_0, and at each of its k points
                    the states x_j, algebraics z_j and inputs u_j, all divided by their typical size
    dynamics        sum_i D_ij x_i = h f(t_j, x_j, z_j, u_j, p)          at every point
    algebraic       0 = g(t_j, x_j, z_j, u_j, p)                         at every point
    path            lower <= c(t_j, x_j, z_j, u_j, p) <= upper           at every point
    continuity      x_0 of the next element = value of this one's polynomial at its end
    boundary        conditions on values at single times
    integral        sum over elements of h sum_j w_j L(t_j, ...)

What happens at a point is one small function, evaluated and differentiated for all points at once; the rest is
linear (see assembly). Nothing symbolic grows with the number of elements.
"""

from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy import sparse

from gantrytau import ModelError
from gantrytau_optimica.assembly import Assembled, Block, assemble
from gantrytau_optimica.places import Places, lay_out
from gantrytau_optimica.records import ControlProblem, Limit, PointValue
from gantrytau_optimica.scheme import Collocation
from gantrytau_optimica.sorting import bare_limit, signal_limits


@dataclass(frozen=True, eq=False)
class Row:
    """What a constraint of the program is: kind, name in the model's words, and place on [0, 1] or None."""

    kind: str  # "dynamics", "algebraic", "continuity", "path", "boundary"
    name: str
    fraction: float | None


@dataclass(frozen=True, eq=False)
class Program:
    """The nonlinear program in scaled unknowns, its limits, and what its rows and unknowns mean."""

    problem: ControlProblem
    places: Places
    assembled: Assembled
    rows: tuple[Row, ...]
    lbw: np.ndarray
    ubw: np.ndarray
    lbg: np.ndarray
    ubg: np.ndarray

    def with_numbers(self, problem: ControlProblem) -> "Program":
        """The same program with other free numbers and first guesses."""
        lower, upper, places = self.lbw.copy(), self.ubw.copy(), self.places
        for place, number in zip(places.free, problem.free, strict=True):
            lower[place], upper[place] = number.min / places.scale[place], number.max / places.scale[place]
        return replace(self, problem=problem, lbw=lower, ubw=upper)


def transcribe(problem: ControlProblem, mesh: np.ndarray, scheme: Collocation) -> Program:
    """The nonlinear program of `problem` on `mesh`, element borders from 0 to 1 (n + 1,)."""
    places = lay_out(problem, mesh, scheme)
    path = [limit for limit in problem.path_limits if bare_limit(limit, problem) is None]
    rows, lower, upper = _rows(places, path)
    running = _point_block(places, path, len(rows))
    objective = [_single_block(places, [problem.objective], sparse.csr_matrix([[1.0]]))]
    constraints = [running]
    if not problem.integrand.is_zero():
        objective.append(_integral_block(places))
    count = len(problem.boundary)
    if count:
        scatter = sparse.csr_matrix(
            (np.ones(count), (np.arange(len(rows) - count, len(rows)), np.arange(count))),
            shape=(len(rows), count),
        )
        constraints.append(_single_block(places, [m.expression for m in problem.boundary], scatter))
    lbw, ubw = _bounds(places)
    assembled = assemble(objective, constraints, _linear(places, len(path), len(rows)), 0)
    return Program(problem, places, assembled, rows, lbw, ubw, lower, upper)


def _rows(places: Places, path: list[Limit]) -> tuple[tuple[Row, ...], np.ndarray, np.ndarray]:
    """All rows with their limits: point after point, then continuity, then boundary."""
    problem, states = places.problem, [s.name for s in places.problem.states]
    kinds = [("dynamics", name) for name in states]
    kinds += [("algebraic", name) for name in problem.residual_names]
    kinds += [("path", limit.name) for limit in path]
    rows = [Row(kind, name, float(fraction)) for fraction in places.fractions for kind, name in kinds]
    equal = [0.0] * (len(kinds) - len(path))
    lower = [*equal, *(limit.lower for limit in path)] * places.fractions.size
    upper = [*equal, *(limit.upper for limit in path)] * places.fractions.size
    jumps = places.jumps().shape[0]
    borders = np.repeat(places.mesh[1:], len(states))[:jumps]
    rows += [Row("continuity", states[k % len(states)], float(border)) for k, border in enumerate(borders)]
    rows += [Row("boundary", limit.name, None) for limit in problem.boundary]
    lower += [0.0] * jumps + [limit.lower for limit in problem.boundary]
    upper += [0.0] * jumps + [limit.upper for limit in problem.boundary]
    return tuple(rows), np.array(lower), np.array(upper)


def _linear(places: Places, paths: int, count: int) -> sparse.csr_matrix:
    """The rows' linear part: differentiation matrix and continuity."""
    slopes, jumps = places.slopes().tocoo(), places.jumps().tocoo()
    nx = len(places.problem.states)
    per_point = nx + len(places.problem.algebraics) + paths
    row = np.concatenate(
        [
            (slopes.row // max(nx, 1)) * per_point + slopes.row % max(nx, 1),
            places.fractions.size * per_point + jumps.row,
        ]
    )
    column, value = np.concatenate([slopes.col, jumps.col]), np.concatenate([slopes.data, jumps.data])
    return sparse.csr_matrix((value, (row, column)), shape=(count, places.size))


def _local(problem: ControlProblem) -> ca.SX:
    """Signals and free numbers, as they stand in a column of the point function."""
    return ca.vertcat(ca.SX(0, 1), *(s.symbol for s in problem.signals), *(n.symbol for n in problem.free))


def _timed(problem: ControlProblem, expression: ca.SX, fraction: ca.SX) -> ca.SX:
    """The expression with time written as a share of the horizon."""
    t = problem.start_time + fraction * (problem.final_time - problem.start_time)
    return (
        ca.substitute(expression, problem.time, t) if ca.depends_on(expression, problem.time) else expression
    )


def _point_block(places: Places, path: list[Limit], count: int) -> Block:
    problem, fraction = places.problem, ca.SX.sym("fraction")
    horizon = problem.final_time - problem.start_time
    values = ca.vertcat(problem.ode * horizon, problem.residuals, *(limit.expression for limit in path))
    per_point, points = values.numel(), places.fractions.size
    factor = np.ones((places.mesh.size - 1, places.scheme.points.size, per_point))
    nx = len(problem.states)
    sizes = np.array([s.nominal for s in problem.states])
    factor[:, :, :nx] = -np.diff(places.mesh)[:, None, None] / sizes
    index = np.arange(points * per_point)
    scatter = sparse.csr_matrix((factor.ravel(), (index, index)), shape=(count, index.size))
    values = _timed(problem, ca.densify(values), fraction)
    return Block(
        _local(problem), ca.SX(0, 1), fraction, values, places.fractions[None, :], places.at_points(), scatter
    )


def _integral_block(places: Places) -> Block:
    problem, fraction = places.problem, ca.SX.sym("fraction")
    value = _timed(problem, problem.integrand * (problem.final_time - problem.start_time), fraction)
    weights = (np.diff(places.mesh)[:, None] * places.scheme.weights).reshape(1, -1)
    return Block(
        _local(problem),
        ca.SX(0, 1),
        fraction,
        ca.densify(value),
        places.fractions[None, :],
        places.at_points(),
        sparse.csr_matrix(weights),
    )


def _single_block(places: Places, expressions: list[ca.SX], scatter) -> Block:
    """Expressions of values at single times and of free numbers, once."""
    problem = places.problem
    wanted = {leaf.element_hash() for e in expressions for leaf in ca.symvar(e)}
    local, gather, old, new = (
        [ca.vertcat(ca.SX(0, 1), *(n.symbol for n in problem.free))],
        [places.numbers()],
        [],
        [],
    )
    signals = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in problem.signals))
    for point in problem.points:
        if not any(element.element_hash() in wanted for element in point.symbol.elements()):
            continue
        fraction = point_fraction(problem, point)
        here = ca.SX.sym("point", signals.numel())
        local.append(here)
        gather.append(places.at_fraction(fraction))
        old.append(point.symbol)
        new.append(ca.substitute(_timed(problem, point.expression, ca.SX(fraction)), signals, here))
    column = ca.vertcat(*expressions)
    if old:
        column = ca.substitute(column, ca.vertcat(*old), ca.vertcat(*new))
    matrix = sparse.vstack(gather).tocsr()
    return Block(
        ca.vertcat(*local), ca.SX(0, 1), ca.SX(0, 1), ca.densify(column), np.zeros((0, 1)), matrix, scatter
    )


def _bounds(places: Places) -> tuple[np.ndarray, np.ndarray]:
    """Limits of the unknowns, those of bare signals on the path included."""
    lower, upper = np.full(places.size, -np.inf), np.full(places.size, np.inf)
    limits = signal_limits(places.problem, "limits")
    for signals, table in places.tables():
        for column, signal in enumerate(signals):
            lower[table[..., column]], upper[table[..., column]] = limits[signal.name]
    for place, number in zip(places.free, places.problem.free, strict=True):
        lower[place], upper[place] = number.min, number.max
    return lower / places.scale, upper / places.scale


def point_fraction(problem: ControlProblem, point: PointValue) -> float:
    """Where on [0, 1] a point lies. Raises ModelError if it depends on free numbers, or lies outside."""
    if isinstance(point.time, str):
        return 0.0 if point.time == "initial" else 1.0
    place = (point.time - problem.start_time) / (problem.final_time - problem.start_time)
    numbers = ca.vertcat(ca.SX(0, 1), *(n.symbol for n in problem.free))
    evaluate = ca.Function("place", [numbers], [place])
    guess = ca.DM([n.guess for n in problem.free])
    found, other = float(evaluate(guess)), float(evaluate(1.37 * guess + 0.11))  # any other values
    if abs(found - other) > 1e-12:
        raise ModelError(
            f"at({point.time}, ...): with a free horizon the time must be a fixed fraction of it; write it as "
            "start_time + fraction * (final_time - start_time)"
        )
    if not -1e-12 <= found <= 1 + 1e-12:
        raise ModelError(f"at({point.time}, ...): lies outside of the horizon; choose a time inside of it")
    return min(max(found, 0.0), 1.0)
