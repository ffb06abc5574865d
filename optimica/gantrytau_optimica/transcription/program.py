"""Direct collocation: a control problem on meshes becomes a nonlinear program.

    unknowns        free numbers p; per phase the moving borders, and per element the states at its start x_0, and
                    at each of its k points the states x_j, algebraics z_j and inputs u_j, divided by typical sizes
    dynamics        sum_i D_ij x_i = h f(t_j, x_j, z_j, u_j, p)          at every point
    algebraic       0 = g(t_j, x_j, z_j, u_j, p)                         at every point
    path            lower <= c(t_j, x_j, z_j, u_j, p) <= upper           at every point
    continuity      x_0 of the next element = value of this one's polynomial at its end
    step            |next value - value| <= max_step                     of piecewise inputs
    border          distance of moving borders >= the shortest
    boundary        conditions on values at single times
    integral        sum over elements of h sum_j w_j L(t_j, ...)

What happens at a point is one small function, evaluated and differentiated for all points at once; the rest is
linear (see assemble). Nothing symbolic grows with the number of elements.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as ca
import numpy as np
from scipy import sparse

from gantrytau import ModelError
from gantrytau_optimica.control.control_problem import ControlProblem, Limit, Phase
from gantrytau_optimica.control.limits import bare_limit, signal_limits
from gantrytau_optimica.transcription.assemble import Assembled, Term, assemble
from gantrytau_optimica.transcription.costs import differences, running_costs, sample_sums, without_sums
from gantrytau_optimica.transcription.layout import Layout, Places, Sparse, lay_out
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.point_functions import (
    Place,
    fixed_share,
    places_of_points,
    running,
    share_of,
    single_term,
)
from gantrytau_optimica.transcription.scheme import Collocation

FEW = 1e-5  # of an element, by which a moving point may stand outside of it


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of the program that mean one thing: kind, name in the model's words, phase, and places on [0, 1] (or NaN).

    size: a row of the program times this is the quantity in its unit.
    """

    kind: str  # "dynamics", "algebraic", "path", "continuity", "step", "border", "boundary"
    name: str
    phase: int
    rows: np.ndarray
    moments: np.ndarray
    lower: float
    upper: float
    size: float = 1.0


@dataclass(frozen=True, eq=False)
class Program:
    """The nonlinear program in scaled unknowns, its limits, and what its rows and unknowns mean."""

    problem: ControlProblem
    places: Places
    assembled: Assembled
    groups: tuple[Rows, ...]
    lbw: np.ndarray
    ubw: np.ndarray
    lbg: np.ndarray
    ubg: np.ndarray
    points: tuple[Place, ...] = field(default=())

    def with_numbers(self, problem: ControlProblem) -> "Program":
        """The same program with other free numbers and first guesses."""
        lower, upper, places = self.lbw.copy(), self.ubw.copy(), self.places
        for place, number in zip(places.free, problem.free, strict=True):
            lower[place], upper[place] = number.min / places.scale[place], number.max / places.scale[place]
        return replace(self, problem=problem, lbw=lower, ubw=upper)

    def astray(self, w: np.ndarray) -> bool:
        """Whether a point whose time moves has left the element whose polynomials it reads."""
        moved = [one for one in self.points if one.place is None]
        if not moved:
            return False
        borders = [layout.placed(w).borders for layout in self.places.layouts]
        now = places_of_points(self.places, w[self.places.free], borders, inside_only=False)
        for old, new in zip(self.points, now, strict=True):
            here = borders[old.phase]
            left, right = here[old.element], here[old.element + 1]
            share = self._share(old, w)
            if old.place is None and new.element != old.element and not (
                left - FEW * (right - left) <= share <= right + FEW * (right - left)
            ):  # fmt: skip
                return True
        return False

    def require_points(self, w: np.ndarray) -> None:
        """ModelError if a point whose time moves lies outside of the horizon."""
        if any(one.place is None for one in self.points):
            borders = [layout.placed(w).borders for layout in self.places.layouts]
            places_of_points(self.places, w[self.places.free], borders)

    def _share(self, one: Place, w: np.ndarray) -> float:
        if isinstance(one.point.time, str):
            return float(one.point.time == "final")
        share = share_of(self.problem.phases[one.phase], one.point.time)
        return float(ca.Function("share", [self.problem.numbers], [share])(w[self.places.free]))

    @cached_property
    def kinds(self) -> np.ndarray:
        """Number of its group for every row."""
        found = np.zeros(self.assembled.rows, int)
        for number, group in enumerate(self.groups):
            found[group.rows] = number
        return found


