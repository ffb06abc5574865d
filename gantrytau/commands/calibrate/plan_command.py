"""`gantrytau calibrate cell.toml`: the guided procedure, as a folder with poses, a robot program and a verdict."""

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import typer

from gantrytau import ModelError
from gantrytau.commands.calibrate import cell_file as cells
from gantrytau.commands.calibrate.calibration_files import rehearse
from gantrytau.commands.calibrate.cell_file import Cell
from gantrytau.commands.printing.reporting import (
    FAULT,
    INTERRUPTED,
    CommandError,
    as_json,
    fail,
    note,
    write_text,
)
from gantrytau.commands.printing.spelling import Spelling

CELL = "plan.toml"  # in the folder of a plan: the cell that it was made for
PROGRAM = "Calibration"
MEASUREMENTS, TEMPLATE = "measurements.csv", "measurements-template.csv"
SAME = 1e-6  # m and rad, by which poses of the same plan may differ
STAGES = {
    "workspace": "workspace of the robot",
    "candidates": "safe and visible places",
    "choice": "choice of poses",
    "ways": "ways between them",
    "trials": "simulated calibrations",
    "verdict": "verdict",
}


SPELLING = Spelling(
    ("plan_calibration", "Limits"),
    {
        "wanted": "goal.error",
        "poses": "goal.poses",
        "tape": "robot.tape",
        "limits": "limits",
        "device": "device",
    }
    | {"strokes": "limits.strokes", "facing": "device.facing"}
    | {name: f"plan.{name}" for name in cells.PLAN},
    exactly={
        "obstacles[": "limits.obstacles[",
        "plate[": "limits.plate[",
        ", or box=, a slice for example": "",
    },
)


@dataclass
class Reached:
    """How far a procedure has come."""

    stage: str = ""
    done: int = 0
    of: int = 1

    def __str__(self) -> str:
        count = f", {self.done} of {self.of} done" if self.of > 1 else ""
        return f"{STAGES.get(self.stage, self.stage)}{count}"


def folder_beside(file: Path) -> Path:
    """Where a plan goes if no other folder is named."""
    return file.with_name(f"{file.stem}-plan")


def plan(file: Path, output: Path | None, json: bool) -> None:
    """Plan what to measure, write it, and print the verdict; leaves with exit code 1 if that is not good."""
    cell = cells.read(file)
    folder = output or folder_beside(file)
    rehearse(folder)
    reached = Reached()
    try:
        with _live(reached, hidden=json) as progress:
            found = _planned(cell, folder, progress)
            _protect(folder, found)
            found.write(folder, **cell.program)
            write_text(_copy(cell), folder / CELL)
    except KeyboardInterrupt:
        where = f" in the stage '{reached}'" if reached.stage else ""
        fail(f"Interrupted{where}; the same command goes on from there", INTERRUPTED, json)
    except ModelError as error:
        with suppress(OSError):  # a folder that was made for nothing
            folder.rmdir()
        raise ModelError(f"{file}: {SPELLING.of(error)}") from error
    files = [str(path) for path in _files(folder, cell)]
    good, reasons = found.verdict.good, "\n".join(found.verdict.reasons)
    if json:
        wrong = {} if good else {"error": reasons, "kind": "verdict"}
        typer.echo(as_json({**summary(found), "files": files, **wrong}))
    else:
        typer.echo(str(found))
        for name in files:
            typer.echo(f"Written: {name}")
        typer.echo(_next(found, folder, file))
    if not good:
        raise typer.Exit(FAULT)


def _protect(folder: Path, found: Any) -> None:
    """CommandError if the folder holds measurements of other poses, which this plan would make worthless."""
    from gantrytau_optimica import load_plan

    measured = folder / MEASUREMENTS
    if not measured.is_file() or not (folder / "plan.json").is_file():
        return
    earlier = load_plan(folder)
    if earlier.q.shape != found.q.shape or np.abs(earlier.q - found.q).max() > SAME:
        raise CommandError(
            f"{measured}: found measurements of an earlier plan with other poses; nothing was written. Name another folder "
            "with --output, or move the measurements away"
        )


