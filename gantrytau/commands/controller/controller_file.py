"""`cell.toml`: a plant, a controller of the user, references, limits, parameters, and what happens when."""

from pathlib import Path
from typing import Any

from gantrytau import ModelError, read_toml
from gantrytau.border import NamedObject, Value, named, read_table
from gantrytau.commands.arguments.model_choice import build
from gantrytau.commands.arguments.values import signal
from gantrytau.commands.printing.reporting import CommandError, refusing
from gantrytau_fmu.controller import AxisLimits, Channel, Client, Controller, Declaration, RemoteClient

LIBRARY = "gantrytau_models"
ANY, TEXT = Value("any"), Value("text")
KEYS = {
    **dict.fromkeys(("plant", "law", "kinematics"), TEXT),
    **dict.fromkeys(("period", "state", "clock", "patience"), ANY),
    **dict.fromkeys(("references", "limits", "parameters", "wires", "starts", "places"), Value("table")),
    "clients": Value("texts"),
    "event": Value("table", ((None,),)),
}
LIMITS: dict[str, Value] = dict.fromkeys(("minimum", "maximum", "speed"), ANY)
EVENT: dict[str, Value] = dict.fromkeys(("at", "state", "set", "value"), ANY)
PARAMETER: dict[str, Value] = dict.fromkeys(("value", "unit", "minimum", "maximum"), ANY)
CHANNEL: dict[str, Value] = dict.fromkeys(("unit", "size", "minimum", "maximum"), ANY)
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


def read_controller(file: Path, clock: str | None = None) -> Controller:
    """The controller that a file describes, with another clock if one is given; CommandError for what is wrong in it."""
    with refusing():
        table = read_table(f"{file}: ", read_toml(file), KEYS, ("plant", "law"))
    keywords: dict[str, Any] = {
        key: table[key] for key in ("period", "state", "clock", "patience") if key in table
    }
    if clock is not None:
        keywords["clock"] = clock
    keywords["references"] = dict(
        signal(f"{name}={value}", f"{file}: references:")
        for name, value in table.get("references", {}).items()
    )
    keywords |= {key: table[key] for key in ("wires", "starts") if table.get(key)}
    with refusing(f"{file}: "):
        keywords["limits"] = {
            name: AxisLimits(**read_table(f"limits.{name}", own, LIMITS))
            for name, own in table.get("limits", {}).items()
        }
        keywords["parameters"] = dict(
            _parameter(name, own) for name, own in table.get("parameters", {}).items()
        )
        if "kinematics" in table:
            keywords["kinematics"] = named(table["kinematics"], file.parent, LIBRARY)
        clients = [_client(file, name) for name in table.get("clients", [])]
        clients += [_place(name, own) for name, own in table.get("places", {}).items()]
        parts = (_part(file, table["plant"]), _part(file, table["law"]))
        controller = Controller(*parts, clients=clients, **keywords)
        for k, event in enumerate(table.get("event", [])):
            _plan(controller, f"event[{k}]", event)
    return controller


def _part(file: Path, text: str) -> Any:
    """A plant or a law: a file, a model, or what a Python file names."""
    if text.lower().endswith(FILES):
        return file.parent / text
    if NamedObject.read(text).file is None:
        return build(text).model
    return named(text, file.parent, LIBRARY)


def _client(file: Path, text: str) -> Any:
    found = named(text, file.parent, LIBRARY)
    if not callable(found) or isinstance(found, Client):
        return found
    try:
        return found()
    except TypeError as error:
        raise CommandError(
            f"{file}: clients: found {text}, which cannot be called without arguments ({error}), expected a client, or a "
            "function that makes one"
        ) from error


def _place(name: str, sends: Any) -> RemoteClient:
    """A place for a client over the network, and what it sends."""
    tables = read_table(f"places.{name}", sends, dict.fromkeys(sends, Value("table"))) if sends else {}
    channels = []
    for channel, own in tables.items():
        keys = read_table(f"places.{name}.{channel}", own, CHANNEL)
        channels.append(Channel(channel, keys.pop("unit", "1"), **keys))
    return RemoteClient(name, Declaration(channels))


def _parameter(name: str, own: Any) -> tuple[Channel, Any]:
    keys = read_table(f"parameters.{name}", own, PARAMETER, ("value",))
    value = keys.pop("value")
    size = len(value) if isinstance(value, list) else 1
    return Channel(name, keys.pop("unit", "1"), size, **keys), value


def _plan(controller: Controller, place: str, event: Any) -> None:
    keys = read_table(place, event, EVENT, ("at",))
    if ("state" in keys) == ("set" in keys) or ("set" in keys) != ("value" in keys):
        raise ModelError(f"{place}: found {event!r}, expected at with state, or at with set and value")
    if "set" in keys:
        controller.set(keys["set"], keys["value"], at=keys["at"])
        return
    switches = {"idle": controller.idle, "submit": controller.submit, "obtain": controller.obtain}
    if keys["state"] not in switches:
        raise ModelError(f"{place}: found state = {keys['state']!r}, expected {', '.join(switches)}")
    switches[keys["state"]](at=keys["at"])
