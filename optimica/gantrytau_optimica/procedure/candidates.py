"""Poses that can be measured: safe in every robot of the fleet, and seen by the device there."""

from dataclasses import dataclass

import numpy as np

from gantrytau import ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import turned
from gantrytau.kinematics.workspace.pose_limits import REASONS
from gantrytau_optimica.calibration.devices.devices import Device
from gantrytau_optimica.procedure.robot_samples import WIDER, Fleet
from gantrytau_optimica.procedure.workspace_resolution import SettledWorkspace

TRIED = {"three links": 1500, "six links": 1000, "turntables": 1000}  # poses; more hardly change the choice
ENOUGH = 300  # safe and visible poses, from which a choice can be made
BATCHES = 4
TILT = np.radians(25.0)  # largest rotation from the orientation at home that is tried with turntables
EVALUATED = 300  # poses of the workspace at which errors of the tool are predicted and looked at
DECIMALS_M, DECIMALS_DEG = 7, 5  # what a program commands: 0.1 um and 1e-5 degrees


@dataclass(frozen=True, eq=False)
class Candidates(Record):
    """Poses that were tried, by their actuator coordinates q (N, n), with nominal r (N, 3), R (N, 3, 3).

    reason: (N,) the first limit that some robot breaks, a number of REASONS; seen: (N,) whether the device sees the
    target in all of the safe ones. at_q, at_r, at_R: poses spread over the nominal workspace, where errors of the tool
    are judged.
    """

    q: np.ndarray
    r: np.ndarray
    R: np.ndarray
    reason: np.ndarray
    seen: np.ndarray
    at_q: np.ndarray
    at_r: np.ndarray
    at_R: np.ndarray

    @property
    def safe(self) -> np.ndarray:
        """Rows in which all robots are safe."""
        return np.flatnonzero(self.reason == 0)

    @property
    def usable(self) -> np.ndarray:
        """Rows that are safe and visible."""
        return np.flatnonzero((self.reason == 0) & self.seen)


def commanded(q: np.ndarray, carts: int = 3) -> np.ndarray:
    """Coordinates as a program can command them: 0.1 um, 1e-5 degrees."""
    found = np.round(q, DECIMALS_M)
    found[:, carts:] = np.radians(np.round(np.degrees(q[:, carts:]), DECIMALS_DEG))
    return found


def find_candidates(fleet: Fleet, places: SettledWorkspace, device: Device, seed: int) -> Candidates:
    """Candidates from places of the workspace, in batches until there are enough.

    Raises ModelError where no place is safe, or none visible, with what stands against it most often.
    """
    if not len(places.r):
        raise ModelError(
            "plan_calibration: found no place in the workspace that keeps the limits of the nominal robot, expected some; "
            "give larger strokes or smaller obstacles and margins, or correct link lengths"
        )
    random = np.random.default_rng(seed)
    count, parts = TRIED[fleet.kind], []
    for _ in range(BATCHES):
        q = commanded(_tried(fleet, places, count, random))
        q = q[np.isfinite(q).all(axis=1)]
        reason = fleet.reasons(q)
        seen = np.zeros(len(q), dtype=bool)
        seen[reason == 0] = fleet.seen(device, q[reason == 0])
        parts.append((q, reason, seen))
        if sum(int(each[2].sum()) for each in parts) >= ENOUGH or len(places.r) <= count:
            break
    q, reason, seen = (np.concatenate(each) for each in zip(*parts, strict=True))
    q, first = np.unique(q, axis=0, return_index=True)
    reason, seen = reason[first], seen[first]
    _check(fleet, device, q, reason, seen)
    r, R = fleet.nominal.pose(q)
    at = commanded(_tried(fleet, places, EVALUATED, random))
    at_r, at_R = fleet.nominal.pose(at)
    good = np.isfinite(at_r).all(axis=1)
    return Candidates(q, r, R, reason, seen, at[good], at_r[good], at_R[good])


def _tried(fleet: Fleet, places: SettledWorkspace, count: int, random: np.random.Generator) -> np.ndarray:
    """Coordinates (count, n) of places by chance, of a plate with turntables turned by chance too."""
    if not fleet.turntables:
        return places.q[random.choice(len(places.q), min(count, len(places.q)), replace=False)]
    rows = random.choice(len(places.q), count)
    size = random.uniform(0.0, TILT, (count, 1))
    axis = random.standard_normal((count, 3))
    R = turned(places.R[rows], size * axis / np.linalg.norm(axis, axis=1, keepdims=True))
    q = fleet.nominal.joints(places.r[rows], R)
    q = q[np.isfinite(q).all(axis=1)]
    return q[fleet.nominal.judged(q).inside]


def _check(fleet: Fleet, device: Device, q: np.ndarray, reason: np.ndarray, seen: np.ndarray) -> None:
    """ModelError where nothing is left."""
    if not (reason == 0).any():
        counts = np.bincount(reason, minlength=len(REASONS))
        shares = ", ".join(
            f"{counts[k] / len(reason):.0%} {REASONS[k]}" for k in np.argsort(-counts) if counts[k]
        )
        raise ModelError(
            f"plan_calibration: found no safe place among {len(q)} tried: in one or another of {len(fleet.judges)} "
            f"robots with the tape error or {WIDER:g} times that {shares}; expected some; measure the robot better by hand "
            "(tape=), give smaller margins and obstacles, or larger strokes"
        )
    if not seen.any():
        where = np.round(np.asarray(device.r, dtype=float), 3).tolist()
        raise ModelError(
            f"plan_calibration: found {np.count_nonzero(reason == 0)} safe places, none of which the "
            f"{type(device).__name__} at {where} sees in all robots; expected some; put it elsewhere, turn the target "
            "(facing=) towards it, or move what stands in between"
        )
