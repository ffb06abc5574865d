"""What is wrong with a hexapod, and what is special about it."""

from typing import Any

import numpy as np

from gantrytau.border.checks import array, number
from gantrytau.border.refusal import StructureError
from gantrytau.kinematics.modes.link_crossings import PAIRS
from gantrytau.kinematics.modes.study_coordinates import quadrics
from gantrytau.kinematics.modes.study_roots import placed

EXACT = 1e-9  # by the size of the hexapod: joints nearer than this coincide
DEPENDENT = 1e-10  # least singular value of the conditions of the links by the largest; the F1 has 0.05
_PATH = "assembly_modes"


def checked_hexapod(base: Any, platform: Any, lengths: Any, diameter: float) -> tuple[np.ndarray, ...]:
    """Joints and lengths as arrays of floats. Raises ModelError and StructureError as `assembly_modes` says."""
    diameter = number(_PATH, "diameter", diameter, unit="m", least=0.0)
    base = array(_PATH, "base", base, (6, 3), unit="m")
    platform = array(_PATH, "platform", platform, (6, 3), unit="m")
    lengths = array(_PATH, "lengths", lengths, (6,), unit="m", above=0.0)
    for name, joints in (("base", base), ("platform", platform)):
        if _extents(joints)[1] <= EXACT * max(_extents(joints)[0], EXACT * lengths.max()):
            raise StructureError(
                f"{_PATH}: found all joints of the {name} on one line, about which links do not hold it; expected "
                "joints that span a plane at least; move one of them"
            )
    _check_dependence(base, platform, lengths)
    return base, platform, lengths


def specialities(base: np.ndarray, platform: np.ndarray, lengths: np.ndarray) -> list[str]:
    """What about the joints makes modes fewer, pairs of them, or singular."""
    found = []
    small = EXACT * max(lengths.max(), _extents(base)[0])
    for name, joints in (("base", base), ("platform", platform)):
        pairs = _pairs(_distances(joints) < small)
        if pairs:
            found.append(
                f"joints {pairs} of the {name} coincide: modes are fewer than 40 where three do, or pairs do"
            )
    if all(_extents(joints)[2] < EXACT * _extents(joints)[0] for joints in (base, platform)):
        found.append(
            "joints lie in a plane on base and platform: modes are pairs, mirrored by the plane of the base"
        )
    i, j = PAIRS.T
    alike = (np.abs(_distances(base) - _distances(platform)) < small) & (_distances(base) >= small)
    if pairs := _pairs(alike & (np.abs(lengths[i] - lengths[j]) < small)):
        found.append(f"links {pairs} form parallelograms: modes with crossed links are near singular ones")
    return found


def _extents(joints: np.ndarray) -> np.ndarray:
    """Principal extents of joints (6, 3), from large to small, (3,) in m."""
    return np.linalg.svd(joints - joints.mean(0), compute_uv=False)


def _check_dependence(base: np.ndarray, platform: np.ndarray, lengths: np.ndarray) -> None:
    """Refuse links whose conditions repeat or contradict each other whatever the pose.

    On two similar hexagons they do (architecture singularity): five conditions leave curves of poses, or none.
    """
    *hexapod, _ = placed(base, platform, lengths)
    values = np.linalg.svd(quadrics(*hexapod).reshape(6, 64), compute_uv=False)
    if values[-1] < DEPENDENT * values[0]:
        raise StructureError(
            f"{_PATH}: found {int((values >= DEPENDENT * values[0]).sum())} independent conditions of six links, "
            "expected 6; their modes are no separate poses; move a joint out of the pattern of the others"
        )


def _distances(joints: np.ndarray) -> np.ndarray:
    i, j = PAIRS.T
    return np.linalg.norm(joints[i] - joints[j], axis=1)


def _pairs(chosen: np.ndarray) -> str:
    return ", ".join(f"{i}-{j}" for i, j in PAIRS[chosen])
