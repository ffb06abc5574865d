"""`gantrytau fmu check`: what is wrong with an FMU."""

from dataclasses import asdict
from typing import Any

import typer

from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.fmu.fmu_info import FmuFile, counted, is_system, present
from gantrytau.commands.printing.reporting import FAULT, as_json, busy, reporting
from gantrytau_fmu import check_fmu, check_system


@serves(
    check_fmu,
    run=typer.Option(
        "--run",
        help="Also load its binary, take a few steps and rerun its reference results, in a process of its own. "
        "It is code: trust it.",
    ),
    timeout="With --run: seconds after which it is taken to hang.",
)
def check(file: FmuFile, json: Json = False, **policy: Any) -> None:
    """Check an FMU of any tool: the archive, the official schemas, FMPy's validation, and what they leave out.

    Of a system (.ssp) each FMU is checked, and how they are connected. Exit code 1 if there are errors; warnings and
    notes alone give 0. Reference results that an FMU carries are read, and with --run compared.
    """
    with reporting(json):
        present(file)
        with busy(f"checking {file.name}"):
            findings = (check_system if is_system(file) else check_fmu)(file, **policy)
        errors = [finding for finding in findings if finding.severity == "error"]
        if json:
            first = {"error": f"{errors[0].path}: {errors[0].message}"} if errors else {}
            typer.echo(as_json({**first, "file": file, "findings": [asdict(one) for one in findings]}))
        else:
            others = len(findings) - len(errors)
            remarks = f", {counted(others, 'remark')}" if others else ""
            verdict = f"{file}: {counted(len(errors), 'error')}{remarks}"
            typer.echo("\n".join([*map(str, findings), verdict]))
        if errors:
            raise typer.Exit(FAULT)
