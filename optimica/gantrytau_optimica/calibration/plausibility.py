"""Whether measurements are those of this robot: columns swapped, millimetres, turned frames, another robot.

Closure errors of nominal values are compared with those after each of a few mistakes is undone. Poses are thinned; the
median decides, so that outliers do not.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations

import numpy as np

from gantrytau_optimica.calibration.closure import Chain
from gantrytau_optimica.calibration.findings import CalibrationError, rows_in_words
from gantrytau_optimica.calibration.linear_start import linear_start
from gantrytau_optimica.calibration.models import Link
from gantrytau_optimica.calibration.rotations import rotation_vector

NEAR = 0.1  # m by which nominal values may miss; a tape measure does better
BETTER = 10.0  # times smaller errors that undoing a mistake must leave
POSES = 200
AXES = "xyz"


# from q (N, n), r (N, 3), R to how far the worst link of each pose is from its nominal length, (N,) in m
Misses = Callable[[np.ndarray, np.ndarray, np.ndarray | None], np.ndarray]


@dataclass(frozen=True)
class Mistake:
    """Something that may have been done to q (N, n) and r (N, 3): its kind, words, and how it is undone."""

    kind: str
    words: str
    columns: tuple[int, ...]
    axes: tuple[int, ...]
    signs: tuple[int, ...] = (1, 1, 1)
    scale_q: float = 1.0
    scale_r: float = 1.0


def _orders(n: int) -> Iterator[tuple[int, ...]]:
    """Orders of n columns: all of three, of more those that swap two."""
    same = tuple(range(n))
    if n <= 3:
        yield from permutations(same)
        return
    yield same
    for i, k in combinations(same, 2):
        yield tuple(k if c == i else i if c == k else c for c in same)


def _mistakes(n: int) -> Iterator[Mistake]:
    same, straight = tuple(range(n)), (0, 1, 2)
    for columns in _orders(n):
        for axes in permutations(straight):
            words = [f"q{k + 1} stands in column q{c + 1}" for k, c in enumerate(columns) if k != c]
            words += [f"{AXES[k]} stands in column {AXES[c]}" for k, c in enumerate(axes) if k != c]
            if words:
                yield Mistake("swapped columns", ", ".join(words), columns, axes)
    for scale_q, scale_r in ((1e-3, 1e-3), (1.0, 1e-3), (1e-3, 1.0)):
        names = " and ".join(n for n, s in (("q", scale_q), ("r", scale_r)) if s != 1)
        yield Mistake("millimetres", f"{names} in mm", same, straight, (1, 1, 1), scale_q, scale_r)
    for k, axis in enumerate(AXES):
        signs = tuple(1 if k == i else -1 for i in range(3))
        yield Mistake(
            "rotated frame", f"the frame of r turned by 180 degrees about {axis}", same, straight, signs
        )


def thinned(count: int, poses: int = POSES) -> np.ndarray:
    """At most `poses` rows, evenly spread."""
    return np.unique(np.linspace(0, count - 1, min(count, poses)).astype(int))


def check_robot(misses: Misses, q: np.ndarray, r: np.ndarray, R: np.ndarray | None, rows: np.ndarray) -> None:
    """CalibrationError if undoing a mistake makes nominal values fit that did not.

    misses: of nominal values; q (N, n), r (N, 3), R: measured; rows: their numbers for the message.
    """
    few = thinned(len(q))
    q, r, R = q[few], r[few], None if R is None else R[few]
    found = miss(misses, q, r, R)
    if found < NEAR / 10:
        return
    trials = [(m, miss(misses, *_undone(m, q, r, R))) for m in _mistakes(q.shape[1])]
    mistake, left = min(trials, key=lambda trial: trial[1])
    if left < NEAR and left * BETTER < found:
        raise CalibrationError(
            f"Measurements: found {mistake.words} in {rows_in_words(rows)} (links miss their lengths by "
            f"{found * 1e3:.3g} mm in the median, {left * 1e3:.3g} mm with that undone); correct the columns of the "
            "measurements",
            kind=mistake.kind,
            rows=rows,
        )


def explained_rows(
    misses: Misses, q: np.ndarray, r: np.ndarray, R: np.ndarray | None
) -> Iterator[tuple[Mistake, np.ndarray]]:
    """Mistakes that explain some of these rows: nominal values fit them once it is undone; places of these rows."""
    wrong = misses(q, r, R) > NEAR
    trials = [(m, misses(*_undone(m, q, r, R))) for m in _mistakes(q.shape[1])]
    best = np.argmin([left for _, left in trials], axis=0)
    for k, (mistake, left) in enumerate(trials):
        places = np.flatnonzero(wrong & (best == k) & (left < NEAR))
        if places.size:
            yield mistake, places


def _undone(mistake: Mistake, q: np.ndarray, r: np.ndarray, R: np.ndarray | None):
    signs = np.array(mistake.signs, dtype=float)
    turned = R if R is None or mistake.kind != "rotated frame" else signs[:, None] * R
    return q[:, mistake.columns] * mistake.scale_q, signs * r[:, mistake.axes] * mistake.scale_r, turned


def miss(misses: Misses, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> float:
    """How far links are from their nominal lengths, median over some of the poses of the worst link, m."""
    few = thinned(len(q))
    return float(np.median(misses(q[few], r[few], None if R is None else R[few])))


def misses_of(links: Sequence[Link]) -> Misses:
    """How far links with linear guideways are from their start lengths."""

    def misses(q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        errors = []
        for link in links:
            chain = Chain("", q[:, link.arm], r, None if link.chain.R is None else R)
            y = np.linalg.norm(chain.vector(link.start), axis=1)
            errors.append(np.abs(y - link.start[0]))
        return np.max(errors, axis=0)

    return misses


@dataclass(frozen=True)
class Fitting:
    """How nominal values fit measurements.

    miss: of the links, in the frame of the measurements, m; left: of links that are identified without nominal values, m;
    shift: of guideways after the best motion of the frame, m; turn: rotation vector of that motion.
    """

    miss: float
    left: float
    shift: float
    turn: np.ndarray


def compare(links: Sequence[Link], q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> Fitting:
    """Nominal values beside measurements: in their frame, and in the frame that suits them best."""
    few = thinned(len(q), 1000)
    q, r, R = q[few], r[few], None if R is None else R[few]
    nominal, found, left = [], [], []
    middle = q.mean(axis=0)
    for link in links:
        chain = Chain("", q[:, link.arm], r)
        x = linear_start(chain)
        left.append(np.median(np.abs(np.linalg.norm(chain.vector(x), axis=1) - x[0])))
        offset = link.start[1:4] - (
            0 if link.chain.R is None or R is None else R.mean(axis=0) @ link.start[7:10]
        )
        for s in (-1.0, 1.0):  # two points of the guideway
            nominal.append(offset + (middle[link.arm] + s) * link.start[4:7])
            found.append(x[1:4] + (middle[link.arm] + s) * x[4:7])
    a, b = np.array(nominal), np.array(found)
    U, _, V = np.linalg.svd((b - b.mean(axis=0)).T @ (a - a.mean(axis=0)))
    turn = U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V
    shift = np.linalg.norm(b - b.mean(axis=0) - (a - a.mean(axis=0)) @ turn.T, axis=1).max()
    return Fitting(miss(misses_of(links), q, r, R), float(max(left)), float(shift), rotation_vector(turn))
