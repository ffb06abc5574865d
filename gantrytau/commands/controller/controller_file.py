"""`cell.toml`: a plant, a controller of the user, references, limits, parameters, and what happens when."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gantrytau import did_you_mean, read_toml
from gantrytau.border import NamedObject, load, similar
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.values import signal
from gantrytau.commands.printing.reporting import CommandError, refusing

if TYPE_CHECKING:
    from gantrytau_fmu.controller import Controller

PLAIN = ("plant", "law", "period", "state", "clock", "patience", "clients", "kinematics")
TABLES = ("references", "limits", "parameters", "wires", "starts", "places")
LIMITS, EVENT = ("minimum", "maximum", "speed"), ("at", "state", "set", "value")
PARAMETER = ("value", "unit", "minimum", "maximum")
CHANNEL = ("unit", "size", "minimum", "maximum")
FILES = (".fmu", ".so", ".dylib", ".dll")
EXAMPLE = """\
# A robot under a controller, every 4 ms. Make this file your own, then: gantrytau controller run cell.toml --stop 0.5
plant = "MeasuredGantryTau(L1)"    # a model; or robot.fmu, or cell.py:plant, a PythonComponent
law = "TrackingController(L1)"     # the same, or law.so, or cell.py:law, a function law(t, values) -> {reference: value}
period = 0.004                     # s
clock = "virtual"                  # as fast as it goes; "wall" waits for every period
state = "obtain"                   # at first; "idle" sends nothing, "submit" overwrites nothing
# clients = ["cell.py:probe"]      # clients, or functions that make them
# kinematics = "cell.py:kinematics"  # an ExternalKinematics: references are poses then

# [references]                     # of the plant where nobody overwrites them: numbers, vectors, "motion.csv:q", signals
# "carts[0].f" = 0.0

[limits."carts[0].f"]              # of what the plant is given, whatever is asked for; in its unit, speed in this per s
minimum = -800.0
maximum = 800.0

[parameters.r_ref]                 # what may be set from sample to sample
unit = "m"
value = [1.0, 3.0, -0.35]

[wires]                            # input or output of a law that is a model -> what it is joined with
"f[0]" = "carts[0].f"
"f[1]" = "carts[1].f"
"f[2]" = "carts[2].f"

# [places.stream]                  # who may come over the network, with --port, and what it sends
# delta = { unit = "m", size = 3, minimum = -0.01, maximum = 0.01 }

