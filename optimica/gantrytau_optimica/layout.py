"""Which variable of the nonlinear program is which value of which signal.

Within one element every signal is a polynomial through some nodes: a state through the start of the element
and its collocation points, an algebraic or a free input through the collocation points, a constant input
through one node, a linear one through the ends of its group of elements. Nodes are in element coordinates, 0
to 1 over the element.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gantrytau_optimica.collocation import Scheme, lagrange
from gantrytau_optimica.control_problem import ControlProblem, Signal

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Pieces:
    """An input that is constant, or linear and continuous, over groups of elements."""

    kind: Literal["constant", "linear"]
    elements: int = 1  # in each group
    max_step: float | None = None  # largest change from one value to the next

    def __post_init__(self) -> None:
        if self.kind not in ("constant", "linear"):
            raise ValueError(f"kind of control: found '{self.kind}', expected 'constant' or 'linear'")
        if self.elements < 1:
            raise ValueError(f"elements of a piece of control: found {self.elements}, expected at least 1")


@dataclass(frozen=True, eq=False)
class Track:
    """The polynomial pieces of one signal: nodes (elements, n) and the variables holding the values there."""

    nodes: Array
    variables: Indices


@dataclass(frozen=True, eq=False)
class Layout:
    """The variables of the nonlinear program: free numbers first, then the signals along time."""

    borders: Array  # (elements + 1,) from 0 to 1, relative time
    scheme: Scheme
    tracks: tuple[Track, ...]  # of states, algebraics, inputs
    chains: tuple[
        tuple[Indices, float], ...
    ]  # consecutive values of an input that may not step further than that
    starts: Indices  # (elements + 1, states): the state at every border
    size: int
    owner: Indices  # (size,): number of the signal a variable belongs to, -1 for free numbers
    moment: Array  # (size,): relative time of a variable, NaN for free numbers

    @property
    def widths(self) -> Array:
        """Relative length of the elements, (elements,)."""
        return np.diff(self.borders)

    @property
    def times(self) -> Array:
        """Relative times of the collocation points, (elements, points)."""
        return self.borders[:-1, None] + self.widths[:, None] * self.scheme.points

    def locate(self, moment: Array) -> tuple[Indices, Array]:
        """Element and element coordinate of relative times; a border belongs to the element on its left."""
        element = np.clip(np.searchsorted(self.borders, moment, side="left") - 1, 0, len(self.borders) - 2)
        return element, (moment - self.borders[element]) / self.widths[element]

    def values(self, track: Track, variables: Array, element: Indices, s: Array) -> Array:
        """The signal at element coordinates s of the given elements."""
        basis = np.array(lagrange(track.nodes[element].T, s))
        return (basis * variables[track.variables[element]].T).sum(axis=0)


def lay_out(problem: ControlProblem, borders: Array, scheme: Scheme, pieces: Mapping[str, Pieces]) -> Layout:
    """Number the variables element by element, so that what is coupled stands close together."""
    elements, k = len(borders) - 1, len(scheme.points)
    nf, nx, nz = len(problem.free), len(problem.states), len(problem.algebraics)
    free_inputs = [i for i, signal in enumerate(problem.inputs) if signal.name not in pieces]
    unknown = set(pieces) - {signal.name for signal in problem.inputs}
    if unknown:
        raise ValueError(
            f"controls: '{sorted(unknown)[0]}' is no input; inputs are "
            + ", ".join(signal.name for signal in problem.inputs)
        )
    local = nx + nz + len(free_inputs)
    radau = scheme.name == "radau"  # the last point is the end of the element
    stride = k * local + (0 if radau else nx)
    first = nf + nx + stride * np.arange(elements)
    at_points = first[:, None, None] + local * np.arange(k)[None, :, None] + np.arange(local)
    ends = at_points[:, -1, :nx] if radau else first[:, None] + k * local + np.arange(nx)
    starts = np.vstack([nf + np.arange(nx)[None, :], ends])
    size = nf + nx + stride * elements

    moment, owner = np.full(size, np.nan), np.full(size, -1)
    times = borders[:-1, None] + np.diff(borders)[:, None] * scheme.points
    moment[at_points] = times[:, :, None]
    moment[starts] = borders[:, None]
    owner[starts] = np.arange(nx)
    numbers = np.array([*range(nx + nz), *(nx + nz + i for i in free_inputs)], dtype=np.int64)
    owner[at_points] = numbers

    nodes, points = np.tile(scheme.nodes, (elements, 1)), np.tile(scheme.points, (elements, 1))
    tracks = [Track(nodes, np.column_stack([starts[:-1, i], at_points[:, :, i]])) for i in range(nx)]
    tracks += [Track(points, at_points[:, :, nx + i]) for i in range(nz)]
    chains = []
    for i, signal in enumerate(problem.inputs):
        if signal.name not in pieces:
            tracks.append(Track(points, at_points[:, :, nx + nz + free_inputs.index(i)]))
            continue
        piece = pieces[signal.name]
        track, new = _piecewise(signal, piece, borders, size)
        tracks.append(track)
        moment, owner = np.append(moment, new), np.append(owner, np.full(len(new), nx + nz + i))
        if piece.max_step is not None:
            chains.append((np.arange(size, size + len(new)), piece.max_step))
        size += len(new)
    return Layout(borders, scheme, tuple(tracks), tuple(chains), starts, size, owner, moment)


def _piecewise(signal: Signal, piece: Pieces, borders: Array, offset: int) -> tuple[Track, Array]:
    """Track of a piecewise input, and the relative times of its values: middles or ends of the pieces."""
    elements = len(borders) - 1
    if piece.max_step is not None and not piece.max_step >= 0:
        raise ValueError(f"{signal.name}: max_step {piece.max_step}, expected a number that is not negative")
    group = np.arange(elements) // piece.elements
    knots = np.append(borders[:: piece.elements][: group[-1] + 1], borders[-1])
    if piece.kind == "constant":
        return Track(np.full((elements, 1), 0.5), offset + group[:, None]), (knots[:-1] + knots[1:]) / 2
    ends = np.column_stack([knots[group], knots[group + 1]])
    nodes = (ends - borders[:-1, None]) / np.diff(borders)[:, None]
    return Track(nodes, offset + np.column_stack([group, group + 1])), knots
