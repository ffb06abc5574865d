"""`gantrytau doctor`: what an installation lacks."""

import typer

from gantrytau.commands.arguments.options import Json
from gantrytau.commands.installation import as_json, examine, show


def doctor(json: Json = False) -> None:
    """Check this installation: versions, solvers, compiler, extras."""
    findings = examine()
    if json:
        typer.echo(as_json(findings))
    else:
        show(findings)
    if any(finding.essential and not finding.good for finding in findings):
        raise typer.Exit(1)
