"""Mistakes that are made when measurements are written down, and how each is undone."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import combinations, permutations, product

import numpy as np

AXES = "xyz"
UNITS = {
    "millimetres": ("mm", 1e-3),
    "centimetres": ("cm", 1e-2),
    "inches": ("inches", 0.0254),
    "kilometres": ("km (m that were divided by 1000)", 1e3),
}

Poses = tuple[np.ndarray, np.ndarray, np.ndarray | None]  # q (N, n), r (N, 3), R (N, 3, 3) or None


@dataclass(frozen=True)
class Mistake:
    """Something that may have been done to q, r and R: its kind, words, and how it is undone."""

    kind: str
    words: str
    undo: Callable[[np.ndarray, np.ndarray, np.ndarray | None], Poses]


def mistakes(carts: int, turntables: int, turns: bool) -> Iterator[Mistake]:
    """Mistakes worth a try; turns: whether orientations are used."""
    yield from _swapped(carts, turntables)
    yield from _units(carts, turntables)
    yield from _signs(carts + turntables)
    for k, axis in enumerate(AXES):
        turn = np.diag([1.0 if k == i else -1.0 for i in range(3)])
        words = f"the frame of r turned by 180 degrees about {axis}"
        yield Mistake(
            "rotated frame", words, lambda q, r, R, S=turn: (q, r @ S, None if R is None else S @ R)
        )
        if turns:
            words = f"the frame of r, but not that of R, turned by 180 degrees about {axis}"
            yield Mistake("rotated frame", words, lambda q, r, R, S=turn: (q, r @ S, R))
    if turns:
        yield Mistake(
            "orientations", "R transposed, plate = R @ world", lambda q, r, R: (q, r, _transposed(R))
        )
        words = "the scalar of the quaternions in the last column"
        yield Mistake("orientations", words, lambda q, r, R: (q, r, _scalar_first(R)))


def _swapped(carts: int, turntables: int) -> Iterator[Mistake]:
    """All orders of carts, of turntables, and of axes; and a cart in place of a turntable."""
    same = tuple(range(carts + turntables))
    orders = [(*a, *b) for a, b in product(permutations(same[:carts]), permutations(same[carts:]))]
    for i, k in combinations(same, 2):
        if i < carts <= k:
            orders.append(tuple(k if c == i else i if c == k else c for c in same))
    for columns, axes in product(orders, permutations(range(3))):
        words = [f"q{k + 1} stands in column q{c + 1}" for k, c in enumerate(columns) if k != c]
        words += [f"{AXES[k]} stands in column {AXES[c]}" for k, c in enumerate(axes) if k != c]
        if words:
            yield Mistake(
                "swapped columns",
                ", ".join(words),
                lambda q, r, R, columns=columns, axes=axes: (q[:, columns], r[:, axes], R),
            )


def _units(carts: int, turntables: int) -> Iterator[Mistake]:
    for kind, (unit, scale) in UNITS.items():
        for names in (("q", "r"), ("r",), ("q",)):
            of_q = np.r_[np.full(carts, scale if "q" in names else 1.0), np.ones(turntables)]
            of_r = scale if "r" in names else 1.0
            words = f"{' and '.join(names)} in {unit}"
            yield Mistake(kind, words, lambda q, r, R, a=of_q, b=of_r: (q * a, r * b, R))
    if turntables:
        scales = np.r_[np.ones(carts), np.full(turntables, np.pi / 180)]
        yield Mistake("degrees", "angles of turntables in degrees", lambda q, r, R, a=scales: (q * a, r, R))


def _signs(count: int) -> Iterator[Mistake]:
    for k in range(count):
        sign = np.where(np.arange(count) == k, -1.0, 1.0)
        yield Mistake("sign", f"q{k + 1} with the opposite sign", lambda q, r, R, s=sign: (q * s, r, R))
    for k, axis in enumerate(AXES):
        sign = np.where(np.arange(3) == k, -1.0, 1.0)
        words = f"{axis} with the opposite sign"
        yield Mistake("sign", words, lambda q, r, R, s=sign: (q, r * s, R))
    yield Mistake("sign", "x, y and z with opposite signs", lambda q, r, R: (q, -r, R))


def _transposed(R: np.ndarray | None) -> np.ndarray | None:
    return None if R is None else np.swapaxes(R, 1, 2)


def _scalar_first(R: np.ndarray | None) -> np.ndarray | None:
    """Rotations of quaternions (x, y, z, w) that were read as (w, x, y, z)."""
    if R is None:
        return None
    from scipy.spatial.transform import Rotation

    finite = np.asarray(np.isfinite(R).all(axis=(1, 2)))
    read = Rotation.from_matrix(np.where(finite[:, None, None], R, np.eye(3))).as_quat(scalar_first=True)
    found = Rotation.from_quat(read).as_matrix()
    found[~finite] = np.nan
    return found
