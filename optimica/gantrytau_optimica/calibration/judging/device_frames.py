"""Arms in the frame of the measurements: where forward kinematics of nominal values puts the plate, and where it was seen.

T' = S T + t        A' = S A + t,   v' = S v,   R(u)' = S R(u),   what is in the frame of a turntable stays
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gantrytau import GantryTauError, Model
from gantrytau.kinematics.rotations import rotation_vector
from gantrytau_optimica.calibration.data.measurements import Measurements, thinned
from gantrytau_optimica.calibration.judging.plausibility import Fitting, Misses, miss, trimmed_motion
from gantrytau_optimica.calibration.rods.arm_closure import ArmClosure, exponential, product

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


def moved_arms(arms: Sequence[ArmClosure], turn: np.ndarray, shift: np.ndarray) -> tuple[ArmClosure, ...]:
    """The same arms in another frame, turn (3, 3) and shift (3,) as above."""
    return tuple(_moved(arm, turn, shift) for arm in arms)


def _moved(arm: ArmClosure, turn: np.ndarray, shift: np.ndarray) -> ArmClosure:
    values, said = dict(arm.values), arm.said
    if said.offset is not None:
        values[said.offset] = turn @ values[said.offset] + shift
    values[said.direction] = turn @ values[said.direction]
    if said.turntables:
        first = said.turntables[0]
        values[first.offset] = turn @ values[first.offset]
        values[first.orientation] = product(exponential(rotation_vector(turn)), values[first.orientation])
    else:
        for name in (rod.offset for rod in said.rods if rod.offset is not None):
            values[name] = turn @ values[name] + (shift if said.offset is None else 0.0)
    return replace(arm, values=values)