def transcribe(
    problem: ControlProblem,
    meshes: Sequence[Mesh],
    scheme: Collocation,
    located: tuple[np.ndarray, Sequence[np.ndarray]] | None = None,
) -> Program:
    """The nonlinear program of `problem` on one mesh per phase.

    located: free numbers, and borders by phase, for which points at moving times are looked up (default: the guess).
    """
    if scheme.scheme == "shooting":
        from gantrytau_optimica.transcription.shooting import shoot_steps

        return shoot_steps(problem, meshes, scheme)
    places = lay_out(problem, tuple(meshes), scheme)
    free, borders = located or (np.array([n.guess for n in problem.free]), [m.borders for m in meshes])
    where = places_of_points(places, free, borders, inside_only=located is None)
    groups: list[Rows] = []
    objective, terms, linear = [], [], []
    paths = [
        [limit for limit in phase.path_limits if bare_limit(limit, phase) is None] for phase in problem.phases
    ]
    count = 0
    for number, (layout, path) in enumerate(zip(places.layouts, paths, strict=True)):
        mine = _rows(places, layout, number, path, count)
        groups += mine.groups
        linear.append((mine, layout, path))
        count = mine.stop
    groups += [
        Rows("boundary", limit.name, -1, np.array([count + i]), np.array([np.nan]), limit.lower, limit.upper)
        for i, limit in enumerate(problem.boundary)
    ]
    total = count + len(problem.boundary)
    for mine, layout, path in linear:
        terms.append(_point_term(places, layout, path, mine.start, total))
        if layout.begin.size:
            terms.append(_begin_term(places, layout, mine.begin, total))
        objective += running_costs(places, layout)
    if problem.boundary:
        rows = np.arange(count, total)
        scatter = sparse.csr_matrix((np.ones(rows.size), (rows, rows - count)), shape=(total, rows.size))
        terms.append(single_term(places, where, [limit.expression for limit in problem.boundary], scatter))
    objective.append(single_term(places, where, [without_sums(problem)], sparse.csr_matrix([[1.0]])))
    objective += [b for layout in places.layouts for b in sample_sums(places, layout)]
    matrix = sparse.vstack(
        [m for mine, _, _ in linear for m in mine.linear] + [sparse.csr_matrix((total - count, places.size))]
    )
    lower, upper = np.zeros(total), np.zeros(total)
    for group in groups:
        lower[group.rows], upper[group.rows] = group.lower / group.size, group.upper / group.size
    lbw, ubw = _bounds(places)
    assembled = assemble(objective, terms, matrix.tocsr(), 0)
    return Program(problem, places, assembled, tuple(groups), lbw, ubw, lower, upper, tuple(where))


@dataclass(frozen=True, eq=False)
class _PhaseRows:
    """The rows of one phase: numbers from start to stop, what they mean, and their linear part."""

    start: int
    stop: int
    groups: list[Rows]
    linear: list[Sparse]
    begin: int  # of the equations of algebraics at the start


