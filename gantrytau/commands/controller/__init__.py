"""`gantrytau controller`: a robot controller whose references others overwrite, one module for each command."""

from gantrytau.commands.printing.command_group import group

PLACES = {
    "run": (
        "controller.controller_run",
        "gantrytau controller run --example > cell.toml && gantrytau controller run cell.toml --stop 0.5",
    ),
    "stream": ("controller.controller_stream", "gantrytau controller stream corrections.csv --port 5000"),
    "panel": (
        "controller.controller_panel",
        "gantrytau controller panel --port 5000 --token TOKEN --web 0",
    ),
}
app = group(
    "A robot controller whose references clients and a controller of yours overwrite every 4 ms.", PLACES
)
