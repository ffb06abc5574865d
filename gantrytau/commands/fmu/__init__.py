"""`gantrytau fmu`: FMUs written, checked, described and run, one module for each command."""

from gantrytau.commands.printing.command_group import group

PLACES = {
    "export": ("fmu.fmu_export", "gantrytau fmu export 'GantryTau(D1)' --to robot.fmu --platforms all"),
    "check": ("fmu.fmu_check", "gantrytau fmu check robot.fmu --run"),
    "info": ("fmu.fmu_info", "gantrytau fmu info robot.fmu --json"),
    "run": ("fmu.fmu_run", "gantrytau fmu run robot.fmu --stop 2 --plot tool.r --to motion.png"),
}
app = group(
    "FMUs (FMI 2.0 and 3.0): write models as FMUs, check, describe and run those of any tool.", PLACES
)
