"""`gantrytau view`: a model in a pose, or the motion of a result that was saved, as a page for any browser."""

from pathlib import Path
from typing import Annotated, Any

import typer

import gantrytau
from gantrytau import animate, translate
from gantrytau.border import source_of
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json, ModelName, PrototypeName, Settings
from gantrytau.commands.arguments.saved_results import read_result
from gantrytau.commands.arguments.values import check_names, pairs
from gantrytau.commands.printing.reporting import (
    CommandError,
    answered,
    busy,
    reporting,
    writable_place,
    written,
)


@serves(animate, speed="Seconds of the motion in one second, with --result.")
def view(
    model: ModelName,
    speed: float,
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
            help="Show this motion of the model, saved by simulate or optimize. Repeatable: side by side.",
            show_default=False,
        ),
    ] = None,
    slider: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME[=LOW..HIGH]",
            help="A slider that moves a variable or a parameter, as 'crank.phi=-90 deg..90 deg'. Repeatable.",
            show_default=False,
        ),
    ] = None,
    live: Annotated[
        bool,
        typer.Option("--live", help="Serve the page and compute each pose as it is asked for, until Ctrl-C."),
    ] = False,
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
    with reporting(json, source_of(model)):
        _check_together(pose, result, slider, live, output, json)
        writable_place("--output", output, ".html", ".htm")
        page: Any
        motions = [read_result(file, "--result") for file in result or ()]
        values = pairs("--pose", pose)
        chosen = build(model, prototype, set_ or ())
        with busy(f"translating {chosen.name}"):
            dae = translate(chosen.model, events=True)
        check_names("--pose", values, dae.expand)
        ranges = dict(_range(text) for text in slider or ())
        check_names("--slider", ranges, dae.expand)
        if motions:
            names = [motion.title for motion in motions] if len(motions) > 1 else None
            page = animate(motions, model=dae, speed=speed, names=names)
        elif live:
            _serve(gantrytau.view(dae, values, sliders=ranges or None, live=True))
            return
        else:
            with busy(f"posing {chosen.name}"):
                page = gantrytau.view(dae, values, sliders=ranges or None)
        files = written(output or Path(f"{chosen.name}.html"), page.save)
        record = {**chosen.record("model"), "file": files[0], "bytes": len(page.text.encode())}
        answered(json, record, None, files)


def _check_together(pose: Any, result: Any, slider: Any, live: bool, output: Any, json: bool) -> None:
    """CommandError for two options that exclude each other."""
    for one, other, first, second, why in (
        (pose, result, "--pose", "--result", "a motion has poses of its own"),
        (slider, result, "--slider", "--result", "a motion has no sliders"),
        (live, result, "--live", "--result", "a motion has no sliders"),
        (live, output, "--live", "--output", "a live page is no file"),
        (live, json, "--live", "--json", "a live page is no file"),
    ):
        if one and other:
            raise CommandError(f"found {first} and {second}, expected one of them; {why}")


def _range(text: str) -> tuple[str, tuple[str, str] | None]:
    """Name and range of a slider, `crank.phi=-90 deg..90 deg` or `crank.phi`."""
    name, told, limits = (part.strip() for part in text.partition("="))
    if not told:
        return name, None
    low, between, high = (part.strip() for part in limits.partition(".."))
    if not between:
        raise CommandError(
            f"--slider {text}: found {limits}, expected LOW..HIGH, as '0.1..0.5' or '-90 deg..90 deg'"
        )
    return name, (low, high)


def _serve(page: Any) -> None:
    typer.echo(f"Served at {page.url} until Ctrl-C")
    page.show()
    page.wait()
