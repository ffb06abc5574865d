"""`gantrytau controller stream`: a CSV file to a controller that serves, a row for each sample."""

from pathlib import Path
from typing import Annotated, Any

import typer

from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.printing.reporting import INTERRUPTED, as_json, reporting
from gantrytau_fmu.controller import run_client, stream_file


@serves(stream_file, name="Its place at the controller.", at_end="After the last row: hold it, or stop.")
def stream(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="CSV, as learning control writes corrections.")
    ],
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the controller.")],
    host: Annotated[str, typer.Option(help="Where it runs.")] = "127.0.0.1",
    tcp: Annotated[bool, typer.Option("--tcp", help="By a connection instead of datagrams.")] = False,
    token: Annotated[str, typer.Option(help="Of the controller; needed from elsewhere.")] = "",
    json: Json = False,
    **policy: Any,
) -> None:
    """Stream a file to a controller: a row for each sample, from the moment that f_activate goes from 0 to 1.

    It ends when the controller does, or at Ctrl-C.
    """
    with reporting(json, None, {"transport": "--tcp"}):
        client = stream_file(file, **policy)
        transport = "tcp" if tcp else "udp"
        attended = run_client(client, (host, port), transport=transport, token=token)
        told = {
            "samples": attended.samples,
            "answers": attended.answers,
            "ended": attended.ended,
            "state": client.state,
        }
        words = f"{attended.answers} answers to {attended.samples} samples; {attended.ended}; {client.state}"
        typer.echo(as_json(told) if json else words)
        if attended.ended == "interrupted":
            raise typer.Exit(INTERRUPTED)
