"""The command line. It alone joins the parts of the toolkit; each command imports what it needs."""

from importlib.metadata import version as version_of
from typing import Annotated

import typer

from gantrytau.commands import controller, fmu, new, vision
from gantrytau.commands.calibrate.calibrate_command import calibrate
from gantrytau.commands.check_command import check
from gantrytau.commands.demo.demo_command import demo
from gantrytau.commands.doctor.doctor_command import doctor
from gantrytau.commands.equations_command import equations
from gantrytau.commands.estimate.estimate_command import estimate
from gantrytau.commands.identify.identify_command import identify
from gantrytau.commands.learn.learn_command import learn
from gantrytau.commands.library_command import describe, library
from gantrytau.commands.linearize_command import linearize
from gantrytau.commands.optimize_command import optimize
from gantrytau.commands.pareto_command import pareto
from gantrytau.commands.printing.reporting import Commands
from gantrytau.commands.simulate_command import simulate
from gantrytau.commands.study_command import study
from gantrytau.commands.view_command import view

app = typer.Typer(
    cls=Commands,
    help="Acausal models of parallel robots: simulate, optimise, calibrate, identify, learn, export.",
    no_args_is_help=True,
    pretty_exceptions_show_locals=False,
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


app.command(epilog="Example: gantrytau doctor --json")(doctor)
app.command(epilog="Example: gantrytau demo --output pictures")(demo)
app.command(epilog="Example: gantrytau check 'GantryTau(D1)'")(check)
app.command(
    epilog="Example: gantrytau simulate Pendulum --stop 10 --set x.start=0.5 --plot x,y --to swing.png"
)(simulate)
app.command(
    epilog="Example: gantrytau linearize 'GantryTau(L1)' --outputs tool.r --plot bode.png --output system.json"
)(linearize)
app.command(
    epilog="Example: gantrytau study --example > swings.toml && gantrytau study swings.toml --plot x"
)(study)
app.command(
    epilog="Example: gantrytau calibrate measurements.csv --robot 'GantryTau(L1)' --set arms[0].length=1.52"
)(calibrate)
app.command(epilog="Example: gantrytau identify log.csv --robot 'GantryTau(L1)' --fixed link_masses=0")(
    identify
)
app.command(
    epilog="Example: gantrytau estimate --example > swing.toml; gantrytau estimate swing.toml --plot fit.png"
)(estimate)
app.command(
    epilog="Example: gantrytau learn --example > rig.toml && gantrytau learn rig.toml --output learnt"
)(learn)
app.command(
    epilog="Example: gantrytau optimize move.py:Fastest --set cart.m=2.5 --plot cart.f --to force.png"
)(optimize)
app.command(
    epilog="Example: gantrytau pareto move.py:Fastest --values 0.001,0.01,0.1 --along final_time --plot curve.png"
)(pareto)
app.command(
    epilog="Example: gantrytau equations GantryTau --given tool.r --find carts[0].s,carts[1].s,carts[2].s"
)(equations)
app.command(epilog="Example: gantrytau view 'GantryTau(L1)' --pose 'tool.r=[0.5, 3, -0.6]' -o robot.html")(
    view
)
app.command(epilog="Example: gantrytau library --json")(library)
app.command(epilog="Example: gantrytau describe Revolute")(describe)
app.add_typer(new.app, name="new")
app.add_typer(fmu.app, name="fmu")
app.add_typer(controller.app, name="controller")
app.add_typer(vision.app, name="vision")
