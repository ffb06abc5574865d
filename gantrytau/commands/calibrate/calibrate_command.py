"""`gantrytau calibrate`: its argument says whether a measurement is planned or made use of."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from gantrytau.border import listed, source_of
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json, PrototypeName, Settings
from gantrytau.commands.arguments.shell_offers import models
from gantrytau.commands.calibrate import calibration_files
from gantrytau.commands.calibrate.calibration_options import constraint_values, prior_values
from gantrytau.commands.calibrate.measurement_file import MeasurementFile
from gantrytau.commands.calibrate.outcome import NominalRobot, finish
from gantrytau.commands.calibrate.plan_command import EXAMPLES, model_of_cell, plan
from gantrytau.commands.printing.reporting import CommandError, refusing, reporting
from gantrytau_optimica import calibrate as calibrated
from gantrytau_optimica.procedure import cell_example, is_planned, load_planned_cell

Source = Annotated[
    Path | None,
    typer.Argument(
        metavar="FILE",
        help="Measured poses, as measurements.csv with the header q1,q2,...,x,y,z[,qw,qx,qy,qz] in m and rad; or a cell to "
        "be planned, as cell.toml.",
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
        autocompletion=models,
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
Prior = Annotated[
    str | None,
    typer.Option(
        metavar="NAME=DEVIATION,...",
        help="How well nominal values are known, as plate_offset=0.001 in m.",
        show_default=False,
    ),
]
Names = Annotated[
    list[str] | None,
    typer.Option(
        "--parameters",
        metavar="NAME,...",
        help="Parameters of any robot that are to be found, by their names in the model, as upper.r,fore.r.",
        show_default="the rods of the robot",
    ),
]
Joints = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME,...", help="With --parameters: columns of q.", show_default="the joints that are driven"
    ),
]
Constraints = Annotated[
    list[str] | None,
    typer.Option(
        "--constraint",
        metavar="NAME=VALUE",
        help="What numbers keep, with --method ipopt: 'arms[0].length=2.05', limits as 'arms[0].length=[2.0,2.1]', "
        "equal ones as 'arms[1].length=arms[0].length', or '|arms[0].direction|=1' of a vector's length. Repeatable.",
        show_default=False,
    ),
]
Output = Annotated[
    Path | None,
    typer.Option(help="Folder for what is written.", show_default="beside the file, with its name"),
]


Robust = Annotated[bool, typer.Option("--robust", help="Leave gross errors without weight.")]
Holdout = Annotated[
    Literal["second", "none"] | None,
    typer.Option(
        help="Which poses validate: every second, or those of the fit.",
        show_default="second; of a plan, and of fewer than 60 poses, each fifth in turn",
    ),
]
Frame = Annotated[
    Literal["fitted", "base"] | None,
    typer.Option(
        help="base: poses were measured in the base of the robot, where it is commanded; fitted: in any frame.",
        show_default="as the plan says, else fitted",
    ),
]
Example = Annotated[
    bool,
    typer.Option(
        "--example",
        help="Print the file of a cell, to begin with: --example l1, --example six (links), --example f1 (turntables), "
        "or of the --robot.",
    ),
]


@serves(
    calibrated,
    model=typer.Option(
        help="Error model; 1 to 5 are those of thesis Table 5.2.",
        show_default="straight guideways, each with its direction",
    ),
    method="How to solve.",
    start="Where to start; linear needs no nominal values.",
    orientation="How quaternions of turntables are free.",
)
def calibrate(
    file: Source = None,
    robot: RobotName = None,
    rails: Rails = None,
    prior: Prior = None,
    parameters: Names = None,
    joints: Joints = None,
    constraints: Constraints = None,
    loss: Robust = False,
    holdout: Holdout = None,
    frame: Frame = None,
    output: Output = None,
    prototype: PrototypeName = None,
    set_: Settings = None,
    example: Example = False,
    json: Json = False,
    **policy: Any,
) -> None:
    """Calibrate a robot: plan what to measure (cell.toml), then find its parameters (measurements.csv).

    cell.toml says what the tape measure knows of robot, obstacles and device: poses that are safe and visible, a robot
    program in a collision-free order, and a verdict go into a folder. Interrupted, the same command goes on where it was.

    measurements.csv gives the parameters, how sure they are, and the error that is left: a report (HTML and JSON), and
    calibrated.toml, which all commands take: --set calibrated.toml. The plan in its folder, or --robot, says of which robot.
    """
    with reporting(json, source_of(robot) if robot else None, {"kind": "--example"}):
        if example:
            typer.echo(cell_example(None if file is None else str(file), robot), nl=False)
            return
        if file is None:
            raise CommandError(
                "found no FILE, expected measurements, gantrytau calibrate measurements.csv, or a cell to be planned: "
                "gantrytau calibrate --example > cell.toml"
            )
        if file.suffix.lower() == ".toml":
            others: dict[str, object] = dict(robot=robot, rails=rails, model=policy["model"], prior=prior)
            others |= dict(frame=frame, parameters=parameters, joints=joints, constraint=constraints)
            _refuse_others(file, others | dict(set=set_, prototype=prototype))
            plan(file, output, json)
            return
        if not file.is_file():
            raise CommandError(f"{file}: there is no such file{_kinds(file)}")
        policy |= dict(
            frame=frame,
            holdout=None if holdout == "none" else "second",
            prior=prior_values(prior),
            constraints=constraint_values(constraints or ()),
            loss="robust" if loss else "linear",
            parameters=listed(parameters) or None,
            joints=listed(joints) or None,
        )
        folder = output or calibration_files.folder_beside(file)
        calibration_files.rehearse(folder)
        nominal = _robot(file, robot, prototype, set_ or ())
        if parameters and nominal.planned is not None:
            raise CommandError(
                f"{file}: the plan beside it is of a robot on rods; leave --parameters out, or give --robot"
            )
        measured = MeasurementFile.read(file, [Path(name) for name in listed([rails] if rails else None)])
        finish(nominal, measured, policy, folder, validate=holdout is None, json=json)


def _kinds(file: Path) -> str:
    """What may have been meant by a file that is not there."""
    known = str(file).lower() in EXAMPLES
    return f"; for a cell to begin with give --example {file}" if known else "; check its path"


def _robot(file: Path, robot: str | None, prototype: str | None, settings: Sequence[str]) -> NominalRobot:
    """The robot that is named, or that of the plan beside the measurements."""
    if robot is not None:
        chosen = build(robot, prototype, settings)
        name = f"{chosen.name}({chosen.prototype})" if chosen.prototype else robot
        return NominalRobot(chosen.model, name, None)
    if not is_planned(file.absolute().parent):
        raise CommandError(
            f"{file}: found no plan beside it that says of which robot it is; name the robot with its nominal values, as "
            f"gantrytau calibrate {file} --robot 'GantryTau(L1)'"
        )
    with refusing():
        planned = load_planned_cell(file.absolute().parent, model_of_cell)
    if settings or prototype:
        raise CommandError(
            f"{file}: the plan beside it says what the robot is ({planned.cell.name}); leave --set and --prototype out, "
            "or give --robot"
        )
    return NominalRobot(planned.cell.robot, planned.cell.name, planned)


def _refuse_others(file: Path, options: dict[str, object]) -> None:
    """CommandError for options that say what the file of a cell says."""
    if given := [f"--{name}" for name, value in options.items() if value]:
        raise CommandError(
            f"{file} says what is planned, found {', '.join(given)} too; leave it out, or write it there"
        )
