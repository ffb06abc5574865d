"""What changes over the rows: positions that drift, jump or are off in every k-th row, a frame that turns, an actuator that
drifts or slips. Each is a cause with columns of its own in one linear system.

    left = X b + noise,   X = U f   across the numbers

U are derivatives of the closure errors by positions, a turn of the frame or an actuator; f are functions of the row:
Legendre polynomials up to the third from the first row to the last, a step, or 1 in every k-th row. The best cause is told
if chance does not give its gain b'X'left: noise of a pose moves all its links, so that gains are compared with
tr (X'X)^-1 sum_n (X_n'e_n)(X_n'e_n)', that of errors independent from pose to pose (Liang and Zeger, 1986). Errors of the
model depend on the pose and not on the row: where smooth functions of the pose explain as much, nothing is said.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gantrytau_optimica.calibration.diagnostics.link_systems import (
    SMOOTHER,
    LinkSystem,
    freedom,
    variance,
    with_smooth,
)

Kind = Literal["position", "turn", "actuator", "jump", "period", "slip"]
CHANCE = 1e-6  # of a gain as large without a cause
SHARE = 0.5  # of the squares, from which on a cause is the main one
ENDS = 5  # rows at the least on each side of a step: fewer are outliers
FREEDOM = 12  # poses more than numbers of a link; fewer hardly tell a trend from noise
MANY = 30  # poses, for polynomials above the first
DEGREE = 3
PERIODS = range(2, 7)  # rows, after which a mistake comes again
# of the squares of t, that a linear function of the position leaves where rows follow the places
FOLLOWS = 0.1


@dataclass(frozen=True, eq=False)
class RowEffect:
    """A cause and its size over the rows.

    kind: whether positions, the frame or an actuator drift, or positions or an actuator are off in some rows; history: how
    far in each row, (N, 3) or (N, 1) in m or rad; variance: of what it leaves, m2; column: of the actuator; period: k;
    alike: whether rows follow the places of the tool, so that an error of the model may look the same.
    """

    kind: Kind
    history: np.ndarray
    variance: float
    column: int = 0
    period: int = 0
    alike: bool = False

    @property
    def rows(self) -> np.ndarray:
        """Indices of the rows that are off others."""
        return np.flatnonzero(self.history.any(axis=1))

    @property
    def change(self) -> np.ndarray:
        """How far some of the rows are off, or the last beside the first."""
        drifts = self.kind in ("position", "turn", "actuator")
        return self.history[-1] - self.history[0] if drifts else self.history[self.rows[0]]

    @property
    def size(self) -> float:
        """The largest distance between two rows, of which one is the first that is there."""
        start = self.history[0] if self.kind in ("position", "turn", "actuator") else 0.0
        return float(np.linalg.norm(self.history - start, axis=1).max())


@dataclass(frozen=True, eq=False)
class _Cause:
    """U of each system, (N, m, c), and f, (N, d); trials: how many there are of its kind."""

    kind: Kind
    U: list[np.ndarray]
    f: np.ndarray
    column: int = 0
    period: int = 0
    trials: int = 1

    @property
    def columns(self) -> list[np.ndarray]:
        """Of each system, (N, m, c d)."""
        return [np.einsum("nmc,nd->nmcd", U, self.f).reshape(*U.shape[:2], -1) for U in self.U]


@dataclass(frozen=True, eq=False)
class _Trial:
    cause: _Cause
    effect: RowEffect
    chance: float


def row_effects(systems: Sequence[LinkSystem], r: np.ndarray, rows: np.ndarray) -> list[RowEffect]:
    """What explains most of the errors by the rows: one effect, or slips of several actuators.

    r: positions (N, 3) in m; rows: their numbers, (N,).
    """
    found: list[RowEffect] = []
    while (best := _best(systems, r, rows)) is not None:
        if found and (best.effect.kind != "slip" or best.effect.column in [one.column for one in found]):
            break
        found.append(best.effect)
        if best.effect.kind != "slip":
            break
        systems = [one.with_columns(X) for one, X in zip(systems, best.cause.columns, strict=True)]
    return found


def _best(systems: Sequence[LinkSystem], r: np.ndarray, rows: np.ndarray) -> _Trial | None:
    """The cause that leaves least, None where chance or the model explains as much."""
    if _poses(systems) < FREEDOM:
        return None
    found = min(
        (_tried(systems, cause) for cause in _causes(systems, r, rows)), key=lambda t: t.effect.variance
    )
    if found.chance > CHANCE:
        return None
    moved = [k for k, U in enumerate(found.cause.U) if U.any()]
    systems = [systems[k] for k in moved]
    cause = replace(found.cause, U=[found.cause.U[k] for k in moved])
    left, wide = _tried(systems, cause).effect.variance, with_smooth(systems, r)
    enough = _poses(wide) >= FREEDOM
    model = enough and variance(wide) * SMOOTHER < left
    if left < (1 - SHARE) * variance(systems) and not model:
        drifts = cause.kind in ("position", "turn", "actuator", "jump")
        return replace(found, effect=replace(found.effect, alike=drifts and _follows(r)))
    return found if enough and cause.kind != "slip" and _tried(wide, cause).chance < CHANCE else None


def _poses(systems: Sequence[LinkSystem]) -> float:
    """Poses more than numbers of a link."""
    return freedom(systems) / sum(one.errors.shape[1] for one in systems)


def _follows(r: np.ndarray) -> bool:
    """Whether the order of rows is all but a linear function of the positions."""
    t, line = np.linspace(-1.0, 1.0, len(r)), np.column_stack([np.ones(len(r)), r])
    rest = t - line @ np.linalg.lstsq(line, t, rcond=None)[0]
    return bool(rest @ rest < FOLLOWS * (t @ t))


def _causes(systems: Sequence[LinkSystem], r: np.ndarray, rows: np.ndarray) -> Iterator[_Cause]:
    count = len(r)
    t = np.linspace(-1.0, 1.0, count)
    drift = np.polynomial.legendre.legvander(t, DEGREE if count >= MANY else 1)[:, 1:]
    place = [one.place for one in systems]
    yield _Cause("position", place, drift)
    away = r - r.mean(axis=0)
    yield _Cause("turn", [np.cross(away[:, None], one.place) + one.turn for one in systems], drift)
    yield _period(systems, rows)
    inner = count - 2 * ENDS + 1
    if inner > ENDS:
        yield _Cause("jump", place, _from(_step(systems, place), count), trials=inner)
    for column in sorted({column for one in systems for column in one.actuators}):
        U = [one.actuators.get(column, np.zeros_like(one.errors))[..., None] for one in systems]
        yield _Cause("actuator", U, drift, column)
        if inner > ENDS:
            yield from _slips(systems, U, column, inner)


def _slips(systems: Sequence[LinkSystem], U: list[np.ndarray], column: int, inner: int) -> Iterator[_Cause]:
    """An actuator that is off from one row on, or from one to another."""
    count = len(U[0])
    first = _step(systems, U)
    once = _Cause("slip", U, _from(first, count), column, trials=inner)
    yield once
    moved = [k for k, each in enumerate(U) if each.any()]
    second = _step([systems[k].with_columns(once.columns[k]) for k in moved], [U[k] for k in moved])
    if abs(second - first) >= ENDS:
        between = np.abs(_from(first, count) - _from(second, count))
        yield _Cause("slip", U, between, column, trials=inner**2)


def _from(first: int, count: int) -> np.ndarray:
    """1 from a row on, (N, 1)."""
    return (np.arange(count) >= first).astype(float)[:, None]


def _step(systems: Sequence[LinkSystem], U: list[np.ndarray]) -> int:
    """The row from which on U explains most of what numbers leave."""
    squares, along = 0.0, 0.0
    for one, each in zip(systems, U, strict=True):
        known = one.known.reshape(*one.errors.shape, -1)
        inside = _onwards(np.einsum("nmp,nmk->npk", known, each))
        squares = squares + _onwards(np.einsum("nmk,nml->nkl", each, each))
        squares = squares - np.einsum("npk,npl->nkl", inside, inside)
        along = along + _onwards(np.einsum("nmk,nm->nk", each, one.left))
    inner = slice(ENDS, len(U[0]) - ENDS + 1)
    return ENDS + int(np.argmax(_gains(np.asarray(squares)[inner], np.asarray(along)[inner])))


def _gains(squares: np.ndarray, along: np.ndarray) -> np.ndarray:
    """B'X'left of columns, by X'X (n, k, k) and X'left (n, k)."""
    inverse = np.linalg.pinv(squares, rcond=1e-9, hermitian=True)
    return np.einsum("nk,nkl,nl->n", along, inverse, along)


def _onwards(values: np.ndarray) -> np.ndarray:
    """Sums from each row on."""
    return np.cumsum(values[::-1], axis=0)[::-1]


def _period(systems: Sequence[LinkSystem], rows: np.ndarray) -> _Cause:
    """Positions in every k-th row, of those that explain most where numbers explain what all rows have in common."""
    # of two rows one is off the other, whichever is called so
    trials = [(k, (rows % k == c).astype(float)) for k in PERIODS for c in range(k if k > 2 else 1)]
    weights = np.array([off - off.mean() for _, off in trials])
    along = weights @ np.sum([np.einsum("nmk,nm->nk", one.place, one.left) for one in systems], axis=0)
    squares = sum(np.einsum("fn,nmk,nml->fkl", weights**2, one.place, one.place) for one in systems)
    period, off = trials[int(np.argmax(_gains(np.asarray(squares), along)))]
    place = [one.place for one in systems]
    return _Cause("period", place, off[:, None], period=period, trials=len(trials))


def _tried(systems: Sequence[LinkSystem], cause: _Cause) -> _Trial:
    from scipy.special import fdtrc

    columns = [one.across(each) for one, each in zip(systems, cause.columns, strict=True)]
    X, left = np.concatenate(columns, axis=1), np.concatenate([one.left for one in systems], axis=1)
    squares, along = np.einsum("nmk,nml->kl", X, X), np.einsum("nmk,nm->k", X, left)
    inverse = np.linalg.pinv(squares, rcond=1e-9, hermitian=True)
    b = inverse @ along
    rest = left - X @ b
    own = np.einsum("nmk,nm->nk", X, rest)
    count, k = len(left), len(b)
    remaining = max(_poses(systems) - k / left.shape[1], 1.0)
    expected = float(np.einsum("nk,kl,nl->", own, inverse, own)) * count / remaining
    chance = float(fdtrc(k, remaining, float(b @ along) / max(expected, 1e-300))) * cause.trials
    spread = float(np.sum(rest**2)) / max(1, freedom(systems) - k)
    history = cause.f @ b.reshape(cause.U[0].shape[2], -1).T
    return _Trial(cause, RowEffect(cause.kind, history, spread, cause.column, cause.period), chance)
