"""`gantrytau optimize`: an optimal-control problem solved, its answer as figures, files and pictures."""

from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import typer

import gantrytau_optimica
from gantrytau import FlatModel, GantryTauError, SolveError, flatten
from gantrytau.border import listed, source_of
from gantrytau.commands.arguments import solver_options
from gantrytau.commands.arguments.display_option import Displayed, check_display, displayed
from gantrytau.commands.arguments.model_choice import PROBLEM, Chosen, build
from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json, Plotted, PrototypeName, Quiet, Saved, Settings, To
from gantrytau.commands.arguments.problem_name import ProblemName
from gantrytau.commands.arguments.saved_results import FORMATS, read_result
from gantrytau.commands.arguments.values import check_names
from gantrytau.commands.printing import optimum_summary, picture_output, result_output
from gantrytau.commands.printing.reporting import (
    FAULT,
    INTERRUPTED,
    MISUSE,
    answered,
    busy,
    fail,
    note,
    reporting,
)
from gantrytau.commands.printing.spelling import spelled
from gantrytau_optimica import Optimum


@serves(
    gantrytau_optimica.optimize,
    **solver_options.OPTIONS,
    refine=solver_options.REFINE,
    starts=solver_options.STARTS,
    compile=solver_options.COMPILE,
)
def optimize(
    problem: ProblemName,
    guess: solver_options.Guess = None,
    plot: Plotted = None,
    to: To = None,
    display: Displayed = None,
    save: Saved = None,
    quiet: Quiet = False,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
    **policy: Any,
) -> None:
    """Solve an optimal-control problem, and print what was found and which limits it reaches.

    Ctrl-C stops early; with --save what was reached until then is kept, and --guess goes on from there.
    """
    with reporting(json, source_of(problem), solver_options.NAMES):
        drawn, units = listed(plot), displayed(display)
        place = picture_output.place(drawn, to)
        result_output.rehearse(save)
        start = None if guess is None else read_result(guess)
        chosen = build(problem, prototype, set_ or (), PROBLEM)
        flat = flatten(chosen.model)
        check_names("--plot", drawn, flat.expand)
        check_display(units, flat, drawn)
        model: Any = chosen.model
        try:
            with busy(chosen.name, quiet):
                optimum = gantrytau_optimica.optimize(model, guess=start, **policy)
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


def _answer(optimum: Optimum, chosen: Chosen, flat: FlatModel, wanted: Wanted) -> None:
    """Files first, then the report; Ctrl-C in between costs no file."""
    files: list[str] = []
    try:
        wrong = _written(optimum, wanted, files)
        refinement = optimum.refinement
        missed = str(refinement) if refinement is not None and not refinement.reached else ""
        message = "\n".join(words for words in (wrong, missed) if words)
        record = optimum_summary.summary(chosen, optimum) | ({"error": message} if message else {})
        answered(wanted.json, record, lambda: optimum_summary.show(optimum, flat), files)
    except KeyboardInterrupt:
        if wanted.save is not None and not files:
            with suppress(KeyboardInterrupt, GantryTauError):  # pressed once more, it is written nevertheless
                files += result_output.save(optimum, wanted.save)
        words = f"; written: {', '.join(files)}" if files else "; nothing was written"
        fail(f"Interrupted{words}", INTERRUPTED, wanted.json)
    if message:
        note(message)
        raise typer.Exit(MISUSE if wrong else FAULT)


def _written(optimum: Optimum, wanted: Wanted, files: list[str]) -> str:
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
    message, files = spelled(error), []
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
    code = INTERRUPTED if pressed else FAULT
    if not json:
        fail(message, code, json)
    note(message)
    fail(message, code, json, **optimum_summary.summary(chosen, optimum), files=files)
