"""Whether the planned calibration will do, and what is missing if not: decided by the error of the tool."""

from dataclasses import dataclass

import numpy as np

from gantrytau import GantryTauError
from gantrytau_optimica.calibration.assessment.calibration_acceptance import Verdict
from gantrytau_optimica.calibration.design.pose_selection import enough_poses, predict
from gantrytau_optimica.calibration.devices.devices import Device
from gantrytau_optimica.fitting.finding import length_text
from gantrytau_optimica.procedure.candidates import Candidates
from gantrytau_optimica.procedure.monte_carlo import Trials
from gantrytau_optimica.procedure.plan_goal import PlanGoal
from gantrytau_optimica.procedure.pose_choice import PoseChoice, device_noise, expected_error, poses_of
from gantrytau_optimica.procedure.robot_samples import Fleet
from gantrytau_optimica.procedure.workspace_resolution import SettledWorkspace

SYSTEMATIC = 0.7  # of the error that averaged readings leave: then it is not noise
HIDDEN = 0.7  # of the safe places, below which the place of the device is worth a word


@dataclass(frozen=True, eq=False)
class PlanVerdict(Verdict):
    """Of a plan: good if every simulated robot keeps the wanted error of the tool in the mean over the workspace.

    error: of the worst of them, m.
    """

    error: float


def decide(
    fleet: Fleet,
    device: Device,
    places: SettledWorkspace,
    candidates: Candidates,
    choice: PoseChoice,
    trials: Trials,
    asked: PlanGoal,
) -> PlanVerdict:
    """The verdict on a plan."""
    wanted = asked.wanted
    good = bool(trials.worst <= wanted)
    count = len(choice.rows)
    said = [_told(trials, count, wanted)]
    if trials.failed:
        said.append(_failed(device, trials, count, wanted))
    elif not good and trials.averaged >= SYSTEMATIC * trials.worst:
        said.append(_systematic(device, trials))
    elif not good:
        said.append(_noise(fleet, device, candidates, choice, trials, asked))
    said += _remarks(device, places, candidates, count, asked.poses, choice, trials)
    return PlanVerdict(good, wanted, tuple(said), trials.worst)


def _told(trials: Trials, count: int, wanted: float) -> str:
    robots = f"{len(trials)} simulated robots" if len(trials) > 1 else "the simulated robot"
    if trials.failed:
        return f"Of {robots} {trials.failed} could not be calibrated with {count} poses."
    before = f"from {length_text(float(trials.before.mean()))} before"
    return (
        f"With {count} poses the tool of {robots} errs by {length_text(float(trials.after.mean()))} in the mean over the "
        f"workspace, of the worst robot by {length_text(trials.worst)} ({before}); wanted are {length_text(wanted)}."
    )


def _failed(device: Device, trials: Trials, count: int, wanted: float) -> str:
    note = next(note for note in trials.notes if note)
    said = f"The first message: {note.rstrip('.')}."
    if trials.misread > wanted:
        return (
            f"{said} Even when 25 readings of each pose are averaged the {type(device).__name__} errs by "
            f"{length_text(trials.misread)}, which is systematic: calibrate the device itself, place it nearer, or take a "
            "better one."
        )
    return f"{said} Plan more than {count} poses, or measure the robot better by hand first."


def _systematic(device: Device, trials: Trials) -> str:
    return (
        f"{length_text(trials.averaged)} remain even when 25 readings of each pose are averaged, so that the error is "
        f"systematic in the {type(device).__name__} and more poses do not help: calibrate the device itself, place it "
        "nearer to the middle of the workspace, or take a better one."
    )


def _noise(
    fleet: Fleet,
    device: Device,
    candidates: Candidates,
    choice: PoseChoice,
    trials: Trials,
    asked: PlanGoal,
) -> str:
    """How many poses would be enough, or which other device or place."""
    wanted, tape, seed = asked.wanted, asked.tape, asked.seed
    usable = poses_of(fleet, candidates, candidates.usable)
    noise, angle = max(choice.noise, 1e-9), choice.noise_angle
    chosen = poses_of(fleet, candidates, choice.rows)
    now = predict(fleet.robot, chosen, at=usable, noise=noise, angle=angle, tape=tape).error
    goal = wanted * now / trials.worst
    try:
        rows = enough_poses(fleet.robot, usable, goal, noise=noise, angle=angle, tape=tape, seed=seed)
        if len(rows) > len(choice.rows):
            return f"The rest is noise of the device: plan about {len(rows)} poses."
        return f"The rest is noise of the device: plan more than {len(choice.rows)} poses."
    except GantryTauError:
        pass
    safe = candidates.safe
    every = device_noise(device, candidates.r[safe], candidates.R[safe])
    best = expected_error(fleet, candidates, safe, noise=every, tape=tape).error
    if best * trials.worst / choice.error <= wanted < np.inf and len(safe) > len(candidates.usable):
        return (
            f"All {len(usable.q)} visible places together are not enough, all {len(safe)} safe ones would be: put the "
            "device where it sees more of the workspace."
        )
    factor = trials.worst / wanted
    return (
        f"All {len(usable.q)} visible places together are not enough: take a device with {factor:.2g} times less noise than "
        f"{length_text(choice.noise)} per axis, or average several readings of each pose."
    )


def _remarks(
    device: Device,
    places: SettledWorkspace,
    candidates: Candidates,
    count: int,
    poses: int,
    choice: PoseChoice,
    trials: Trials,
) -> list[str]:
    safe, usable = len(candidates.safe), len(candidates.usable)
    found = []
    if count < poses:
        found.append(
            f"Only {count} of {poses} poses can be reached without a collision: smaller obstacles or margins, or another "
            "home, give more."
        )
    if usable < HIDDEN * safe:
        found.append(
            f"The {type(device).__name__} sees {usable} of {safe} safe places in all robots; another place for it would "
            "show more."
        )
    if safe < 0.5 * len(candidates.q):
        found.append(
            f"Only {safe} of {len(candidates.q)} places are safe whatever the tape error; measure the robot better by "
            "hand, or make margins and obstacles smaller, to use more of the workspace."
        )
    if not places.settled and len(places.spacings) > 1:
        found.append("The grid of the workspace has not settled; give spacing= for a finer one.")
    times = float(trials.in_frame.mean() / choice.error)
    if not trials.failed and times > 2:
        found.append(
            f"Errors are {times:.0f} times those predicted from noise alone "
            f"({length_text(choice.error)}): part of them is systematic."
        )
    if trials.unseen.any():
        found.append(f"In {np.count_nonzero(trials.unseen)} robots some poses were not seen.")
    return found
