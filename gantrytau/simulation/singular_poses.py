"""Singular poses: how far a model is from one, and whether it meets one between two points of its motion.

Constraints become dependent: the smallest singular value of their Jacobian falls to zero. Near such a pose the
forces grow beyond all limits, but an integrator may step over it. The determinant of the columns of the
dependent coordinates changes its sign there; it also does where only this choice of coordinates fails, and
then the singular values say so. Accelerations and forces follow from linear equations, of which elimination
leaves a small matrix per block; it is watched in the same way.

The distance from a singular pose falls to zero along a straight line and rises again behind it, while a
determinant changes its sign. Two ways to assemble may cross in that pose: an integrator that steps over it may come
out on the other way, where the determinant has its old sign. Then only the distance tells, and only to one who
walks up to the pose in steps that end before it.
"""

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.border.refusal import SolveError
from gantrytau.compiler.start.balance import NOISE, balance
from gantrytau.compiler.start.level import ROUNDING
from gantrytau.language.term_sizes import term_sizes
from gantrytau.simulation.events.at_places import AtPlaces

CLOSE = 1e-3  # smallest singular value of the constraints, relative to that at the start: forces a million times larger
LOST = 0.3  # of the least singular value at the start: below, the equations of a position that stops the run are named
SOUND = 0.01  # smallest singular value of a scaled matrix that is taken as a measure at least
LEAST = 1e-6  # the same of the equations of accelerations and forces
FORESIGHT = 1.5  # intervals over which a fall of the distance is led on: it may become steeper
SHARE = 0.5  # of the way to where the distance would be zero, or nothing was found, taken in one step
PROBE = 1e-4  # of the interval: a first step, which says how fast the distance falls
LONGEST = 0.25  # step, of the interval
SHORTEST = 2.0**-14  # step, of the interval, to come near to where the integration stops
SURPRISE = 0.25  # of the distance, by which it may miss what its fall had led to expect
MOST = 400  # steps; past a pose that is not met a motion needs about twenty

NOTHING = 1e-9  # of the largest, below which a row or a column counts as zero

Point = tuple[np.ndarray, np.ndarray, float, np.ndarray]  # states, algebraics, time, sampled inputs
Scale = tuple[np.ndarray, np.ndarray, float]  # lengths of rows and columns, and the smallest singular value


@dataclass(frozen=True)
class Look:
    """Observations at some points, arrays over them.

    side: sign of the determinant of the dependent coordinates; distance: smallest singular value of the
    constraints, relative to the first look on the same side of all events; regular: whether accelerations and forces are
    determined.
    """

    side: np.ndarray
    distance: np.ndarray
    regular: np.ndarray

    @property
    def near(self) -> np.ndarray:
        """Whether a point counts as singular."""
        return (self.distance < CLOSE) | ~self.regular


