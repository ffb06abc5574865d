"""Direct collocation: a control problem on a mesh becomes a nonlinear program.

    unknowns        free numbers p; per element the states at its start x_0, and at each of its k points
                    the states x_j, algebraics z_j and inputs u_j, all divided by their typical size
    dynamics        sum_i D_ij x_i = h f(t_j, x_j, z_j, u_j, p)          at every point
    algebraic       0 = g(t_j, x_j, z_j, u_j, p)                         at every point
    continuity      x_0 of the next element = value of this one's polynomial at its end
    integral        sum over elements of h sum_j w_j L(t_j, ...)

With Radau points the last point is the end of the element and shares its unknowns with the next start.
One SX function is written per point and called for each, so that CasADi derives the sparsity itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.scheme import Collocation, interpolation
from gantrytau_optimica.records import ControlProblem, PointValue


@dataclass(frozen=True, eq=False)
class Row:
    """What a constraint of the program is: kind, name in the model's words, and place on [0, 1] or None."""

    kind: str  # "dynamics", "algebraic", "continuity", "path", "boundary"
    name: str
    fraction: float | None


@dataclass(frozen=True, eq=False)
class Program:
    """The nonlinear program. w: unknowns (scaled by `scale`), g: constraints with their meaning in `rows`.

    places: index in w of the states at element starts (n, nx) (the last row is the end), of states (n, k, nx),
    algebraics and inputs (n, k, .) at the points, and of the free numbers.
    """

    problem: ControlProblem
    scheme: Collocation
    mesh: np.ndarray
    w: ca.SX
    f: ca.SX
    g: ca.SX
    rows: tuple[Row, ...]
    lbw: np.ndarray
    ubw: np.ndarray
    lbg: np.ndarray
    ubg: np.ndarray
    scale: np.ndarray
    starts: np.ndarray
    states: np.ndarray
    algebraics: np.ndarray
    inputs: np.ndarray
    free: np.ndarray


def transcribe(problem: ControlProblem, mesh: np.ndarray, scheme: Collocation) -> Program:
    """The nonlinear program of `problem` on `mesh`, element borders from 0 to 1 (n + 1,)."""
    return _Writer(problem, mesh, scheme).program()


