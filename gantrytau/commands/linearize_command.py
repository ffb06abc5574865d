"""`gantrytau linearize`: the linear system that a model is close to a pose, its poles, and a Bode picture."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

import gantrytau
from gantrytau import Linearization
from gantrytau.border import listed, source_of
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.option import serves
from gantrytau.commands.arguments.options import Json, ModelName, Picture, PrototypeName, Settings
from gantrytau.commands.arguments.values import pairs
from gantrytau.commands.printing import picture_output
from gantrytau.commands.printing.reporting import (
    answered,
    busy,
    print_table,
    reporting,
    writable_place,
    written,
)


@serves(
    gantrytau.linearize,
    steady="Look for a point at rest, where --at holds.",
    period=typer.Option(help="From sample to sample, in s, with inputs held.", show_default="continuous"),
)
def linearize(
    model: ModelName,
    at: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Value of a variable at the operating point, as 'tool.r=[0.5, 3, -0.6]'. Repeatable.",
            show_default="as it starts",
        ),
    ] = None,
    inputs: Annotated[
        list[str] | None,
        typer.Option(metavar="NAMES", help="Inputs, separated by commas.", show_default="all"),
    ] = None,
    outputs: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAMES",
            help="Outputs, separated by commas: any variables, or derivatives as der(x).",
            show_default="the model's, else its states",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Save it: .json, .npz (NumPy) or .csv.", show_default=False),
    ] = None,
    plot: Picture = None,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
    **policy: Any,
) -> None:
    """Linearize a model about an operating point: A, B, C, D, and poles with their damping and Hz.

    dx' = A dx + B du and dy = C dx + D du, in SI units. --plot draws gain and phase over frequency.
    """
    with reporting(json, source_of(model), {"parameters": "--set"}):
        writable_place("--output", output, ".json", ".npz", ".csv")
        picture_output.rehearse(plot, "--plot")
        policy |= {"inputs": inputs and listed(inputs), "outputs": outputs and listed(outputs)}
        point = pairs("--at", at)
        chosen = build(model, prototype, set_ or ())
        with busy(f"linearizing {chosen.name}"):
            found = gantrytau.linearize(chosen.model, at=point, **policy)
        files = [*written(output, found.save), *picture_output.shown(found.plot_bode, plot)]
        record = {**chosen.record("model"), **found.record(), "at": _point(found)}
        answered(json, record, lambda: _show(found), files)


def _point(found: Linearization) -> dict[str, float]:
    """The states and inputs at the operating point; what is sampled is told where the point knows it."""
    names = (*found.states, *found.inputs, *found.outputs)
    return {name: float(found.point[name]) for name in names if name in found.point}


def _show(found: Linearization) -> None:
    """Matrices in blocks of columns that fit the terminal, and a table of poles."""
    from rich.console import Console

    every = "" if found.period is None else f", every {found.period:g} s"
    typer.echo(f"{found.model}, linear about its operating point{every}")
    for line in _blocks(found, Console().width):
        typer.echo(line)
    if not found.states:
        typer.echo("It has no states, hence no poles.")
        return
    rows = []
    for pole in found.record()["poles"]:
        sign = f" {'+' if pole['imaginary'] > 0 else '-'} {abs(pole['imaginary']):.6g}j"
        value = f"{pole['real']:.6g}" + (sign if pole["imaginary"] else "")
        rows.append((value, f"{pole['hertz']:.5g}", f"{pole['damping'] + 0.0:.4g}"))  # no -0
    first = "pole [1/s]" if found.period is None else "pole of z"
    print_table((first, "Hz", "damping"), rows, right=(0, 1, 2))


def _blocks(found: Linearization, width: int) -> Iterator[str]:
    """[A B; C D] as lines of at most `width` letters, if each column fits by itself."""
    after = "der({})" if found.period is None else "{} a sample later"
    rows = [*(after.format(name) for name in found.states), *found.outputs]
    columns = [*found.states, *found.inputs]
    matrix = np.block([[found.A, found.B], [found.C, found.D]])
    first = max((len(name) for name in rows), default=0)
    widths = [max(len(name), 11) + 2 for name in columns]
    begin = 0
    while begin < len(columns):
        end = begin + 1
        while end < len(columns) and first + sum(widths[begin : end + 1]) <= width:
            end += 1
        yield ""
        chosen = range(begin, end)
        yield " " * first + "".join(f"{columns[k]:>{widths[k]}}" for k in chosen)
        for name, row in zip(rows, matrix, strict=True):
            yield f"{name:<{first}}" + "".join(f"{row[k]:>{widths[k]}.5g}" for k in chosen)
        begin = end
