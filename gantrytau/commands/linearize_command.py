"""`gantrytau linearize`: the linear system that a model is close to a pose, its poles, and a Bode picture."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gantrytau.border import listed, source_of
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.options import Json, ModelName, Picture, PrototypeName, Settings
from gantrytau.commands.arguments.values import number, split
from gantrytau.commands.printing import picture_output
from gantrytau.commands.printing.reporting import as_json, busy, reporting, writable, writable_place
from gantrytau.commands.printing.spelling import Spelling

if TYPE_CHECKING:
    from gantrytau import Linearization

SPELLING = Spelling(
    ("linearize", "at", "inputs", "outputs"),
    {name: f"--{name}" for name in ("at", "inputs", "outputs", "period")} | {"parameters": "--set"},
    exactly={"linearize about a motion with steady=False": "leave --steady out"}
    | {"leave it out, or linearize with steady=False": "leave it out, or --steady"},
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
    steady: Annotated[
        bool, typer.Option("--steady", help="Look for a point at rest, where --at holds.")
    ] = False,
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
    period: Annotated[
        float | None,
        typer.Option(help="From sample to sample, in s, with inputs held.", show_default="continuous"),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Save it: .json, .npz (NumPy) or .csv.", show_default=False),
    ] = None,
    plot: Picture = None,
    prototype: PrototypeName = None,
    set_: Settings = None,
    json: Json = False,
) -> None:
    """Linearize a model about an operating point: A, B, C, D, and poles with their damping and Hz.

    dx' = A dx + B du and dy = C dx + D du, in SI units. --plot draws gain and phase over frequency.
    """
    import gantrytau

    with reporting(json, source_of(model), SPELLING):
        writable_place("--output", output, ".json", ".npz", ".csv")
        if plot is not None:
            picture_output.rehearse(plot, "--plot")
        point = {name: number("--at", name, value) for name, value in (split("--at", a) for a in at or ())}
        chosen = build(model, prototype, set_ or ())
        with busy(f"linearizing {chosen.name}"):
            found = gantrytau.linearize(
                chosen.model,
                at=point,
                steady=steady,
                inputs=None if inputs is None else listed(inputs),
                outputs=None if outputs is None else listed(outputs),
                period=period,
            )
        files = []
        if output is not None:
            with writable(output):
                files.append(str(found.save(output)))
        if plot is not None:
            files += picture_output.shown(lambda file: found.plot_bode(file=file), plot)
        if json:
            record = {"model": chosen.name, "prototype": chosen.prototype, **found.record()}
            typer.echo(as_json({**record, "at": _point(found), "files": files}))
        else:
            _show(found)
            for file in files:
                typer.echo(f"Written: {file}")


def _point(found: "Linearization") -> dict[str, float]:
    """The states and inputs at the operating point; what is sampled is told where the point knows it."""
    names = (*found.states, *found.inputs, *found.outputs)
    return {name: float(found.point[name]) for name in names if name in found.point}


def _show(found: "Linearization") -> None:
    """Matrices in blocks of columns that fit the terminal, and a table of poles."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    console = Console()
    every = "" if found.period is None else f", every {found.period:g} s"
    typer.echo(f"{found.model}, linear about its operating point{every}")
    for line in _blocks(found, console.width):
        typer.echo(line)
    table = Table(box=SIMPLE, pad_edge=False)
    for heading in ("pole [1/s]" if found.period is None else "pole of z", "Hz", "damping"):
        table.add_column(heading, justify="right", no_wrap=True)
    for pole in found.record()["poles"]:
        sign = f" {'+' if pole['imaginary'] > 0 else '-'} {abs(pole['imaginary']):.6g}j"
        value = f"{pole['real']:.6g}" + (sign if pole["imaginary"] else "")
        table.add_row(value, f"{pole['hertz']:.5g}", f"{pole['damping'] + 0.0:.4g}")  # no -0
    if found.states:
        console.print(table)
    else:
        typer.echo("It has no states, hence no poles.")


def _blocks(found: "Linearization", width: int) -> Iterator[str]:
    """[A B; C D] as lines of at most `width` letters, if each column fits by itself."""
    import numpy as np

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
