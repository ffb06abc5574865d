"""`gantrytau controller panel`: what a controller that serves publishes, its state switch and parameters."""

import contextlib
import sys
import time
from typing import Annotated

import typer

from gantrytau.commands.printing.reporting import reporting
from gantrytau_fmu.controller.panel import PanelLink, WebPanel, terminal_panel


def panel(
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the controller.")],
    host: Annotated[str, typer.Option(help="Where it runs.")] = "127.0.0.1",
    token: Annotated[
        str, typer.Option(help="Of the controller; without it one may only look.", envvar="GANTRYTAU_TOKEN")
    ] = "",
    web: Annotated[
        int | None,
        typer.Option(
            help="As a page for a browser of this machine, at this port; 0: any.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Show the values of a controller, and set its parameters and its state.

    Enter idle, submit, obtain, set NAME VALUE, or quit. It ends when the controller does, or at Ctrl-C.
    """
    with (
        reporting(False, None, {"port": "--web"}),
        contextlib.suppress(KeyboardInterrupt),
        PanelLink((host, port), token=token) as link,
    ):
        if web is None:
            from rich.console import Console

            terminal_panel(link, Console(), sys.stdin)
        else:
            with WebPanel(link, port=web) as page:
                typer.echo(f"The panel is at {page.url}")
                while not link.ended:
                    time.sleep(0.1)
        if link.ended:
            typer.echo(f"The controller ended: {link.ended}")