def _rows(places: Places, layout: Layout, number: int, path: list[Limit], start: int) -> _PhaseRows:
    phase, fractions = layout.phase, layout.fractions
    meaning = [("dynamics", s.name, 0.0, 0.0, s.nominal) for s in phase.states]
    meaning += [("algebraic", name, 0.0, 0.0, 1.0) for name in phase.residual_names]
    meaning += [("path", limit.name, limit.lower, limit.upper, 1.0) for limit in path]
    per_point, points = len(meaning), fractions.size
    at_points = start + per_point * np.arange(points)
    groups = [
        Rows(kind, name, number, at_points + i, fractions, low, high, size)
        for i, (kind, name, low, high, size) in enumerate(meaning)
    ]
    slopes = places.slopes(layout).tocoo()
    nx = max(len(phase.states), 1)
    place = (slopes.row // nx) * per_point + slopes.row % nx
    linear: list[Sparse] = [
        sparse.csr_matrix((slopes.data, (place, slopes.col)), shape=(per_point * points, places.size))
    ]
    stop = start + per_point * points
    jumps = places.jumps(layout)
    for i, state in enumerate(phase.states if jumps.shape[0] else ()):
        rows = stop + nx * np.arange(layout.mesh.elements) + i
        groups.append(
            Rows("continuity", state.name, number, rows, layout.mesh.borders[1:], 0.0, 0.0, state.nominal)
        )
    linear.append(jumps)
    stop += jumps.shape[0]
    begin = stop
    for name in phase.residual_names[: layout.begin.size]:
        groups.append(Rows("algebraic", name, number, np.array([stop]), np.zeros(1), 0.0, 0.0))
        stop += 1
    linear.append(sparse.csr_matrix((stop - begin, places.size)))
    for signal, chain in layout.chains.items():
        step = phase.signals[signal].pieces.max_step
        if step is None or chain.size < 2:
            continue
        rows = np.arange(chain.size - 1)
        linear.append(differences(places, chain))
        moments = layout.moment[chain[1:] - layout.first]
        groups.append(
            Rows(
                "step",
                phase.signals[signal].name,
                number,
                stop + rows,
                moments,
                -step,
                step,
                phase.signals[signal].nominal,
            )
        )
        stop += rows.size
    if layout.knots.size:
        stretches = np.diff(np.concatenate([[0.0], layout.mesh.borders[list(layout.mesh.moving)], [1.0]]))
        matrix, offset = _stretches(places, layout)
        linear.append(matrix)
        for i, (length, fixed) in enumerate(zip(stretches, offset, strict=True)):
            name = f"the length of stretch {i + 1} of the mesh"
            low = layout.mesh.shortest * length - fixed
            groups.append(Rows("border", name, number, np.array([stop + i]), np.array([np.nan]), low, np.inf))
        stop += stretches.size
    return _PhaseRows(start, stop, groups, linear, begin)


def _stretches(places: Places, layout: Layout) -> tuple[Sparse, np.ndarray]:
    """Distances of consecutive moving borders, the ends of the phase included: linear part and offset."""
    m = layout.knots.size
    rows = np.arange(m)
    matrix = places.pick([rows, rows + 1], [layout.knots, layout.knots], [np.ones(m), -np.ones(m)], m + 1)
    offset = np.zeros(m + 1)
    offset[-1] = 1.0
    return matrix, offset


def _point_term(places: Places, layout: Layout, path: list[Limit], start: int, total: int) -> Term:
    phase, run = layout.phase, running(places, layout)
    slopes = phase.ode * (run.horizon * run.width)
    values = ca.vertcat(slopes, phase.residuals, *(limit.expression for limit in path))
    element, place = layout.points
    per_point = values.numel()
    factor = np.ones((element.size, per_point))
    factor[:, : len(phase.states)] = -1.0 / np.array([s.nominal for s in phase.states])
    index = np.arange(factor.size)
    scatter = sparse.csr_matrix((factor.ravel(), (start + index, index)), shape=(total, index.size))
    return run.term(values, element, place, scatter)


def _begin_term(places: Places, layout: Layout, start: int, total: int) -> Term:
    """The equations of the algebraics at the start of a phase."""
    run, nx, nz = running(places, layout), len(layout.phase.states), layout.begin.size
    rows = np.arange(nz)
    scatter = sparse.csr_matrix((np.ones(nz), (start + rows, rows)), shape=(total, nz))
    term = run.term(layout.phase.residuals, np.zeros(1, int), np.zeros(1), scatter)
    exact = places.pick([rows], [layout.begin], [np.ones(nz)], nz)
    gather = sparse.vstack([term.gather[:nx], exact, term.gather[nx + nz :]]).tocsr()
    return replace(term, gather=gather)


def _bounds(places: Places) -> tuple[np.ndarray, np.ndarray]:
    """Limits of the scaled unknowns, those of bare signals on the path included."""
    lower, upper = np.full(places.size, -np.inf), np.full(places.size, np.inf)
    for layout in places.layouts:
        limits = signal_limits(layout.phase, places.problem.name)
        for i, signal in enumerate(layout.phase.signals):
            lower[layout.of(i)], upper[layout.of(i)] = limits[signal.name]
    for place, number in zip(places.free, places.problem.free, strict=True):
        lower[place], upper[place] = number.min, number.max
    return lower / places.scale, upper / places.scale


def first_guess(program: Program) -> np.ndarray:
    """The guess as unknowns of the program, inside of their bounds."""
    places, problem = program.places, program.problem
    w = np.zeros(places.size)
    w[places.free] = [number.guess for number in problem.free]
    for layout, phase in zip(places.layouts, problem.phases, strict=True):
        w[layout.knots] = layout.mesh.borders[list(layout.mesh.moving)]
        for number, signal in enumerate(phase.signals):
            mine = layout.of(number)
            w[mine] = signal.guess(layout.moment[mine - layout.first])
    return np.clip(w, program.lbw * places.scale, program.ubw * places.scale)


MOST_ASKED = 200  # times at which values are asked for and that become borders


def asked_shares(phase: Phase, problem: ControlProblem) -> np.ndarray:
    """Shares of the horizon at which values are asked for, where they are fixed: motions may have kinks there."""
    found = [np.zeros(0)]
    for point in phase.points:
        if not isinstance(point.time, str):
            share, fixed = fixed_share(problem, phase, point.time, np.array([n.guess for n in problem.free]))
            found += [np.array([share])] if fixed else []
    if phase.sums and phase.start_time.is_constant() and phase.final_time.is_constant():
        start, final = float(phase.start_time), float(phase.final_time)
        found += [(np.unique(np.concatenate([s.times for s in phase.sums])) - start) / (final - start)]
    shares = np.unique(np.concatenate(found))
    return shares[(shares > 0) & (shares < 1)] if shares.size <= MOST_ASKED else np.zeros(0)


def check_freedom(program: Program) -> None:
    """ModelError if nothing is free, or if there are more conditions than unknowns."""
    name = program.problem.name
    equalities = int(np.sum(program.lbg == program.ubg))
    unknowns = program.places.size - int(np.sum(program.lbw == program.ubw))
    if unknowns == 0:
        raise ModelError(f"{name}: nothing is free; declare a Free number or an Input")
    if equalities > unknowns:
        from gantrytau_optimica.failures.dependence import decided_text

        raise ModelError(
            f"{name}: {equalities} conditions for {unknowns} unknowns on this mesh, expected no more conditions than "
            f"unknowns; remove some at the ends or along the path, or free a number{decided_text(program)}"
        )
