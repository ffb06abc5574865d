"""`gantrytau controller`: a robot controller whose references others overwrite, one module for each command."""

import typer

from gantrytau.commands.controller.controller_panel import panel
from gantrytau.commands.controller.controller_run import run
from gantrytau.commands.controller.controller_stream import stream

app = typer.Typer(
    help="A robot controller whose references clients and a controller of yours overwrite every 4 ms.",
    no_args_is_help=True,
)

app.command(
    epilog="Example: gantrytau controller run --example > cell.toml && gantrytau controller run cell.toml --stop 0.5"
)(run)
app.command(epilog="Example: gantrytau controller stream corrections.csv --port 5000")(stream)
app.command(epilog="Example: gantrytau controller panel --port 5000 --token TOKEN --web 0")(panel)
