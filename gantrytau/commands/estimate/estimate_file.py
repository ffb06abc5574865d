"""The file of an estimation: a model, what is estimated, and experiments with their data."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gantrytau import FlatModel, ModelError, did_you_mean, flatten, read_toml
from gantrytau.border import NamedObject
from gantrytau.commands.arguments.model_choice import Chosen, build
from gantrytau.commands.arguments.values import signal
from gantrytau.commands.estimate.data_columns import Data
from gantrytau.commands.printing.reporting import CommandError, refusing

if TYPE_CHECKING:
    from gantrytau_optimica import Experiment, Free

POLICY = ("loss", "elements", "points", "scheme", "tolerance", "max_iterations", "max_time")
FREE = ("guess", "min", "max")
PARTS = ("name", "data", "measured", "deviation", "inputs", "start", "set", "begin", "stop", "held")
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
    parameters: Mapping[str, "Free"]
    experiments: tuple["Experiment", ...]
    keywords: Mapping[str, Any]


def read_estimate(file: Path) -> EstimateFile:
    """The estimation that a file describes; CommandError for what is missing, unknown or of the wrong kind."""
    with refusing():
        table = read_toml(file)
    _check_keys(file, "", table, ("model", *POLICY, "estimate", "set", "experiment"))
    if not isinstance(table.get("model"), str):
        raise CommandError(
            f'{file}: found model = {table.get("model")!r}, expected a name in quotes, as model = "Pendulum"; '
            "`gantrytau estimate --example` prints a whole file"
        )
    for key in ("estimate", "set"):
        if not isinstance(table.get(key, {}), dict):
            raise CommandError(
                f"{file}: found {key} = {table[key]!r}, expected a table: a line [{key}], then name = value"
            )
    trials = table.get("experiment")
    if not isinstance(trials, list) or not all(isinstance(one, dict) for one in trials) or not trials:
        raise CommandError(f"{file}: found no experiment, expected a line [[experiment]], then its data")
    text = _beside(file, table["model"])
    chosen = build(text)
    flat = flatten(chosen.model)
    known = {n for p in flat.parameters for n in (p.name, *p.elements)}
    with refusing(f"{file}: "):
        parameters = {
            name: _free(flat, f"estimate.{name}", name, value, known)
            for name, value in table.get("estimate", {}).items()
        }
        common = {name: _known(f"set.{name}", value) for name, value in table.get("set", {}).items()}
        experiments = [_experiment(file, flat, k, one, common) for k, one in enumerate(trials)]
    keywords = {key: table[key] for key in POLICY if key in table}
    return EstimateFile(text, chosen, flat, parameters, tuple(experiments), keywords)


def _beside(file: Path, text: str) -> str:
    """A model in a Python file is beside this one."""
    return text if NamedObject.read(text).file is None else f"{file.parent.absolute() / text}"


def _check_keys(file: Path, place: str, table: Mapping[str, Any], known: tuple[str, ...]) -> None:
    for key in table:
        if key not in known:
            raise CommandError(f"{file}: {place}there is no key '{key}'{did_you_mean(key, known)}")


def _experiment(
    file: Path, flat: FlatModel, number: int, table: Mapping[str, Any], common: Mapping[str, Any]
) -> "Experiment":
    """One experiment; ModelError or CommandError with its place in the file."""
    from gantrytau_optimica import Experiment

    place = f"experiment[{number}]"
    _check_keys(file, f"{place}: ", table, PARTS)
    if not isinstance(table.get("data"), str):
        raise ModelError(
            f'{place}: found data = {table.get("data")!r}, expected a file in quotes, as "swing.csv"'
        )
    for key in ("inputs", "start", "set"):
        if not isinstance(table.get(key, {}), dict):
            raise ModelError(f"{place}.{key}: found {table[key]!r}, expected {{ name = value }}")
    columns = Data.read(file.parent / table["data"])
    variables = {n for v in flat.variables for n in (v.name, *v.elements)}
    part = columns.part(table.get("begin"), table.get("stop"))
    if part.times is not None and not part.times.size:
        raise ModelError(f"{place}: found no data between begin and stop, expected some; widen them")
    measured = part.measured(flat, place, table.get("measured"), table.get("deviation"))
    starts = {
        name: _free(flat, f"{place}.start.{name}", name, value, variables)
        if isinstance(value, dict)
        else _known(f"{place}.start.{name}", value)
        for name, value in table.get("start", {}).items()
    }
    known = {n for p in flat.parameters for n in (p.name, *p.elements)}
    own = {
        name: _free(flat, f"{place}.set.{name}", name, value, known)
        if isinstance(value, dict)
        else _known(f"{place}.set.{name}", value)
        for name, value in table.get("set", {}).items()
    }
    ends = {key: table[key] for key in ("begin", "stop", "name") if key in table}
    try:
        return Experiment(
            measured,
            _inputs(file, flat, place, table, columns),
            starts,
            parameters={**common, **own},
            **_part(columns, ends),
        )
    except ModelError as error:
        raise ModelError(f"{place}: {str(error).removeprefix('Experiment: ')}") from error


def _part(columns: Data, ends: Mapping[str, Any]) -> dict[str, Any]:
    """Begin and stop, by default those of the data."""
    first = {} if columns.times is None else {"begin": float(columns.times[0])}
    return {**first, **ends}


def _inputs(
    file: Path, flat: FlatModel, place: str, table: Mapping[str, Any], columns: Data
) -> dict[str, Any]:
    """What the file says of inputs, and columns that have their names."""
    held = table.get("held", [])
    if not isinstance(held, list) or not all(isinstance(name, str) for name in held):
        raise ModelError(f'{place}.held: found {held!r}, expected a list of inputs, as ["u"]')
    found = columns.inputs(flat, place, held)
    for name, value in table.get("inputs", {}).items():
        text = f"{name}={value}"
        path, dot, rest = str(value).rpartition(".csv")
        if dot and (not rest or rest.startswith(":")):
            text = f"{name}={file.parent.absolute() / (path + dot)}{rest}"
        try:
            found |= dict([signal(text)])
        except CommandError as error:
            raise CommandError(str(error).replace("--input", f"{place}.inputs:", 1)) from None
    return found


def _known(place: str, value: Any) -> Any:
    """A number, or numbers."""
    if isinstance(value, bool) or not _numeric(value):
        raise ModelError(f"{place}: found {value!r}, expected a number, or a list of numbers, in SI")
    return value


def _free(flat: FlatModel, place: str, name: str, value: Any, known: set[str]) -> "Free":
    """What is to be estimated, with a guess of the file or of the model, and limits."""
    from gantrytau_optimica import Free

    if name not in known:
        raise ModelError(f"{place}: the model has no '{name}'{did_you_mean(name, known)}")
    if not isinstance(value, dict):
        return Free(_known(place, value))
    for key, number in value.items():
        if key not in FREE:
            raise ModelError(f"{place}: there is no key '{key}'{did_you_mean(key, FREE)}")
        _known(f"{place}.{key}", number)
    guess = value["guess"] if "guess" in value else _own(flat, place, name)
    return Free(guess, min=value.get("min"), max=value.get("max"))


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


def _numeric(value: Any) -> bool:
    if isinstance(value, list):
        return bool(value) and all(_numeric(one) for one in value)
    return isinstance(value, (int, float)) and not isinstance(value, bool)
