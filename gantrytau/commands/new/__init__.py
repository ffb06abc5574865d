"""`gantrytau new`: something of your own to begin with."""

import typer

from gantrytau.commands.new.new_robot import robot

app = typer.Typer(help="Write a project of your own to begin with.", no_args_is_help=True)


@app.callback()
def options() -> None:
    """Write a project of your own to begin with."""


app.command(epilog="Example: gantrytau new robot my_robot && cd my_robot && python -m pytest")(robot)