[[event]]                          # as many as there are: a parameter that is set, or a state
at = 0.1                           # s
set = "r_ref"
value = [1.0, 3.05, -0.35]
"""


def read_controller(file: Path, clock: str | None = None) -> "Controller":
    """The controller that a file describes, with another clock if one is given; CommandError for what is wrong in it."""
    from gantrytau_fmu.controller import Controller

    with refusing():
        table = read_toml(file)
    _check(file, table)
    keywords: dict[str, Any] = {
        key: table[key] for key in ("period", "state", "clock", "patience") if key in table
    }
    if clock is not None:
        keywords["clock"] = clock
    references = table.get("references", {})
    keywords["references"] = dict(_reference(file, name, value) for name, value in references.items())
    keywords |= {key: table[key] for key in ("wires", "starts") if table.get(key)}
    with refusing(f"{file}: "):
        keywords["limits"], keywords["parameters"] = _limits(file, table), _parameters(file, table)
        if "kinematics" in table:
            keywords["kinematics"] = _named(file, str(table["kinematics"]))
        clients = [_client(file, name) for name in table.get("clients", [])]
        clients += [_place(file, name, own) for name, own in table.get("places", {}).items()]
        parts = (_part(file, table["plant"]), _part(file, table["law"]))
        controller = Controller(*parts, clients=clients, **keywords)
        for k, event in enumerate(table.get("event", [])):
            _plan(controller, f"{file}: event[{k}]", event)
    return controller


def _reference(file: Path, name: str, value: Any) -> tuple[str, Any]:
    """A reference by its name; CommandError in the words of the file."""
    try:
        return signal(f"{name}={value}")
    except CommandError as error:
        raise CommandError(f"{file}: {str(error).replace('--input', 'references:', 1)}") from None


def _check(file: Path, table: Mapping[str, Any]) -> None:
    """CommandError for keys that are unknown or missing, and for tables that are none."""
    known = (*PLAIN, *TABLES, "event")
    for key, value in table.items():
        if key not in known:
            raise CommandError(f"{file}: there is no key '{key}'{did_you_mean(key, known)}")
        if key in TABLES and not isinstance(value, dict):
            raise CommandError(
                f"{file}: found {key} = {value!r}, expected a table: a line [{key}], then name = value"
            )
        if key in ("clients", "event") and not isinstance(value, list):
            raise CommandError(
                f"{file}: found {key} = {value!r}, expected a list" + ", [[event]]" * (key == "event")
            )
    for key in ("plant", "law"):
        if not isinstance(table.get(key), str):
            raise CommandError(
                f"{file}: found {key} = {table.get(key)!r}, expected a text; `gantrytau controller run --example` prints a "
                "whole file"
            )


def _part(file: Path, text: str) -> Any:
    """A plant or a law: a file, a model, or what a Python file names."""
    if text.lower().endswith(FILES):
        return file.parent / text
    choice = NamedObject.read(text)
    if choice.file is None:
        return build(text).model
    found = _named(file, text)
    return build(f"{file.parent.absolute() / text}").model if isinstance(found, type) else found


def _client(file: Path, text: Any) -> Any:
    from gantrytau_fmu.controller import Client

    if not isinstance(text, str):
        raise CommandError(f"{file}: clients: found {text!r}, expected names in quotes, as cell.py:probe")
    found = _named(file, text)
    if not callable(found) or (isinstance(found, Client) and not isinstance(found, type)):
        return found
    try:
        return found()
    except TypeError as error:
        raise CommandError(
            f"{file}: clients: found {text}, which cannot be called without arguments ({error}), expected a client, or a "
            "function that makes one"
        ) from error


def _place(file: Path, name: str, sends: Any) -> Any:
    """A place for a client over the network, and what it sends."""
    from gantrytau_fmu.controller import Channel, Declaration, RemoteClient

    if not isinstance(sends, dict):
        raise CommandError(
            f"{file}: places.{name}: found {sends!r}, expected what it sends, as delta = {{ unit = 'm' }}"
        )
    channels = []
    for channel, own in sends.items():
        keys = _keys(f"{file}: places.{name}.{channel}", own, CHANNEL)
        channels.append(Channel(channel, keys.pop("unit", "1"), **keys))
    return RemoteClient(name, Declaration(channels))


def _named(file: Path, text: str) -> Any:
    """What a Python file beside this one names."""
    choice = NamedObject.read(f"{file.parent.absolute() / text}")
    if choice.file is None or not choice.name:
        raise CommandError(
            f"{file}: found '{text}', expected a Python file and a name in it, as cell.py:probe"
        )
    there = {name: value for name, value in vars(load(choice.file)).items() if not name.startswith("_")}
    if choice.name not in there:
        raise CommandError(f"{file}: {choice.file.name} has no '{choice.name}'{similar(choice.name, there)}")
    return there[choice.name]


def _limits(file: Path, table: Mapping[str, Any]) -> dict[str, Any]:
    from gantrytau_fmu.controller import AxisLimits

    limits = table.get("limits", {})
    return {name: AxisLimits(**_keys(f"{file}: limits.{name}", own, LIMITS)) for name, own in limits.items()}


def _parameters(file: Path, table: Mapping[str, Any]) -> dict[Any, Any]:
    from gantrytau_fmu.controller import Channel

    found = {}
    for name, own in table.get("parameters", {}).items():
        place = f"{file}: parameters.{name}"
        keys = _keys(place, own, PARAMETER)
        if "value" not in keys:
            raise CommandError(f"{place}: found no value, expected one, as value = 1.0")
        value = keys.pop("value")
        found[Channel(name, keys.pop("unit", "1"), len(value) if isinstance(value, list) else 1, **keys)] = (
            value
        )
    return found


def _plan(controller: "Controller", place: str, event: Any) -> None:
    keys = _keys(place, event, EVENT)
    if "at" not in keys or ("state" in keys) == ("set" in keys) or ("set" in keys) != ("value" in keys):
        raise CommandError(f"{place}: found {event!r}, expected at with state, or at with set and value")
    with refusing(f"{place}: "):
        if "set" in keys:
            controller.set(keys["set"], keys["value"], at=keys["at"])
            return
        switches = {"idle": controller.idle, "submit": controller.submit, "obtain": controller.obtain}
        if keys["state"] not in switches:
            raise CommandError(f"found state = {keys['state']!r}, expected {', '.join(switches)}")
        switches[keys["state"]](at=keys["at"])


def _keys(place: str, table: Any, known: tuple[str, ...]) -> dict[str, Any]:
    if not isinstance(table, dict):
        raise CommandError(f"{place}: found {table!r}, expected a table with {', '.join(known)}")
    for key in table:
        if key not in known:
            raise CommandError(f"{place}: there is no key '{key}'{did_you_mean(key, known)}")
    return dict(table)
