"""Roots of quadrics, followed all at once while the quadrics change: a parameter homotopy.

    H(z, t) = z.(Q0 + t (Q1 - Q0)) z = 0, seven quadrics (7, 8, 8); z (8,) up to a factor; t from 0 to 1

Each path has its own t and step. Within a step the path is a power series, z(t + s) = z + z_1 s + z_2 s^2 + ...,
whose terms all follow from one inverse, as H is quadratic:

    2 z.Q z_k = - sum_{0<i<k} z_i.Q z_{k-i} - sum_{i<k} z_i.(Q1 - Q0) z_{k-1-i},    conj(z).z_k = 0.

The first terms that are left out say how far it holds; two steps of Newton lead back to the path. Where both
systems are real, or a path meets a singular point, numbers turn complex or a path stops: the way is made generic
by a complex start.
"""

from typing import NamedTuple

import numpy as np

ORDER = 8  # of the series; 5 and 12 take the same time in all
LEAST_STEP = 1e-9  # a path whose steps get smaller than this stops
MOST_STEPS = 400  # ten times what paths to regular roots take
FAR = 0.03  # a first correction above this, for z of length 1, is no small one
CONTRACTION = 0.03  # the second correction against the first
ROUNDING = 1e-6  # a second correction below this is small enough whatever the first


class Paths(NamedTuple):
    """Where the paths are: z (n, 8) of length 1, and t (n,), which is 1 where they arrived."""

    z: np.ndarray
    t: np.ndarray


class Homotopy:
    """The way from the quadrics `start` to the quadrics `target`, (7, 8, 8) each."""

    def __init__(self, start: np.ndarray, target: np.ndarray):
        self._both = np.concatenate([start, target - start]).transpose(1, 0, 2).reshape(8, -1)

    def forms(self, z: np.ndarray, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Q(t) z and (Q1 - Q0) z at z (n, 8) and t (n,), (n, 7, 8) each."""
        found = (z @ self._both).reshape(len(z), 14, 8)
        return found[:, :7] + t[:, None, None] * found[:, 7:], found[:, 7:]


def track(homotopy: Homotopy, roots: np.ndarray, *, tolerance: float = 1e-3) -> Paths:
    """Follow the roots (n, 8) of the start quadrics to the target.

    tolerance: of the predicted z of length 1, before Newton. Paths to singular roots and to points that are no
    pose stop a little before t = 1, or arrive where the Jacobian is singular.
    """
    z, t = roots.astype(complex), np.zeros(len(roots))
    longest = np.ones(len(roots))
    active = np.arange(len(roots))
    for _ in range(MOST_STEPS):
        if not len(active):
            break
        here, now = z[active], t[active]
        terms = _series(homotopy, here, now)
        step = np.minimum(_reach(terms, tolerance), longest[active])
        ends = step >= 1.0 - now
        step[ends] = 1.0 - now[ends]
        then = np.where(ends, 1.0, now + step)
        found, good = _corrected(homotopy, _value(terms, step), then, here.conj())
        z[active[good]], t[active[good]] = found[good], then[good]
        longest[active] = np.where(good, 1.0, step / 3)
        active = active[(longest[active] > LEAST_STEP) & ~(good & ends)]
    return Paths(z, t)


def _series(homotopy: Homotopy, z: np.ndarray, t: np.ndarray) -> np.ndarray:
    """The terms of the power series of the paths at (z, t), (ORDER + 1, n, 8)."""
    terms = np.empty((ORDER + 1, *z.shape), complex)
    still, moving = np.empty((2, ORDER + 1, len(z), 7, 8), complex)
    terms[0] = z
    still[0], moving[0] = homotopy.forms(z, t)
    inverse = inverted(_bordered(2 * still[0], z.conj()))[:, :, :7]
    for k in range(1, ORDER + 1):
        left = np.einsum("kmrc,kmc->mr", moving[:k], terms[k - 1 :: -1])
        if k > 1:
            left += np.einsum("kmrc,kmc->mr", still[1:k], terms[k - 1 : 0 : -1])
        terms[k] = -(inverse @ left[:, :, None])[:, :, 0]
        if k < ORDER:
            still[k], moving[k] = homotopy.forms(terms[k], t)
    return terms


def _reach(terms: np.ndarray, tolerance: float) -> np.ndarray:
    """Steps (n,) at which the last two terms of the series are as small as the tolerance."""
    last, before = (np.maximum(np.linalg.norm(term, axis=1), 1e-300) for term in (terms[-1], terms[-2]))
    return np.minimum((tolerance / last) ** (1 / ORDER), (tolerance / before) ** (1 / (ORDER - 1)))


def _value(terms: np.ndarray, step: np.ndarray) -> np.ndarray:
    """The series at a step, by Horner."""
    found = terms[-1]
    for term in terms[-2::-1]:
        found = found * step[:, None] + term
    return found


def _corrected(
    homotopy: Homotopy, z: np.ndarray, t: np.ndarray, patch: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Points after two steps of Newton, and whether those contract as they must near a regular root."""
    sizes = []
    for _ in range(2):
        step = newton_step(homotopy.forms(z, t)[0], z, patch)
        z = z + step
        sizes.append(np.linalg.norm(step, axis=1))
    first, second = sizes
    good = (first < FAR) & (second < np.maximum(ROUNDING, CONTRACTION * first))
    return z / np.linalg.norm(z, axis=1)[:, None], good


def polished(target: np.ndarray, z: np.ndarray, *, steps: int = 3) -> np.ndarray:
    """Points z (n, 8) after steps of Newton on the quadrics (7, 8, 8), of length 1."""
    for _ in range(steps):
        z = z + newton_step(_applied(target, z), z, z.conj())
        z = z / np.linalg.norm(z, axis=1)[:, None]
    return z


def regularity(target: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Smallest singular value (n,) of the Jacobian of the quadrics at points z of length 1; 0 at singular ones."""
    matrix = _bordered(2 * _applied(target, z), z.conj())
    return np.linalg.svd(matrix, compute_uv=False)[:, -1]


def _applied(target: np.ndarray, z: np.ndarray) -> np.ndarray:
    return np.einsum("nc,rcd->nrd", z, target)


def newton_step(forms: np.ndarray, z: np.ndarray, patch: np.ndarray) -> np.ndarray:
    """Steps (n, 8) for points z, with forms Q z (n, 7, 8), across the rows conj(z) of a patch (n, 8).

    Of longer numbers only what is left of the quadrics is used as it is: the rest is the slope.
    """
    left = np.zeros((len(z), 8, 1), complex)
    left[:, :7] = forms @ z[:, :, None]
    return -solved(_bordered(2 * forms, patch).astype(complex), left)[:, :, 0]


def _bordered(forms: np.ndarray, patch: np.ndarray) -> np.ndarray:
    return np.concatenate([forms, patch[:, None]], axis=1)


def solved(matrices: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Solutions of linear systems, of least squares for all if one of them is exactly singular."""
    try:
        return np.linalg.solve(matrices, right)
    except np.linalg.LinAlgError:
        return np.linalg.pinv(matrices) @ right


def inverted(matrices: np.ndarray) -> np.ndarray:
    """Inverses, pseudo-inverses of all if one of them does not exist."""
    try:
        return np.linalg.inv(matrices)
    except np.linalg.LinAlgError:
        return np.linalg.pinv(matrices)
