"""`gantrytau calibrate`: its argument says whether a measurement is planned or made use of."""

from pathlib import Path
from typing import Annotated

import typer

from gantrytau.commands.calibrate import results, wording
from gantrytau.commands.calibrate.measured import Measured, calibrated
from gantrytau.commands.calibrate.policy import policy, rail_files
from gantrytau.commands.choice import source_of
from gantrytau.commands.models import build
from gantrytau.commands.options import Json, PrototypeName, Settings
from gantrytau.commands.reporting import CommandError, as_json, reporting

Source = Annotated[
    Path | None,
    typer.Argument(
        metavar="FILE",
        help="Measured poses, as measurements.csv with the header q1,q2,...,x,y,z[,qw,qx,qy,qz] in m and rad.",
        show_default=False,
    ),
]
RobotName = Annotated[
    str | None,
    typer.Option(
        "--robot",
        metavar="MODEL",
        help="The robot with its nominal values, named as for the other commands: 'GantryTau(L1)', robot.py:Robot.",
        show_default=False,
    ),
]
Rails = Annotated[
    str | None,
    typer.Option(
        metavar="FILES",
        help="Measured guideways for models 2, 4 and 5: a CSV file q,x,y,z for each, separated by commas.",
        show_default=False,
    ),
]
ErrorModel = Annotated[
    str | None,
    typer.Option(
        metavar="parallel|1..5",
        help="Error model; 1 to 5 are those of thesis Table 5.2.",
        show_default="straight guideways, each with its direction",
    ),
]
Prior = Annotated[
    str | None,
    typer.Option(
        metavar="NAME=DEVIATION,...",
        help="How well nominal values are known, as plate_offset=0.001 in m.",
        show_default=False,
    ),
]
Output = Annotated[
    Path | None,
    typer.Option(help="Folder for what is written.", show_default="beside the file, with its name"),
]


def calibrate(
    file: Source = None,
    robot: RobotName = None,
    rails: Rails = None,
    model: ErrorModel = None,
    method: Annotated[str, typer.Option(metavar="gauss-newton|ipopt", help="How to solve.")] = "gauss-newton",
    start: Annotated[
        str, typer.Option(metavar="nominal|linear", help="Where to start; linear needs no nominal values.")
    ] = "nominal",
    orientation: Annotated[
        str, typer.Option(metavar="local|unit|free", help="How quaternions of turntables are free.")
    ] = "local",
    prior: Prior = None,
    robust: Annotated[bool, typer.Option("--robust", help="Leave gross errors without weight.")] = False,
    holdout: Annotated[
        str,
        typer.Option(metavar="second|none", help="Which poses validate: every second, or those of the fit."),
    ] = "second",
    output: Output = None,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
) -> None:
    """Calibrate a robot with measured poses: parameters, how sure they are, and the error that is left.

    Writes a report (HTML and JSON) and calibrated.toml, which all commands take: --set calibrated.toml.
    """
    with reporting(json, source_of(robot) if robot else None):
        if file is None:
            raise CommandError("found no FILE, expected measurements: gantrytau calibrate measurements.csv")
        how = policy(model, method, start, orientation, holdout, prior, robust)
        folder = output or results.folder_beside(file)
        results.rehearse(folder)
        if robot is None:
            raise CommandError(
                f"{file}: found no robot for these measurements; name it with its nominal values, as "
                f"gantrytau calibrate {file} --robot 'GantryTau(L1)'"
            )
        measured = Measured.read(file, rail_files(rails))
        chosen = build(robot, prototype, set_ or ())
        found = calibrated(chosen.model, measured, how, json)
        name = f"{chosen.name}({chosen.prototype})" if chosen.prototype else robot
        written = results.write(found, folder, name, file)
        if json:
            typer.echo(as_json(wording.summary(found, measured, name, written)))
        else:
            wording.show(found, measured, written)
