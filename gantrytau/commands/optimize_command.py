"""`gantrytau optimize`: an optimal-control problem solved, its answer as figures, files and picture_output."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from gantrytau import GantryTauError, SolveError
from gantrytau.border import listed, source_of
from gantrytau.commands.arguments import solver_options
from gantrytau.commands.arguments.display_option import Displayed, check_display, displayed
from gantrytau.commands.arguments.model_choice import Chosen, Kind, build
from gantrytau.commands.arguments.options import Json, Plotted, PrototypeName, Saved, Settings, To
from gantrytau.commands.arguments.problem_name import ProblemName
from gantrytau.commands.arguments.saved_results import FORMATS, read_result
from gantrytau.commands.printing import optimum_summary, picture_output, result_output
from gantrytau.commands.printing.reporting import (
    FAULT,
    INTERRUPTED,
    MISUSE,
    as_json,
    fail,
    note,
    refusing,
    reporting,
)
from gantrytau.commands.printing.solver_line import live

if TYPE_CHECKING:
    from gantrytau import FlatModel
    from gantrytau_optimica import Optimum


def optimize(
    problem: ProblemName,
    elements: solver_options.Elements = 50,
    points: solver_options.Points = 3,
    scheme: solver_options.Scheme = "radau",
    refine: solver_options.Refine = None,
    tolerance: solver_options.Tolerance = 1e-8,
    max_iterations: solver_options.MaxIterations = 1000,
    max_time: solver_options.MaxTime = 300.0,
    starts: solver_options.Starts = None,
    guess: solver_options.Guess = None,
    plot: Plotted = None,
    to: To = None,
    display: Displayed = None,
    save: Saved = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
) -> None:
    """Solve an optimal-control problem, and print what was found and which limits it reaches.

    Ctrl-C stops early; with --save what was reached until then is kept, and --guess goes on from there.
    """
    from gantrytau_optimica import Optimization

    with reporting(json, source_of(problem), solver_options.SPELLING):
        drawn, units = listed(plot), displayed(display)
        place = picture_output.place(drawn, to)
        result_output.rehearse(save)
        policy: dict[str, Any] = dict(elements=elements, points=points, scheme=scheme, tolerance=tolerance)
        policy |= dict(max_iterations=max_iterations, max_time=max_time)
        policy |= {
            name: value for name, value in (("refine", refine), ("starts", starts)) if value is not None
        }
        if guess is not None:
            policy["guess"] = read_result(guess)
        chosen = build(problem, prototype, set_ or (), Kind(Optimization, "problem", "move.py:Fastest"))
        flat = _flat(chosen, drawn)
        check_display(units, flat, drawn)
        try:
            optimum = _solved(chosen, quiet, policy)
        except SolveError as error:
            _leave(error, chosen, save, json)
        _answer(optimum, chosen, flat, Wanted(save, drawn, place, json, units))


@dataclass(frozen=True)
class Wanted:
    """What is wanted of an optimum: a file, pictures of variables and their place, JSON, and in which units."""

    save: Path | None
    drawn: tuple[str, ...]
    place: str | None
    json: bool
    units: Any = None


def _answer(optimum: "Optimum", chosen: Chosen, flat: "FlatModel", wanted: Wanted) -> None:
    """Files first, then the report; Ctrl-C in between costs no file."""
    files: list[str] = []
    try:
        wrong = _written(optimum, wanted, files)
        record = optimum_summary.summary(chosen, optimum, files) if wanted.json else None
        refinement = optimum.refinement
        missed = str(refinement) if refinement is not None and not refinement.reached else ""
        said = "\n".join(words for words in (wrong, missed) if words)
        if record is not None:
            typer.echo(as_json({**record, "error": said} if said else record))
        else:
            optimum_summary.show(optimum, flat, files)
    except KeyboardInterrupt:
        if wanted.save is not None and not files:
            with suppress(KeyboardInterrupt, GantryTauError):  # pressed once more, it is written nevertheless
                result_output.save(optimum, wanted.save)
                files.append(str(wanted.save))
        words = f"; written: {', '.join(files)}" if files else "; nothing was written"
        fail(f"Interrupted{words}", INTERRUPTED, wanted.json)
    if said:
        note(said)
        raise typer.Exit(MISUSE if wrong else FAULT)


def _flat(chosen: Chosen, drawn: tuple[str, ...]) -> "FlatModel":
    """The problem written out, which knows all names; CommandError for one to draw that it does not have."""
    from gantrytau import flatten

    flat = flatten(chosen.model)
    for name in drawn:
        with refusing(f"--plot {name}: "):
            flat.expand(name)
    return flat


def _solved(chosen: Chosen, quiet: bool, policy: dict[str, Any]) -> "Optimum":
    """The optimum; SolveError if none is found."""
    import gantrytau_optimica

    model: Any = chosen.model
    with live(chosen.name, quiet) as progress:
        return gantrytau_optimica.optimize(model, progress=progress, **policy)


def _written(optimum: "Optimum", wanted: Wanted, files: list[str]) -> str:
    """Write the files of a solution, named in `files`; why some are not written, which does not cost the answer."""
    wrong: list[str] = []
    try:
        files += result_output.save(optimum, wanted.save, wanted.units)
    except GantryTauError as error:
        wrong.append(str(error))
    try:
        files += (
            picture_output.draw(optimum, wanted.drawn, wanted.place, wanted.units) if wanted.place else []
        )
    except GantryTauError as error:
        wrong.append(str(error))
    return "\n".join(wrong)


def _leave(error: SolveError, chosen: Chosen, save: Path | None, json: bool) -> NoReturn:
    """Keep what was reached, say why there is no solution, and leave."""
    optimum = error.optimum
    if optimum is None:
        raise error
    pressed = error.interrupted
    message, files = solver_options.SPELLING.of(error), []
    if save is not None and (optimum.success or optimum.iterations > 0):
        kept = save.with_name(f"{save.stem}.unfinished{save.suffix}")  # a solution saved before stays
        try:
            files = result_output.save(optimum, kept)
            message += f"\nWhat was reached until then is in {kept}"
            if kept.suffix.lower() in FORMATS and (
                optimum.success or pressed or "limit reached" in optimum.status
            ):
                message += f"; --guess {kept} goes on from there"
        except GantryTauError as wrong:
            message += f"\nWhat was reached cannot be saved: {wrong}"
    elif pressed:
        message += "\nWith --save what was reached would have been kept"
    if json:
        typer.echo(as_json({**optimum_summary.summary(chosen, optimum, files), "error": message}))
    note(message)
    raise typer.Exit(INTERRUPTED if pressed else FAULT) from None
