"""Simulated calibrations: robots with tape errors, measured with all errors of the device, and compared with the truth.

A calibrated robot is as good as its tool is where it is told to be, in whatever frame: before errors are taken, calibrated
and nominal robot are laid over the truth by the rigid motion that suits them best.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau import GantryTauError, ModelError
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau.kinematics.rotations import motion
from gantrytau_optimica.calibration.calibrate import calibrate
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.devices.devices import Device
from gantrytau_optimica.procedure.candidates import Candidates
from gantrytau_optimica.procedure.robot_samples import Fleet, Member

AVERAGED = 25  # readings of each pose, whose mean shows what is systematic
SPACING = 1000  # between seeds of trials, which draw one for each reading


@dataclass(frozen=True, eq=False)
class Trial:
    """One simulated robot: mean error of the tool over the workspace before and after its calibration, m.

    largest: after, of any pose; in_frame: mean after, without laying robots over each other; misread: mean error of the
    readings, laid over the true poses best; unseen: how many poses the device did not see; note: why there is no
    calibration.
    """

    before: float
    after: float
    largest: float
    in_frame: float
    misread: float
    unseen: int
    note: str


@dataclass(frozen=True, eq=False)
class Trials(Record):
    """All simulated robots, arrays (k,) in m as in `Trial`, NaN where a calibration failed.

    averaged: the error after a calibration with 25 readings of each pose averaged: what no patience of the device removes;
    misread: mean error of these averages themselves.
    """

    before: np.ndarray
    after: np.ndarray
    largest: np.ndarray
    in_frame: np.ndarray
    unseen: np.ndarray
    averaged: float
    misread: float
    notes: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.after)

    @property
    def failed(self) -> int:
        """How many calibrations did not succeed."""
        return int(np.count_nonzero(~np.isfinite(self.after)))

    @property
    def worst(self) -> float:
        """The largest mean error of any robot after calibration, m; infinite where one failed."""
        return float("inf") if self.failed else float(self.after.max())


def collected(trials: list[Trial], averaged: Trial) -> Trials:
    """Trials as arrays."""
    columns = {
        name: np.array([getattr(each, name) for each in trials])
        for name in ("before", "after", "largest", "in_frame", "unseen")
    }
    return Trials(
        **columns,
        averaged=averaged.after,
        misread=averaged.misread,
        notes=tuple(each.note for each in trials),
    )


def simulated(
    fleet: Fleet,
    candidates: Candidates,
    device: Device,
    q: np.ndarray,
    number: int,
    *,
    seed: int,
    tape: float,
    readings: int = 1,
) -> Trial:
    """Calibrate the nominal robot with what the device reads of robot `number` of the fleet at q (n, k)."""
    truth = fleet.others[number]
    points, turns, unseen = _read(truth, device, q, seed + SPACING * number, readings)
    wrong = _aligned(points, _points(truth, device, q)[0])
    misread = float(np.nanmean(wrong)) if np.isfinite(wrong).any() else np.nan
    placing = _placing(points, _points(fleet.nominal, device, q)[0])
    points, turns = _moved(placing, points, turns)
    at = candidates.at_q
    true, true_R = _moved(placing, *_in_device(device, *_points(truth, device, at)))
    good = np.isfinite(true).all(axis=1)
    before = _aligned(_points(fleet.nominal, device, at)[0][good], true[good])
    try:
        data = Measurements(q, points, turns if fleet.nominal.turns else None)
        found = calibrate(fleet.robot, data, holdout=None, prior=prior_of(fleet, tape))
        near = (true[good], true_R[good]) if fleet.nominal.turns else true[good]
        place, _ = found.chains.fk(at[good], near)
        note = (
            ""
            if np.isfinite(place).all()
            else "the calibrated robot does not reach all places of the workspace"
        )
    except GantryTauError as error:
        place, note = np.full_like(true[good], np.nan), str(error)
    after, raw = _aligned(place, true[good]), np.linalg.norm(place - true[good], axis=1)
    errors = (
        (np.nan, np.nan, np.nan) if note else (float(after.mean()), float(after.max()), float(raw.mean()))
    )
    return Trial(float(before.mean()), *errors, misread, unseen, note)


def prior_of(fleet: Fleet, tape: float) -> dict[str, float] | None:
    """What calibration is told beforehand: joints on the plate as the tape measure knows them, m.

    Poses with nearly one orientation cannot tell them from the joints on the carts. Other robots do without.
    """
    return {"plate_offset": tape} if fleet.kind == "six links" else None


def check_device(fleet: Fleet, device: Device) -> None:
    """ModelError for a device that finds no positions, or no orientations where the robot needs them."""
    home = fleet.nominal.linked.home
    found = device.measure(home.r[None], home.R[None])
    if found.r is None:
        raise ModelError(
            "which finds no position, expected a device that does; take a LaserTracker, a TMac or cameras",
            place="plan_calibration",
            found=Given("device", type(device).__name__),
        )
    if fleet.nominal.turns and found.R is None:
        raise ModelError(
            f"expected a device that finds orientations too for a robot with {fleet.kind}; take a TMac or cameras, or plan "
            "for the robot with three links",
            place="plan_calibration",
            found=Given("device", type(device).__name__),
        )


def _read(
    truth: Member, device: Device, q: np.ndarray, seed: int, readings: int
) -> tuple[np.ndarray, np.ndarray | None, int]:
    """Points (n, 3) and orientations in the axes of the device, NaN where it saw nothing; and at how many poses."""
    r, R = truth.pose(q)
    bars = truth.bars(q, r, R)
    found = [device.measure(r, R, seed + k, frame="device", bars=bars) for k in range(readings)]
    turns = None if found[0].R is None else found[0].R
    return np.mean([each.r for each in found], axis=0), turns, int(np.count_nonzero(~found[0].seen))


def _points(member: Member, device: Device, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a device without errors finds of a robot at q, in the world: the tool, or its target."""
    r, R = member.pose(q)
    finds_tool = member.turns or device.measure(r[:1], R[:1]).R is not None
    return (r if finds_tool else r + R @ np.asarray(device.target, dtype=float)), R


