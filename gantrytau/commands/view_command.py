"""`gantrytau view`: a model in a pose, or the motion of a result that was saved, as a page for any browser."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gantrytau.border import source_of
from gantrytau.commands.arguments.model_choice import Chosen, build
from gantrytau.commands.arguments.options import Json, ModelName, PrototypeName, Settings
from gantrytau.commands.arguments.saved_results import read_result
from gantrytau.commands.arguments.values import check_names, number, split
from gantrytau.commands.printing.reporting import (
    CommandError,
    as_json,
    busy,
    reporting,
    writable,
    writable_place,
)
from gantrytau.commands.printing.spelling import Spelling

if TYPE_CHECKING:
    from gantrytau import Dae

SPELLING = Spelling(
    ("view", "animate"),
    {"speed": "--speed", "pose": "--pose"},
    exactly={"without outputs=[...]": "without --outputs"},
)


def view(
    model: ModelName,
    pose: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Value of a variable in the pose, as 'tool.r=[0.5, 3, -0.6]'. Repeatable.",
            show_default="as it starts",
        ),
    ] = None,
    result: Annotated[
        list[Path] | None,
        typer.Option(
            help="Show this motion of the model, saved by simulate or optimize as .csv or .nc. Repeatable: side by side.",
            show_default=False,
        ),
    ] = None,
    speed: Annotated[float, typer.Option(help="Seconds of the motion in one second, with --result.")] = 1.0,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Write this page.", show_default="MODEL.html")
    ] = None,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
) -> None:
    """Write a page that shows a model in a pose or in motion, in any browser and without a network.

    It needs the extra `view`; `gantrytau doctor` says whether that is there, and how to get it.
    """
    with reporting(json, source_of(model), SPELLING):
        if pose and result:
            raise CommandError(
                "found --pose and --result, expected one of them; a motion has poses of its own"
            )
        writable_place("--output", output, ".html", ".htm")
        motions = [read_result(file, "--result") for file in result or ()]
        values = {
            name: number("--pose", name, value) for name, value in (split("--pose", p) for p in pose or ())
        }
        chosen = build(model, prototype, set_ or ())
        place = output or Path(f"{chosen.name}.html")
        with busy(f"translating {chosen.name}"):
            dae = _translated(chosen)
        check_names("--pose", values, dae.expand)
        page = _page(dae, values, motions, speed)
        with writable(place):
            page.save(place)
        if json:
            size = len(page.text.encode())
            typer.echo(
                as_json(
                    {"model": chosen.name, "prototype": chosen.prototype, "file": str(place), "bytes": size}
                )
            )
        else:
            typer.echo(f"Written: {place}")


def _translated(chosen: Chosen) -> "Dae":
    from gantrytau import translate

    return translate(chosen.model, events=True)


def _page(dae: "Dae", pose: dict[str, Any], motions: list[Any], speed: float) -> Any:
    from gantrytau import animate
    from gantrytau import view as show

    if not motions:
        return show(dae, pose)
    names = [motion.title for motion in motions] if len(motions) > 1 else None
    return animate(motions, model=dae, speed=speed, names=names)
