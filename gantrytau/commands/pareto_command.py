"""`gantrytau pareto`: a problem solved for several values of a weight, as one curve: time against energy."""

from pathlib import Path
from typing import Annotated, Any

import typer

from gantrytau import flatten
from gantrytau.border import listed, source_of
from gantrytau.commands.arguments import solver_options
from gantrytau.commands.arguments.model_choice import PROBLEM, build
from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json, Picture, PrototypeName, Quiet, Settings
from gantrytau.commands.arguments.problem_name import ProblemName
from gantrytau.commands.arguments.saved_results import read_result
from gantrytau.commands.arguments.values import check_names
from gantrytau.commands.printing import picture_output
from gantrytau.commands.printing.reporting import (
    FAULT,
    CommandError,
    answered,
    busy,
    note,
    reporting,
    writable_place,
    written,
)
from gantrytau_optimica import TradeOff
from gantrytau_optimica import optimize as solved_once
from gantrytau_optimica import pareto as solved


@serves(solved_once, **solver_options.OPTIONS)
def pareto(
    problem: ProblemName,
    values: Annotated[
        str,
        typer.Option(
            metavar="NUMBERS", help="Of the weight, separated by commas: 0.001,0.01,0.1.", show_default=False
        ),
    ],
    weight: Annotated[
        str, typer.Option(metavar="NAME", help="The parameter of the problem that is varied.")
    ] = "weight",
    along: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[LABEL=]QUANTITY",
            help="What is compared: final_time, 'energy=integral(square)', 'final(cart.s)', objective. Repeatable.",
            show_default="the objective without its weighed part, and what is weighed",
        ),
    ] = None,
    guess: solver_options.Guess = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Save the table: .csv.", show_default=False)
    ] = None,
    plot: Picture = None,
    quiet: Quiet = False,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
    **policy: Any,
) -> None:
    """Solve a problem for several weights, and show what is gained in one quantity for what is lost in another.

    As time against energy. Each value starts from the answer of the one before; a value that is not reached is told.
    """
    with reporting(json, source_of(problem), {"parameters": "--weight"}):
        numbers, quantities = _numbers(values), dict(_quantity(text) for text in along or ())
        writable_place("--output", output, ".csv")
        picture_output.rehearse(plot, "--plot")
        if guess is not None:
            policy["guess"] = read_result(guess)
        chosen = build(problem, prototype, set_ or (), PROBLEM)
        model: Any = chosen.model
        check_names("--weight", [weight], flatten(model).expand)
        with busy(chosen.name, quiet):
            found = solved(model, weight, numbers, along=quantities or None, **policy)
        files = [*written(output, found.save), *picture_output.shown(found.plot, plot)]
        answered(json, _summary(chosen.name, found), found.report(), files)
        if found.failures:
            if not json:
                note(f"{len(found.failures)} of {len(numbers)} values were not solved")
            raise typer.Exit(FAULT)


def _numbers(text: str) -> list[float]:
    try:
        return [float(word) for word in listed([text])]
    except ValueError:
        raise CommandError(
            f"--values {text}: expected numbers separated by commas, as 0.001,0.01,0.1"
        ) from None


def _quantity(text: str) -> tuple[str, str]:
    label, sign, quantity = (part.strip() for part in text.partition("="))
    if not label or (sign and not quantity):
        raise CommandError(
            f"--along {text}: expected a quantity, as final_time, or a label for it, as 'energy=integral(square)'"
        )
    return label, quantity or label


def _summary(name: str, found: TradeOff) -> dict[str, Any]:
    return {
        "problem": name,
        "weight": found.weight,
        "weights": found.weights,
        "quantities": found.quantities,
        "units": found.units,
        "objective": [point.objective for point in found.points],
        "iterations": found.iterations,
        "failures": {f"{weight:g}": words for weight, words in found.failures.items()},
        "findings": found.findings,
    }
