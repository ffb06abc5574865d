"""All roots of the quadrics of one hexapod, counted and sorted by what they are.

Forty paths start, each of which ends at a root of its own in a general hexapod. Where two end at the same regular
root, one has jumped; where one stops on its way, it was lost. All are then followed again along another way, with
smaller steps. In special hexapods paths end at singular roots, or where x.x = 0, which is no pose.
"""

from typing import NamedTuple

import numpy as np

from gantrytau.kinematics.modes.study_coordinates import orthonormal, quadrics
from gantrytau.kinematics.modes.study_start import MODES, KnownHexapod, distinct, start_system, with_study
from gantrytau.kinematics.modes.study_tracking import Homotopy, Paths, polished, regularity, track

TOLERANCES = (1e-3, 1e-5, 1e-6, 1e-6)  # of the prediction, track after track
SIZE = 1.7  # of a hexapod, root mean square; start system and target are then of one size
NO_POSE = 1e-6  # |x.x| below which a singular root is at infinity
SINGULAR = 1e-7  # smallest singular value of the Jacobian: double roots are found to about 1e-8
NEAR_END = 1e-4  # 1 - t where paths to singular roots stop at the latest
HALVINGS = 12  # Newton halves the error at double roots, down to about 1e-8
APART = 1e-3  # distance of singular roots that count as two: they are known less well


class Roots(NamedTuple):
    """Roots z (k, 8) of length 1; which of them are regular, (k,); the number of paths at infinity, and lost.

    Rotation and position of z are those of joints with the middles and the scale that `placed` removes.
    """

    z: np.ndarray
    regular: np.ndarray
    at_infinity: int
    lost: int


def placed(base: np.ndarray, platform: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray, ...]:
    """The hexapod about the middles of its joints, of one size; and that size."""
    base, platform = base - base.mean(0), platform - platform.mean(0)
    squares = (base**2).sum(1).mean() + (platform**2).sum(1).mean() + (lengths**2).mean()
    size = np.sqrt(squares) / SIZE
    return base / size, platform / size, lengths / size, size


def all_roots(base: np.ndarray, platform: np.ndarray, lengths: np.ndarray) -> Roots:
    """The roots of a hexapod as `placed` gives it, joints (6, 3) and lengths (6,)."""
    start = start_system()
    target = with_study(orthonormal(quadrics(base, platform, lengths)))
    z = np.zeros((0, 8), complex)
    found = Roots(z, np.zeros(0, bool), 0, MODES)
    for attempt, tolerance in enumerate(TOLERANCES):
        paths = track(Homotopy(start.forms, _mixed(target, start, attempt)), start.roots, tolerance=tolerance)
        before = len(z)
        found, doubled = _sorted(target, paths)
        z = np.concatenate([z, found.z[found.regular]])
        z = _distinct(np.concatenate([z, z.conj()]))  # the hexapod is real
        if len(z) >= MODES:
            return Roots(z, np.ones(len(z), bool), 0, 0)
        if attempt and not doubled and not found.lost and len(z) == before:
            break
    singular = found.z[~found.regular]
    regular = np.arange(len(z) + len(singular)) < len(z)
    unknown = MODES - len(z) - found.at_infinity if found.lost or not len(singular) else 0
    return Roots(np.concatenate([z, singular]), regular, found.at_infinity, max(unknown, 0))


def _distinct(z: np.ndarray) -> np.ndarray:
    return z[distinct(z)]


def _mixed(target: np.ndarray, start: KnownHexapod, attempt: int) -> np.ndarray:
    """The target with its links combined: first as near to the start as they get, then at random."""
    links = target[:6].reshape(6, 64)
    if attempt == 0:
        near = start.forms[:6].reshape(6, 64) @ links.conj().T
    else:
        rng = np.random.default_rng(attempt)
        near = rng.normal(size=(6, 6)) + 1j * rng.normal(size=(6, 6))
    left, _, right = np.linalg.svd(near)
    return with_study((left @ right @ links).reshape(6, 8, 8))


def _sorted(target: np.ndarray, paths: Paths) -> tuple[Roots, int]:
    """The ends of the paths, and how many share a regular root."""
    z = polished(target, paths.z)
    kept = paths.t == 1.0
    z[~kept] = paths.z[~kept]
    least = regularity(target, z)
    away = (np.abs((z[:, :4] ** 2).sum(1)) < NO_POSE) & (least < NO_POSE)
    regular = kept & (least > SINGULAR) & ~away
    lost = ~regular & ~away & (paths.t < 1.0 - NEAR_END)
    singular = polished(target, z[~regular & ~away & ~lost], steps=HALVINGS)
    singular = singular[distinct(singular, APART)]
    roots = _distinct(z[regular])
    both = np.concatenate([roots, singular])
    doubled = int(regular.sum()) - len(roots)
    return Roots(both, np.arange(len(both)) < len(roots), int(away.sum()), int(lost.sum())), doubled
