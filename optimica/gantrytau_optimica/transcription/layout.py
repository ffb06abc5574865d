"""Where the unknowns of a transcribed problem stand, and the constant matrices that pick them out.

Within an element every signal is a polynomial through some nodes: a state through those of the scheme (the start of the
element and mostly its points), an algebraic or a free input through the points, a constant input through one node, a
linear one through the ends of its group of elements. Nodes lie in the element, from 0 to 1.
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from gantrytau import ModelError
from gantrytau.border.refusal import Given
from gantrytau_optimica.control.control_problem import ControlProblem, Phase, Signal
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.scheme import Collocation

Sparse = Any  # a matrix of scipy.sparse
SAME_BORDER = 1e-12  # of the horizon, by rounding


@dataclass(frozen=True, eq=False)
class Track:
    """The polynomial pieces of a signal: nodes (n, m) and the unknowns that hold the values there, (n, m)."""

    nodes: np.ndarray
    unknowns: np.ndarray

    def basis(self, element: np.ndarray, place: np.ndarray) -> np.ndarray:
        """Weights (k, m) of the nodes of the named elements (k,) at places (k,)."""
        return lagrange(self.nodes[element], place)

    def values(self, w: np.ndarray, element: np.ndarray, place: np.ndarray) -> np.ndarray:
        """The signal (k,) at places of elements."""
        return self.weighted(self.basis(element, place), w, element)

    def weighted(self, basis: np.ndarray, w: np.ndarray, element: np.ndarray) -> np.ndarray:
        """The signal (k,) by the weights of the nodes of the named elements."""
        return np.einsum("km,km->k", basis, w[self.unknowns[element]])


def lagrange(nodes: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Weights (k, m) of values at nodes (k, m) for the polynomial's value at places (k,); exact at a node."""
    found = np.ones(nodes.shape)
    for j in range(nodes.shape[1]):
        for i in range(nodes.shape[1]):
            if i != j:
                found[:, j] *= (place - nodes[:, i]) / (nodes[:, j] - nodes[:, i])
    found[np.abs(found) < 1e-14] = 0.0
    return found


def polynomials(nodes: np.ndarray, place: ca.SX) -> ca.SX:
    """Lagrange's polynomials through nodes (m,) at a symbolic place, (m,)."""
    found = []
    for j, node in enumerate(nodes):
        value = ca.SX(1)
        for other in np.delete(nodes, j):
            value *= (place - float(other)) / float(node - other)
        found.append(value)
    return ca.vertcat(*found)


@dataclass(frozen=True, eq=False)
class Layout:
    """The unknowns of one phase on n elements with k points.

    starts (n + 1, nx): states at the borders; where the last node is 1, it is the start of the
    next. tracks: of all signals in their order. chains: consecutive values of piecewise inputs, by number of the
    signal. knots: the moving borders. moment: share of the horizon of every unknown from `first` on. begin (nz,): algebraics
    at the start, where conditions ask for them: polynomials through the points would be extrapolated there.
    """

    phase: Phase
    mesh: Mesh
    scheme: Collocation
    first: int
    knots: np.ndarray
    starts: np.ndarray
    tracks: tuple[Track, ...]
    chains: dict[int, np.ndarray]
    owner: np.ndarray  # number of the signal of every unknown from `first` on, -1 for knots
    moment: np.ndarray
    begin: np.ndarray = field(default_factory=lambda: np.zeros(0, int))

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.owner.size

    @cached_property
    def points(self) -> tuple[np.ndarray, np.ndarray]:
        """Element and place of all collocation points, one after another."""
        n, k = self.mesh.elements, self.scheme.points.size
        return np.repeat(np.arange(n), k), np.tile(self.scheme.points, n)

    @cached_property
    def fractions(self) -> np.ndarray:
        """Where on [0, 1] the points lie, (n k,)."""
        return (self.mesh.borders[:-1, None] + self.mesh.widths[:, None] * self.scheme.points).ravel()

    def of(self, signal: int) -> np.ndarray:
        """All unknowns of a signal, in order of time."""
        mine = np.flatnonzero(self.owner == signal)
        return self.first + mine[np.argsort(self.moment[mine], kind="stable")]

    def bases(self, element: np.ndarray, place: np.ndarray) -> list[np.ndarray]:
        """Weights of the nodes of every track at places of elements; tracks on the same nodes share theirs."""
        found: dict[tuple[type, int], np.ndarray] = {}
        for track in self.tracks:
            key = type(track), id(track.nodes)
            if key not in found:
                found[key] = track.basis(element, place)
        return [found[type(track), id(track.nodes)] for track in self.tracks]

    def placed(self, w: np.ndarray) -> Mesh:
        """The mesh with its moving borders as they stand among the unknowns."""
        return self.mesh.placed(w[self.knots]) if self.knots.size else self.mesh


