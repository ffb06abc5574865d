"""The command line. It alone joins the parts of the toolkit; each command imports what it needs."""

from importlib.metadata import version as version_of
from typing import Annotated

import typer

from gantrytau.commands.printing.command_group import group

PLACES = {  # name -> module, example
    "doctor": ("doctor.doctor_command", "gantrytau doctor --json"),
    "demo": ("demo.demo_command", "gantrytau demo --output pictures"),
    "check": ("check_command", "gantrytau check 'GantryTau(D1)'"),
    "simulate": (
        "simulate_command",
        "gantrytau simulate Pendulum --stop 10 --set x.start=0.5 --plot x,y --to swing.png",
    ),
    "linearize": (
        "linearize_command",
        "gantrytau linearize 'GantryTau(L1)' --outputs tool.r --plot bode.png --output system.json",
    ),
    "study": (
        "study_command",
        "gantrytau study --example > swings.toml && gantrytau study swings.toml --plot x",
    ),
    "calibrate": (
        "calibrate.calibrate_command",
        "gantrytau calibrate measurements.csv --robot 'GantryTau(L1)' --set arms[0].length=1.52",
    ),
    "identify": (
        "identify.identify_command",
        "gantrytau identify log.csv --robot 'GantryTau(L1)' --fixed link_masses=0",
    ),
    "estimate": (
        "estimate.estimate_command",
        "gantrytau estimate --example > swing.toml; gantrytau estimate swing.toml --plot fit.png",
    ),
    "learn": (
        "learn.learn_command",
        "gantrytau learn --example > rig.toml && gantrytau learn rig.toml --output learnt",
    ),
    "optimize": (
        "optimize_command",
        "gantrytau optimize move.py:Fastest --set cart.m=2.5 --plot cart.f --to force.png",
    ),
    "pareto": (
        "pareto_command",
        "gantrytau pareto move.py:Fastest --values 0.001,0.01,0.1 --along final_time --plot curve.png",
    ),
    "equations": (
        "equations_command",
        "gantrytau equations GantryTau --given tool.r --find carts[0].s,carts[1].s,carts[2].s",
    ),
    "view": ("view_command", "gantrytau view 'GantryTau(L1)' --pose 'tool.r=[0.5, 3, -0.6]' -o robot.html"),
    "browse": (
        "browse_command",
        "gantrytau simulate Pendulum --output swing.nc && gantrytau browse swing.nc",
    ),
    "library": ("library_command", "gantrytau library --json"),
    "describe": ("describe_command", "gantrytau describe Revolute"),
    "new": ("new", ""),
    "fmu": ("fmu", ""),
    "controller": ("controller", ""),
    "vision": ("vision", ""),
}

app = group(
    "Acausal models of parallel robots: simulate, optimise, calibrate, identify, learn, export.", PLACES
)


def _tell(wanted: bool) -> None:
    if wanted:
        typer.echo(f"gantrytau {version_of('gantrytau')}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_tell, is_eager=True)
    ] = False,
) -> None:
    """Acausal models of parallel robots: simulate, optimise, calibrate, identify, learn, export."""
