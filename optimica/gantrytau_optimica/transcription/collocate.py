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
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from scipy import sparse

from gantrytau_optimica.control.control_problem import ControlProblem, Limit
from gantrytau_optimica.control.limits import bare_limit, signal_limits
from gantrytau_optimica.transcription.assemble import Assembled, Term
from gantrytau_optimica.transcription.costs import differences, running_costs, sample_sums, without_sums
from gantrytau_optimica.transcription.layout import Layout, Places, Sparse, lay_out
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.point_functions import places_of_points, running, single_term
from gantrytau_optimica.transcription.program import Program, RowGroup, boundary_part, row_limits
from gantrytau_optimica.transcription.scheme import Collocation


def collocate(
    problem: ControlProblem,
    meshes: Sequence[Mesh],
    scheme: Collocation,
    located: tuple[np.ndarray, Sequence[np.ndarray]] | None = None,
) -> Program:
    """The nonlinear program of `problem` on one mesh per phase.

    located: free numbers, and borders by phase, for which points at moving times are looked up (default: the guess).
    """
    places = lay_out(problem, tuple(meshes), scheme)
    free, borders = located or (np.array([n.guess for n in problem.free]), [m.borders for m in meshes])
    where = places_of_points(places, free, borders, inside_only=located is None)
    groups: list[RowGroup] = []
    parts: list[tuple[PhaseRows, Layout, list[Limit]]] = []
    count = 0
    for number, layout in enumerate(places.layouts):
        path = [limit for limit in layout.phase.path_limits if bare_limit(limit, layout.phase) is None]
        mine = phase_rows(places, layout, number, path, count)
        groups += mine.groups
        parts.append((mine, layout, path))
        count = mine.stop
    boundary, boundary_terms = boundary_part(places, where, count)
    groups += boundary
    total = count + len(boundary)
    objective, terms = [], []
    for mine, layout, path in parts:
        terms.append(_point_term(places, layout, path, mine.start, total))
        if layout.begin.size:
            terms.append(_begin_term(places, layout, mine.begin, total))
        objective += running_costs(places, layout)
    objective.append(single_term(places, where, [without_sums(problem)], sparse.csr_matrix([[1.0]])))
    objective += [term for layout in places.layouts for term in sample_sums(places, layout)]
    linear = [matrix for mine, _, _ in parts for matrix in mine.linear]
    linear.append(sparse.csr_matrix((total - count, places.size)))
    assembled = Assembled(
        objective, [*terms, *boundary_terms], sparse.vstack(linear).tocsr(), scheme.compiled
    )
    limits = *unknown_limits(places), *row_limits(groups, total)
    return Program(problem, places, assembled, tuple(groups), *limits, tuple(where))


@dataclass(frozen=True, eq=False)
class PhaseRows:
    """The rows of one phase: numbers from start to stop, what they mean, and their linear part."""

    start: int
    stop: int
    groups: list[RowGroup]
    linear: list[Sparse]
    begin: int  # of the equations of algebraics at the start


def phase_rows(places: Places, layout: Layout, number: int, path: list[Limit], start: int) -> PhaseRows:
    """The rows of phase `number` from row `start` on: at its points, between elements, at its start, and of steps."""
    phase, nx = layout.phase, len(layout.phase.states)
    groups, derivatives = _rows_at_points(places, layout, number, path, start)
    linear, stop = [derivatives], start + derivatives.shape[0]
    jumps = places.jumps(layout)
    for i, state in enumerate(phase.states if jumps.shape[0] else ()):
        rows = stop + nx * np.arange(layout.mesh.elements) + i
        borders = layout.mesh.borders[1:]
        groups.append(RowGroup("continuity", state.name, number, rows, borders, 0.0, 0.0, state.nominal))
    linear.append(jumps)
    begin = stop = stop + jumps.shape[0]
    for name, size in zip(phase.residual_names, phase.residual_sizes, strict=True):
        if not layout.begin.size:
            break
        groups.append(RowGroup("algebraic", name, number, np.array([stop]), np.zeros(1), 0.0, 0.0, size))
        stop += 1
    linear.append(sparse.csr_matrix((stop - begin, places.size)))
    for signal, chain in layout.chains.items():
        step, name = phase.signals[signal].pieces.max_step, phase.signals[signal].name
        if step is None or chain.size < 2:
            continue
        linear.append(differences(places, chain))
        rows, moments = stop + np.arange(chain.size - 1), layout.moment[chain[1:] - layout.first]
        groups.append(
            RowGroup("step", name, number, rows, moments, -step, step, phase.signals[signal].nominal)
        )
        stop += rows.size
    if layout.knots.size:
        lengths, matrix = _rows_of_stretches(places, layout, number, stop)
        groups += lengths
        linear.append(matrix)
        stop += len(lengths)
    return PhaseRows(start, stop, groups, linear, begin)


