"""What changes with the order of the rows: positions that drift or jump, a frame that turns, an actuator off its count.

    left = X b + noise,   X = U f(t)   across the numbers,   t from -1 in the first row to 1 in the last

f are Legendre polynomials up to the third, a step, or 1 in every k-th row. A cause is told if chance does not give its gain
b'X'left: noise of a pose moves all its links, so that gains are compared with tr (X'X)^-1 sum_n (X_n'e_n)(X_n'e_n)', that
of errors independent from pose to pose (Liang and Zeger, 1986). Errors of the model depend on the pose and not on the order:
where smooth functions of the pose explain as much, nothing is said.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gantrytau_optimica.calibration.diagnostics.link_systems import LinkSystem, freedom, variance
from gantrytau_optimica.calibration.diagnostics.slips import SMOOTHER, Slip, for_each_link, smooth_functions

Kind = Literal["position", "turn", "actuator", "jump", "period"]
CHANCE = 1e-6  # of a gain as large without a cause
SHARE = 0.5  # of the squares, from which on a cause is the main one
ENDS = 5  # rows at the least on each side of a jump: fewer are outliers
FREEDOM = 12  # poses more than numbers of a link; fewer hardly tell a trend from noise
MANY = 30  # poses, for polynomials above the first
DEGREE = 3
PERIODS = range(2, 7)  # rows, after which a mistake comes again
FOLLOWS = (
    0.1  # of the squares of t, that a linear function of the position leaves where rows follow the places
)


@dataclass(frozen=True, eq=False)
class OrderEffect:
    """A cause and its size over the rows.

    kind: whether positions, the frame or an actuator drift, or positions are off in rows from one on or in every k-th;
    column: of the actuator; rows: places among the rows that are off; period: k; course: how far positions, frame or
    actuator are off in each row, (N, 3) or (N, 1) in m or rad; variance: of what it leaves, m2; alike: whether rows follow
    the places of the tool, so that an error of the model may look the same.
    """

    kind: Kind
    course: np.ndarray
    variance: float
    column: int = 0
    period: int = 0
    alike: bool = False

    @property
    def rows(self) -> np.ndarray:
        """Places of the rows that are off others."""
        return np.flatnonzero(self.course.any(axis=1))

    @property
    def change(self) -> np.ndarray:
        """How far positions are off in some of the rows, or in the last beside the first."""
        if self.kind in ("jump", "period"):
            return self.course[self.rows[0]]
        return self.course[-1] - self.course[0]

    @property
    def size(self) -> float:
        """The largest distance between two rows, of which one is the first that is there."""
        start = 0.0 if self.kind in ("jump", "period") else self.course[0]
        return float(np.linalg.norm(self.course - start, axis=1).max())


def order_effect(
    systems: Sequence[LinkSystem], r: np.ndarray, rows: np.ndarray, slips: Sequence[tuple[int, Slip]]
) -> OrderEffect | None:
    """What explains most of the errors by the order of the rows, None where nothing does or slips of actuators explain more.

    r: positions (N, 3) in m; rows: their numbers, (N,); slips: column of q, and from where to where it is off.
    """
    links = sum(one.errors.shape[1] for one in systems)
    poses = freedom(systems) / links
    if poses < FREEDOM:
        return None
    trials = [_tried(systems, cause, poses) for cause in _causes(systems, r, rows)]
    found = min((*trials, *_jump(systems, poses)), key=lambda trial: trial.effect.variance)
    effect, whole = found.effect, variance(systems)
    known = [_tried(systems, _slip(systems, *each), poses).effect.variance for each in slips]
    if found.chance > CHANCE or min(known, default=np.inf) < effect.variance:
        return None
    wide = [one.beside(for_each_link(smooth_functions(r), one.errors.shape[1])) for one in systems]
    enough = freedom(wide) / links >= FREEDOM
    model = enough and variance(wide) * SMOOTHER < effect.variance
    if effect.variance < (1 - SHARE) * whole and not model:
        return replace(effect, alike=effect.kind != "period" and _follows(r))
    if enough and _tried(wide, found.cause, freedom(wide) / links).chance < CHANCE:
        return effect
    return None


def _follows(r: np.ndarray) -> bool:
    """Whether the order of rows is all but a linear function of the positions."""
    t, line = np.linspace(-1.0, 1.0, len(r)), np.column_stack([np.ones(len(r)), r])
    rest = t - line @ np.linalg.lstsq(line, t, rcond=None)[0]
    return bool(rest @ rest < FOLLOWS * (t @ t))


@dataclass(frozen=True, eq=False)
class _Cause:
    """Columns (N, m, k) for each system, from k numbers the course (N, 3 or 1); trials: how many there are of its kind."""

    kind: Kind
    columns: list[np.ndarray]
    course: Callable[[np.ndarray], np.ndarray]
    column: int = 0
    period: int = 0
    trials: int = 1


@dataclass(frozen=True, eq=False)
class _Trial:
    cause: _Cause
    effect: OrderEffect
    chance: float


def _causes(systems: Sequence[LinkSystem], r: np.ndarray, rows: np.ndarray) -> Iterator[_Cause]:
    t = np.linspace(-1.0, 1.0, len(r))
    shapes = np.polynomial.legendre.legvander(t, DEGREE if len(r) >= MANY else 1)[:, 1:]

    def along(slopes: np.ndarray) -> np.ndarray:
        """Slopes (N, m, c) by shapes (N, d), (N, m, c d)."""
        return np.einsum("nmc,nd->nmcd", slopes, shapes).reshape(*slopes.shape[:2], -1)

    def course(axes: int) -> Callable[[np.ndarray], np.ndarray]:
        return lambda b: shapes @ b.reshape(axes, -1).T

    yield _Cause("position", [along(one.place) for one in systems], course(3))
    away = r - r.mean(axis=0)
    turned = [along(np.cross(away[:, None], one.place) + one.turn) for one in systems]
    yield _Cause("turn", turned, course(3))
    for column in sorted({column for one in systems for column in one.actuators}):
        slopes = [_by_actuator(one, column)[..., None] for one in systems]
        yield _Cause("actuator", [along(one) for one in slopes], course(1), column)
    yield _period(systems, rows)


def _period(systems: Sequence[LinkSystem], rows: np.ndarray) -> _Cause:
    """Positions in every k-th row, of those that explain most where numbers explain what all rows have in common."""
    # of two rows one is off the other, whichever is called so
    trials = [(k, (rows % k == c).astype(float)) for k in PERIODS for c in range(k if k > 2 else 1)]
    weights = np.array([off - off.mean() for _, off in trials])
    each = [np.einsum("nmk,nm->nk", one.place, one.left) for one in systems]
    along = weights @ np.sum(each, axis=0)
    squares = sum(np.einsum("fn,nmk,nml->fkl", weights**2, one.place, one.place) for one in systems)
    gains = np.einsum("fk,fkl,fl->f", along, np.linalg.pinv(squares, rcond=1e-9, hermitian=True), along)
    period, off = trials[int(np.argmax(gains))]
    return _off_in(systems, off, "period", period, len(trials))


def _off_in(
    systems: Sequence[LinkSystem], weights: np.ndarray, kind: Kind, period: int, trials: int
) -> _Cause:
    """Positions that are off in some rows, weights 1 of (N,)."""
    columns = [one.place * weights[:, None, None] for one in systems]
    return _Cause(kind, columns, lambda b: weights[:, None] * b, period=period, trials=trials)


def _slip(systems: Sequence[LinkSystem], column: int, slip: Slip) -> _Cause:
    count = len(systems[0].errors)
    off = ((np.arange(count) >= slip.first) & (np.arange(count) < slip.last)).astype(float)
    columns = [(_by_actuator(one, column) * off[:, None])[..., None] for one in systems]
    return _Cause("actuator", columns, lambda b: off[:, None] * b, column)


def _by_actuator(one: LinkSystem, column: int) -> np.ndarray:
    return one.actuators.get(column, np.zeros_like(one.errors))


def _tried(systems: Sequence[LinkSystem], cause: _Cause, poses: float) -> _Trial:
    from scipy.special import fdtrc

    columns = [one.across(each) for one, each in zip(systems, cause.columns, strict=True)]
    X, left = np.concatenate(columns, axis=1), np.concatenate([one.left for one in systems], axis=1)
    squares, along = np.einsum("nmk,nml->kl", X, X), np.einsum("nmk,nm->k", X, left)
    inverse = np.linalg.pinv(squares, rcond=1e-9, hermitian=True)
    b = inverse @ along
    rest = left - X @ b
    own = np.einsum("nmk,nm->nk", X, rest)
    count, k = len(left), len(b)
    remaining = max(poses - k / left.shape[1], 1.0)
    expected = float(np.einsum("nk,kl,nl->", own, inverse, own)) * count / remaining
    gain = float(b @ along)
    chance = float(fdtrc(k, remaining, gain / max(expected, 1e-300))) * cause.trials
    spread = float(np.sum(rest**2)) / max(1, freedom(systems) - k)
    effect = OrderEffect(cause.kind, cause.course(b), spread, cause.column, cause.period)
    return _Trial(cause, effect, chance)


def _jump(systems: Sequence[LinkSystem], poses: float) -> list[_Trial]:
    """Positions that are off from the row on where that explains most."""
    count = len(systems[0].errors)
    if count < 3 * ENDS:
        return []
    squares, along = np.zeros((count, 3, 3)), np.zeros((count, 3))
    for one in systems:
        m = one.errors.shape[1]
        by_numbers = np.einsum("nmp,nmk->npk", one.known.reshape(count, m, -1), one.place)
        inside = _onwards(by_numbers)
        squares += _onwards(np.einsum("nmk,nml->nkl", one.place, one.place))
        squares -= np.einsum("npk,npl->nkl", inside, inside)
        along += _onwards(np.einsum("nmk,nm->nk", one.place, one.left))
    inner = slice(ENDS, count - ENDS + 1)
    inverse = np.linalg.pinv(squares[inner], rcond=1e-9, hermitian=True)
    gains = np.einsum("nk,nkl,nl->n", along[inner], inverse, along[inner])
    first = ENDS + int(np.argmax(gains))
    off = (np.arange(count) >= first).astype(float)
    return [_tried(systems, _off_in(systems, off, "jump", 0, len(gains)), poses)]


def _onwards(values: np.ndarray) -> np.ndarray:
    """Sums from each row on."""
    return np.cumsum(values[::-1], axis=0)[::-1]