@dataclass(frozen=True, eq=False)
class Places:
    """All unknowns: the free numbers, then phase after phase. scale: typical size of each."""

    problem: ControlProblem
    free: np.ndarray
    layouts: tuple[Layout, ...]
    scale: np.ndarray

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return self.scale.size

    def pick(self, row: Any, unknown: Any, value: Any, rows: int) -> Sparse:
        """The matrix (rows, size) of scaled unknowns with value * scale at (row, unknown)."""
        row, unknown, value = (np.concatenate([np.ravel(x) for x in part]) for part in (row, unknown, value))
        unknown = unknown.astype(np.int64)
        return sparse.csr_matrix((value * self.scale[unknown], (row, unknown)), shape=(rows, self.size))

    def gather(self, layout: Layout, element: np.ndarray, place: np.ndarray) -> Sparse:
        """To signals, free numbers and, where borders move, the ends of the element, at places (k,), one after another."""
        moving, nf = layout.knots.size > 0, self.free.size
        local = len(layout.tracks) + nf + (2 if moving else 0)
        point = np.arange(element.size) * local
        rows, unknowns, values = [np.zeros(0, int)], [np.zeros(0, int)], [np.zeros(0)]
        bases = layout.bases(element, place)
        for i, (track, basis) in enumerate(zip(layout.tracks, bases, strict=True)):
            r, c = np.nonzero(basis)
            rows.append(point[r] + i)
            unknowns.append(track.unknowns[element[r], c])
            values.append(basis[r, c])
        for i in range(nf):
            rows.append(point + len(layout.tracks) + i)
            unknowns.append(np.full(element.size, self.free[i]))
            values.append(np.ones(element.size))
        if moving:
            shares = layout.mesh.shares()[0]
            for i, border in enumerate((element, element + 1)):
                part = shares[border].tocoo()
                rows.append(point[part.row] + len(layout.tracks) + nf + i)
                unknowns.append(layout.knots[part.col])
                values.append(part.data)
        return self.pick(rows, unknowns, values, local * element.size)

    def numbers(self) -> Sparse:
        """To the free numbers."""
        return self.pick([np.arange(self.free.size)], [self.free], [np.ones(self.free.size)], self.free.size)

    def differentiated(self, layout: Layout) -> Sparse:
        """To D x: derivatives of all states at all points by the place in the element, divided by size."""
        n, k, nx = layout.mesh.elements, layout.scheme.points.size, len(layout.phase.states)
        if not nx:
            return sparse.csr_matrix((0, self.size))
        sizes = np.array([s.nominal for s in layout.phase.states])
        nodes = np.stack([layout.tracks[i].unknowns for i in range(nx)], axis=2)  # (n, k + 1, nx)
        place = np.broadcast_to(nodes[:, None], (n, k, k + 1, nx))
        value = np.broadcast_to(layout.scheme.differentiation.T[None, :, :, None] / sizes, place.shape)
        row = np.broadcast_to(np.arange(n * k * nx).reshape(n, k, 1, nx), place.shape)
        return self.pick([row], [place], [value], n * k * nx)

    def jumps(self, layout: Layout) -> Sparse:
        """To the end of each element less the start of the next; no rows where the two are one unknown."""
        n, nx = layout.mesh.elements, len(layout.phase.states)
        if layout.scheme.nodes[-1] == 1.0 or not nx:
            return sparse.csr_matrix((0, self.size))
        sizes = np.array([s.nominal for s in layout.phase.states])
        nodes = np.stack([layout.tracks[i].unknowns for i in range(nx)], axis=2)
        nodes = np.concatenate([nodes, layout.starts[1:, None, :]], axis=1)
        weights = np.concatenate([layout.scheme.end, [-1.0]])
        value = np.broadcast_to(weights[None, :, None] / sizes, nodes.shape)
        row = np.broadcast_to(np.arange(n * nx).reshape(n, 1, nx), nodes.shape)
        return self.pick([row], [nodes], [value], n * nx)


def lay_out(problem: ControlProblem, meshes: tuple[Mesh, ...], scheme: Collocation) -> Places:
    """Number the unknowns: free numbers, then element after element, so that what belongs together stands together."""
    layouts: list[Layout] = []
    size = len(problem.free)
    scales = [np.array([n.size for n in problem.free])]
    for phase, mesh in zip(problem.phases, meshes, strict=True):
        layout = _lay_out(phase, mesh, scheme, size)
        size += layout.size
        layouts.append(layout)
        nominal = np.array([*(s.nominal for s in phase.signals), 1.0])  # the last for knots, numbered -1
        scales.append(nominal[layout.owner])
    return Places(problem, np.arange(len(problem.free)), tuple(layouts), np.concatenate(scales))