class _Writer:
    def __init__(self, problem: ControlProblem, mesh: np.ndarray, scheme: Collocation):
        self.problem, self.mesh, self.scheme = problem, mesh, scheme
        n, k = mesh.size - 1, scheme.points.size
        nx, nz, nu, np_ = (len(x) for x in (problem.states, problem.algebraics, problem.inputs, problem.free))
        shared = scheme.points[-1] == 1.0  # the last point is the start of the next element
        self.free = np.arange(np_)
        place = np_
        self.starts = np.zeros((n + 1, nx), dtype=int)
        self.states = np.zeros((n, k, nx), dtype=int)
        self.algebraics = np.zeros((n, k, nz), dtype=int)
        self.inputs = np.zeros((n, k, nu), dtype=int)
        self.starts[0] = np.arange(place, place + nx)
        place += nx
        for e in range(n):
            for j in range(k):
                for table, size in ((self.states, nx), (self.algebraics, nz), (self.inputs, nu)):
                    table[e, j] = np.arange(place, place + size)
                    place += size
            if shared:
                self.starts[e + 1] = self.states[e, -1]
            else:
                self.starts[e + 1] = np.arange(place, place + nx)
                place += nx
        self.size, self.shared = place, shared
        self.w = ca.SX.sym("w", place)
        self.scale = np.ones(place)
        for signals, table in self._tables():
            for column, signal in enumerate(signals):
                self.scale[table[..., column]] = signal.nominal
        for column, number in enumerate(problem.free):
            self.scale[column] = max(abs(number.guess), 1e-3)
        self.values = ca.SX(self.scale) * self.w
        self.elements = np.array(self.values.elements(), dtype=object)

    def _tables(self):
        problem = self.problem
        return (
            (problem.states, self.starts),
            (problem.states, self.states),
            (problem.algebraics, self.algebraics),
            (problem.inputs, self.inputs),
        )

    def program(self) -> Program:
        problem, scheme = self.problem, self.scheme
        p = self._at(self.free)
        symbols = ca.vertcat(*(number.symbol for number in problem.free)) if problem.free else ca.SX(0, 1)
        t0, tf = ca.substitute([problem.start_time, problem.final_time], [symbols], [p])
        path = [limit for limit in problem.path_limits if _bound(limit, problem) is None]
        point = self._point_function([limit.expression for limit in path], symbols)
        self.lbw, self.ubw = self._bounds()
        g: list[ca.SX] = []
        lower: list[float] = []
        upper: list[float] = []
        rows: list[Row] = []
        f = ca.SX(0)

        def add(expression: ca.SX, kind: str, names: Sequence[str], place: float | None, low=None, high=None):
            size = len(names)
            g.append(expression)
            lower.extend([0.0] * size if low is None else low)
            upper.extend([0.0] * size if high is None else high)
            rows.extend(Row(kind, name, place) for name in names)

        sizes = self._sizes()
        state_names = [s.name for s in problem.states]
        for e in range(self.mesh.size - 1):
            fraction = self.mesh[e + 1] - self.mesh[e]
            h = fraction * (tf - t0)
            nodes = [self._at(self.starts[e]), *(self._at(x) for x in self.states[e])]
            matrix = ca.horzcat(*nodes)
            for j, c in enumerate(scheme.points):
                place = float(self.mesh[e] + c * fraction)
                t = t0 + place * (tf - t0)
                ode, residual, integrand, limits = point(
                    t, nodes[j + 1], self._at(self.algebraics[e, j]), self._at(self.inputs[e, j]), p
                )
                if state_names:
                    slope = matrix @ scheme.differentiation[:, j]
                    add((slope - h * ode) / sizes, "dynamics", state_names, place)
                add(residual, "algebraic", problem.residual_names, place)
                add(
                    limits,
                    "path",
                    [m.name for m in path],
                    place,
                    [m.lower for m in path],
                    [m.upper for m in path],
                )
                f += h * scheme.weights[j] * integrand
            if not self.shared and state_names:
                end = matrix @ scheme.end
                add(
                    (end - self._at(self.starts[e + 1])) / sizes,
                    "continuity",
                    state_names,
                    float(self.mesh[e + 1]),
                )
        boundary = problem.boundary
        expressions = [problem.objective, *(limit.expression for limit in boundary)]
        objective, *conditions = self._with_points(expressions, symbols, p, t0, tf)
        if boundary:
            low, high = [m.lower for m in boundary], [m.upper for m in boundary]
            add(ca.vertcat(*conditions), "boundary", [m.name for m in boundary], None, low, high)
        return Program(
            problem, scheme, self.mesh, self.w, f + objective, ca.vertcat(*g) if g else ca.SX(0, 1), tuple(rows),
            self.lbw, self.ubw, np.array(lower), np.array(upper), self.scale,
            self.starts, self.states, self.algebraics, self.inputs, self.free,
        )  # fmt: skip

    def _sizes(self) -> ca.DM:
        return ca.DM([s.nominal for s in self.problem.states])

    def _at(self, places: np.ndarray) -> ca.SX:
        found = self.elements[places].tolist()
        return ca.vertcat(*found) if found else ca.SX(0, 1)

    def _arguments(self, symbols: ca.SX) -> list[ca.SX]:
        problem = self.problem
        columns = [
            ca.vertcat(*(s.symbol for s in signals)) if signals else ca.SX(0, 1)
            for signals in (problem.states, problem.algebraics, problem.inputs)
        ]
        return [problem.time, *columns, symbols]

    def _point_function(self, limits: list[ca.SX], symbols: ca.SX) -> ca.Function:
        problem = self.problem
        path = ca.vertcat(*limits) if limits else ca.SX(0, 1)
        return ca.Function(
            "point",
            self._arguments(symbols),
            [problem.ode, problem.residuals, problem.integrand, path],
            {"cse": True},
        )

    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Limits of the unknowns, those of bare signals on the path included."""
        problem = self.problem
        lower, upper = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        limits = {s.name: (s.min, s.max) for s in problem.signals}
        for limit in problem.path_limits:
            found = _bound(limit, problem)
            if found is not None:
                name, low, high = found
                limits[name] = (max(limits[name][0], low), min(limits[name][1], high))
        for signals, table in self._tables():
            for column, signal in enumerate(signals):
                lower[table[..., column]], upper[table[..., column]] = limits[signal.name]
        for column, number in enumerate(problem.free):
            lower[column], upper[column] = number.min, number.max
        return lower / self.scale, upper / self.scale

    def _with_points(
        self, expressions: list[ca.SX], symbols: ca.SX, p: ca.SX, t0: ca.SX, tf: ca.SX
    ) -> list[ca.SX]:
        """Expressions of points and free numbers in the unknowns."""
        old, new = [symbols], [p]
        for point in self.problem.points:
            old.append(point.symbol)
            new.append(self._point_value(point, symbols, p, t0, tf))
        return ca.substitute(expressions, [ca.vertcat(*old)], [ca.vertcat(*new)])

    def _point_value(self, point: PointValue, symbols: ca.SX, p: ca.SX, t0: ca.SX, tf: ca.SX) -> ca.SX:
        place = self._fraction(point)
        e = int(np.clip(np.searchsorted(self.mesh, place, side="right") - 1, 0, self.mesh.size - 2))
        local = (place - self.mesh[e]) / (self.mesh[e + 1] - self.mesh[e])
        x_weights = interpolation(self.scheme.nodes, np.array([local]))[0]
        other_weights = interpolation(self.scheme.points, np.array([local]))[0]
        x = ca.horzcat(self._at(self.starts[e]), *(self._at(s) for s in self.states[e])) @ _exact(x_weights)
        z = ca.horzcat(*(self._at(s) for s in self.algebraics[e])) @ _exact(other_weights)
        u = ca.horzcat(*(self._at(s) for s in self.inputs[e])) @ _exact(other_weights)
        value = ca.Function("value", self._arguments(symbols), [point.expression])
        found = value(t0 + place * (tf - t0), x, z, u, p)
        assert isinstance(found, ca.SX)
        return found

    def _fraction(self, point: PointValue) -> float:
        """Where on [0, 1] a point lies; it must not depend on the free numbers."""
        if isinstance(point.time, str):
            return 0.0 if point.time == "initial" else 1.0
        problem = self.problem
        span = problem.final_time - problem.start_time
        place = (point.time - problem.start_time) / span
        numbers = ca.vertcat(*(n.symbol for n in problem.free)) if problem.free else ca.SX(0, 1)
        evaluate = ca.Function("place", [numbers], [place])
        guess = ca.DM([n.guess for n in problem.free])
        found, other = float(evaluate(guess)), float(evaluate(1.37 * guess + 0.11))  # any other values
        if abs(found - other) > 1e-12:
            raise ModelError(
                f"at({point.time}, ...): with a free horizon the time must be a fixed fraction of it; write it as "
                "start_time + fraction * (final_time - start_time)"
            )
        if not -1e-12 <= found <= 1 + 1e-12:
            raise ModelError(
                f"at({point.time}, ...): lies outside of the horizon; choose a time inside of it"
            )
        return min(max(found, 0.0), 1.0)


def _exact(weights: np.ndarray) -> ca.DM:
    # weights of a node are exactly 0 and 1 there, and stay structural zeros
    return ca.sparsify(ca.DM(np.where(np.abs(weights) < 1e-14, 0.0, weights)))


def _bound(limit, problem: ControlProblem) -> tuple[str, float, float] | None:
    """(signal, lower, upper) where a path limit is one on a signal times a number, else None."""
    leaves = ca.symvar(limit.expression)
    if len(leaves) != 1:
        return None
    slope = ca.jacobian(limit.expression, leaves[0])
    names = {s.symbol.element_hash(): s.name for s in problem.signals}
    if not slope.is_constant() or leaves[0].element_hash() not in names or float(slope) == 0.0:
        return None
    offset = float(ca.substitute(limit.expression, leaves[0], 0))
    ends = sorted(((limit.lower - offset) / float(slope), (limit.upper - offset) / float(slope)))
    return names[leaves[0].element_hash()], ends[0], ends[1]
