"""`gantrytau controller stream`: a CSV file to a controller that serves, a row for each sample."""

from pathlib import Path
from typing import Annotated

import typer

from gantrytau.commands.arguments.options import Json
from gantrytau.commands.printing.reporting import INTERRUPTED, CommandError, as_json, reporting
from gantrytau.commands.printing.spelling import Spelling

SPELLING = Spelling(("controller",), {"at_end": "--at-end", "transport": "--tcp"})


def stream(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="CSV, as learning control writes corrections.")
    ],
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the controller.")],
    host: Annotated[str, typer.Option(help="Where it runs.")] = "127.0.0.1",
    name: Annotated[str, typer.Option(help="Its place at the controller.")] = "stream",
    at_end: Annotated[str, typer.Option(help="hold the last row, or stop.")] = "hold",
    tcp: Annotated[bool, typer.Option("--tcp", help="By a connection instead of datagrams.")] = False,
    token: Annotated[str, typer.Option(help="Of the controller; needed from elsewhere.")] = "",
    json: Json = False,
) -> None:
    """Stream a file to a controller: a row for each sample, from the moment that f_activate goes from 0 to 1.

    It ends when the controller does, or at Ctrl-C.
    """
    with reporting(json, None, SPELLING):
        from gantrytau_fmu.controller import run_client, stream_file

        if at_end not in ("hold", "stop"):
            raise CommandError(f"--at-end {at_end}: expected hold or stop")
        client = stream_file(file, name=name, at_end="hold" if at_end == "hold" else "stop")
        transport = "tcp" if tcp else "udp"
        attended = run_client(client, (host, port), transport=transport, token=token)
        told = {
            "samples": attended.samples,
            "answers": attended.answers,
            "ended": attended.ended,
            "state": client.state,
        }
        if json:
            typer.echo(as_json(told))
        else:
            typer.echo(
                f"{attended.answers} answers to {attended.samples} samples; {attended.ended}; {client.state}"
            )
        if attended.ended == "interrupted":
            raise typer.Exit(INTERRUPTED)
