"""Arms in the frame of the measurements: where forward kinematics of nominal values puts the plate, and where it was seen.

T' = S T + t        A' = S A + t,   v' = S v,   R(u)' = S R(u),   what is in the frame of a turntable stays
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gantrytau import GantryTauError, Model
from gantrytau.kinematics.rotations import rotation_vector
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.judging.plausibility import Fitting, Misses, miss, thinned, trimmed_motion
from gantrytau_optimica.calibration.rods.arms import Arm, exponential, product

FEWEST = 4  # poses that nominal kinematics must reach


def frame_of(robot: Model, misses: Misses, data: Measurements) -> Fitting | None:
    """The frame of measurements of a robot by its forward kinematics, None where that does not reach the poses."""
    from gantrytau.kinematics import Kinematics

    few = thinned(len(data))
    try:
        r, _ = Kinematics(robot).fk(data.q[few])
    except GantryTauError:
        return None
    if np.isfinite(r).all(axis=1).sum() < FEWEST:
        return None
    turn, shift = trimmed_motion(r, data.r[few])
    off = float(np.nanmedian(np.linalg.norm(data.r[few] - shift - r @ turn.T, axis=1)))
    return Fitting(miss(misses, data.q, data.r, data.R), off, turn, shift, off)


def moved_arms(arms: Sequence[Arm], turn: np.ndarray, shift: np.ndarray) -> tuple[Arm, ...]:
    """The same arms in another frame, turn (3, 3) and shift (3,) as above."""
    return tuple(_moved(arm, turn, shift) for arm in arms)


def _moved(arm: Arm, turn: np.ndarray, shift: np.ndarray) -> Arm:
    values = dict(arm.values)
    values[f"{arm.name}.offset"] = turn @ values[f"{arm.name}.offset"] + shift
    values[f"{arm.name}.direction"] = turn @ values[f"{arm.name}.direction"]
    if arm.turntables:
        first = arm.turntables[0].name
        values[f"{first}.offset"] = turn @ values[f"{first}.offset"]
        values[f"{first}.orientation"] = product(
            exponential(rotation_vector(turn)), values[f"{first}.orientation"]
        )
    else:
        for link in arm.links:
            if link != arm.name:
                values[f"{link}.offset"] = turn @ values[f"{link}.offset"]
    return replace(arm, values=values)
