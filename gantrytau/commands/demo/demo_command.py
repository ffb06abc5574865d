"""`gantrytau demo`: the minimum-time motions of the thesis, solved, drawn and set beside its table."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gantrytau import GantryTauError, SolveError
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.demo.motion_figures import draw_paths, draw_torques
from gantrytau.commands.demo.thesis_table import ROWS, summary, table
from gantrytau.commands.printing.reporting import FAULT, INTERRUPTED, MISUSE, as_json

if TYPE_CHECKING:
    from rich.console import Console

    from gantrytau_optimica import Optimum

UNFINISHED = "unfinished.csv"


def demo(
    output: Annotated[Path, typer.Option(help="Folder for pictures and trajectories.")] = Path("demo-output"),
    json: Json = False,
) -> None:
    """Solve the minimum-time motions of thesis Table 3.1 and draw its Figures 3.9 and 3.10."""
    from rich.console import Console

    from gantrytau.commands.demo.motion_problems import LIMIT

    screen = Console(stderr=json)
    try:
        output.mkdir(parents=True, exist_ok=True)
        (output / UNFINISHED).unlink(missing_ok=True)
    except OSError as error:
        screen.print(f"Cannot write into {output}: {error.strerror}; name another folder with --output")
        raise typer.Exit(MISUSE) from None
    try:
        optima = _solve_rows(screen)
    except SolveError as error:
        screen.print(str(error), markup=False)
        if error.optimum is not None:
            partial = output / UNFINISHED
            save_trajectory(error.optimum, partial)
            screen.print(f"The unfinished trajectory is in {partial}")
        raise typer.Exit(INTERRUPTED if error.interrupted else FAULT) from None
    except GantryTauError as error:
        screen.print(str(error), markup=False)
        raise typer.Exit(FAULT) from None
    except KeyboardInterrupt:
        screen.print("Interrupted; no files were written")
        raise typer.Exit(INTERRUPTED) from None
    summaries = [summary(row, optima[row.key]) for row in ROWS]
    files = [output / "paths.png", output / "torques.png"]
    with screen.status("drawing"):
        draw_paths(optima, files[0])
        draw_torques(optima, LIMIT, files[1])
        for key, optimum in optima.items():
            files.append(output / f"{key}.csv")
            save_trajectory(optimum, files[-1])
    if json:
        typer.echo(as_json({"rows": summaries, "files": [str(file) for file in files]}))
        return
    screen.print(table(summaries))
    screen.print(f"Pictures and trajectories are in {output}/: {', '.join(file.name for file in files)}")


def save_trajectory(optimum: "Optimum", file: Path) -> None:
    """The motion as CSV: tool, carts, forces and torques over time."""
    carts = [f"robot.carts[{k}].{name}" for k in range(3) for name in ("s", "v", "f", "friction")]
    optimum.result.select(["robot.tool.r", "robot.tool.v", *carts, "torque"]).save(file)


def _solve_rows(screen: "Console") -> "dict[str, Optimum]":
    """The four motions, with progress on the screen."""
    from gantrytau.commands.demo.motion_problems import FreePath, OnLine
    from gantrytau_optimica import optimize

    optima: dict[str, Optimum] = {}
    with screen.status("translating the robot") as status:

        def reporter(title: str) -> Callable[[int, float], None]:
            return lambda iteration, objective: status.update(
                f"{title}: iteration {iteration}, cost {objective:.4f}"
            )

        for row in ROWS:
            status.update(f"{row.title}: translating and building")
            problem = (OnLine if row.line else FreePath)(weight=row.weight)
            optima[row.key] = optimize(problem, progress=reporter(row.title))
            screen.print(f"solved {row.title}: T = {optima[row.key].final_time:.5f} s")
    return optima