def _in_device(device: Device, r: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    axes = np.asarray(device.R)
    return (r - np.asarray(device.r)) @ axes, axes.T @ R


def _placing(points: np.ndarray, onto: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The rigid motion (R, p) that lays points (n, 3) over others best: R x + p; rows of NaN do not count."""
    good = np.isfinite(points).all(axis=1) & np.isfinite(onto).all(axis=1)
    if good.sum() < 3:
        return np.eye(3), np.zeros(3)
    return motion(points[good], onto[good])


def _moved(placing: tuple[np.ndarray, np.ndarray], r: np.ndarray, R: Any) -> tuple[np.ndarray, Any]:
    turn, shift = placing
    return r @ turn.T + shift, None if R is None else turn @ R


def _aligned(place: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Distances (n,) of places from true ones, laid over each other best."""
    return np.linalg.norm(_moved(_placing(place, true), place, None)[0] - true, axis=1)


def placed(measurements: Measurements, q: np.ndarray, r: np.ndarray) -> Measurements:
    """Measurements in the frame of a device, laid over the poses r (n, 3) expected at q (n, k), by rows with the same q."""
    rows = matched(measurements.q, q)
    known = rows >= 0
    placing = _placing(measurements.r[known], r[rows[known]])
    moved, turns = _moved(placing, measurements.r, measurements.R)
    return Measurements(measurements.q, moved, turns, measurements.rails)


def matched(q: np.ndarray, planned: np.ndarray, within: float = 1e-4) -> np.ndarray:
    """For each row of q (n, k) the nearest row of planned ones (m, k), -1 where none is `within` (m, rad)."""
    if not len(planned) or not len(q):
        return np.full(len(q), -1)
    apart = np.abs(q[:, None] - planned).max(axis=2)
    nearest = np.where(np.isnan(apart), np.inf, apart).argmin(axis=1)
    near = apart[np.arange(len(q)), nearest] <= within
    return np.where(near, nearest, -1)


def with_obstacles(device: Device, obstacles: tuple) -> Device:
    """The device behind the obstacles of the cell, too: they hide what is behind them."""
    return replace(device, obstacles=(*device.obstacles, *obstacles)) if obstacles else device
