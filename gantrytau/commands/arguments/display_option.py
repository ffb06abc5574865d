"""`--display`: the units in which figures, tables and CSV files show a result."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from gantrytau import FlatModel, ModelError, Result, si
from gantrytau.border import listed
from gantrytau.commands.printing.reporting import CommandError, refusing

Displayed = Annotated[
    list[str] | None,
    typer.Option(
        "--display",
        metavar="[NAME=]UNIT",
        help="Units of figures, tables and CSV files: crank.phi=deg, rad=deg for all that is in rad, deg for all angles, "
        "SI, or declared (of CSV files, which are in SI without). Separated by commas.",
        show_default="declared",
    ),
]
WORDS = ("SI", "declared")


def displayed(texts: list[str] | None) -> Any:
    """What `display=` takes, or None; CommandError for what cannot be read."""
    parts = listed(texts)
    if not parts:
        return None
    if len(parts) == 1 and "=" not in parts[0]:
        _check(parts[0])
        return parts[0]
    found: dict[str, str] = {}
    for part in parts:
        name, sign, unit = (word.strip() for word in part.partition("="))
        if not (name and sign and unit):
            raise CommandError(
                f"--display {part}: expected NAME=UNIT where there are several, as --display phi=deg,length=mm"
            )
        _check(unit, part)
        found[name] = unit
    return found


def _check(unit: str, part: str = "") -> None:
    if unit in WORDS and not part:
        return
    with refusing(f"--display {part or unit}: "):
        si(1.0, unit)


def check_display(display: Any, flat: FlatModel, drawn: Sequence[str] = ()) -> None:
    """CommandError, before anything is computed, for units that no variable of a model, or none that is drawn, has."""
    if display is None or display in WORDS:
        return
    units = {v.name: v.unit or "" for v in (*flat.variables, *flat.parameters, *flat.propagated)}
    trial: dict[str, float] = {n: 0.0 for v in flat.vectors.values() for n in v.elements}
    for name in (*drawn, *(display if isinstance(display, Mapping) else ())):
        with suppress(ModelError):  # modes of friction, which are told later; units, and unknown names
            trial |= dict.fromkeys(flat.expand(name), 0.0)
            units.setdefault(name, flat.unit(name) or "")
    names = [name for name in drawn if name in trial or name in units] or [*trial]
    try:
        Result([0.0], trial, units=units, title=flat.name).shown(*names, "time", display=display)
    except ModelError as error:
        raise CommandError(f"{flat.name}: --{error.words(str)}") from error


def of_file(display: Any, file: Path | None) -> dict[str, Any]:
    """The keyword of `save` for a file, which only CSV files take."""
    csv = file is not None and file.suffix.lower() == ".csv"
    return {"display": display} if csv and display is not None else {}


def of_table(result: Result, names: Sequence[str], display: Any) -> Mapping[str, Any]:
    """Values and unit of each variable in a table of a command."""
    try:
        return result.shown(*names, display=display)
    except ModelError:  # a unit for what is drawn beside
        return result.shown(*names)
