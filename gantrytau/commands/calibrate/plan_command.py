"""`gantrytau calibrate cell.toml`: the guided procedure, as a folder with poses, a robot program and a verdict."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from gantrytau import Model, ModelError
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.calibrate.calibration_files import rehearse
from gantrytau.commands.printing.reporting import (
    FAULT,
    INTERRUPTED,
    CommandError,
    answered,
    fail,
    note,
    refusing,
)
from gantrytau.commands.printing.spelling import RUNNING
from gantrytau_optimica import CalibrationPlan, read_cell
from gantrytau_optimica.procedure import PlannedCell, plan_cell

EXAMPLES = ("l1", "six", "f1")  # kinds of cells to begin with
STAGES = {
    "workspace": "workspace of the robot",
    "candidates": "safe and visible places",
    "choice": "choice of poses",
    "ways": "ways between them",
    "trials": "simulated calibrations",
    "verdict": "verdict",
}
NAMES = {  # keys of the file by argument
    "wanted": "goal.error",
    "poses": "goal.poses",
    "tape": "robot.tape",
    "limits": "limits",
    "device": "device",
    "strokes": "limits.strokes",
    "facing": "device.facing",
    **{name: f"plan.{name}" for name in ("robots", "seed", "spacing", "places", "margin", "home")},
    "folder": "--output",
}


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


def model_of_cell(name: str) -> Model:
    """The robot that the file of a cell names, as all commands name models."""
    return build(name).model


def plan(file: Path, output: Path | None, json: bool) -> None:
    """Plan what to measure, write it, and print the verdict; leaves with exit code 1 if that is not good."""
    with refusing():
        cell = read_cell(file, model_of_cell)
    folder = output or folder_beside(file)
    rehearse(folder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    reached = Reached()
    try:
        with _live(reached, hidden=json) as progress:
            planned = plan_cell(cell, folder, progress=progress)
    except KeyboardInterrupt:
        where = f" in the stage '{reached}'" if reached.stage else ""
        fail(f"Interrupted{where}; the same command goes on from there", INTERRUPTED, json)
    except ModelError as error:
        with suppress(OSError):  # a folder that was made for nothing
            folder.rmdir()
        message = RUNNING.get().with_names(NAMES).message(error)
        if error.argument == "folder":
            raise CommandError(message) from error
        raise ModelError(message, place=str(file)) from error
    found = planned.plan
    good, reasons = found.verdict.good, "\n".join(found.verdict.reasons)
    wrong = {} if good else {"error": reasons, "kind": "verdict"}
    answered(json, {**summary(found), **wrong}, str(found), planned.files)
    if not json:
        typer.echo(_next(planned, file))
    if not good:
        raise typer.Exit(FAULT)


def _next(planned: PlannedCell, file: Path) -> str:
    """What to do with a plan."""
    few = planned.plan.few_robots
    safe = f"Safe: {planned.plan.safety}\n" if few else ""
    if planned.plan.verdict.good:
        return (
            f"{safe}Measure the poses, save {planned.template} as {planned.measurements}, filled in (or a file with the "
            f"header {planned.plan.header}), then: {planned.plan.command(planned.folder)}"
        )
    return safe + (
        f"Change {file}, and give the same command again: it goes on from what does not depend on the change"
    )


def summary(found: CalibrationPlan) -> dict[str, Any]:
    """A plan as a record for programs."""
    return {
        "robot": found.robot_name,
        "good": found.verdict.good,
        "reasons": list(found.verdict.reasons),
        "wanted_m": found.verdict.wanted,
        "error_m": found.verdict.error,
        "predicted_error_m": float(found.prediction.error),
        "simulated": {"before_m": found.trials.before, "after_m": found.trials.after},
        "poses": int(found.measured.sum()),
        "passed": int((~found.measured).sum()),
    }


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
