"""`gantrytau fmu`: FMUs written, checked, described and run, one module for each command."""

import typer

from gantrytau.commands.fmu.fmu_check import check
from gantrytau.commands.fmu.fmu_export import export
from gantrytau.commands.fmu.fmu_info import info
from gantrytau.commands.fmu.fmu_run import run

app = typer.Typer(
    help="FMUs (FMI 2.0 and 3.0): write models as FMUs, check, describe and run those of any tool.",
    no_args_is_help=True,
)

app.command(epilog="Example: gantrytau fmu export 'GantryTau(D1)' --to robot.fmu --platforms all")(export)
app.command(epilog="Example: gantrytau fmu check robot.fmu --run")(check)
app.command(epilog="Example: gantrytau fmu info robot.fmu --json")(info)
app.command(epilog="Example: gantrytau fmu run robot.fmu --stop 2 --plot tool.r --to motion.png")(run)