def _rows_at_points(
    places: Places, layout: Layout, number: int, path: list[Limit], start: int
) -> tuple[list[RowGroup], Sparse]:
    """Dynamics, algebraic equations and path limits at every point; D x of the dynamics, their linear part."""
    phase, fractions = layout.phase, layout.fractions
    meaning = [("dynamics", s.name, 0.0, 0.0, s.nominal) for s in phase.states]
    sizes = zip(phase.residual_names, phase.residual_sizes, strict=True)
    meaning += [("algebraic", name, 0.0, 0.0, size) for name, size in sizes]
    meaning += [("path", limit.name, limit.lower, limit.upper, limit.size) for limit in path]
    per_point, points = len(meaning), fractions.size
    at_points = start + per_point * np.arange(points)
    groups = [
        RowGroup(kind, name, number, at_points + i, fractions, low, high, size)
        for i, (kind, name, low, high, size) in enumerate(meaning)
    ]
    # row (element, point, state) of the dynamics: D x - h f = 0, here D x, in _point_term - h f
    D_x = places.differentiated(layout).tocoo()
    nx = max(len(phase.states), 1)
    row = (D_x.row // nx) * per_point + D_x.row % nx
    return groups, sparse.csr_matrix((D_x.data, (row, D_x.col)), shape=(per_point * points, places.size))


def _rows_of_stretches(
    places: Places, layout: Layout, number: int, start: int
) -> tuple[list[RowGroup], Sparse]:
    """Distances of consecutive moving borders, the ends of the phase included: least lengths and linear part."""
    m = layout.knots.size
    rows = np.arange(m)
    matrix = places.pick([rows, rows + 1], [layout.knots, layout.knots], [np.ones(m), -np.ones(m)], m + 1)
    lengths = np.diff(np.concatenate([[0.0], layout.mesh.borders[list(layout.mesh.moving)], [1.0]]))
    found = []
    for i, length in enumerate(lengths):
        name = f"the length of stretch {i + 1} of the mesh"
        low = layout.mesh.shortest * length - float(i == m)
        found.append(RowGroup("border", name, number, np.array([start + i]), np.array([np.nan]), low, np.inf))
    return found, matrix


def _point_term(places: Places, layout: Layout, path: list[Limit], start: int, total: int) -> Term:
    phase, run = layout.phase, running(places, layout)
    h, f, g, c = run.horizon * run.width, phase.ode, phase.residuals, [limit.expression for limit in path]
    # D x - h f = 0,  g = 0,  lower <= c <= upper
    values = ca.vertcat(-(f * h), g, *c)
    element, place = layout.points
    sizes = [*(s.nominal for s in phase.states), *phase.residual_sizes, *(limit.size for limit in path)]
    factor = np.tile(1.0 / np.array(sizes), (element.size, 1))
    index = np.arange(factor.size)
    scatter = sparse.csr_matrix((factor.ravel(), (start + index, index)), shape=(total, index.size))
    return run.term(values, element, place, scatter)


def _begin_term(places: Places, layout: Layout, start: int, total: int) -> Term:
    """The equations of the algebraics at the start of a phase."""
    run, nx, nz = running(places, layout), len(layout.phase.states), layout.begin.size
    rows = np.arange(nz)
    sizes = np.array(layout.phase.residual_sizes)
    scatter = sparse.csr_matrix((1.0 / sizes, (start + rows, rows)), shape=(total, nz))
    term = run.term(layout.phase.residuals, np.zeros(1, int), np.zeros(1), scatter)
    exact = places.pick([rows], [layout.begin], [np.ones(nz)], nz)
    gather = sparse.vstack([term.gather[:nx], exact, term.gather[nx + nz :]]).tocsr()
    return replace(term, gather=gather)


def unknown_limits(places: Places) -> tuple[np.ndarray, np.ndarray]:
    """Limits of the scaled unknowns, those of bare signals on the path included."""
    lower, upper = np.full(places.size, -np.inf), np.full(places.size, np.inf)
    for layout in places.layouts:
        limits = signal_limits(layout.phase, places.problem.name)
        for i, signal in enumerate(layout.phase.signals):
            lower[layout.of(i)], upper[layout.of(i)] = limits[signal.name]
    for place, number in zip(places.free, places.problem.free, strict=True):
        lower[place], upper[place] = number.min, number.max
    return lower / places.scale, upper / places.scale
