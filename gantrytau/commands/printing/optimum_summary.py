"""What `gantrytau optimize` prints of an optimum."""

import platform
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import typer

from gantrytau.commands.arguments.model_choice import Chosen
from gantrytau.commands.printing.reporting import CommandError
from gantrytau.errors import ModelError
from gantrytau.language.symbols import split_derivative

if TYPE_CHECKING:
    from gantrytau.flattening.flat_model import FlatModel
    from gantrytau.results.result import Result


def summary(chosen: Chosen, optimum: Any, files: list[str]) -> dict[str, Any]:
    """The optimum as a record for programs; times of the work in s."""
    return {
        "problem": chosen.name,
        "prototype": chosen.prototype,
        "success": optimum.success,
        "status": optimum.status,
        "objective": optimum.objective,
        "final_time": optimum.final_time,
        "free": optimum.free,
        "iterations": optimum.iterations,
        "seconds": {"build": optimum.build_time, "solve": optimum.solve_time},
        "versions": {
            "gantrytau": version("gantrytau"),
            "casadi": version("casadi"),
            "python": platform.python_version(),
        },
        "report": optimum.report().splitlines(),
        "files": files,
    }


def show(optimum: Any, flat: "FlatModel", files: list[str]) -> None:
    """The report, the free numbers with their units, and the files."""
    typer.echo(optimum.report())
    if optimum.free:
        typer.echo("Free numbers:")
    for name, value in optimum.free.items():
        quantity = next(
            (q for q in (*flat.parameters, *flat.variables) if name in (q.name, *q.elements)), None
        )
        unit = quantity.unit if quantity and quantity.unit not in (None, "1") else ""
        words = f" ({quantity.description})" if quantity and quantity.description else ""
        typer.echo(f"  {name} = {value:.8g} {unit}".rstrip() + words)
    typer.echo(f"Built in {optimum.build_time:.2f} s, solved in {optimum.solve_time:.2f} s")
    for file in files:
        typer.echo(f"Written: {file}")


def selected(optimum: Any, names: tuple[str, ...]) -> "Result":
    """The variables to draw as a result: derivatives and free numbers, too.

    CommandError for a derivative that the equations do not determine, as that of an input.
    """
    from gantrytau.results.result import Result
    from gantrytau.simulation.to_result import labels

    elements = [element for name in names for element in optimum.dae.expand(name)]
    units, words = labels(optimum.dae)
    values = {element: _values(optimum, element) for element in elements if element != "time"}
    return Result(optimum.time, values, units=units, descriptions=words, title=optimum.result.title)


def _values(optimum: Any, name: str) -> Any:
    try:
        return optimum[name]
    except ModelError as error:  # of derivatives that the problem does not hold
        raise CommandError(
            f"--plot {name}: the equations do not determine this derivative; draw '{split_derivative(name)[0]}'"
        ) from error
