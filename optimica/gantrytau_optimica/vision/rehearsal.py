"""The procedure of thesis section 5.6 with images instead of points: a plan carried out by a simulated robot before cameras.

A robot that differs from the nominal one by the error of the tape measure drives through the poses of a plan; its pattern is
drawn through lenses that differ from what is believed of them; corners, poses and numbers of the robot are found from these
images alone; the verdict is that of real measurements, and stands beside the truth.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import check_words, number, whole
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.assessment.calibration_acceptance import CalibrationVerdict
from gantrytau_optimica.calibration.assessment.cross_validation import cross_validate
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.devices.cameras import Cameras, PlacedCamera
from gantrytau_optimica.procedure.cells.planned_cell import PlannedCell
from gantrytau_optimica.procedure.measured_plan import measured_plan
from gantrytau_optimica.procedure.robot_samples import Member, build_fleet
from gantrytau_optimica.vision.boards import Pattern
from gantrytau_optimica.vision.comparison.compare import Comparison, compare
from gantrytau_optimica.vision.detection.detect import detect
from gantrytau_optimica.vision.detection.detections import Detections
from gantrytau_optimica.vision.intrinsics import Camera
from gantrytau_optimica.vision.reconstruction.reconstruct import reconstruct
from gantrytau_optimica.vision.reconstruction.reconstruction import Reconstruction
from gantrytau_optimica.vision.scenes.render import Images, render
from gantrytau_optimica.vision.scenes.scene import Light, Scene

Array = np.ndarray
SIDE = 0.06  # m, of a cell of the pattern
GOOD = Light()
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class Rehearsal(Record):
    """What a simulated robot before cameras came to.

    images: where they are; detections, poses: what was found in them; measured: poses beside the true ones; calibration,
    verdict: as of real measurements; tool: the calibrated robot beside the true one at all poses of the plan.
    """

    images: Images = field(repr=False)
    detections: Detections = field(repr=False)
    poses: Reconstruction = field(repr=False)
    measured: Comparison
    calibration: Calibration = field(repr=False)
    verdict: CalibrationVerdict
    tool: Comparison
    files: tuple[Path, ...] = ()

    def __str__(self) -> str:
        return "\n".join(
            [
                str(self.detections),
                str(self.poses),
                f"Poses beside the truth: {self.measured}",
                f"Calibrated robot beside the truth: {self.tool}",
                str(self.verdict),
                *(str(finding) for finding in self.calibration.findings if finding.kind != "frame"),
            ]
        )


def rehearse_plan(
    planned: PlannedCell,
    *,
    side: float = SIDE,
    light: Light = GOOD,
    intrinsics: Literal["fixed", "estimate"] = "estimate",
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Rehearsal:
    """Carry out a plan whose device is cameras, on rendered images, from the tape measure to the verdict.

        planned = plan_cell(read_cell("cell.toml"), "cell-plan")
        print(rehearse_plan(planned))

    side: of a cell of the quincunx on the tool, m; intrinsics: as of `reconstruct`; light, seed: of the images, and of the
    robot that stands there; progress: told what is done. Images and `measurements.csv` are kept in the folder rehearsal of
    the plan. Raises ModelError for a plan for another device, and all errors of its steps.
    """
    check_words(rehearse_plan, locals())
    side = number("rehearse_plan", "side", side, above=0.0)
    whole("rehearse_plan", "seed", seed, least=0)
    device = _cameras_of(planned)
    tell = progress or (lambda words: None)
    plan = planned.plan
    rows = np.flatnonzero(plan.measured)
    q = plan.q[rows]
    cell = planned.cell
    truth = build_fleet(cell.robot, cell.limits, tape=cell.tape, robots=1, seed=seed).others[0]
    r, R = truth.pose(q)
    scene = Scene(Pattern.quincunx(side), place=device.target, R=_axes(device.facing), seed=seed)
    folder = planned.folder / "rehearsal"
    folder.mkdir(exist_ok=True)
    tell(f"drawing {len(rows) * len(device.cameras)} images")
    images = render(scene, (r, R), device.cameras, light=light, seed=seed, folder=folder)
    tell("looking for the pattern")
    detections = detect(images, scene.pattern)
    tell("adjusting cameras and poses")
    lenses = [_lens(camera) for camera in device.believed]
    turns = plan.kind != "three links"
    poses = reconstruct(detections, lenses, intrinsics=intrinsics, orientation="free" if turns else "fixed")
    tell("calibrating")
    found = poses.measurements(q, place=device.target, R=scene.R, turning=turns)
    assert found.numbers is not None
    found.numbers = plan.numbers[rows][found.numbers]
    found.write(folder / "measurements.csv")
    calibration, verdict = _calibrated(planned, found)
    return Rehearsal(
        images,
        detections,
        poses,
        compare(poses.r, r + R @ np.asarray(device.target, dtype=float)),
        calibration,
        verdict,
        _tool(calibration, truth, plan.q),
        (folder, folder / "measurements.csv"),
    )


def _cameras_of(planned: PlannedCell) -> Cameras:
    """The device of a plan; ModelError for another than cameras."""
    device = planned.cell.device
    if not isinstance(device, Cameras):
        words = 'expected cameras; set kind = "stereo cameras" in [device] and plan anew'
        found_kind = f"found a plan for {type(device).__name__}, "
        raise ModelError(found_kind + words, place="rehearse_plan", argument="planned")
    return device


def _calibrated(planned: PlannedCell, measurements: Measurements) -> tuple[Calibration, CalibrationVerdict]:
    ready = measured_plan(planned, measurements)
    checked = cross_validate(planned.cell.robot, ready.measurements, prior=ready.prior, frame=ready.frame)
    return ready.judged(checked)


def _tool(calibration: Calibration, truth: Member, q: Array) -> Comparison:
    """Where the calibrated robot says that its tool is, beside where it is."""
    r, R = truth.pose(q)
    reached, _ = calibration.chains.fk(q, (r, R) if truth.turns else r)
    return compare(reached, r)


def _axes(facing: Array | None) -> Array:
    """Axes of a pattern that looks along `facing` of the plate, its upper side up."""
    ahead = np.array([1.0, 0.0, 0.0]) if facing is None else np.asarray(facing, dtype=float)
    ahead = ahead / np.linalg.norm(ahead)
    across = np.cross(UP, ahead)
    if np.linalg.norm(across) < 1e-3:
        across = np.array([0.0, 1.0, 0.0])
    across = across / np.linalg.norm(across)
    return np.column_stack([across, np.cross(ahead, across), ahead])


def _lens(camera: PlacedCamera) -> Camera:
    """What is believed of a camera, apart from where it stands."""
    fx, fy = camera.focal
    x, y = camera.centre
    return Camera([[fx, 0, x], [0, fy, y], [0, 0, 1]], camera.distortion, camera.size)