def _lay_out(phase: Phase, mesh: Mesh, scheme: Collocation, first: int) -> Layout:
    n, k, m = mesh.elements, scheme.points.size, len(mesh.moving)
    nx, nz = len(phase.states), len(phase.algebraics)
    pointwise = [
        *range(nx + nz),
        *(nx + nz + i for i, u in enumerate(phase.inputs) if u.pieces.kind == "free"),
    ]
    per_point, shared = len(pointwise), scheme.nodes[-1] == 1.0
    per_element = k * per_point + (0 if shared else nx)
    begin = first + m + nx
    point = begin + per_element * np.arange(n)[:, None] + per_point * np.arange(k)[None, :]
    ends = (
        point[:, -1, None] if shared else (begin + per_element * np.arange(1, n + 1) - nx)[:, None]
    ) + np.arange(nx)
    starts = np.vstack([first + m + np.arange(nx), ends])
    size = m + nx + per_element * n
    owner, moment = np.full(size, -1), np.zeros(size)
    nodes, points = np.tile(scheme.nodes, (n, 1)), np.tile(scheme.points, (n, 1))
    at_nodes, at_points = (mesh.borders[:-1, None] + mesh.widths[:, None] * x for x in (nodes[:, 1:], points))
    moment[:m] = mesh.borders[list(mesh.moving)]
    owner[starts - first], moment[starts - first] = np.arange(nx), mesh.borders[:, None]
    tracks: dict[int, Track] = {}
    for offset, i in enumerate(pointwise):
        mine = point + offset - first
        owner[mine], moment[mine] = i, at_nodes if i < nx else at_points
        if i < nx:
            tracks[i] = Track(nodes, np.column_stack([starts[:-1, i], point + offset]))
        else:
            tracks[i] = Track(points, point + offset)
    chains: dict[int, np.ndarray] = {}
    for i, signal in enumerate(phase.inputs, nx + nz):
        if signal.pieces.kind == "free":
            continue
        if mesh.moving and signal.pieces.kind == "linear" and signal.pieces.elements > 1:
            why = "expected 'given' beside straight lines over several elements; give the lengths, or elements=1 there"
            raise ModelError(why, place=f"controls {signal.name}", found=Given("lengths", "free"))
        tracks[i], new = pieces_of(signal, mesh, first + owner.size)
        if signal.pieces.kind != "ramps":
            chains[i] = first + owner.size + np.arange(new.size)
        owner, moment = np.append(owner, np.full(new.size, i)), np.append(moment, new)
    begin = np.zeros(0, int)
    if nz and _asked_at_the_start(phase):
        begin = first + owner.size + np.arange(nz)
        owner, moment = np.append(owner, nx + np.arange(nz)), np.append(moment, np.zeros(nz))
    ordered = tuple(tracks[i] for i in range(len(phase.signals)))
    return Layout(
        phase, mesh, scheme, first, first + np.arange(m), starts, ordered, chains, owner, moment, begin
    )


def _asked_at_the_start(phase: Phase) -> bool:
    """Whether an algebraic stands in a value at the start."""
    symbols = ca.vertcat(*(a.symbol for a in phase.algebraics))
    asked = [p.expression for p in phase.points if isinstance(p.time, str) and p.time == "initial"]
    return any(ca.depends_on(e, symbols) for e in asked)


def pieces_of(signal: Signal, mesh: Mesh, first: int) -> tuple[Track, np.ndarray]:
    """Track of an input made of pieces, and the shares of the horizon of its values: middles or ends of the pieces."""
    n, borders, pieces = mesh.elements, mesh.borders, signal.pieces
    if pieces.kind == "ramps":
        jumps = np.ones(n - 1, bool)
        if pieces.borders:
            jumps = np.min(np.abs(borders[1:-1, None] - np.array(pieces.borders)), axis=1) < SAME_BORDER
        begins = np.cumsum(np.concatenate([[0], 1 + jumps]))
        ends = np.concatenate([borders[:1], np.repeat(borders[1:-1], 1 + jumps), borders[-1:]])
        unknowns = first + np.column_stack([begins, begins + 1])
        return Track(np.tile([0.0, 1.0], (n, 1)), unknowns), ends
    if pieces.borders:
        ends = np.array(pieces.borders)
        group = np.clip(np.searchsorted(ends, (borders[:-1] + borders[1:]) / 2) - 1, 0, ends.size - 2)
    else:
        group = np.arange(n) // pieces.elements
        ends = np.append(borders[:: pieces.elements][: group[-1] + 1], borders[-1])
    if pieces.kind == "constant":
        return Track(np.full((n, 1), 0.5), first + group[:, None]), (ends[:-1] + ends[1:]) / 2
    pair = np.column_stack([ends[group], ends[group + 1]])
    nodes = (pair - borders[:-1, None]) / mesh.widths[:, None]
    return Track(nodes, first + np.column_stack([group, group + 1])), ends
