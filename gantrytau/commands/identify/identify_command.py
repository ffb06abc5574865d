"""`gantrytau identify`: masses and friction of a robot from logs of its motion."""

import shlex
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from gantrytau.border import source_of
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json, PrototypeName, RobotName, Settings
from gantrytau.commands.printing.reporting import (
    CommandError,
    answered,
    busy,
    refusing,
    reporting,
    written,
)
from gantrytau.commands.printing.spelling import RUNNING
from gantrytau_optimica import Finding, Identification, MotionLog
from gantrytau_optimica import identify as identified
from gantrytau_optimica.identification import check_motion

MANY = 100  # rows of a finding that are listed
Logs = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE...",
        help="Logs of motion, as log.csv with the header t,q1,...,f1,... in SI, or with units, as 'q1 (mm)'.",
        show_default=False,
    ),
]
FixedValues = Annotated[
    list[str] | None,
    typer.Option(
        "--fixed",
        metavar="NAME=VALUE",
        help="Parameters or families that are known: link_masses=0, cart_masses[0]=13.1. Repeatable.",
        show_default=False,
    ),
]
Report = Annotated[
    Path | None, typer.Option("--report", help="Write a page (HTML) of what was found.", show_default=False)
]


@serves(
    identified,
    friction="The law of friction; none keeps the model's.",
    cutoff=typer.Option(metavar="HZ", help="Of the filter of motion and forces."),
    minimum_speed=typer.Option(
        metavar="M/S", help="Below it a joint's rows do not count; rad/s of those that turn."
    ),
)
def identify(
    files: Logs,
    robot: RobotName,
    fixed: FixedValues = None,
    report: Report = None,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
    **policy: Any,
) -> None:
    """Identify masses and friction of a robot from logs of its motion and forces.

    What is wrong with the logs, as gaps, units, late forces, is told with rows and remedy.

    The last line has the values as options of all commands: --set carts[0].m=13.1.
    """
    with reporting(json, source_of(robot)):
        known = dict(_fixed(text) for text in fixed or ())
        chosen = build(robot, prototype, set_ or ())
        with refusing():
            logs = [MotionLog.read(file) for file in files]
        with busy(f"identifying {chosen.name}"):
            noticed = [
                (file, f, len(log))
                for file, log in zip(files, logs, strict=True)
                for f in _once(log, check_motion(chosen.model, log))
            ]
            found = identified(chosen.model, logs, fixed=known, **policy)
        record = summary(found, noticed)
        answered(json, {**record, "report": report}, _told(found, record), written(report, found.report))


def _fixed(text: str) -> tuple[str, float]:
    name, _, value = text.partition("=")
    try:
        return name.strip(), float(value)
    except ValueError:
        raise CommandError(
            f"--fixed {text}: found {value!r}, expected a number, as --fixed link_masses=0"
        ) from None


def _once(log: MotionLog, against: tuple[Finding, ...]) -> list[Finding]:
    """Findings of a log, and of it beside the robot, one of each kind of the latter."""
    own = list(log.findings)
    return [*own, *(f for f in against if f.kind not in {one.kind for one in own})]


def summary(found: Identification, noticed: list[tuple[Path, Finding, int]]) -> dict[str, Any]:
    """What was found as a record for programs; rows of findings count from 0, lines of files from 1."""
    told: list[dict[str, Any]] = []
    for file, f, count in noticed:
        lines = MotionLog.lines(file, f.rows[:MANY]).tolist() if 0 < f.rows.size < count else []
        told.append(
            dict(
                file=file,
                kind=f.kind,
                message=RUNNING.get().sentence(f.parts),
                rows=f.rows[:MANY],
                lines=lines,
            )
        )
    told += [
        dict(file=None, kind=f.kind, message=RUNNING.get().sentence(f.parts), rows=f.rows[:MANY], lines=[])
        for f in found.findings
        if f.kind not in {one["kind"] for one in told}
    ]
    return {
        "robot": found.robot_name,
        "parameters": {
            name: {"value": float(value), "deviation": float(found.deviations[name])}
            for name, value in found.parameters.items()
        },
        "weak": list(found.weak),
        "active": list(found.active),
        "condition": float(found.condition),
        "squares_N2": found.squares,
        "set": {name: float(value) for name, value in found.model_values.items()},
        "findings": told,
    }


def _told(found: Identification, record: dict[str, Any]) -> str:
    """The same for readers."""
    lines = [str(replace(found, findings=()))]
    for finding in record["findings"]:
        first = f", line {finding['lines'][0]}" if finding["lines"] else ""
        place = f"{finding['file'].name}{first}: " if finding["file"] else ""
        lines.append(f"  {place}{finding['kind']}: {finding['message']}")
    options = " ".join(f"--set {shlex.quote(f'{name}={value:.9g}')}" for name, value in record["set"].items())
    return "\n".join([*lines, f"As options: {options}"])
