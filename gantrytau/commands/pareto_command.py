"""`gantrytau pareto`: a problem solved for several values of a weight, as one curve: time against energy."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gantrytau import flatten
from gantrytau.border import listed, source_of
from gantrytau.commands.arguments import solver_options
from gantrytau.commands.arguments.model_choice import Kind, build
from gantrytau.commands.arguments.options import Json, Picture, PrototypeName, Settings
from gantrytau.commands.arguments.problem_name import ProblemName
from gantrytau.commands.arguments.saved_results import read_result
from gantrytau.commands.printing import picture_output
from gantrytau.commands.printing.reporting import (
    FAULT,
    CommandError,
    as_json,
    note,
    refusing,
    reporting,
    writable,
    writable_place,
)
from gantrytau.commands.printing.solver_line import live
from gantrytau.commands.printing.spelling import Spelling

if TYPE_CHECKING:
    from gantrytau_optimica import TradeOff

SPELLING = Spelling(
    ("pareto",),
    {
        **solver_options.SPELLING.options,
        "weight": "--weight",
        "parameters": "--weight",
        "values": "--values",
        "along": "--along",
    },
    exactly=solver_options.SPELLING.exactly,
)


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
    elements: solver_options.Elements = 50,
    points: solver_options.Points = 3,
    scheme: solver_options.Scheme = "radau",
    tolerance: solver_options.Tolerance = 1e-8,
    max_iterations: solver_options.MaxIterations = 1000,
    max_time: solver_options.MaxTime = 300.0,
    guess: solver_options.Guess = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Save the table: .csv.", show_default=False)
    ] = None,
    plot: Picture = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
) -> None:
    """Solve a problem for several weights, and show what is gained in one quantity for what is lost in another.

    As time against energy. Each value starts from the answer of the one before; a value that is not reached is told.
    """
    from gantrytau_optimica import Optimization
    from gantrytau_optimica import pareto as solved

    with reporting(json, source_of(problem), SPELLING):
        numbers, quantities = _numbers(values), dict(_quantity(text) for text in along or ())
        writable_place("--output", output, ".csv")
        if plot is not None:
            picture_output.rehearse(plot, "--plot")
        policy: dict[str, Any] = dict(elements=elements, points=points, scheme=scheme, tolerance=tolerance)
        policy |= dict(max_iterations=max_iterations, max_time=max_time)
        if guess is not None:
            policy["guess"] = read_result(guess)
        kind = Kind(Optimization, "problem", "move.py:Fastest")
        chosen = build(problem, prototype, set_ or (), kind)
        model: Any = chosen.model
        with refusing(f"--weight {weight}: "):
            flatten(model).expand(weight)
        with live(chosen.name, quiet) as progress:
            found = solved(model, weight, numbers, along=quantities or None, progress=progress, **policy)
        files = []
        if output is not None:
            with writable(output):
                files.append(str(found.save(output)))
        if plot is not None:
            files += picture_output.shown(lambda file: found.plot(file=file), plot)
        if json:
            typer.echo(as_json({**_summary(chosen.name, found), "files": files}))
        else:
            typer.echo(found.report())
            for file in files:
                typer.echo(f"Written: {file}")
        if found.failures:
            if not json:
                note(f"{len(found.failures)} of {len(numbers)} values were not solved")
            raise typer.Exit(FAULT)


def _numbers(text: str) -> list[float]:
    found = []
    for word in listed([text]):
        try:
            found.append(float(word))
        except ValueError:
            raise CommandError(
                f"--values {text}: found '{word}', expected numbers separated by commas, as 0.001,0.01,0.1"
            ) from None
    if not found:
        raise CommandError("--values: found none, expected numbers separated by commas, as 0.001,0.01,0.1")
    return found


def _quantity(text: str) -> tuple[str, str]:
    label, sign, quantity = (part.strip() for part in text.partition("="))
    if not label or (sign and not quantity):
        raise CommandError(
            f"--along {text}: expected a quantity, as final_time, or a label for it, as 'energy=integral(square)'"
        )
    return label, quantity or label


def _summary(name: str, found: "TradeOff") -> dict[str, Any]:
    return {
        "problem": name,
        "weight": found.weight,
        "weights": found.weights.tolist(),
        "quantities": {label: column.tolist() for label, column in found.quantities.items()},
        "units": found.units,
        "objective": [point.objective for point in found.points],
        "iterations": found.iterations,
        "failures": {f"{weight:g}": words for weight, words in found.failures.items()},
        "findings": list(found.findings),
    }
