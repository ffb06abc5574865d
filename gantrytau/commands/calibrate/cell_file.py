"""`cell.toml`: a robot as the tape measure knows it, its surroundings, and the device that is to measure it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gantrytau import Model, ModelError, did_you_mean, read_toml, with_setting
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.calibrate.toml_quantities import Value, at, read_table
from gantrytau.commands.printing.reporting import CommandError

POINT = Value("m", ((3,),))
ROTATION = Value("1", ((3, 3),))
TEXT = Value("text")
LENGTH, ANGLE = Value("m", above=0.0), Value("rad", above=0.0)
ERROR, TURN = Value("m", least=0.0), Value("rad", least=0.0)

ROBOT = {"model": TEXT, "tape": LENGTH}
GOAL = {"error": LENGTH, "poses": Value("whole", least=1)}
PLAN = {
    "robots": Value("whole", least=1),
    "seed": Value("whole", least=0),
    "spacing": LENGTH,
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
    "obstacles": Value("bodies"),
    "plate": Value("bodies"),
}
BAR = {"start": POINT, "end": POINT, "radius": LENGTH}
OBSTACLES = {
    "box": ("Box", {"low": POINT, "high": POINT, "R": ROTATION}, ("low", "high")),
    "cylinder": ("Cylinder", BAR, ("start", "end", "radius")),
    "capsule": ("Capsule", BAR, ("start", "end", "radius")),
}
_TARGET = {"r": POINT, "target": POINT, "facing": Value("1", ((3,),))}
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
    "laser tracker": ("LaserTracker", _TRACKER, ("r",)),
    "t-mac": ("TMac", _TRACKER | {"rotation_noise": TURN}, ("r",)),
    "single camera": ("single_camera", _CAMERA, ("r", "at")),
    "stereo cameras": ("stereo_cameras", _CAMERA | {"base": LENGTH}, ("r", "at")),
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
TABLES = ("robot", "values", "goal", "limits", "device", "plan", "program")


@dataclass(frozen=True)
class Cell:
    """What a cell file says. robot, limits, device: ready for use; name: of the robot on the command line; values: those
    of the tape measure by name; plan: further keywords of plan_calibration; program: those of the robot program.
    """

    file: Path
    name: str
    robot: Model
    values: dict[str, Any]
    limits: Any
    device: Any
    tape: float
    wanted: float
    poses: int | None = None
    plan: dict[str, Any] = field(default_factory=dict)
    program: dict[str, Any] = field(default_factory=dict)


def read(file: Path) -> Cell:
    """The cell of a file; CommandError, which names the place in it, for all that it cannot be."""
    table = read_toml("", file)
    whole = f"{file}: "
    for name in table:
        if name not in TABLES:
            raise CommandError(f"{whole}[{name}]: there is no such table{did_you_mean(name, TABLES)}")
    for name in ("robot", "goal", "device"):
        if name not in table:
            raise CommandError(
                f"{whole}found no table [{name}], expected one; `gantrytau calibrate --example` prints a whole file"
            )
    own = read_table(f"{whole}robot", table["robot"], ROBOT, ("model", "tape"))
    name, values = named(own["model"], file), _values(f"{whole}values", table.get("values", {}))
    goal = read_table(f"{whole}goal", table["goal"], GOAL, ("error",))
    return Cell(
        file=file,
        name=name,
        robot=_robot(f"{whole}robot.model", name, values, f"{whole}values"),
        values=values,
        limits=_limits(f"{whole}limits", table.get("limits", {})),
        device=_device(f"{whole}device", table["device"]),
        tape=own["tape"],
        wanted=goal["error"],
        poses=goal.get("poses"),
        plan=read_table(f"{whole}plan", table.get("plan", {}), PLAN),
        program=_program(f"{whole}program", table.get("program", {})),
    )


def named(model: str, file: Path) -> str:
    """A model as the command line names it from any folder: files of models lie beside the file of the cell."""
    python, dot, rest = model.partition(".py")
    if not dot or Path(python).is_absolute():
        return model
    return f"{(file.absolute().parent / python).resolve()}.py{rest}"


def _robot(place: str, name: str, values: Mapping[str, Any], at_values: str) -> Model:
    try:
        model = build(name).model
    except CommandError as error:
        raise CommandError(f"{place}: {error}") from error
    for key, value in values.items():
        try:
            model = with_setting(model, key, value)
        except CommandError as error:
            raise CommandError(f"{at_values}: {str(error).removeprefix('--set ')}") from error
    return model


def _values(place: str, table: Any) -> dict[str, Any]:
    """Numbers and vectors by the names of parameters; lengths may bring their unit."""
    if not isinstance(table, Mapping):
        raise CommandError(f"{place}: found {table!r}, expected a table, [values]")
    any_value = Value("m,rad", ((), (3,), (4,), (3, 3)))
    found = {}
    for name, value in table.items():
        if isinstance(value, Mapping):
            raise CommandError(
                f'{at(place, name)}: found a table, expected a number; write the name in quotes, as "arms[0].length" = 2.05'
            )
        found[name] = any_value.read(at(place, name), value)
    return found


def _limits(place: str, table: Any) -> Any:
    from gantrytau.kinematics import Limits

    values = read_table(place, table, LIMITS)
    for name, kinds in (("obstacles", OBSTACLES), ("plate", {"capsule": OBSTACLES["capsule"]})):
        values[name] = _bodies(f"{place}.{name}", values.get(name, []), kinds)
    return _made(place, Limits, values)


def _bodies(place: str, entries: Any, kinds: Mapping[str, Any]) -> list[Any]:
    from gantrytau import kinematics

    if not isinstance(entries, list):
        raise CommandError(
            f"{place}: found {entries!r}, expected a table for each, [[{place.rpartition(': ')[2]}]]"
        )
    found = []
    for k, entry in enumerate(entries):
        name, values = _of_a_kind(f"{place}[{k}]", entry, kinds)
        found.append(_made(f"{place}[{k}]", getattr(kinematics, name), values))
    return found


def _program(place: str, table: Any) -> dict[str, Any]:
    """Options of the robot program, all of which RAPID takes."""
    from gantrytau_optimica.procedure.documents.rapid import check_program

    values = read_table(place, table, PROGRAM)
    try:
        check_program(**values)
    except ModelError as error:
        raise CommandError(f"{place.removesuffix('program')}{error}") from error
    return values


def _device(place: str, table: Any) -> Any:
    import gantrytau_optimica

    name, values = _of_a_kind(place, table, DEVICES)
    make: Callable[..., Any] = getattr(gantrytau_optimica, name)
    return _made(place, make, values)


def _of_a_kind(place: str, table: Any, kinds: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """The class that `kind` names, and what the table says of it; the kind may be left out where there is only one."""
    if not isinstance(table, Mapping):
        raise CommandError(f"{place}: found {table!r}, expected a table")
    kind = Value("text", words=tuple(kinds))
    first = next(iter(kinds))
    if "kind" not in table and len(kinds) > 1:
        raise CommandError(f"{at(place, 'kind')}: found nothing, expected {kind.expected()}")
    chosen = kind.read(at(place, "kind"), table.get("kind", first))
    name, keys, needed = kinds[chosen]
    values = read_table(place, table, {"kind": kind, **keys}, needed)
    return name, {key: value for key, value in values.items() if key != "kind"}


def _made(place: str, make: Callable[..., Any], values: dict[str, Any]) -> Any:
    """What a class makes of values; its complaint with the place in the file."""
    try:
        return make(**values)
    except ModelError as error:
        raise CommandError(f"{place}: {error}") from error
