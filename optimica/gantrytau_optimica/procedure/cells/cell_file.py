"""`cell.toml`: a robot as the tape measure knows it, its surroundings, and the device that is to measure it."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from gantrytau import Model, ModelError, kinematics, read_toml, with_setting
from gantrytau.border.named import named
from gantrytau.border.refusal import told
from gantrytau.border.schema import Value, at, read_table
from gantrytau.describing.record import Record
from gantrytau.kinematics import Limits
from gantrytau_optimica.calibration.devices.cameras import single_camera, stereo_cameras
from gantrytau_optimica.calibration.devices.devices import Device, LaserTracker, TMac
from gantrytau_optimica.procedure.documents.rapid import RapidOptions

POINT = Value("m", ((3,),))
ROTATION = Value("1", ((3, 3),))
TEXT = Value("text")
FRAME = Value("text", words=("fitted", "base"))
LENGTH, ANGLE = Value("m", above=0.0), Value("rad", above=0.0)
ERROR, TURN = Value("m", least=0.0), Value("rad", least=0.0)

ROBOT = {"model": TEXT, "tape": LENGTH}
GOAL = {"error": LENGTH, "poses": Value("whole", least=1)}
PLAN = {
    "robots": Value("whole", least=1),
    "seed": Value("whole", least=0),
    "spacing": LENGTH,
    "places": Value("whole", least=1),
    "margin": LENGTH,
    "home": Value("m,rad", ((None,),)),
}
LIMITS = {
    "strokes": Value("m,rad", ((2,), (None, 2))),
    "ball_joint": ANGLE,
    "cart_axes": Value("1", ((3,), (None, 3))),
    "plate_axes": Value("1", ((3,), (None, 3))),
    "home": POINT,
    "link_radius": ERROR,
    "stroke_margin": ERROR,
    "turn_margin": TURN,
    "angle_margin": TURN,
    "clearance": ERROR,
    "obstacles": Value("table", ((None,),)),
    "plate": Value("table", ((None,),)),
}
BAR = {"start": POINT, "end": POINT, "radius": LENGTH}
OBSTACLES = {
    "box": (kinematics.Box, {"low": POINT, "high": POINT, "R": ROTATION}, ("low", "high")),
    "cylinder": (kinematics.Cylinder, BAR, ("start", "end", "radius")),
    "capsule": (kinematics.Capsule, BAR, ("start", "end", "radius")),
}
_TARGET = {"r": POINT, "target": POINT, "facing": Value("1", ((3,),)), "frame": FRAME}
_TRACKER = _TARGET | {
    "R": ROTATION,
    "range_noise": ERROR,
    "range_noise_per_metre": Value("1", least=0.0),
    "transverse_noise": ERROR,
    "transverse_noise_per_metre": Value("1", least=0.0),
    "scale": Value("1"),
    "nearest": ERROR,
    "farthest": LENGTH,
    "elevation": Value("rad", ((2,),)),
    "acceptance": ANGLE,
}
_CAMERA = _TARGET | {
    "at": POINT,
    "lens_error": Value("1"),
    "pattern": Value("m", ((None, 3),)),
    "noise": Value("1", least=0.0),
    "acceptance": ANGLE,
    "smallest": Value("1", least=0.0),
}
DEVICES = {
    "laser tracker": (LaserTracker, _TRACKER, ("r",)),
    "t-mac": (TMac, _TRACKER | {"rotation_noise": TURN}, ("r",)),
    "single camera": (single_camera, _CAMERA, ("r", "at")),
    "stereo cameras": (stereo_cameras, _CAMERA | {"base": LENGTH}, ("r", "at")),
}
PROGRAM = {
    "name": TEXT,
    "speed": Value("m/s", above=0.0),
    "settle": Value("s", least=0.0),
    "measure": Value("s", least=0.0),
    "carts": Value("text", words=("robax", "extax")),
    "trigger": TEXT,
    "tool": TEXT,
}
TABLES: dict[str, Value] = dict.fromkeys(
    ("robot", "values", "goal", "limits", "device", "plan", "program"), Value("table")
)


Robot = Model | Callable[[str], Model]
LIBRARY = "gantrytau_models"  # of models that a file names without their module


@dataclass(frozen=True)
class Cell(Record):
    """What a cell file says; lengths in m, angles in rad.

    file: its path; name: of the robot, as the file names it, a model in a file by its full path; robot, limits, device:
    ready for use; values: those of the tape measure by name; tape: their standard deviation; wanted: the error of the tool
    to be reached; poses: how many to measure, None for the usual number; frame: in which the device measures, as of
    `calibrate`; plan: further keywords of `plan_calibration`; program: those of `CalibrationPlan.program`.
    """

    file: Path
    name: str
    robot: Model
    values: Mapping[str, Any]
    limits: Limits
    device: Device
    tape: float
    wanted: float
    poses: int | None = None
    frame: Any = "fitted"
    plan: Mapping[str, Any] = field(default_factory=dict)
    program: Mapping[str, Any] = field(default_factory=dict)

    @property
    def policy(self) -> dict[str, Any]:
        """Keywords of `plan_calibration` for this cell, besides robot, limits and device."""
        poses = {} if self.poses is None else {"poses": self.poses}
        return {**self.plan, "wanted": self.wanted, "tape": self.tape, **poses}

    def copied(self) -> str:
        """The text of its file for another folder: a model in a file is named by its full path."""
        text = self.file.read_text(encoding="utf-8-sig")
        model = re.compile(r"^(\s*model\s*=\s*)([\"']).*?\.py.*?\2", re.MULTILINE)
        named = model.sub(lambda found: f"{found[1]}'{self.name}'", text)
        return f"# The cell of this plan, from {self.file.name}.\n{named}"


def read_cell(path: str | Path, robot: Robot | None = None) -> Cell:
    """The cell of a TOML file, such as `cell_example` gives one; numbers are SI, texts bring a unit, as "5 mm".

    robot: the model with its nominal values, or a function that finds it by the name in the file; None imports it by name,
    from `gantrytau_models` or as "package.module:Robot", "robot.py:Robot". Raises ModelError, which names the place in the
    file, for all that it cannot be.
    """
    file = Path(path)
    whole = f"{file}: "
    table = read_table(whole, read_toml(file), TABLES, ("robot", "goal", "device"))
    own = read_table(f"{whole}robot", table["robot"], ROBOT, ("model", "tape"))
    name, values = absolute_name(own["model"], file), _values(f"{whole}values", table.get("values", {}))
    goal = read_table(f"{whole}goal", table["goal"], GOAL, ("error",))
    model = robot
    if not isinstance(model, Model):
        model = told(f"{whole}robot.model", partial(model or robot_by_name, name))
    device, frame = _device(f"{whole}device", table["device"])
    return Cell(
        file=file,
        name=name,
        robot=_with_values(f"{whole}values", model, values),
        values=values,
        limits=_limits(f"{whole}limits", table.get("limits", {})),
        device=device,
        frame=frame,
        tape=own["tape"],
        wanted=goal["error"],
        poses=goal.get("poses"),
        plan=read_table(f"{whole}plan", table.get("plan", {}), PLAN),
        program=_program(f"{whole}program", table.get("program", {})),
    )


def absolute_name(model: str, file: Path) -> str:
    """The name of a model in any folder: files of models lie beside the file of the cell."""
    python, dot, rest = model.partition(".py")
    if not dot or Path(python).is_absolute():
        return model
    return f"{(file.absolute().parent / python).resolve()}.py{rest}"


def robot_by_name(name: str) -> Model:
    """The model that a file names: `GantryTau(L1, plate_mass=9)`, `package.module:Robot`, `robot.py:Robot`.

    Raises ModelError where there is none.
    """
    made = named(name, Path.cwd(), LIBRARY)
    if not isinstance(made, Model):
        raise ModelError(f"found '{name}', which is no model, expected one, as GantryTau(L1)")
    return made


def _with_values(place: str, model: Model, values: Mapping[str, Any]) -> Model:
    for name, value in values.items():
        model = told(place, partial(with_setting, model, name, value))
    return model


def _values(place: str, table: Any) -> dict[str, Any]:
    """Numbers and vectors by the names of parameters; lengths may bring their unit."""
    any_value = Value("m,rad", ((), (3,), (4,), (3, 3)))
    if nested := next((name for name, value in table.items() if isinstance(value, Mapping)), None):
        raise ModelError(
            f'{at(place, nested)}: found a table, expected a number; write the name in quotes, as "arms[0].length" = 2.05'
        )
    return {name: any_value.read(at(place, name), value) for name, value in table.items()}


def _limits(place: str, table: Any) -> Limits:
    values = read_table(place, table, LIMITS)
    for name, kinds in (("obstacles", OBSTACLES), ("plate", {"capsule": OBSTACLES["capsule"]})):
        values[name] = _bodies(f"{place}.{name}", values.get(name, []), kinds)
    return told(place, lambda: Limits(**values))


def _bodies(place: str, entries: Any, kinds: Mapping[str, Any]) -> list[Any]:
    found = []
    for k, entry in enumerate(entries):
        make, values = _of_a_kind(f"{place}[{k}]", entry, kinds)
        found.append(told(f"{place}[{k}]", partial(make, **values)))
    return found


def _program(place: str, table: Any) -> dict[str, Any]:
    """Options of the robot program, all of which RAPID takes."""
    values = read_table(place, table, PROGRAM)
    told(place.removesuffix(": program"), lambda: RapidOptions(**values))
    return values


def _device(place: str, table: Any) -> tuple[Device, Any]:
    """The device, and the frame in which it measures."""
    make, values = _of_a_kind(place, table, DEVICES)
    frame = values.pop("frame", "fitted")
    return told(place, lambda: make(**values)), frame


def _of_a_kind(place: str, table: Any, kinds: Mapping[str, Any]) -> tuple[Callable[..., Any], dict[str, Any]]:
    """What makes the kind that is named, and what the table says of it; the kind may be left out where there is only one."""
    kind = Value("text", words=tuple(kinds))
    if "kind" not in table and len(kinds) > 1:
        raise ModelError(f"{at(place, 'kind')}: found nothing, expected {kind.expected()}")
    make, keys, needed = kinds[kind.read(at(place, "kind"), table.get("kind", next(iter(kinds))))]
    values = read_table(place, table, {"kind": kind, **keys}, needed)
    return make, {key: value for key, value in values.items() if key != "kind"}
