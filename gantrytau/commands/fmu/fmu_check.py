"""`gantrytau fmu check`: what is wrong with an FMU."""

from dataclasses import asdict
from typing import Annotated

import typer

from gantrytau.commands.arguments.options import Json
from gantrytau.commands.fmu.fmu_info import FmuFile, counted, is_system, present
from gantrytau.commands.printing.reporting import FAULT, as_json, busy, reporting


def check(
    file: FmuFile,
    run: Annotated[
        bool,
        typer.Option(
            "--run",
            help="Also load its binary and take a few steps, in a process of its own. It is code: trust it.",
        ),
    ] = False,
    timeout: Annotated[
        float, typer.Option(min=0.1, help="With --run: seconds after which it is taken to hang.")
    ] = 60.0,
    json: Json = False,
) -> None:
    """Check an FMU of any tool: the archive, the official schemas, FMPy's validation, and what they leave out.

    Of a system (.ssp) each FMU is checked, and how they are connected. Exit code 1 if there are errors; warnings and
    notes alone give 0.
    """
    from gantrytau_fmu import check_fmu, check_system

    with reporting(json):
        present(file)
        with busy(f"checking {file.name}"):
            findings = (check_system if is_system(file) else check_fmu)(file, run=run, timeout=timeout)
        errors = [finding for finding in findings if finding.severity == "error"]
        if json:
            found = {"file": str(file), "findings": [asdict(finding) for finding in findings]}
            first = {"error": f"{errors[0].path}: {errors[0].message}"} if errors else {}
            typer.echo(as_json({**first, **found}))
        else:
            for finding in findings:
                typer.echo(str(finding))
            others = len(findings) - len(errors)
            verdict = f"{counted(len(errors), 'error')}" + (
                f", {counted(others, 'remark')}" if others else ""
            )
            typer.echo(f"{file}: {verdict}")
        if errors:
            raise typer.Exit(FAULT)
