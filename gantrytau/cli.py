"""The command line. It alone joins the parts of the toolkit; each command imports what it needs."""

from typing import Annotated

import typer

app = typer.Typer(
    help="Acausal models of parallel robots: simulate, optimise, calibrate, export.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_show_locals=False,
)


@app.callback()
def main() -> None:
    """Keep commands named even while there is only one."""


@app.command()
def doctor(
    json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Check this installation: versions, solvers, compiler, extras."""
    from gantrytau import installation

    findings = installation.examine()
    if json:
        print(installation.as_json(findings))
    else:
        installation.show(findings)
    if any(finding.essential and not finding.good for finding in findings):
        raise typer.Exit(1)


if __name__ == "__main__":
    app()
