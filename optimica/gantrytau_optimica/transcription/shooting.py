"""Multiple shooting: the classical Runge-Kutta method of fourth order, with the stages kept as unknowns.

Every element is divided into steps of length h; inputs are constant over an element unless they are declared linear.

    X_1 = x,  X_2 = x + h/2 F_1,  X_3 = x + h/2 F_2,  X_4 = x + h F_3       F_j = f(t + c_j h, X_j, z_j, u)
    x of the next step = x + h/6 (F_1 + 2 F_2 + 2 F_3 + F_4)                0 = g(t + c_j h, X_j, z_j, u)

The first line says that all h F_j are differences of stages, so that each step is four rows `linear = h F_j`, just as
the rows of a collocation scheme: the sparse ("lifted") form of multiple shooting, with the same solutions. Algebraics
of every stage are solved exactly, loops and square roots included.

Limits along the path hold at the starts of the steps and at the end of the phase. Between, the motion is the
method's continuous extension of third order (Hairer, Norsett, Wanner, Solving ODEs I, II.6); algebraics at the
end of a step are those of its fourth stage, third order as well. The method is explicit: a stiff problem, whose
fastest decay is quicker than about h / 2.8, makes it unstable, and the optimiser then fails or returns oscillating
inputs; use "radau" for those.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from gantrytau import ModelError
from gantrytau.border.refusal import Given
from gantrytau_optimica.control.control_problem import ControlProblem, Limit, Phase
from gantrytau_optimica.control.limits import bare_limit
from gantrytau_optimica.transcription.assemble import Assembled, Term
from gantrytau_optimica.transcription.collocate import phase_rows, unknown_limits
from gantrytau_optimica.transcription.costs import running_costs, sample_sums, without_sums
from gantrytau_optimica.transcription.layout import Layout, Places, Sparse, Track, pieces_of
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.point_functions import places_of_points, running, single_term
from gantrytau_optimica.transcription.program import Program, RowGroup, boundary_part, row_limits
from gantrytau_optimica.transcription.scheme import Collocation

PLACES = np.array([0.0, 0.5, 0.5, 1.0])
WEIGHTS = np.array([1.0, 2.0, 2.0, 1.0]) / 6
# rows: x, X_2, X_3, X_4 and the next x; columns: h F_1 to h F_4 as sums of them
SLOPES = np.array([
    [-2.0, -2.0, -1.0, 2.0],
    [2.0, 0.0, 0.0, -2.0],
    [0.0, 2.0, 0.0, -4.0],
    [0.0, 0.0, 1.0, -2.0],
    [0.0, 0.0, 0.0, 6.0],
])  # fmt: skip
STAGES = Collocation("shooting", PLACES, np.append(0.0, PLACES), SLOPES, np.eye(5)[4], WEIGHTS)


@dataclass(frozen=True, eq=False)
class Shooting(Collocation):
    """How a solution is read: values at the ends of steps, integrals by Simpson's rule; `steps` in each element."""

    steps: int = 1

    def divided(self, meshes: Sequence[Mesh]) -> list[Mesh]:
        """The meshes whose elements are the steps."""
        parts = np.arange(self.steps) / self.steps
        inner = [(mesh.borders[:-1, None] + mesh.widths[:, None] * parts).ravel() for mesh in meshes]
        return [Mesh(np.append(borders, 1.0)) for borders in inner]


def shooting(steps: int) -> Shooting:
    """The method with `steps` steps in each element."""
    difference, end = np.array([[-1.0], [1.0]]), np.array([0.0, 1.0])
    simpson = np.array([1.0, 4.0, 1.0]) / 6
    return Shooting("shooting", end[1:], end, difference, end, simpson, refinable=False, steps=steps)


