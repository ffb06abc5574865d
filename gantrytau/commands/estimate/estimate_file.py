"""The file of an estimation: a model, what is estimated, and experiments with their data."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gantrytau import FlatModel, ModelError, did_you_mean, flatten, read_toml
from gantrytau.border import NamedObject, Value, read_table
from gantrytau.commands.arguments.model_choice import Chosen, build
from gantrytau.commands.arguments.values import signal
from gantrytau.commands.estimate.data_columns import Data
from gantrytau.commands.printing.reporting import refusing
from gantrytau_optimica import Experiment, Free

POLICY = ("loss", "elements", "points", "scheme", "tolerance", "max_iterations", "max_time")
NUMBERS = Value("1", ((), (None,), (None, None)))
FREE: dict[str, Value] = dict.fromkeys(("guess", "min", "max"), NUMBERS)
KEYS = {
    "model": Value("text"),
    **dict.fromkeys(POLICY, Value("any")),
    "estimate": Value("table"),
    "set": Value("table"),
    "experiment": Value("table", ((None,),)),
}
PARTS = {
    **dict.fromkeys(("name", "data"), Value("text")),
    **dict.fromkeys(("measured", "deviation"), Value("any")),
    **dict.fromkeys(("inputs", "start", "set"), Value("table")),
    **dict.fromkeys(("begin", "stop"), Value("s")),
    "held": Value("texts"),
}
EXAMPLE = """\
# Length and drag of a pendulum from a film of its swing. Make this file your own, then: gantrytau estimate swing.toml
# This one takes its data from a simulation: gantrytau simulate Pendulum --stop 6 --set L=0.9 --set damping=0.15 \\
#   --set x.start=0.5 --set y.start=-0.748 --outputs x,y --points 121 --output swing.csv
model = "Pendulum"    # as for the other commands: 'GantryTau(L1)', robot.py:Robot
# loss = "robust"     # stray values count less; by default squares
# max_time = 300      # s

[estimate]            # parameters: a guess in SI, or limits as well, or {} where the model's value is the guess
L = { guess = 1.0, min = 0.2, max = 3.0 }
damping = 0.05

[set]                 # parameters that are known to be other than the model says
m = 1.0

