"""Direct collocation: an optimal-control problem becomes a nonlinear program.

Per element of relative width d, horizon H = final - start, points c_j with differentiation matrix D and
quadrature weights b, and row by row in the program:

    sum_k D_jk x_k - d H ode(t_j, x_j, z_j, u_j) = 0      divided by the state's nominal value
    residuals(t_j, x_j, z_j, u_j) = 0
    lower <= path limits(t_j, x_j, z_j, u_j) <= upper     those of one signal times a number are bounds
    x(next element) - sum_k e_k x_k = 0                   Gauss only; with Radau the last point is the next
    start |next value - value| <= max_step                      of a piecewise input
    boundary conditions

Objective: Mayer term + sum of d H b_j integrand(t_j, x_j, z_j, u_j). The variables are divided by nominal
values.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gantrytau_optimica.assembly import Block, Program, assemble
from gantrytau_optimica.collocation import SchemeName, lagrange, scheme
from gantrytau_optimica.control_problem import ControlProblem
from gantrytau_optimica.layout import Layout, Pieces, lay_out
from gantrytau_optimica.limits import Bounds, BoundsDraft, Row, rows_of
from gantrytau_optimica.points import Place, parameter_values, place, point_block

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class RowGroup:
    """Rows of the program that mean one thing at several times."""

    name: str
    kind: str  # "derivative", "residual", "path", "continuity", "step" or "boundary"
    rows: Indices
    moments: Array  # relative times; NaN for boundary conditions
    unit: str = ""
    moving: str = ""  # as in limits.Row
    scale: float = 1.0  # row of the program = scale * what the group says


@dataclass(frozen=True, eq=False)
class Transcription:
    """A problem on a mesh: the program, and what its variables and rows mean."""

    problem: ControlProblem
    layout: Layout
    program: Program
    nominal: Array  # variable = nominal * variable of the program
    variable_bounds: Bounds
    row_bounds: Bounds
    groups: tuple[RowGroup, ...]
    places: tuple[Place, ...]
    controls: Mapping[str, Pieces]
    seconds: float  # spent on building

    def horizon(self, free: Array, parameters: Array) -> tuple[float, float]:
        """Start and final time, s."""
        symbols = [ca.vertcat(*(x.symbol for x in self.problem.free)), _parameters(self.problem)]
        ends = [ca.SX(self.problem.start_time), ca.SX(self.problem.final_time)]
        start, final = ca.Function("horizon", symbols, ends)(free, parameters)
        return float(start), float(final)

    def first_guess(self, parameters: Array, guess: Mapping[str, Any] | None = None) -> Array:
        """The variables (not divided) from the guesses of the record, or from `guess` where it names one.

        guess: name of a signal -> number or function of an array of times (s); name of a free number ->
        number.
        """
        given: dict[str, Any] = dict(guess or {})
        problem, layout = self.problem, self.layout
        values = np.zeros(layout.size)
        for i, number in enumerate(problem.free):
            values[i] = float(given.pop(number.name, number.guess))
        start, final = self.horizon(values[: len(problem.free)], parameters)
        if not final > start:
            raise ValueError(f"first guess: final time {final:.6g} s is not after start time {start:.6g} s")
        for i, signal in enumerate(problem.signals):
            mine = np.flatnonzero(layout.owner == i)
            function = given.pop(signal.name, signal.guess)
            times = start + layout.moment[mine] * (final - start)
            values[mine] = np.asarray(function(times) if callable(function) else function, dtype=float)
        if given:
            raise ValueError(
                f"first guess: '{next(iter(given))}' is neither a signal nor a free number of the problem"
            )
        strange = np.flatnonzero(~np.isfinite(values))
        if len(strange):
            owner = layout.owner[strange[0]]
            name = problem.signals[owner].name if owner >= 0 else problem.free[strange[0]].name
            raise ValueError(f"first guess of {name}: found {values[strange[0]]}, expected finite numbers")
        return values


def transcribe(
    problem: ControlProblem,
    mesh: int | Array = 50,
    *,
    points: int = 3,
    scheme_name: SchemeName = "radau",
    controls: Mapping[str, Pieces] | None = None,
    located: Mapping[str, Any] | None = None,
) -> Transcription:
    """The program of a problem.

    mesh: number of equal elements, or the relative times of their borders from 0 to 1.
    controls: piecewise inputs by name; the others are free at every collocation point.
    located: values of free numbers by name, where points at times that depend on them are placed first.
    """
    began = time.perf_counter()
    layout = lay_out(problem, _borders(mesh), scheme(scheme_name, points), controls or {})
    nominal, draft, paths = _limited_variables(problem, layout)
    nf = len(problem.free)
    rows = _Rows(problem, layout, paths, rows_of(problem.boundary, problem.parameters))
    located_free = np.array([float((located or {}).get(x.name, x.guess)) for x in problem.free])
    places = [
        place(problem, layout, point, located_free, parameter_values(problem)) for point in problem.points
    ]
    scale = sparse.diags(nominal).tocsr()
    gather = _gather(layout, nf) @ scale
    constraints = [_dynamics(problem, layout, paths, rows, gather)]
    if rows.boundary:
        column = ca.vertcat(*(row.expression for row in rows.boundary))
        scatter = sparse.csr_matrix(
            (
                np.ones(len(rows.boundary)),
                (rows.boundary_start + np.arange(len(rows.boundary)), np.arange(len(rows.boundary))),
            ),
            shape=(rows.count, len(rows.boundary)),
        )
        constraints.append(point_block(problem, layout, places, column, nominal, scatter))
    objective = [
        point_block(problem, layout, places, ca.SX(problem.objective), nominal, sparse.csr_matrix([[1.0]]))
    ]
    integrand = ca.SX(problem.integrand)
    if not integrand.is_zero():
        weights = (layout.widths[:, None] * layout.scheme.quadrature).reshape(1, -1)
        objective.append(
            _running(problem, layout, integrand * _horizon(problem), gather, sparse.csr_matrix(weights))
        )
    program = assemble(objective, constraints, rows.linear() @ scale, _parameters(problem).numel())
    parameters = _parameters(problem)
    return Transcription(
        problem,
        layout,
        program,
        nominal,
        draft.finish(parameters),
        rows.bounds.finish(parameters),
        tuple(rows.groups),
        tuple(places),
        dict(controls or {}),
        time.perf_counter() - began,
    )


def _borders(mesh: int | Array) -> Array:
    """Relative times of the borders of the elements."""
    if isinstance(mesh, (int, np.integer)):
        if mesh < 1:
            raise ValueError(f"elements: found {mesh}, expected at least 1")
        return np.linspace(0.0, 1.0, int(mesh) + 1)
    borders = np.asarray(mesh, dtype=float)
    if (
        borders.ndim != 1
        or len(borders) < 2
        or borders[0] != 0
        or borders[-1] != 1
        or (np.diff(borders) <= 0).any()
    ):
        raise ValueError("mesh: expected increasing relative times from 0 to 1")
    return borders


def _parameters(problem: ControlProblem) -> ca.SX:
    return ca.vertcat(ca.SX(0, 1), *(ca.vec(item.symbol) for item in problem.parameters))


def _horizon(problem: ControlProblem) -> ca.SX:
    return ca.SX(problem.final_time) - problem.start_time


def _limited_variables(problem: ControlProblem, layout: Layout) -> tuple[Array, BoundsDraft, list[Row]]:
    """Nominal values and bounds of the variables, and the path limits that are no bounds of one signal."""
    nominal = np.array([float(x.nominal) for x in (*problem.signals, *problem.free)])
    nf = len(problem.free)
    owner = layout.owner.copy()
    owner[:nf] = len(problem.signals) + np.arange(nf)
    nominal = nominal[owner]

    draft = BoundsDraft(layout.size)
    for i, x in enumerate((*problem.signals, *problem.free)):
        draft.limit(np.flatnonzero(owner == i), x.min, x.max)
    paths = []
    for row in rows_of(problem.path_limits, problem.parameters):
        one = _one_signal(row.expression, problem)
        if one is None:
            paths.append(row)
        else:
            i, slope, offset = one
            ends = ((row.lower - offset) / slope, (row.upper - offset) / slope)
            draft.limit(np.flatnonzero(owner == i), *(ends if slope > 0 else ends[::-1]))
    return nominal, draft, paths


def _one_signal(expression: ca.SX, problem: ControlProblem) -> tuple[int, float, float] | None:
    """(number, slope, offset) where an expression is slope * signal + offset, else None."""
    leaves = ca.symvar(expression)
    numbers = {signal.symbol.element_hash(): i for i, signal in enumerate(problem.signals)}
    if len(leaves) != 1 or leaves[0].element_hash() not in numbers:
        return None
    slope = ca.jacobian(expression, leaves[0])
    if not slope.is_constant() or float(slope) == 0.0:
        return None
    offset = float(ca.substitute(expression, leaves[0], 0))
    return numbers[leaves[0].element_hash()], float(slope), offset


def _gather(layout: Layout, free: int) -> sparse.csr_matrix:
    """Signals and free numbers at the collocation points from the variables, points one after the other."""
    elements, k = layout.times.shape
    local = len(layout.tracks) + free
    point = np.arange(elements * k)
    parts = []
    for i, track in enumerate(layout.tracks):
        element, s = np.repeat(np.arange(elements), k), np.tile(layout.scheme.points, elements)
        nodes = track.nodes[element]
        from_node = np.abs(nodes - s[:, None]) < 1e-14  # at a node the value is a variable
        basis = _basis(nodes, s)
        basis[from_node.any(axis=1)] = 0.0
        basis[from_node] = 1.0
        r, c = np.nonzero(basis)
        parts.append((r * local + i, track.variables[element[r], c], basis[r, c]))
    for i in range(free):
        parts.append((point * local + len(layout.tracks) + i, np.full(len(point), i), np.ones(len(point))))
    row, column, value = (np.concatenate([part[n] for part in parts]) for n in range(3))
    return sparse.csr_matrix((value, (row, column)), shape=(local * len(point), layout.size))


def _basis(nodes: Array, s: Array) -> Array:
    return np.array(lagrange(nodes.T, s)).T


def _running(problem: ControlProblem, layout: Layout, values: ca.SX, gather, scatter) -> Block:
    """An expression of signals, time, free numbers and parameters at every collocation point."""
    moment = ca.SX.sym("moment")
    if ca.depends_on(values, problem.time):
        physical = problem.start_time + moment * _horizon(problem)
        values = ca.substitute(values, problem.time, physical)
    local = ca.vertcat(*(x.symbol for x in problem.signals), *(x.symbol for x in problem.free))
    return Block(local, _parameters(problem), moment, values, layout.times.reshape(1, -1), gather, scatter)


def _dynamics(problem: ControlProblem, layout: Layout, paths: list[Row], rows: _Rows, gather) -> Block:
    """Derivatives, residuals and path limits at every collocation point."""
    states, count = len(problem.states), rows.per_point
    values = ca.vertcat(
        problem.ode * _horizon(problem), problem.residuals, *(row.expression for row in paths)
    )
    factor = np.ones((len(layout.widths), len(layout.scheme.points), count))
    nominal = np.array([state.nominal for state in problem.states])
    factor[:, :, :states] = -layout.widths[:, None, None] / nominal
    place = np.arange(factor.size)
    scatter = sparse.csr_matrix((factor.ravel(), (place, place)), shape=(rows.count, factor.size))
    return _running(problem, layout, values, gather, scatter)


class _Rows:
    """Numbers the rows of the program, and draws up their bounds and their linear part."""

    def __init__(
        self, problem: ControlProblem, layout: Layout, paths: list[Row], boundary: list[Row]
    ) -> None:
        self.problem, self.layout, self.boundary = problem, layout, boundary
        nx, nz = len(problem.states), len(problem.algebraics)
        elements, k = layout.times.shape
        self.per_point = nx + nz + len(paths)
        self.continuity_start = self.per_point * elements * k
        continuity = 0 if layout.scheme.name == "radau" else nx * elements
        self.steps_start = self.continuity_start + continuity
        steps = [len(chain) - 1 for chain, _ in layout.chains]
        self.boundary_start = self.steps_start + sum(steps)
        self.count = self.boundary_start + len(boundary)
        self.bounds = BoundsDraft(self.count)
        self.groups: list[RowGroup] = []

        moments = layout.times.ravel()
        at_points = np.arange(elements * k) * self.per_point
        for i, state in enumerate(problem.states):
            self._equation(f"der({state.name})", "derivative", at_points + i, moments, 1 / state.nominal)
        for i in range(nz):
            name = problem.residual_names[i] if problem.residual_names else f"residual {i}"
            self._equation(name, "residual", at_points + nx + i, moments)
        for i, row in enumerate(paths):
            self._limit(row, "path", at_points + nx + nz + i, moments)
        if continuity:
            for i, state in enumerate(problem.states):
                self._equation(
                    state.name,
                    "continuity",
                    self.continuity_start + nx * np.arange(elements) + i,
                    layout.borders[1:],
                    1 / state.nominal,
                )
        first = self.steps_start
        for (chain, step), count in zip(layout.chains, steps, strict=True):
            entries = first + np.arange(count)
            name = problem.signals[layout.owner[chain[0]]].name
            self.groups.append(RowGroup(f"step of {name}", "step", entries, layout.moment[chain[1:]]))
            self.bounds.limit(entries, -step, step)
            first += count
        for i, row in enumerate(boundary):
            self._limit(row, "boundary", np.array([self.boundary_start + i]), np.array([np.nan]))

    def _equation(self, name: str, kind: str, entries: Indices, moments: Array, scale: float = 1.0) -> None:
        self.groups.append(RowGroup(name, kind, entries, moments, scale=scale))
        self.bounds.limit(entries, 0.0, 0.0)

    def _limit(self, row: Row, kind: str, entries: Indices, moments: Array) -> None:
        self.groups.append(RowGroup(row.name, kind, entries, moments, row.unit, row.moving))
        self.bounds.limit(entries, row.lower, row.upper)

    def linear(self) -> sparse.csr_matrix:
        """The part of the rows that is linear in the variables."""
        layout, nx = self.layout, len(self.problem.states)
        elements, k = layout.times.shape
        parts = []
        for i, (state, track) in enumerate(zip(self.problem.states, layout.tracks, strict=False)):
            row = (np.arange(elements * k) * self.per_point + i).reshape(elements, k)
            matrix = np.broadcast_to(layout.scheme.differentiation / state.nominal, (elements, k, k + 1))
            parts.append(np.broadcast_arrays(row[:, :, None], track.variables[:, None, :], matrix))
            if self.steps_start > self.continuity_start:
                row = self.continuity_start + nx * np.arange(elements) + i
                columns = np.column_stack([layout.starts[1:, i], track.variables])
                values = np.append(1.0, -layout.scheme.end) / state.nominal
                parts.append(np.broadcast_arrays(row[:, None], columns, values[None, :]))
        first = self.steps_start
        for chain, _ in layout.chains:
            row = first + np.arange(len(chain) - 1)
            parts.append(
                np.broadcast_arrays(
                    row[:, None], np.column_stack([chain[1:], chain[:-1]]), np.array([[1.0, -1.0]])
                )
            )
            first += len(chain) - 1
        row, column, value = (np.concatenate([part[n].ravel() for part in parts]) for n in range(3))
        return sparse.csr_matrix((value, (row, column)), shape=(self.count, layout.size))