class Conditioning:
    """Constraint Jacobian and matrices of the blocks as functions of the point.

    constraints: Jacobian by the coordinates, of which `dependent` are the columns of the dependent ones;
    divisors, matrices: of the blocks; what never changes is left out. arguments: symbols of a point; steps: columns of
    its inputs that change at events only: behind one that the matrices depend on they are measured anew.
    """

    def __init__(
        self,
        constraints: ca.SX,
        dependent: Sequence[int],
        divisors: Sequence[ca.SX],
        matrices: Sequence[ca.SX],
        arguments: Sequence[ca.SX],
        steps: Sequence[int] = (),
    ):
        heads = [d for d in divisors if not d.is_constant()]
        changing = [ca.densify(m) for m in matrices if not m.is_constant()]
        if constraints.is_constant():
            constraints, dependent = ca.SX(0, 0), ()
        self._dependent = list(dependent) if len(dependent) == constraints.shape[0] else []
        self._shapes = [constraints.shape, *(m.shape for m in changing)]
        self._divisors = len(heads)
        parts = [ca.densify(constraints), *changing]
        everything = ca.densify(ca.vertcat(*heads, *(ca.vec(m) for m in parts)))
        self._values = AtPlaces(ca.Function("conditioning", list(arguments), [everything], {"cse": True}))
        self._symbols = list(arguments), everything
        self._steps = [k for k in steps if ca.depends_on(everything, arguments[-1][k])]
        self._scales: dict[bytes, list[Scale]] = {}
        self._first: dict[bytes, np.ndarray] = {}

    def anew(self) -> "Conditioning":
        """A copy for another run, which gets scales of its own points."""
        found = copy(self)
        found._scales, found._first = {}, {}
        return found

    @property
    def needed(self) -> bool:
        """Whether anything changes at all."""
        return self._values.function.numel_out(0) > 0

    def sides(self, w: np.ndarray) -> np.ndarray:
        """What tells the sides of events apart by which matrices are measured, (points, k), of inputs (points, m)."""
        return w[:, self._steps]

    def look(self, *points: np.ndarray) -> Look:
        """What is to be seen at points, given by the arguments with one row per point."""
        sides = self.sides(points[-1])
        if np.all(sides[:1] == sides):
            return self._look(sides[0], *points)
        sides, own = np.unique(sides, axis=0, return_inverse=True)
        found = [self._look(side, *(p[own.ravel() == k] for p in points)) for k, side in enumerate(sides)]
        order = np.argsort(np.argsort(own.ravel(), kind="stable"), kind="stable")
        parts = zip(*((one.side, one.distance, one.regular) for one in found), strict=True)
        return Look(*(np.concatenate(part)[order] for part in parts))

    def _look(self, side: np.ndarray, *points: np.ndarray) -> Look:
        """The same on one side of all events; the first point there is the measure."""
        (values,) = self._values(*points)
        matrices = self._matrices(values)
        constraints, *blocks = matrices
        scales = self._scales.setdefault(side.tobytes(), [])
        if not scales:
            sure = self._sure(values[:1], [p[:1] for p in points])
            self._first[side.tobytes()] = np.concatenate([np.ravel(p[:1]) for p in points])
            scales += [_scale(m[0], one) for m, one in zip(matrices, sure, strict=True)]
        distances = [_least(m, scale) for m, scale in zip(matrices, scales, strict=True)]
        sign = np.ones(len(values))
        if self._dependent:
            rows, columns, _ = scales[0]
            sign = np.linalg.slogdet((constraints / rows / columns)[:, :, self._dependent])[0]
        regular = np.all([d > LEAST for d in distances[1:]], axis=0) if blocks else np.ones(len(values), bool)
        for k in np.flatnonzero(
            ~regular
        ).tolist():  # small as their terms are, as conductances of a diode that closes
            terms = self._terms([p[k : k + 1] for p in points], self._first[side.tobytes()])[1:]
            own = [_least(m[k : k + 1], _scale(t, 0)) for m, t in zip(blocks, terms, strict=True)]
            regular[k] = np.all(np.concatenate(own) > LEAST)
        return Look(sign, distances[0], regular)

    def _matrices(self, values: np.ndarray) -> list[np.ndarray]:
        """Constraints and blocks, (points, rows, columns), of what stands below each other in (points, values)."""
        matrices, place = [], self._divisors
        for rows, columns in self._shapes:
            part = values[:, place : place + rows * columns].reshape(len(values), columns, rows)
            matrices.append(np.nan_to_num(part.transpose(0, 2, 1), nan=0.0, posinf=0.0, neginf=0.0))
            place += rows * columns
        return matrices

    def _sure(self, values: np.ndarray, point: Sequence[np.ndarray]) -> list[np.ndarray]:
        """1 where entries that are small beside their row, or beside their column, are no rounding, else 0."""
        sizes = [np.abs(m[0]) for m in self._matrices(values)]
        most = [(m.max(axis=1, keepdims=True, initial=0.0), m.max(axis=0, initial=0.0)) for m in sizes]
        sure = [(m > NOISE * r) ^ (m > NOISE * c) for m, (r, c) in zip(sizes, most, strict=True)]
        if any(np.any(one) for one in sure):
            terms = self._terms(point)
            sure = [one & (m > ROUNDING * r) for one, m, r in zip(sure, sizes, terms, strict=True)]
        return [one.astype(int) for one in sure]

    def _terms(self, point: Sequence[np.ndarray], first: np.ndarray | None = None) -> list[np.ndarray]:
        """Sizes of the terms of all entries at a point; first: a point by whose numbers symbols have a size at least."""
        arguments, everything = self._symbols
        names = [one.name() for one in ca.vertcat(*arguments).elements()]
        least = None if first is None else dict(zip(names, np.abs(first).tolist(), strict=True))
        terms = ca.Function("terms", arguments, [ca.vertcat(*term_sizes(everything.elements(), least))])
        return [m[0] for m in self._matrices(AtPlaces(terms)(*point)[0])]


