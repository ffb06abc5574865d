"""A plan on file: JSON, CSV, the program and the page, each written whole or not at all."""

import csv
import json
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from gantrytau import ModelError
from gantrytau.whole_files import replacing
from gantrytau_optimica.procedure.documents.figures import draw_plan
from gantrytau_optimica.procedure.documents.plan_page import html_page
from gantrytau_optimica.procedure.documents.rapid import RapidOptions, rapid_program
from gantrytau_optimica.procedure.monte_carlo import Trials
from gantrytau_optimica.procedure.plan_acceptance import PlanVerdict
from gantrytau_optimica.procedure.pose_choice import CRITERION, PoseChoice
from gantrytau_optimica.procedure.pose_plan import PosePlan
from gantrytau_optimica.procedure.workspace_resolution import SettledWorkspace

KIND = "gantrytau calibration plan"
FORMAT = 2
Record = TypeVar("Record")
TEMPLATE = "measurements-template.csv"
PLACES = ("r", "R", "q")  # of the workspace, which JSON leaves out


def write_plan(plan: PosePlan, folder: Path, program: RapidOptions) -> Path:
    """See `CalibrationPlan.write`."""
    text = rapid_program(plan, program)  # before anything is written
    check_folder("write", folder)
    folder.mkdir(exist_ok=True)
    picture = None
    if plan.cell is not None:
        picture = folder / "workspace.png"
        draw_plan(plan, picture)
    name = f"{program.name}.mod"
    page = html_page(plan, picture, name, folder=folder, trigger=program.trigger)
    _write(folder / "poses.csv", lambda path: _write_poses(plan, path))
    _write(folder / TEMPLATE, lambda path: _write_template(plan, path))
    _write(folder / name, lambda path: path.write_text(text, encoding="ascii"))
    _write(folder / "plan.html", lambda path: path.write_text(page, encoding="utf-8"))
    _write(
        folder / "plan.json",
        lambda path: path.write_text(json.dumps(plan_numbers(plan), indent=1), encoding="utf-8"),
    )
    return folder


def check_folder(what: str, folder: Path) -> None:
    """ModelError for a folder that neither is there nor can be made."""
    if not folder.is_dir() and (folder.exists() or not folder.absolute().parent.is_dir()):
        found = "a file" if folder.exists() else f"no folder '{folder.absolute().parent}' to make it in"
        raise ModelError(
            f"found {found} for '{folder}', expected a folder; create it, or name another one",
            place=what,
            argument="folder",
        )


def _write(path: Path, write: Callable[[Path], Any]) -> None:
    with replacing(path) as partial:
        write(partial)


def _write_poses(plan: PosePlan, path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["number", *(f"q{k + 1}" for k in range(plan.q.shape[1])), "x", "y", "z", "measured"])
        for number, q, r, measured in zip(plan.numbers, plan.q, plan.r, plan.measured, strict=True):
            writer.writerow([number, *(f"{x:.9g}" for x in q), *(f"{x:.6f}" for x in r), int(measured)])


def _write_template(plan: PosePlan, path: Path) -> None:
    """The poses to measure, with empty cells for what is measured."""
    empty = [""] * (len(plan.header.split(",")) - plan.q.shape[1])
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["number", *plan.header.split(",")])
        for k in np.flatnonzero(plan.measured):
            writer.writerow([plan.numbers[k], *(f"{x:.9g}" for x in plan.q[k]), *empty])


def plan_numbers(plan: PosePlan) -> dict[str, Any]:
    """The plan as plain numbers, lists and words; lengths in m, angles in rad."""
    return {
        "kind": KIND,
        "format": FORMAT,
        "robot": {
            "name": plan.robot_name,
            "kind": plan.kind,
            "joints": list(plan.joints),
            "carts": plan.carts,
            "parameters": {name: _plain(value) for name, value in plan.parameters.items()},
        },
        "settings": {name: _plain(value) for name, value in plan.settings.items()},
        "criterion": CRITERION,
        "verdict": _numbers(plan.verdict),
        "workspace": _numbers(plan.workspace, without=PLACES),
        "prediction": _numbers(plan.prediction) | {"error": plan.prediction.error},
        "trials": _numbers(plan.trials),
        "program": {name: _plain(getattr(plan, name)) for name in ("q", "r", "R", "measured", "numbers")},
        "lost": _plain(plan.lost),
        "unseen": _plain(plan.unseen),
    }


def _numbers(record: Any, without: tuple[str, ...] = ()) -> dict[str, Any]:
    names = [field.name for field in fields(record) if field.name not in without]
    return {name: _plain(getattr(record, name)) for name in names}


def _plain(value: Any) -> Any:
    """Arrays as lists, what is not finite as null."""
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return value


def plan_on_file(path: Path) -> dict[str, Any]:
    """The fields of a plan from the folder in which it was written, or from its plan.json itself."""
    path = path / "plan.json" if path.is_dir() else path
    try:
        numbers = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ModelError(
            f"load_plan: found no plan at '{path}' ({error.strerror}), expected plan.json as "
            "CalibrationPlan.write leaves it; name its folder, or plan first"
        ) from None
    except ValueError:
        numbers = None
    if not isinstance(numbers, dict) or numbers.get("kind") != KIND:
        raise ModelError(f"load_plan: found '{path}' that is no calibration plan, expected one; plan again")
    if numbers.get("format") != FORMAT:
        raise ModelError(
            f"load_plan: found '{path}' of format {numbers.get('format', 'without a number')}, of another version of "
            f"gantrytau, expected format {FORMAT}; plan again, which goes on from the stages that are still right"
        )
    try:
        return _fields(numbers)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        lacks = f"without {error}" if isinstance(error, KeyError) else f"with what no plan has ({error})"
        raise ModelError(f"load_plan: found '{path}' {lacks}, expected a whole plan; plan again") from None


def _fields(numbers: dict[str, Any]) -> dict[str, Any]:
    robot, program = numbers["robot"], numbers["program"]
    n = len(robot["joints"])
    empty = dict(r=np.zeros((0, 3)), R=np.zeros((0, 3, 3)), q=np.zeros((0, n)))
    return dict(
        robot_name=robot["name"],
        kind=robot["kind"],
        joints=tuple(robot["joints"]),
        carts=robot["carts"],
        parameters=robot["parameters"],
        settings=numbers["settings"],
        workspace=_record(SettledWorkspace, numbers["workspace"], empty),
        q=np.array(program["q"], dtype=float),
        r=np.array(program["r"], dtype=float),
        R=np.array(program["R"], dtype=float),
        measured=np.array(program["measured"], dtype=bool),
        prediction=_record(PoseChoice, numbers["prediction"]),
        trials=_record(Trials, numbers["trials"]),
        verdict=_record(PlanVerdict, numbers["verdict"]),
        lost=np.array(numbers["lost"], dtype=float).reshape(-1, 3),
        unseen=np.array(numbers["unseen"], dtype=float).reshape(-1, 3),
        numbers=np.array(program["numbers"], dtype=int),
    )


def _record(kind: type[Record], numbers: dict[str, Any], more: dict[str, Any] | None = None) -> Record:
    """A record of plain numbers, null as what is not finite."""
    words = ("reasons", "notes")
    values = dict(more or {})
    for one in fields(kind):  # type: ignore[arg-type]
        if one.name in values:
            continue
        value = numbers[one.name]
        if isinstance(value, list):
            values[one.name] = (
                tuple(value)
                if one.name in words
                else np.array(value, dtype=None if one.name == "rows" else float)
            )
        else:
            values[one.name] = (np.inf if one.name == "error" else np.nan) if value is None else value
    return kind(**values)