def _next(found: Any, folder: Path, file: Path) -> str:
    """What to do with a plan."""
    from gantrytau_optimica.procedure.documents.plan_page import USUAL, command, drawn

    measured = folder / MEASUREMENTS
    few = int(found.settings["robots"]) < USUAL
    safe = f"Safe: {drawn(found)}\n" if few else ""
    if found.verdict.good:
        return (
            f"{safe}Measure the poses, save {folder / TEMPLATE} as {measured}, filled in (or a file with the header "
            f"{header(found)}), then: {command(found, folder)}"
        )
    return safe + (
        f"Change {file}, and give the same command again: it goes on from what does not depend on the change"
    )


def _planned(cell: Cell, folder: Path, progress: Callable[[str, int, int], None]) -> Any:
    from gantrytau_optimica import plan_calibration

    policy: dict[str, Any] = dict(cell.plan, wanted=cell.wanted, tape=cell.tape)
    if cell.poses is not None:
        policy["poses"] = cell.poses
    folder.parent.mkdir(parents=True, exist_ok=True)
    return plan_calibration(cell.robot, cell.limits, cell.device, folder=folder, progress=progress, **policy)


def summary(found: Any) -> dict[str, Any]:
    """A plan as a record for programs."""
    return {
        "robot": found.robot_name,
        "good": found.verdict.good,
        "reasons": list(found.verdict.reasons),
        "wanted_m": found.verdict.wanted,
        "error_m": found.verdict.error,
        "predicted_error_m": float(found.prediction.error),
        "simulated": {"before_m": found.trials.before.tolist(), "after_m": found.trials.after.tolist()},
        "poses": int(found.measured.sum()),
        "passed": int((~found.measured).sum()),
    }


def header(found: Any) -> str:
    """The header of the measurements of a plan."""
    joints = [f"q{k + 1}" for k in range(found.q.shape[1])]
    turns = [] if found.kind == "three links" else ["qw", "qx", "qy", "qz"]
    return ",".join([*joints, "x", "y", "z", *turns])


def _files(folder: Path, cell: Cell) -> list[Path]:
    program = f"{cell.program.get('name', PROGRAM)}.mod"
    names = ("plan.html", "workspace.png", "poses.csv", TEMPLATE, program, "plan.json", CELL)
    return [folder / name for name in names if (folder / name).is_file()]


def _copy(cell: Cell) -> str:
    """The file of a cell for the folder of its plan: a model in a file is named from anywhere."""
    text = cell.file.read_text(encoding="utf-8-sig")
    model = re.compile(r"^(\s*model\s*=\s*)([\"']).*?\.py.*?\2", re.MULTILINE)
    return f"# The cell of this plan, from {cell.file.name}.\n" + model.sub(
        lambda found: f"{found[1]}'{cell.name}'", text
    )


@contextmanager
def _live(reached: Reached, hidden: bool) -> Iterator[Callable[[str, int, int], None]]:
    """What follows the stages: a line on a terminal that changes, else a line for each stage."""

    def follow(stage: str, done: int, of: int) -> bool:
        begun = stage != reached.stage
        reached.stage, reached.done, reached.of = stage, done, of
        return begun

    if hidden or not sys.stderr.isatty():

        def tell(stage: str, done: int, of: int) -> None:
            if follow(stage, done, of) and not hidden:
                note(f"{STAGES.get(stage, stage)} ...")

        yield tell
        return
    from rich.console import Console
    from rich.text import Text

    console = Console(file=sys.stderr)
    with console.status(Text("reading the cell")) as status:

        def show(stage: str, done: int, of: int) -> None:
            follow(stage, done, of)
            status.update(Text(str(reached)))

        yield show
