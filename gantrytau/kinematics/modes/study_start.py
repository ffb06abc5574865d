"""A hexapod with all its 40 modes known, from which those of every other one are reached.

Its joints are complex, so that nearly no way from it meets a singular hexapod. Its roots were found once, by
monodromy: hexapods that go round a loop and come back exchange their modes, so that one known mode leads to others.
They are stored in study_start.npz, as `python -m gantrytau.kinematics.modes.study_start` writes it.
"""

import functools
from pathlib import Path
from typing import NamedTuple

import numpy as np

from gantrytau.border.refusal import SolveError
from gantrytau.kinematics.modes.study_coordinates import STUDY, orthonormal, quadrics
from gantrytau.kinematics.modes.study_tracking import Homotopy, track

MODES = 40  # of a general hexapod
SEED = 1
MOST_LOOPS = 60  # seven are enough for this seed
SAME = 1e-6  # distance of points of length 1; rounding moves regular roots by less
_FILE = Path(__file__).with_name("study_start.npz")


class KnownHexapod(NamedTuple):
    """Quadrics (7, 8, 8), the last one Study's, and their roots (40, 8) of length 1."""

    forms: np.ndarray
    roots: np.ndarray


@functools.cache
def start_system() -> KnownHexapod:
    """The stored start system."""
    with np.load(_FILE) as stored:
        return KnownHexapod(stored["forms"], stored["roots"])


def with_study(forms: np.ndarray) -> np.ndarray:
    """The six quadrics of links and Study's, (7, 8, 8)."""
    return np.concatenate([forms, STUDY[None]])


def distinct(z: np.ndarray, same: float = SAME) -> np.ndarray:
    """Which of the points z (n, 8) of length 1 are not among those before them, whatever their phases, (n,)."""
    near = np.abs(z.conj() @ z.T) > 1.0 - same**2 / 2
    return np.logical_not(np.tril(near, -1).any(axis=1))


def solve_by_monodromy(seed: int = SEED) -> KnownHexapod:
    """Find a start system anew, from one pose in which a complex hexapod is assembled by construction.

    Raises SolveError when loops do not lead to 40 modes.
    """
    rng = np.random.default_rng(seed)
    base, platform = _complex(rng, 6, 3), _complex(rng, 6, 3)
    gap = base - platform  # at the pose R = I, r = 0, where z = (1, 0, 0, 0, 0, 0, 0, 0)
    home = with_study(orthonormal(quadrics(base, platform, np.sqrt((gap * gap).sum(1)))))
    roots = np.eye(1, 8, dtype=complex)
    for _ in range(MOST_LOOPS):
        found, forms = roots, home
        for way in (_somewhere(rng), _somewhere(rng), home):
            paths = track(Homotopy(forms, way), found)
            found, forms = paths.z[paths.t == 1.0], way
        both = np.concatenate([roots, found])
        roots = both[distinct(both)]
        if len(roots) >= MODES:
            return KnownHexapod(home, roots)
    raise SolveError(
        f"solve_by_monodromy: found {len(roots)} modes in {MOST_LOOPS} loops, expected {MODES}; take another seed"
    )


def _complex(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def _somewhere(rng: np.random.Generator) -> np.ndarray:
    return with_study(orthonormal(quadrics(_complex(rng, 6, 3), _complex(rng, 6, 3), _complex(rng, 6))))


if __name__ == "__main__":
    np.savez(_FILE, **solve_by_monodromy()._asdict())