@dataclass(frozen=True, eq=False)
class StateTrack(Track):
    """A state over a step, from x, X_2, X_3, X_4 and the next x: unknowns (n, 5)."""

    def basis(self, element: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Weights (k, 5): x + sum of b_j(place) h F_j."""
        s = np.asarray(place, dtype=float)
        first, middle, last = s - 1.5 * s**2 + 2 / 3 * s**3, s**2 - 2 / 3 * s**3, -0.5 * s**2 + 2 / 3 * s**3
        found = np.stack([first, middle, middle, last], axis=1) @ SLOPES.T
        found[:, 0] += 1.0
        found[np.abs(found) < 1e-14] = 0.0
        return found


@dataclass(frozen=True, eq=False)
class AlgebraicTrack(Track):
    """An algebraic over a step, from its four stages: a parabola, the two in the middle averaged."""

    def basis(self, element: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Weights (k, 4)."""
        s = np.asarray(place, dtype=float)
        middle = 2 * s * (1 - s)
        return np.stack([(1 - s) * (1 - 2 * s), middle, middle, s * (2 * s - 1)], axis=1)


@dataclass(frozen=True, eq=False)
class ShootingLayout(Layout):
    """The unknowns of a phase; `mesh` holds the steps. inside: states (n, 3, nx) of the stages within a step."""

    inside: np.ndarray = field(kw_only=True)
    algebraics: np.ndarray = field(kw_only=True)  # (n, 4, nz)

    @property
    def stages(self) -> Layout:
        """The same unknowns as a scheme of four points per step."""
        known = {name: getattr(self, name) for name in Layout.__dataclass_fields__}
        return Layout(**{**known, "scheme": STAGES})

    def stage(self, j: int) -> Layout:
        """Signals as they are at stage j, wherever in the step."""
        nx, nz = len(self.phase.states), len(self.phase.algebraics)
        x = self.starts[:-1] if j == 0 else self.inside[:, j - 1]
        columns = np.hstack([x, self.algebraics[:, j]])
        flat = tuple(Track(np.zeros((len(c), 1)), c[:, None]) for c in columns.T)
        return replace(self, tracks=(*flat, *self.tracks[nx + nz :]))

    @cached_property
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """Element and place where integrands are read."""
        n = self.mesh.elements
        return np.repeat(np.arange(n), 3), np.tile([0.0, 0.5, 1.0], n)

    @cached_property
    def fractions(self) -> np.ndarray:
        """Where limits along the path hold: the borders of the steps."""
        return self.mesh.borders


def shoot(
    problem: ControlProblem, meshes: Sequence[Mesh], scheme: Collocation, located: Any = None
) -> Program:
    """The nonlinear program of `problem` on one mesh of steps per phase, of which `scheme.steps` make up an element.

    Raises ModelError for values at times that move inside of the horizon, so that none have to be `located`.
    """
    assert isinstance(scheme, Shooting)
    places = _places(problem, meshes, scheme)
    where = places_of_points(
        places, np.array([n.guess for n in problem.free]), [x.mesh.borders for x in places.layouts]
    )
    moving = next((one for one in where if one.place is None), None)
    if moving is not None:
        where = f"at({moving.point.time}, ...): this share of the horizon changes with free numbers; take "
        raise ModelError(where, Given("scheme", "radau"), place=problem.name, argument="scheme")
    groups: list[RowGroup] = []
    linear: list[Sparse] = []
    parts: list[tuple[ShootingLayout, list[Limit], int, int]] = []
    count = 0
    for number, layout in enumerate(places.layouts):
        assert isinstance(layout, ShootingLayout)
        mine = phase_rows(places, layout.stages, number, [], count)
        path = [limit for limit in layout.phase.path_limits if bare_limit(limit, layout.phase) is None]
        groups += [*mine.groups, *_path_groups(layout, number, path, mine.stop)]
        linear += mine.linear
        parts.append((layout, path, count, mine.stop))
        count = mine.stop + len(path) * layout.mesh.borders.size
        linear.append(sparse.csr_matrix((count - mine.stop, places.size)))
    boundary, boundary_terms = boundary_part(places, where, count)
    groups += boundary
    total = count + len(boundary)
    linear.append(sparse.csr_matrix((len(boundary), places.size)))
    terms = [*(term for part in parts for term in _terms(places, *part, total)), *boundary_terms]
    objective = [single_term(places, where, [without_sums(problem)], sparse.csr_matrix([[1.0]]))]
    objective += [term for layout, *_ in parts for term in _costs(places, layout)]
    assembled = Assembled(objective, terms, sparse.vstack(linear).tocsr(), scheme.compiled)
    limits = *_stage_limits(places), *row_limits(groups, total)
    return Program(problem, places, assembled, tuple(groups), *limits, tuple(where))


def _places(problem: ControlProblem, meshes: Sequence[Mesh], scheme: Shooting) -> Places:
    """Number the unknowns."""
    layouts: list[Layout] = []
    size = len(problem.free)
    scales = [np.array([n.size for n in problem.free])]
    for phase, mesh in zip(problem.phases, meshes, strict=True):
        layouts.append(_lay_out(_held(phase, scheme.steps), mesh, scheme, size))
        size += layouts[-1].size
        scales.append(np.array([s.nominal for s in phase.signals])[layouts[-1].owner])
    return Places(problem, np.arange(len(problem.free)), tuple(layouts), np.concatenate(scales))


def _held(phase: Phase, steps: int) -> Phase:
    """The phase with every input in pieces of whole elements: constant if nothing else was declared."""
    inputs = []
    for u in phase.inputs:
        kind = "constant" if u.pieces.kind == "free" else u.pieces.kind
        inputs.append(replace(u, pieces=replace(u.pieces, kind=kind, elements=u.pieces.elements * steps)))
    return replace(phase, inputs=tuple(inputs))


def _lay_out(phase: Phase, mesh: Mesh, scheme: Shooting, first: int) -> ShootingLayout:
    n, nx, nz = mesh.elements, len(phase.states), len(phase.algebraics)
    # step after step, so that what belongs together stands together
    each = 4 * (nx + nz)
    begin = first + each * np.arange(n)[:, None]
    starts = np.vstack([begin + np.arange(nx), first + each * n + np.arange(nx)])
    inside = begin[:, :, None] + nx + np.arange(3 * nx).reshape(3, nx)
    algebraics = begin[:, :, None] + 4 * nx + np.arange(4 * nz).reshape(4, nz)
    owner, moment = np.full(each * n + nx, -1), np.zeros(each * n + nx)
    times = mesh.borders[:-1, None, None] + mesh.widths[:, None, None] * PLACES[None, :, None]
    for where, numbers, when in (
        (starts, np.arange(nx), mesh.borders[:, None]),
        (inside, np.arange(nx), times[:, 1:]),
        (algebraics, nx + np.arange(nz), times),
    ):
        owner[where - first], moment[where - first] = numbers, when
    none = np.zeros((n, 0))
    tracks: list[Track] = []
    for i in range(nx):
        tracks.append(StateTrack(none, np.column_stack([starts[:-1, i], inside[:, :, i], starts[1:, i]])))
    tracks += [AlgebraicTrack(none, algebraics[:, :, i]) for i in range(nz)]
    chains: dict[int, np.ndarray] = {}
    for i, signal in enumerate(phase.inputs, nx + nz):
        track, new = pieces_of(signal, mesh, first + owner.size)
        tracks.append(track)
        chains[i] = first + owner.size + np.arange(new.size)
        owner, moment = np.append(owner, np.full(new.size, i)), np.append(moment, new)
    return ShootingLayout(
        phase, mesh, scheme, first, np.zeros(0, int), starts, tuple(tracks), chains, owner, moment,
        inside=inside, algebraics=algebraics,
    )  # fmt: skip


def _path_groups(layout: ShootingLayout, number: int, path: list[Limit], start: int) -> list[RowGroup]:
    count, moments = layout.mesh.borders.size, layout.fractions
    rows = start + len(path) * np.arange(count)
    return [
        RowGroup("path", x.name, number, rows + i, moments, x.lower, x.upper, x.size)
        for i, x in enumerate(path)
    ]


def _terms(
    places: Places, layout: ShootingLayout, path: list[Limit], start: int, stop: int, total: int
) -> list[Term]:
    """The four stages of every step, and the limits at the starts of steps and at the end."""
    phase, n, found = layout.phase, layout.mesh.elements, []
    steps = np.arange(n)
    for j, place in enumerate(PLACES):
        run = running(places, layout.stage(j))
        values = ca.vertcat(phase.ode * (run.horizon * run.width), phase.residuals)
        if not values.numel():
            continue
        sizes = np.array([*(-s.nominal for s in phase.states), *phase.residual_sizes])
        factor = np.tile(1.0 / sizes, (n, 1))
        rows = start + (4 * steps[:, None] + j) * values.numel() + np.arange(values.numel())
        found.append(run.term(values, steps, np.full(n, place), _scatter(factor, rows, total)))
    if path:
        limits = ca.vertcat(*(limit.expression for limit in path))
        for one, element, place, border in (
            (layout.stage(0), steps, np.zeros(n), steps),
            (layout, steps[-1:], np.ones(1), np.array([n])),
        ):
            rows = stop + len(path) * border[:, None] + np.arange(len(path))
            factor = np.tile([1.0 / limit.size for limit in path], (border.size, 1))
            found.append(running(places, one).term(limits, element, place, _scatter(factor, rows, total)))
    return found


def _scatter(factor: np.ndarray, rows: np.ndarray, total: int) -> Sparse:
    return sparse.csr_matrix((factor.ravel(), (rows.ravel(), np.arange(rows.size))), shape=(total, rows.size))


def _costs(places: Places, layout: ShootingLayout) -> list[Term]:
    """The integral by the same method, penalties on steps of inputs, and sums over samples."""
    phase = layout.phase
    bare = replace(layout, phase=replace(phase, integrand=ca.SX(0)))
    found = [*running_costs(places, bare), *sample_sums(places, layout)]
    if not phase.integrand.is_zero():
        n = layout.mesh.elements
        for j, (place, weight) in enumerate(zip(PLACES, WEIGHTS, strict=True)):
            run = running(places, layout.stage(j))
            scatter = sparse.csr_matrix(np.full((1, n), weight))
            cost = phase.integrand * run.horizon * run.width
            found.append(run.term(cost, np.arange(n), np.full(n, place), scatter))
    return found


def _stage_limits(places: Places) -> tuple[np.ndarray, np.ndarray]:
    """Limits of the scaled unknowns; within a step only those without which an equation has no meaning."""
    lower, upper = unknown_limits(places)
    for layout in places.layouts:
        assert isinstance(layout, ShootingLayout)
        lower[layout.inside], upper[layout.inside] = -np.inf, np.inf
        for i, signal in enumerate(layout.phase.algebraics):
            inside = layout.algebraics[:, 1:, i].ravel()[:-1]  # the last is the end of the phase
            lower[inside], upper[inside] = (
                signal.min / places.scale[inside],
                signal.max / places.scale[inside],
            )
    return lower, upper
