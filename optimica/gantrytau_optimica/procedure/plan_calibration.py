"""`plan_calibration`: the automated procedure of Dressler (2012), section 5.6, from a tape measure to a verdict."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import Model
from gantrytau.border.checks import array, instance, whole
from gantrytau.ensembles.parallel_map import each
from gantrytau.kinematics import Limits, workspace
from gantrytau.kinematics.workspace.grid_spacing import checked_places
from gantrytau.progress import shows_progress
from gantrytau_optimica.calibration.data.data_checks import FEWEST
from gantrytau_optimica.calibration.devices.devices import Device
from gantrytau_optimica.procedure.calibration_plan import CalibrationPlan
from gantrytau_optimica.procedure.candidates import Candidates, commanded, find_candidates
from gantrytau_optimica.procedure.documents.files import check_folder
from gantrytau_optimica.procedure.monte_carlo import (
    AVERAGED,
    Trial,
    Trials,
    check_device,
    collected,
    prior_of,
    simulated,
    with_obstacles,
)
from gantrytau_optimica.procedure.motion_planning.ordering import Order, ordered
from gantrytau_optimica.procedure.motion_planning.path_cache import KnownWays
from gantrytau_optimica.procedure.plan_acceptance import PlanVerdict, decide
from gantrytau_optimica.procedure.plan_goal import NAME, PlanGoal
from gantrytau_optimica.procedure.pose_choice import PoseChoice, choose, judge
from gantrytau_optimica.procedure.pose_plan import PlanBasis
from gantrytau_optimica.procedure.robot_samples import Fleet, build_fleet, check_home
from gantrytau_optimica.procedure.stages import Progress, Stages, digest
from gantrytau_optimica.procedure.workspace_resolution import SettledWorkspace, settled_workspace


@shows_progress
def plan_calibration(
    robot: Model,
    limits: Limits,
    device: Device,
    *,
    poses: int = 40,
    wanted: float = 200e-6,
    tape: float = 0.005,
    robots: int = 20,
    seed: int = 0,
    spacing: float | None = None,
    places: int | None = None,
    margin: float = 0.002,
    home: Any = None,
    folder: str | Path | None = None,
    progress: Progress | None = None,
) -> CalibrationPlan:
    """Plan the calibration of a robot that is known to the tape measure only.

        box = Box((0.2, 2.0, -2.5), (0.5, 2.6, -1.2))
        limits = Limits(strokes=(0.0, 2.0), obstacles=box, link_radius=0.02, clearance=0.02)
        tracker = LaserTracker((4.0, 3.0, 0.0))
        plan = plan_calibration(GantryTau(prototypes.L1), limits, tracker, wanted=50e-6, folder="cell")
        print(plan)
        plan.write("cell")

    robot: with the parameters that were measured by tape, any Gantry-Tau; limits: strokes, ball joints, obstacles, links
    and plate as bodies, margins; device: where it stands and what it sees. poses: how many to measure; wanted: error of
    the tool, m, that calibration must reach in the mean over the workspace; tape: standard deviation of joints and
    lengths, m; robots: how many with such errors are calibrated in simulation; they must be safe, and as many with twice
    these errors; seed: of all that is drawn; spacing: of the grid of the workspace, m, None refines it until it has
    settled; places: in place of it, about how many places of the grid are to be inside; margin: m (and rad) by which poses
    keep more than the limits ask, so that there are ways between them; home: q (n,) where the program begins and ends,
    None for the start of the model. folder: keeps finished stages there, so that the same call goes on after an
    interruption; stages whose questions changed are done anew. progress: called with
    (stage, done, of). Raises ModelError for what does not fit, where nothing is visible or safe, or home is in a collision.
    """
    if places is not None:
        whole(NAME, "places", places, least=1)
    asked = PlanGoal(poses, wanted, tape, robots, seed, margin, spacing, home)
    instance(NAME, "limits", limits, Limits, "gantrytau.kinematics.Limits(strokes=..., ...)")
    instance(NAME, "device", device, Device, "a device such as LaserTracker((4.0, 3.0, 0.0))")
    path = None if folder is None else Path(folder)
    if path is not None:
        check_folder(NAME, path)
        path.mkdir(exist_ok=True)
    fleet = build_fleet(robot, limits, tape=asked.tape, robots=robots, seed=seed)
    _check_poses(fleet, poses)
    device = with_obstacles(device, limits.obstacles)
    check_device(fleet, device)
    start = _home(fleet, home)
    check_home(fleet, start)
    asked = replace(asked, spacing=_spacing(fleet, limits, spacing, places), home=start)
    return _Procedure(fleet, limits, device, asked, Stages(path, progress)).plan()


class _Procedure:
    """The stages, each with what it depends on."""

    def __init__(self, fleet: Fleet, limits: Limits, device: Device, asked: PlanGoal, stages: Stages):
        self.fleet, self.limits, self.device, self.asked, self.stages = fleet, limits, device, asked, stages
        strict = _stricter(limits, asked.margin)
        self.strict = fleet.with_limits(strict)
        place = fleet.nominal.linked.home
        geometry = [arm.values for arm in fleet.arms]
        self.robot_key = digest(fleet.kind, geometry, place.q, place.r, place.R, fleet.nominal.strokes)

    def plan(self) -> CalibrationPlan:
        places = self._workspace()
        candidates, of_candidates = self._candidates(places)
        choice, order, of_order = self._ways(candidates, of_candidates)
        trials, of_trials = self._trials(candidates, order, of_order)
        verdict = self._verdict(places, candidates, choice, trials, of_trials)
        r, R = self.fleet.nominal.pose(order.q)
        kinematics = self.fleet.nominal.kinematics
        hidden = np.setdiff1d(candidates.safe, candidates.usable)
        return CalibrationPlan(
            robot_name=kinematics.dae.name,
            kind=self.fleet.kind,
            joints=tuple(kinematics.joints),
            carts=len(self.fleet.nominal.linked.geometry.offset),
            parameters={n: arm.values[n] for arm in self.fleet.arms for n in arm.free},
            settings=vars(self.asked)
            | {
                "prior": prior_of(self.fleet, self.asked.tape),
                "device": type(self.device).__name__,
                "device_r": self.device.r,
            },
            workspace=places,
            q=order.q,
            r=r,
            R=R,
            measured=order.measured,
            prediction=choice,
            trials=trials,
            verdict=verdict,
            lost=candidates.r[order.lost],
            unseen=candidates.r[hidden],
            cell=PlanBasis(self.fleet, self.limits, self.device, candidates),
        )

    def _workspace(self) -> SettledWorkspace:
        spacing = self.asked.spacing
        key = digest(self.robot_key, self.limits, self.device, spacing)
        self.workspace_key = key
        return self.stages.of(
            "workspace",
            SettledWorkspace,
            key,
            lambda: settled_workspace(self.fleet, self.limits, self.device, spacing),
        )

    def _candidates(self, places: SettledWorkspace) -> tuple[Candidates, str]:
        asked = self.asked
        key = digest(self.workspace_key, [asked.tape, asked.robots, asked.seed, asked.margin])
        return self.stages.of(
            "candidates",
            Candidates,
            key,
            lambda: find_candidates(self.strict, places, self.device, asked.seed),
        ), key

    def _ways(self, candidates: Candidates, key: str) -> tuple[PoseChoice, Order, str]:
        asked = self.asked
        known, key = KnownWays(self.stages, key), digest(key, asked.poses)
        at = (self.fleet, candidates, self.device)
        choice = self.stages.of("choice", PoseChoice, key, lambda: choose(*at, candidates.usable, asked))
        key = digest(key, asked.home)
        order = self.stages.of(
            "ways",
            Order,
            key,
            lambda: ordered(*at, choice, asked, check=known),
        )
        if not np.array_equal(np.sort(order.rows), choice.rows):
            choice = judge(*at, np.sort(order.rows), tape=asked.tape)
        return choice, order, key

    def _trials(self, candidates: Candidates, order: Order, key: str) -> tuple[Trials, str]:
        q, seed = order.q[order.measured], self.asked.seed
        count, key = self.asked.robots, digest(key, q)

        tape = self.asked.tape
        trial = partial(simulated, self.fleet, candidates, self.device, q, seed=seed, tape=tape)
        done = {k: self.stages.found(f"trial_{k:03d}", Trial, digest(key, k)) for k in range(count)}
        left = [k for k, known in done.items() if known is None]
        self.stages.progress("trials", count - len(left), count)
        for place, new in each(trial, left, len(left)):
            self.stages.keep(f"trial_{left[place]:03d}", new, digest(key, left[place]))
            done[left[place]] = new
            self.stages.progress("trials", sum(known is not None for known in done.values()), count)
        found = [known for known in done.values() if known is not None]
        worst = int(np.argmax([one.after if np.isfinite(one.after) else -1.0 for one in found]))
        averaged = self.stages.of(
            "averaged",
            Trial,
            digest(key, worst, "averaged"),
            lambda: trial(worst, readings=AVERAGED),
            tell=False,
        )
        return collected(found, averaged), key

    def _verdict(
        self, places: SettledWorkspace, candidates: Candidates, choice: PoseChoice, trials: Trials, key: str
    ) -> PlanVerdict:
        asked = self.asked
        key = digest(key, [asked.poses, asked.wanted, asked.tape, asked.seed])
        at = (self.fleet, self.device, places, candidates, choice, trials)
        return self.stages.of("verdict", PlanVerdict, key, lambda: decide(*at, asked))


def _stricter(limits: Limits, margin: float) -> Limits:
    return replace(limits, clearance=limits.clearance + margin, angle_margin=limits.angle_margin + margin)


def _home(fleet: Fleet, home: Any) -> np.ndarray:
    joints = fleet.nominal.kinematics.joints
    found = array(NAME, "home", fleet.nominal.linked.home.q if home is None else home, (len(joints),))
    return commanded(found[None])[0]


def _spacing(fleet: Fleet, limits: Limits, spacing: float | None, places: int | None) -> float | None:
    """The spacing that is given, in m, or that of a grid with so many places in the workspace of the nominal robot."""
    checked_places(places, spacing, NAME)
    if places is None:
        return spacing
    return workspace(fleet.nominal.kinematics, limits, places=places).spacing


def _check_poses(fleet: Fleet, poses: Any) -> None:
    """As many as calibrate() takes to fit all poses."""
    unknowns = {"three links": 7, "six links": 10, "turntables": max(arm.count for arm in fleet.arms) // 3}
    needed = max(FEWEST, unknowns[fleet.kind] + 1)
    whole(NAME, "poses", poses, least=needed)
