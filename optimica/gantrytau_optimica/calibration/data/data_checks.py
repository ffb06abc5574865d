"""Checks of measured numbers that need no robot."""

from collections.abc import Iterator, Sequence

import numpy as np

from gantrytau_optimica.fitting.finding import DataRows, Finding, agreeing

FEWEST = 8  # poses: a link of a three-link robot has seven parameters
LARGEST = 50.0  # m, reach of robots; what is farther apart was not written in m
FLAT = 2e-3  # extent across a line or plane by that along it, below which it is one
BITS = 20  # a million places, in which few of 100,000 rows meet by chance
SAMPLE = 2000  # rows that show how far all extend
MOVED = 1e-3  # m or rad, more than noise of a pose that is measured twice
SPREAD = "spread them over the workspace in three directions"
NOT_A_ROTATION = 1e-3  # of R' R - I; instruments give six decimals


def check_data(
    q: np.ndarray, r: np.ndarray, R: np.ndarray | None, finite: np.ndarray, rails: Sequence[np.ndarray] | None
) -> tuple[Finding, ...]:
    """Findings in measurements q (N, n), r (N, 3), R (N, 3, 3); finite: mask (N,) of the finite rows."""
    rows = np.arange(len(q)) if finite.all() else np.flatnonzero(finite)
    if len(rows) < len(q):
        q, r, R = q[rows], r[rows], None if R is None else R[rows]
    return (
        *_not_finite(finite),
        *_few(rows),
        *_repeated(q, r, rows),
        *_stuck(q, r, rows),
        *_units(q, r, rows),
        *_shape(r, rows),
        *_rotations(R, rows),
        *_rails(rails),
    )


def _not_finite(finite: np.ndarray) -> Iterator[Finding]:
    bad = np.flatnonzero(~finite)
    if bad.size:
        hold, left = agreeing(bad, "hold"), agreeing(bad, "are")
        yield Finding(
            "nan", bad, (DataRows(bad, len(finite)), f" {hold} no finite numbers and {left} left out")
        )


def _few(rows: np.ndarray) -> Iterator[Finding]:
    if len(rows) < FEWEST:
        yield Finding(
            "too few poses", rows, f"found {len(rows)} usable poses, expected {FEWEST} at the least"
        )


def _repeated(q: np.ndarray, r: np.ndarray, rows: np.ndarray) -> Iterator[Finding]:
    later = repeated_rows(q, r)
    if later.size:
        words = (
            f" {agreeing(later, 'repeat')} earlier rows to the last digit; a copied row adds no knowledge but counts twice "
            "in every deviation; it is left out"
        )
        yield Finding("duplicates", rows[later], (DataRows(rows[later]), words))


def _stuck(q: np.ndarray, r: np.ndarray, rows: np.ndarray) -> Iterator[Finding]:
    """Rows in which one of q and r is that of the row before to the last bit, while the other moved on."""
    for name, still, other, moving in (("r", r, "q", q), ("q", q, "r", r)):
        places = np.flatnonzero(still[1:, 0] == still[:-1, 0]) + 1
        places = places[(still[places] == still[places - 1]).all(axis=1)]
        places = places[(np.abs(moving[places] - moving[places - 1]) > MOVED).any(axis=1)]
        if places.size:
            bad = rows[places]
            left = agreeing(bad, "they are")
            words = f" is that of the row before while {other} moved; {left} left out"
            yield Finding("stuck", bad, (f"{name} of ", DataRows(bad), words))


def repeated_rows(*tables: np.ndarray) -> np.ndarray:
    """Places of rows that repeat an earlier row to the last bit; tables (N, k) side by side."""
    if len(tables[0]) < 2:
        return np.zeros(0, dtype=int)
    # one number for each row, alike for alike rows, sorted only where two are alike
    keys = np.zeros(len(tables[0]), dtype=np.uint64)
    for table in tables:
        for column in table.T:
            keys ^= np.add(column, 0.0).view(np.uint64)  # of -0 as of 0
            keys *= np.uint64(0x9E3779B97F4A7C15)  # multiplicative hashing (Knuth)
    if not _some_alike(keys):
        return np.zeros(0, dtype=int)
    order = np.argsort(keys)
    near = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    candidates = np.unique(np.concatenate([order[near], order[near + 1]]))
    rows = np.column_stack([table[candidates] for table in tables])
    _, first, inverse = np.unique(rows, axis=0, return_index=True, return_inverse=True)
    return candidates[first[inverse.ravel()] != np.arange(len(candidates))]


