"""The file of a study: a model or a function, what varies, and what is the same in all cases."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import read_toml
from gantrytau.border import NamedObject, Value, named, read_table
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.values import signal, with_unit
from gantrytau.commands.printing.reporting import CommandError, refusing

RANGE = ("from", "to", "number")
POLICY = (
    "stop",
    "start",
    "tolerance",
    "points",
    "max_step",
    "limits",
    "singular",
    "outputs",
    "seeds",
    "combine",
    "where",
    "folder",
)
KEYS = {
    **dict.fromkeys(("model", "function"), Value("text")),
    **dict.fromkeys(POLICY, Value("any")),
    **dict.fromkeys(("over", "set", "starts", "inputs"), Value("table")),
}
EXAMPLE = """\
# gantrytau study swings.toml --plot x --to swings.png
model = "Pendulum"    # as for the other commands: 'GantryTau(L1)', robot.py:Robot; or function = "moves.py:fastest"
stop = 10.0           # s
outputs = ["x", "y"]  # variables that are kept; without this line all
combine = "grid"      # every combination; "zip" takes the first values of all names, then the second ones
# seeds = 20          # every combination with seeds 0 to 19, of models with random inputs
# folder = "swings"   # keeps finished cases; the same command goes on with the rest

[over]                # parameters, start values, inputs
L = [0.5, 1.0, 2.0]                       # m
x = { from = "50 mm", to = "450 mm", number = 9 }  # numbers without quotes are SI

[set]                 # parameters that are the same in all cases
damping = 0.02
"""


@dataclass(frozen=True, eq=False)
class StudyFile:
    """What a file asks for: a model or a function with its name, and keywords of `study`."""

    subject: Any
    name: str
    keywords: Mapping[str, Any]


def read_study(file: Path) -> StudyFile:
    """The study that a file describes; CommandError for what is missing, unknown or of the wrong kind."""
    with refusing():
        table = read_table(f"{file}: ", read_toml(file), KEYS)
    if ("model" in table) == ("function" in table):
        found = "both" if "model" in table else "neither"
        raise CommandError(
            f'{file}: found {found} of model and function, expected one, as model = "Pendulum"'
        )
    keywords = {k: table[k] for k in POLICY if k in table}
    keywords["over"] = {name: _values(file, name, v) for name, v in table.get("over", {}).items()}
    if "function" in table:
        return StudyFile(_function(file, table["function"]), table["function"], keywords)
    for place, keyword in (("set", "parameters"), ("starts", "starts")):
        if table.get(place):
            keywords[keyword] = table[place]
    if table.get("inputs"):
        keywords["inputs"] = dict(signal(f"{name}={value}") for name, value in table["inputs"].items())
    chosen = build(table["model"])
    return StudyFile(chosen.model, chosen.name, keywords)


def _values(file: Path, name: str, values: Any) -> Any:
    """A list as it stands, or numbers from one to another."""
    if not isinstance(values, dict):
        return values
    first, last, count = (values.get(key) for key in RANGE)
    if isinstance(first, str) and isinstance(last, str) and isinstance(count, int) and count > 1:
        return _with_units(f"{file}: over.{name}", first, last, count)
    good = all(isinstance(n, (int, float)) and not isinstance(n, bool) for n in (first, last))
    if set(values) != set(RANGE) or not good or not isinstance(count, int) or count < 2:
        raise CommandError(
            f"{file}: over.{name}: found {values!r}, expected a list, or {{ from = 0.1, to = 0.9, number = 9 }}"
        )
    return np.linspace(float(first or 0), float(last or 0), count).tolist()


def _with_units(place: str, first: str, last: str, count: int) -> list[str]:
    """Texts from one to another, in the unit that both have."""
    parts = [with_unit(place, text).strip() for text in (first, last)]
    units = [text.lstrip("-+.eE0123456789 ") for text in parts]
    numbers = [text.removesuffix(unit) for text, unit in zip(parts, units, strict=True)]
    if units[0] != units[1]:
        raise CommandError(
            f"{place}: found from {first} to {last}, expected one unit; write both in {units[0]}"
        )
    least, greatest = (float(number) for number in numbers)
    return [f"{x!r} {units[0]}" for x in np.linspace(least, greatest, count).tolist()]


def _function(file: Path, text: str) -> Any:
    """The function of a Python file."""
    choice = NamedObject.read(text)
    if choice.file is None or not choice.name:
        raise CommandError(
            f"{file}: found function = '{text}', expected its file and name, as moves.py:fastest"
        )
    with refusing(f"{file}: "):
        return named(text, Path(), "gantrytau_models")
