"""What `gantrytau optimize` prints of an optimum."""

import platform
from dataclasses import asdict
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import typer

from gantrytau import FlatModel, in_unit
from gantrytau.commands.arguments.model_choice import Chosen

if TYPE_CHECKING:
    from gantrytau_optimica import Optimum


def summary(chosen: Chosen, optimum: "Optimum") -> dict[str, Any]:
    """The optimum as a record for programs; times of the work in s."""
    return {
        **chosen.record("problem"),
        "success": optimum.success,
        "status": optimum.status,
        "objective": optimum.objective,
        "final_time": optimum.final_time,
        "free": optimum.free,
        "refinement": _refinement(optimum),
        "iterations": optimum.iterations,
        "seconds": {"build": optimum.build_time, "solve": optimum.solve_time},
        "versions": {
            "gantrytau": version("gantrytau"),
            "casadi": version("casadi"),
            "python": platform.python_version(),
        },
        "report": optimum.report().splitlines(),
    }


def _refinement(optimum: "Optimum") -> dict[str, Any] | None:
    """Whether the accuracy asked for was reached, and the rounds; None where none was asked for."""
    found = optimum.refinement
    if found is None:
        return None
    named = {"accuracy": found.accuracy, "reached": found.reached, "stopped": found.stopped or None}
    return {**named, "rounds": [asdict(one) for one in found.rounds], "kept": found.kept}


def show(optimum: "Optimum", flat: FlatModel) -> None:
    """The report, and the free numbers with their units."""
    typer.echo(optimum.report())
    if optimum.free:
        typer.echo("Free numbers:")
    for name, value in optimum.free.items():
        quantity = next(
            (q for q in (*flat.parameters, *flat.variables) if name in (q.name, *q.elements)), None
        )
        unit = quantity.unit if quantity and quantity.unit not in (None, "1") else ""
        if quantity and quantity.display:
            value, unit = in_unit(value, quantity.display), quantity.display
        words = f" ({quantity.description})" if quantity and quantity.description else ""
        typer.echo(f"  {name} = {value:.8g} {unit}".rstrip() + words)
    typer.echo(f"Built in {optimum.build_time:.2f} s, solved in {optimum.solve_time:.2f} s")