[[experiment]]        # as many as there are; estimated parameters are the same in all of them
data = "swing.csv"    # beside this file: a header, a column time in s, and columns with names of the model
measured = ["x"]      # or { x = "its column" }; without this line all columns that are variables
deviation = 0.002     # standard deviation of a measured value, or { x = 0.002 }; without it the fit tells
start = { x = { guess = 0.5 }, v_x = 0.0 }  # at the first time: known, or { guess, min, max } where it is estimated too
# inputs = { f = 2.0, u = "drive.csv:u" }   # numbers, columns, signals; columns named like inputs are taken by themselves
# held = ["u"]        # inputs whose values hold until the next time
# set = { m = 1.2 }   # parameters of this experiment alone
# begin = 0.5         # s, stop = 4.0: a part of the data
"""


@dataclass(frozen=True, eq=False)
class EstimateFile:
    """What a file asks for: a model, its parameters to be estimated, experiments, and keywords of `estimate`.

    text: what it says of the model.
    """

    text: str
    chosen: Chosen
    flat: FlatModel
    parameters: Mapping[str, Free]
    experiments: tuple[Experiment, ...]
    keywords: Mapping[str, Any]


def read_estimate(file: Path) -> EstimateFile:
    """The estimation that a file describes; CommandError for what is missing, unknown or of the wrong kind."""
    with refusing():
        table = read_table(f"{file}: ", read_toml(file), KEYS, ("model", "experiment"))
    text = _beside(file, table["model"])
    chosen = build(text)
    flat = flatten(chosen.model)
    with refusing(f"{file}: "):
        parameters = {
            name: _free(flat, f"estimate.{name}", name, value, flat.parameters)
            for name, value in table.get("estimate", {}).items()
        }
        common = _values(flat, "set", table.get("set", {}), ())
        experiments = [
            _experiment(file, flat, f"experiment[{k}]", one, common)
            for k, one in enumerate(table["experiment"])
        ]
    keywords = {key: table[key] for key in POLICY if key in table}
    return EstimateFile(text, chosen, flat, parameters, tuple(experiments), keywords)


def _beside(file: Path, text: str) -> str:
    """A model in a Python file is beside this one."""
    return text if NamedObject.read(text).file is None else f"{file.parent.absolute() / text}"


def _experiment(file: Path, flat: FlatModel, place: str, asked: Any, common: Mapping[str, Any]) -> Experiment:
    """One experiment; ModelError or CommandError with its place in the file."""
    table = read_table(place, asked, PARTS, ("data",))
    columns = Data.read(file.parent / table["data"])
    part = columns.part(table.get("begin"), table.get("stop"))
    if part.times is not None and not part.times.size:
        raise ModelError(f"{place}: found no data between begin and stop, expected some; widen them")
    measured = part.measured(flat, place, table.get("measured"), table.get("deviation"))
    starts = _values(flat, f"{place}.start", table.get("start", {}), flat.variables)
    own = _values(flat, f"{place}.set", table.get("set", {}), flat.parameters)
    inputs = _inputs(file, flat, place, table, columns)
    first = {} if columns.times is None else {"begin": float(columns.times[0])}
    ends = {**first, **{key: table[key] for key in ("begin", "stop", "name") if key in table}}
    try:
        return Experiment(measured, inputs, starts, parameters={**common, **own}, **ends)
    except ModelError as error:
        raise error.within(place) from error


def _inputs(
    file: Path, flat: FlatModel, place: str, table: Mapping[str, Any], columns: Data
) -> dict[str, Any]:
    """What the file says of inputs, and columns that have their names."""
    found = columns.inputs(flat, place, table.get("held", []))
    for name, value in table.get("inputs", {}).items():
        path, dot, rest = str(value).rpartition(".csv")
        if dot and (not rest or rest.startswith(":")):
            value = f"{file.parent.absolute() / (path + dot)}{rest}"
        found |= dict([signal(f"{name}={value}", f"{place}.inputs:")])
    return found


def _values(flat: FlatModel, place: str, table: Mapping[str, Any], free: Sequence[Any]) -> dict[str, Any]:
    """Numbers by name, and what is to be estimated among the quantities `free`, as a table."""
    return {
        name: _free(flat, f"{place}.{name}", name, value, free)
        if isinstance(value, dict) and free
        else NUMBERS.read(f"{place}.{name}", value)
        for name, value in table.items()
    }


def _free(flat: FlatModel, place: str, name: str, value: Any, quantities: Sequence[Any]) -> Free:
    """What is to be estimated, with a guess of the file or of the model, and limits."""
    known = {n for q in quantities for n in (q.name, *q.elements)}
    if name not in known:
        raise ModelError(f"{place}: the model has no '{name}'{did_you_mean(name, known)}")
    if not isinstance(value, dict):
        return Free(NUMBERS.read(place, value))
    limits = read_table(place, value, FREE)
    guess = limits.pop("guess") if "guess" in limits else _own(flat, place, name)
    return Free(guess, **limits)


def _own(flat: FlatModel, place: str, name: str) -> Any:
    """The value, or the start, that the model has."""
    for quantity in (*flat.parameters, *flat.variables):
        values = getattr(quantity, "value", None) or quantity.start
        if name not in (quantity.name, *quantity.elements):
            continue
        chosen = [
            one
            for element, one in zip(quantity.elements, values or (), strict=False)
            if name in (quantity.name, element)
        ]
        if not chosen or not all(one.is_constant() for one in chosen):
            break
        numbers = [float(one) for one in chosen]
        return numbers[0] if len(numbers) == 1 else numbers
    raise ModelError(f"{place}: the model has no number for {name}, expected a guess: {{ guess = 1.0 }}")