def _scale(matrix: np.ndarray, sure: np.ndarray | int) -> Scale:
    """Lengths of rows and columns, and the smallest singular value of the matrix divided by them."""
    rows, columns = _lengths(matrix, sure)
    if matrix.size == 0:
        return rows, columns, 1.0
    least = np.linalg.svd(matrix / rows / columns, compute_uv=False)[-1]
    # a start near a singular pose is no measure
    return rows, columns, max(float(least), SOUND)


def _lengths(matrix: np.ndarray, sure: np.ndarray | int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Lengths of rows (m, 1) and columns (1, n); one that is zero here need not be so elsewhere: it is as long as others."""
    own_rows, own_columns = balance(matrix, sure)
    sized = own_rows * matrix * own_columns
    rows = np.linalg.norm(sized, axis=1, keepdims=True)
    rows = np.where(rows > NOTHING * rows.max(initial=0.0), rows, 1.0)
    columns = np.linalg.norm(sized / rows, axis=0, keepdims=True)
    columns = np.where(columns > NOTHING * columns.max(initial=0.0), columns, 1.0)
    return rows / own_rows, columns / own_columns


def _least(matrices: np.ndarray, scale: Scale) -> np.ndarray:
    """Smallest singular values, relative to that of the scale."""
    rows, columns, size = scale
    if matrices[0].size == 0:
        return np.ones(len(matrices))
    return np.linalg.svd(matrices / rows / columns, compute_uv=False)[:, -1] / size


@dataclass(frozen=True)
class Approach:
    """Result of a walk towards a point.

    point: the last one before the singular pose, or the end; distance: there; zero: time at which that distance
    would be zero, s; arrived: whether the end was reached; met: whether a singular point was seen on the way.
    """

    point: Point
    distance: float
    zero: float
    arrived: bool
    met: bool

    @property
    def singular(self) -> bool:
        """Whether a singular pose stands in the way."""
        return not self.arrived and (self.met or self.distance < 5 * CLOSE)


def doubtful(t: np.ndarray, look: Look) -> np.ndarray:
    """Whether a singular pose may lie between successive points, (points - 1,).

    t: times, (points,) in s. The distance is led on from both sides: it may have risen again within the interval.
    """
    d, h = look.distance, np.diff(t)
    rates = np.diff(d) / h
    falls = h * np.concatenate([[0.0], -rates[:-1]])  # what it loses in the interval if it goes on as before
    rises = h * np.concatenate([rates[1:], [0.0]])
    straight = np.minimum(d[:-1] - FORESIGHT * falls, d[1:] - FORESIGHT * rises) < CLOSE
    return straight | look.near[1:] | (look.side[:-1] * look.side[1:] < 0)


def approach(
    point: Point, end: float, step: Callable[[Point, float], Point], look: Callable[[Point], Look]
) -> Approach:
    """Walk from a point to the time `end`, or to just before the singular pose on the way.

    step: the point some seconds later, RuntimeError or SolveError where there is none. A step takes half of the way
    to where the distance would be zero, and is taken back where the distance is not what its fall led to expect.
    """
    length = end - point[2]
    distance, fall, size, arrived, met = float(look(point).distance[0]), 0.0, PROBE * length, False, False
    for _ in range(MOST):
        left = end - point[2]
        size = min(size, LONGEST * length)
        size = min(size, SHARE * distance / fall) if fall > 0 else size
        if arrived or size < min(SHORTEST * length, left):
            break
        size = min(size, left)
        try:
            there = step(point, size)
        except (RuntimeError, SolveError):
            size /= 2
            continue
        new = look(there)
        if new.near[0]:
            size, met = size / 2, True
            continue
        change = float(new.distance[0]) - distance
        if size > PROBE * length and abs(change + fall * size) > SURPRISE * distance:
            size /= 2
            continue
        arrived = size == left
        point, distance, fall, size = there, distance + change, -change / size, 2 * size
    wait = distance / fall if fall > 0 else np.inf
    return Approach(point, distance, point[2] + (wait if wait < length else 0.0), arrived, met)


def depending(here: np.ndarray, before: np.ndarray, names: Sequence[str]) -> list[str]:
    """Rows of a matrix that nearly depend on each other here, while before they did not."""
    if not (here.size and np.all(np.isfinite(here)) and np.all(np.isfinite(before))):
        return []
    rows, columns = _lengths(before)
    left, values, _ = np.linalg.svd(here / rows / columns)
    if values[-1] > LOST * np.linalg.svd(before / rows / columns, compute_uv=False)[-1]:
        return []
    shares = np.abs(left[:, len(values) - 1])
    return [names[int(i)] for i in np.argsort(-shares)[:6] if shares[i] > 0.1 * np.max(shares)]