def _some_alike(keys: np.ndarray) -> bool:
    """Whether any of N numbers stands twice; those that share their first bits are compared with the last of them, again
    and again without it.
    """
    places = (keys >> np.uint64(64 - BITS)).astype(np.intp)
    last = np.empty(1 << BITS, dtype=np.int32)
    left = np.arange(len(keys), dtype=np.int32)
    while left.size:
        last[places[left]] = left
        other = last[places[left]]
        before = np.flatnonzero(other != left)
        if np.any(keys[left[before]] == keys[other[before]]):
            return True
        left = left[before]
    return False


def _shape(r: np.ndarray, rows: np.ndarray) -> Iterator[Finding]:
    if len(r) < 3:
        return
    r = _some(r)
    extent = np.sqrt(np.maximum(np.linalg.eigvalsh(np.cov(r.T))[::-1], 0.0))
    if extent[0] == 0.0 or extent[1] < FLAT * extent[0]:
        yield Finding("line", rows, f"all tool positions lie on a line; {SPREAD}")
    elif extent[2] < FLAT * extent[0]:
        yield Finding("plane", rows, f"all tool positions lie in a plane; {SPREAD}")


def _some(x: np.ndarray) -> np.ndarray:
    """Rows enough to see the extent of all, by chance, as every tenth row of a grid may lie in a plane."""
    return x if len(x) <= SAMPLE else x[np.random.default_rng(0).integers(0, len(x), SAMPLE)]


def _far(x: np.ndarray) -> np.ndarray:
    """Places of rows (N, k) that are too far from most for metres."""
    middle = np.median(_some(x), axis=0)
    # column by column, as numpy is slow along the first axis
    if max(max(x[:, k].max() - m, m - x[:, k].min()) for k, m in enumerate(middle)) < LARGEST / 2:
        return np.zeros(0, dtype=int)
    away = np.abs(x - middle).max(axis=1)
    far = np.flatnonzero(away > LARGEST / 2)
    # where most others are too far as well for a robot, all were written so
    return np.arange(len(x)) if 2 * len(far) > len(x) or np.median(away) > LARGEST / 8 else far


def _units(q: np.ndarray, r: np.ndarray, rows: np.ndarray) -> Iterator[Finding]:
    if not len(r):
        return
    far = {name: _far(x) for name, x in (("q", q), ("r", r))}
    found = np.union1d(far["q"], far["r"]) if any(len(k) for k in far.values()) else ()
    if len(found):
        both = [name for name, k in far.items() if len(k)]
        names, extend = " and ".join(both), "extend" if len(both) > 1 else "extends"
        yield Finding(
            "millimetres",
            rows[found],
            (
                f"{names} of ",
                DataRows(rows[found]),
                f" {extend} over more than {LARGEST:g} m, expected m and rad; divide by 1000 if they are mm, turn degrees "
                "into rad",
            ),
        )


def _rotations(R: np.ndarray | None, rows: np.ndarray) -> Iterator[Finding]:
    if R is None or not len(R):
        return
    error = np.abs(np.einsum("nij,nik->njk", R, R) - np.eye(3)).max(axis=(1, 2))
    bad = np.flatnonzero((error > NOT_A_ROTATION) | (np.linalg.det(R) < 0))
    if bad.size:
        yield Finding(
            "rotations",
            rows[bad],
            ("R of ", DataRows(rows[bad]), " is no rotation matrix; expected R' R = I and determinant 1"),
        )


def _rails(rails: Sequence[np.ndarray] | None) -> Iterator[Finding]:
    for k, rail in enumerate(rails or ()):
        across = np.linalg.svd(rail[:, 1:] - rail[:, 1:].mean(axis=0), compute_uv=False)
        slope = np.linalg.norm(rail[-1, 1:] - rail[0, 1:]) / (rail[-1, 0] - rail[0, 0])
        if (len(rail) > 2 and across[1] > 0.01 * across[0]) or not 0.5 < slope < 2.0:
            yield Finding(
                "guideway",
                np.arange(len(rail)),
                f"points of guideway {k} lie off a line, or {slope:.3g} m apart for each m of q; expected q, x, y, z in m",
            )
