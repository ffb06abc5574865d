"""`gantrytau doctor`: whether an installation works."""

import typer

from gantrytau.commands.arguments.options import Json
from gantrytau.commands.doctor.installation import as_json, examine, show
from gantrytau.commands.printing.reporting import FAULT, busy


def doctor(json: Json = False) -> None:
    """Check that this installation works: solvers, pictures, processes, C compiler, FMUs, extras.

    Each is tried in small, not only looked for; exit code 1 if something is broken, or missing and needed.
    """
    with busy("trying what is installed"):
        findings = list(examine())
    if json:
        typer.echo(as_json(findings))
    else:
        show(findings)
    if any(finding.harmful for finding in findings):
        raise typer.Exit(FAULT)
