"""`gantrytau demo`: the minimum-time motions of the thesis, solved, drawn and set beside its table."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from gantrytau import GantryTauError, SolveError
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.demo.motion_figures import draw_paths, draw_six_links, draw_torques
from gantrytau.commands.demo.thesis_table import (
    BRANCH,
    BRANCH_TITLE,
    ROWS,
    SIX_LINK,
    SIX_LINK_TITLE,
    STARTS,
    WHICH,
    WHY,
    figures,
    summary,
    table,
)
from gantrytau.commands.printing.reporting import FAULT, INTERRUPTED, MISUSE, as_json

if TYPE_CHECKING:
    from rich.console import Console

    from gantrytau_optimica import Optimum

UNFINISHED = "unfinished.csv"
ACCURACY = 1e-3  # relative, to which motions are refined: limits hold between the nodes, inputs do not ring


def demo(
    output: Annotated[Path, typer.Option(help="Folder for pictures and trajectories.")] = Path("demo-output"),
    friction: Annotated[
        Literal["tanh", "linear"], typer.Option(help="How the sign of a speed is smoothed in friction.")
    ] = "tanh",
    json: Json = False,
) -> None:
    """Solve the minimum-time motions of thesis Table 3.1, and one of a robot with six links; draw them."""
    from rich.console import Console

    from gantrytau.commands.demo.motion_problems import FORCE, LIMIT

    screen = Console(stderr=json)
    try:
        output.mkdir(parents=True, exist_ok=True)
        (output / UNFINISHED).unlink(missing_ok=True)
    except OSError as error:
        screen.print(f"Cannot write into {output}: {error.strerror}; name another folder with --output")
        raise typer.Exit(MISUSE) from None
    try:
        optima, seconds = _solve(screen, friction)
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
    summaries = [summary(row, optima[row.key], seconds[row.key]) for row in ROWS]
    more = [
        {
            **figures(BRANCH_TITLE, optima[BRANCH], seconds[BRANCH]),
            "energy": optima[BRANCH].integral("square"),
        },
        figures(SIX_LINK_TITLE, optima[SIX_LINK], seconds[SIX_LINK]),
    ]
    files = [output / "paths.png", output / "torques.png", output / "six_link.png"]
    with screen.status("drawing"):
        draw_paths(optima, files[0])
        draw_torques(optima, LIMIT, files[1])
        draw_six_links(optima[SIX_LINK], FORCE, files[2])
        for key, optimum in optima.items():
            files.append(output / f"{key}.csv")
            save_trajectory(optimum, files[-1])
    if json:
        found = {"rows": summaries, "more": more, "why": WHY, "files": [str(file) for file in files]}
        typer.echo(as_json(found))
        return
    screen.print(table([*summaries, *more]))
    screen.print(WHY, soft_wrap=True)
    screen.print(WHICH, soft_wrap=True)
    for row, optimum in zip([*summaries, *more], optima.values(), strict=True):
        if not row["refined"]:
            screen.print(f"{row['row']}: {optimum.refinement}", markup=False, soft_wrap=True)
    screen.print(f"Pictures and trajectories are in {output}/: {', '.join(file.name for file in files)}")


def save_trajectory(optimum: "Optimum", file: Path) -> None:
    """The motion as CSV: tool, carts, forces and, where motors stand in the model, torques over time."""
    carts = [f"robot.carts[{k}].{name}" for k in range(3) for name in ("s", "v", "f", "friction")]
    torques = ["torque"] if "torque[0]" in optimum.result else []
    optimum.result.select(["robot.tool.r", "robot.tool.v", *carts, *torques]).save(file)


def _solve(screen: "Console", friction: str) -> "tuple[dict[str, Optimum], dict[str, float]]":
    """All motions, with progress on the screen, and the seconds that each took."""
    from gantrytau.commands.demo.motion_problems import FreePath, OnLine, SixLinks, robots
    from gantrytau_optimica import optimize

    free, line, six = ({"robot": robot} for robot in robots(friction))
    motions: list[tuple[str, str, Any, dict[str, Any]]] = [
        (
            row.key,
            row.title,
            OnLine(weight=row.weight, **line) if row.line else FreePath(weight=row.weight, **free),
            {},
        )
        for row in ROWS
    ]
    motions.append((BRANCH, BRANCH_TITLE, FreePath(**free), {"starts": STARTS}))
    motions.append((SIX_LINK, SIX_LINK_TITLE, SixLinks(**six), {"elements": 20}))
    optima: dict[str, Optimum] = {}
    seconds: dict[str, float] = {}
    with screen.status("translating the robot") as status:

        def reporter(title: str) -> Callable[[int, float], None]:
            return lambda iteration, cost: status.update(f"{title}: iteration {iteration}, cost {cost:.4f}")

        for key, title, problem, policy in motions:
            status.update(f"{title}: translating and building")
            begun = time.perf_counter()
            optima[key] = optimize(problem, refine=ACCURACY, progress=reporter(title), **policy)
            seconds[key] = time.perf_counter() - begun
            screen.print(f"solved {title}: T = {optima[key].final_time:.5f} s")
    return optima, seconds
