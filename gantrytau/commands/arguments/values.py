"""What stands behind `name=` on the command line: numbers, vectors, columns of CSV files."""

import ast
import inspect
import re
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import gantrytau
from gantrytau import Columns, InputSignal, ModelError, Samples, did_you_mean, si
from gantrytau.commands.printing.reporting import CommandError, refusing

KINDS = ("linear", "constant")  # of samples
_VALUE = re.compile(r"[-+]?\.?\d.*|\[.*\]\s*\S+")  # begins like a number, or a vector with something behind
SIGNALS = ("white_noise", "prbs", "steps", "chirp", "multisine")


def split(option: str, text: str) -> tuple[str, str]:
    """The name and the value of `name=value`; CommandError if it has another form."""
    name, sign, value = text.partition("=")
    if not (sign and name.strip() and value.strip()):
        raise CommandError(f"{option} {text}: expected NAME=VALUE, as {option} m=2.5")
    return name.strip(), value.strip()


def pairs(option: str, texts: Iterable[str] | None) -> dict[str, Any]:
    """Names and values of an option that may stand several times."""
    return {
        name: number(option, name, value) for name, value in (split(option, text) for text in texts or ())
    }


def number(option: str, name: str, text: str, *, words: bool = False) -> Any:
    """A number, a truth value, a vector such as `[1, 2, 3]`, or a text with a unit; CommandError for all else.

    words: a name is a value, too, as that of a choice in Modelica text.
    """
    try:
        value = {"true": True, "false": False}.get(text.lower())
        value = ast.literal_eval(text) if value is None else value
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        value = None
    if isinstance(value, tuple):
        value = list(value)
    if value is None and _VALUE.match(text):
        return with_unit(f"{option} {name}={text}", text)
    if words and re.fullmatch(r"[A-Za-z_][\w.]*", text) and value is None:
        return text
    if value is None or not _numeric(value):
        raise CommandError(
            f"{option} {name}={text}: expected a number as 2.5, one with its unit as '700 mm', a vector as '[1, 2, 3]', "
            "true or false"
        )
    return value


def with_unit(place: str, text: str) -> str:
    """A text such as "700 mm" or "[1, 2, 3] mm", which the model reads; CommandError for what is none."""
    with refusing(f"{place}: "):
        si(text)
    return text


def _numeric(value: Any) -> bool:
    if isinstance(value, (list, tuple)):
        return len(value) > 0 and all(_numeric(item) for item in value)
    return isinstance(value, (bool, int, float))


def signal(text: str, place: str = "--input") -> tuple[str, Any]:
    """The name and the value of an input: a number, samples from a column of a CSV file, or a signal.

    text: `name=value`, `name=file.csv:column`, or `name=file.csv` where the column has the name of the input, behind
    either `:constant` for values that are held; `name=prbs(7, 0.1)` for a signal, its arguments numbers, texts and lists.
    """
    name, value = split(place, text)
    path, dot, rest = value.rpartition(".csv")
    if dot and (not rest or rest.startswith(":")):
        column, colon, kind = rest.removeprefix(":").rpartition(":")
        if kind not in KINDS:
            column, kind = f"{column}{colon}{kind}", "linear"
        with refusing(f"{place} {text}: "):
            return name, samples(Path(path + dot), column or name, kind)
    if "(" in value and value.endswith(")") and value[0].isalpha():
        with refusing(f"{place} {text}: "):
            return name, _called(f"{place} {text}", value)
    return name, number(place, name, value)


def _called(place: str, value: str) -> InputSignal:
    """The signal that a call such as `prbs(7, hold=0.1)` makes; CommandError for another one."""
    try:
        call = ast.parse(value, mode="eval").body
        assert isinstance(call, ast.Call)
        assert isinstance(call.func, ast.Name)
        arguments = [ast.literal_eval(one) for one in call.args]
        keywords = {str(one.arg): ast.literal_eval(one.value) for one in call.keywords}
    except (SyntaxError, ValueError, AssertionError):
        raise CommandError(
            f"{place}: expected a signal with numbers in it, as 'u=white_noise(0.1, 0.001, seed=1)'"
        ) from None
    if call.func.id not in SIGNALS:
        raise CommandError(f"{place}: there is no signal {call.func.id}{did_you_mean(call.func.id, SIGNALS)}")
    try:
        return getattr(gantrytau, call.func.id)(*arguments, **keywords)
    except TypeError as error:  # too few, too many or unknown ones
        raise CommandError(f"{place}: expected {_usage(call.func.id)}") from error


def _usage(name: str) -> str:
    """A signal with what it takes, as `prbs(bits, hold, amplitude=1.0)`; what has a value may be left out."""
    parameters = inspect.signature(getattr(gantrytau, name)).parameters.values()
    words = [p.name if p.default in (p.empty, None) else f"{p.name}={p.default!r}" for p in parameters]
    needed = [p.name for p in parameters if p.default is p.empty]
    return f"{name}({', '.join(words)}), with at least {' and '.join(needed)}"


def check_names(option: str, names: Iterable[str], expand: Callable[[str], Any]) -> None:
    """CommandError that names the option for a name that a model does not have; expand: knows its names."""
    for name in names:
        with refusing(f"{option} {name}: "):
            expand(name)


def samples(file: Path, column: str, kind: Any = "linear") -> Samples:
    """A column of a CSV file with a header and a column `time`, in SI."""
    table = Columns.read(file, "a row for each time")
    if table.time is None:
        raise ModelError(f"{file}: found no column of times, expected 'time' beside {', '.join(table.names)}")
    column = next((table.names[k] for k, head in enumerate(table.header) if head == column), column)
    values = table.column(column, filled=True, si=False)
    return Samples(table.time, values, kind=kind, unit=table.unit(column))
