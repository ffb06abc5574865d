"""Arms in the frame of the measurements: where forward kinematics of nominal values puts the plate, and where it was seen.

T' = S T + t        A' = S A + t,   v' = S v,   R(u)' = S R(u),   what is in the frame of a turntable stays
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gantrytau import GantryTauError, Model
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import rotation_vector
from gantrytau_optimica.calibration.data.measurements import Measurements, thinned
from gantrytau_optimica.calibration.diagnostics.plausibility import Fitting, Misses, miss, trimmed_motion
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure, exponential, product

FEWEST = 4  # poses that nominal kinematics must reach


@dataclass(frozen=True, eq=False)
class Motion(Record):
    """From the frame of measurements to the base of the robot: base = rotation @ measured + translation, m.

    placed: whether measurements were moved so before they were fitted: then identified numbers are in the base, else in the
    frame of the measurements.
    """

    rotation: np.ndarray
    translation: np.ndarray
    placed: bool = False

    @classmethod
    def of(cls, fitting: Fitting) -> "Motion":
        """The way back to nominal values that were moved into the frame of the measurements."""
        return cls(fitting.turn.T, -fitting.turn.T @ fitting.shift)


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


def frame_words(frame: str, motion: Motion | None) -> str:
    """In which frame identified numbers are; frame: as of `calibrate`."""
    if frame == "base":
        return "the base of the robot, in which poses were measured"
    if motion is None:
        return "that of the measurements, taken for the base of the robot"
    if motion.placed:
        return "the base of the robot as nominal values know it, where base = R measured + t lays the measurements"
    return "that of the measurements; base = R measured + t, as nominal values know the base of the robot"
