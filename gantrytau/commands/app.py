"""The command line. It alone joins the parts of the toolkit; each command imports what it needs."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from gantrytau.commands import calibrate, fmu
from gantrytau.commands import check_command as check
from gantrytau.commands import equations_command as equations
from gantrytau.commands import library_command as library
from gantrytau.commands import optimize_command as optimize
from gantrytau.commands import simulate_command as simulate
from gantrytau.commands.printing.reporting import Commands

app = typer.Typer(
    cls=Commands,
    help="Acausal models of parallel robots: simulate, optimise, calibrate, export.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_show_locals=False,
)

INTERRUPTED = 130  # exit code of a program stopped by Ctrl-C
UNFINISHED = "unfinished.csv"


@app.callback()
def main() -> None:
    """Keep commands named even while there are few."""


@app.command()
def doctor(
    json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Check this installation: versions, solvers, compiler, extras."""
    from gantrytau.commands import installation

    findings = installation.examine()
    if json:
        print(installation.as_json(findings))
    else:
        installation.show(findings)
    if any(finding.essential and not finding.good for finding in findings):
        raise typer.Exit(1)


@app.command()
def demo(
    output: Annotated[Path, typer.Option(help="Folder for pictures and trajectories.")] = Path("demo-output"),
    json: Annotated[bool, typer.Option("--json", help="Print the figures as JSON.")] = False,
) -> None:
    """Solve the minimum-time motions of thesis Table 3.1 and draw its Figures 3.9 and 3.10."""
    from json import dumps

    from rich.console import Console

    from gantrytau import GantryTauError, SolveError
    from gantrytau.commands.demo import demonstration

    screen = Console(stderr=json)
    try:
        output.mkdir(parents=True, exist_ok=True)
        (output / UNFINISHED).unlink(missing_ok=True)
    except OSError as error:
        screen.print(f"Cannot write into {output}: {error.strerror}; name another folder with --output")
        raise typer.Exit(2) from None
    try:
        optima = _solve_rows(screen)
    except SolveError as error:
        screen.print(str(error), markup=False)
        if error.optimum is not None:
            partial = output / UNFINISHED
            demonstration.save_trajectory(error.optimum, partial)
            screen.print(f"The unfinished trajectory is in {partial}")
        stopped = error.optimum is not None and error.optimum.status == "interrupted"
        raise typer.Exit(INTERRUPTED if stopped else 1) from None
    except GantryTauError as error:
        screen.print(str(error), markup=False)
        raise typer.Exit(1) from None
    except KeyboardInterrupt:
        screen.print("Interrupted; no files were written")
        raise typer.Exit(INTERRUPTED) from None
    summaries = [demonstration.summary(row, optima[row.key]) for row in demonstration.ROWS]
    files = [output / "paths.png", output / "torques.png"]
    with screen.status("drawing"):
        demonstration.draw_paths(optima, files[0])
        demonstration.draw_torques(optima, motion_problems()[2], files[1])
        for key, optimum in optima.items():
            files.append(output / f"{key}.csv")
            demonstration.save_trajectory(optimum, files[-1])
    if json:
        print(dumps({"rows": summaries, "files": [str(file) for file in files]}, indent=2))
        return
    screen.print(demonstration.table(summaries))
    screen.print(f"Pictures and trajectories are in {output}/: {', '.join(file.name for file in files)}")


app.command(epilog="Example: gantrytau check 'GantryTau(D1)'")(check.check)
app.command(
    epilog="Example: gantrytau simulate Pendulum --stop 10 --set x.start=0.5 --plot x,y --to swing.png"
)(simulate.simulate)
app.command(
    epilog="Example: gantrytau calibrate measurements.csv --robot 'GantryTau(L1)' --set arms[0].length=1.52"
)(calibrate.calibrate)
app.command(
    epilog="Example: gantrytau optimize move.py:Fastest --set cart.m=2.5 --plot cart.f --to force.png"
)(optimize.optimize)
app.command(
    epilog="Example: gantrytau equations GantryTau --given tool.r --find carts[0].s,carts[1].s,carts[2].s"
)(equations.equations)
app.command(epilog="Example: gantrytau library --json")(library.library)
app.add_typer(fmu.app, name="fmu")


def _solve_rows(screen: Any) -> dict[str, Any]:
    """The four motions, with progress on the screen."""
    from gantrytau.commands.demo import demonstration
    from gantrytau_optimica import optimize

    free, line, _ = motion_problems()
    optima: dict[str, Any] = {}
    with screen.status("translating the robot") as status:

        def reporter(title: str) -> Callable[[int, float], None]:
            return lambda iteration, objective: status.update(
                f"{title}: iteration {iteration}, cost {objective:.4f}"
            )

        for row in demonstration.ROWS:
            status.update(f"{row.title}: translating and building")
            problem = (line if row.line else free)(weight=row.weight)
            optima[row.key] = optimize(problem, progress=reporter(row.title))
            screen.print(f"solved {row.title}: T = {optima[row.key].final_time:.5f} s")
    return optima


def motion_problems() -> tuple[Any, Any, float]:
    """The motion from A to B as problems, on a free path and along the straight line, and the torque limit in N.m."""
    from gantrytau import Input, Parameter, Real
    from gantrytau_models import GantryTau, prototypes
    from gantrytau_optimica import Free, Optimization, final, initial

    start, end = (0.0, 2.51, -1.03), (1.711, 3.46, -0.24)  # m
    limit = 6.337  # N.m

    class RobotOnLine(GantryTau):
        """The robot with its tool on the straight line from A to B."""

        def equations(self):
            yield from super().equations()
            share = (self.tool.r[0] - start[0]) / (end[0] - start[0])
            for k in (1, 2):
                yield self.tool.r[k] == start[k] + share * (end[k] - start[k])

    class FreePath(Optimization):
        """Carry the tool from A to B as fast as the motors allow, more gently for w > 0."""

        robot = GantryTau(prototypes.GT_A)
        weight = Parameter(0.0, unit="1/(N2.m2)", description="weight w of the energy")
        gear = Parameter(190.5, unit="1/m", description="force along the guideway per torque of the motor")
        torque = Input(3, unit="N.m", description="motor torque", min=-limit, max=limit)
        square = Real(unit="N2.m2", description="sum of the squared torques")
        final_time = Free(1.0, unit="s", min=0.1, max=5.0, description="duration of the motion")

        def equations(self):
            for k, cart in enumerate(self.robot.carts):
                yield cart.f == self.gear * self.torque[k]
            yield self.square == sum(self.torque[k] ** 2 for k in range(3))

        def objective(self):
            return self.final_time

        def integrand(self):
            return self.weight * self.square

        def constraints(self):
            yield initial(self.robot.tool.r) == start
            yield final(self.robot.tool.r) == end
            yield initial(self.robot.tool.v) == 0
            yield final(self.robot.tool.v) == 0

    class OnLine(FreePath):
        """The same along the straight line: one torque moves the tool, the other two follow from the line."""

        robot = RobotOnLine(prototypes.GT_A)
        given = ("torque[2]",)

    return FreePath, OnLine, limit


if __name__ == "__main__":
    app()
