"""From what stands on the command line to a model: found in the library or in a file, built, modified."""

import importlib
import inspect
import typing
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gantrytau_models
from gantrytau import (
    Connector,
    Model,
    ModelError,
    ModelicaLibrary,
    check_member,
    load_modelica,
    parameters_of,
    read_parameters,
    with_setting,
)
from gantrytau.border import NamedObject, import_by_name, load, prototype, similar, source_of
from gantrytau.commands.arguments.values import number, split
from gantrytau.commands.printing.reporting import CommandError, note, refusing
from gantrytau_models import prototypes

FIRST_PROTOTYPE = "L1"
TOLD = 5  # parts of a file that the model has not
ROBOT_FILES = (".urdf", ".mjcf", ".xml", ".sdf")
TEXT = (".mo", ".mop")  # files of Modelica and of Optimica


@dataclass(frozen=True)
class Kind:
    """What a command works on: classes that inherit from the class `path`, called `word`, as for example `example`."""

    path: str
    word: str
    example: str

    def __contains__(self, value: Any) -> bool:
        return isinstance(value, type) and issubclass(value, self.base) and value is not self.base

    def __str__(self) -> str:
        """What is expected, in words."""
        return f"a {self.word}: a class that inherits from {self.path}"

    @property
    def base(self) -> Any:
        """The class."""
        package, _, name = self.path.rpartition(".")
        return getattr(importlib.import_module(package), name)


MODEL = Kind("gantrytau.Model", "model", "robot.py:Robot")
PROBLEM = Kind("gantrytau_optimica.Optimization", "problem", "move.py:Fastest")


@dataclass(frozen=True)
class Chosen:
    """A model that is ready for use, and the name of the prototype it was made from, if it has one."""

    model: Model
    prototype: str | None

    @property
    def name(self) -> str:
        """Class of the model."""
        return type(self.model).__name__

    def record(self, key: str) -> dict[str, str | None]:
        """Name and prototype, for programs."""
        return {key: self.name, "prototype": self.prototype}


def build(text: str, robot: str | None = None, settings: Sequence[str] = (), kind: Kind = MODEL) -> Chosen:
    """The model that MODEL, `--prototype` and `--set` describe; CommandError with a remedy if there is none."""
    choice = NamedObject.read(text)
    wanted = _wanted(choice, text, robot)
    if choice.file and choice.file.suffix.lower() in ROBOT_FILES:
        found = _in_robot_file(choice.file, kind)
    elif choice.file and choice.file.suffix in TEXT:
        found = _in_text(choice.file, choice.name, kind)
    else:
        found = _in_file(choice.file, choice.name, kind) if choice.file else _by_name(choice, kind)
    if isinstance(found, Model):
        if wanted:
            raise CommandError(f"{choice.name} is ready-made and takes no prototype; leave {wanted} out")
        if choice.keywords:
            raise CommandError(
                f"{choice.name} is ready-made and takes no arguments; give --set {choice.keywords[0]} instead"
            )
        chosen = Chosen(found, None)
    else:
        chosen = _made(found, wanted, _keywords(found, choice))
    model = chosen.model
    in_text = choice.file is not None and choice.file.suffix == ".mo"
    for name, value in _settings(settings, chosen.prototype, in_text):
        with refusing("--set "):
            model = with_setting(model, name, value)
    return Chosen(model, chosen.prototype)


def _settings(settings: Sequence[str], made_from: str | None, in_text: bool) -> Iterator[tuple[str, Any]]:
    """Name and value of each `--set NAME=VALUE`, and of all that a file holds for `--set FILE.toml`.

    made_from: the prototype of the model; a file that says it belongs to another one is taken, with a warning. in_text:
    whether the model is Modelica text, whose choices have names.
    """
    for setting in settings:
        if setting.endswith(".toml") and "=" not in setting:
            with refusing("--set "):
                values = read_parameters(Path(setting))
            own = parameters_of(Path(setting))
            if own and made_from and own != made_from:
                note(f"--set {setting}: these are values of {own}, found with {made_from}; expected ({own})")
            yield from values.items()
        else:
            name, value = split("--set", setting)
            yield name, number("--set", name, value, words=in_text)


def _wanted(choice: NamedObject, text: str, robot: str | None) -> str | None:
    """The prototype that is named, in parentheses or by `--prototype`."""
    named = choice.prototypes
    if len(named) > 1:
        raise CommandError(f"{text}: found {', '.join(named)}, expected one prototype and NAME=VALUE")
    if robot and named and robot != named[0]:
        raise CommandError(
            f"found the prototype {named[0]} in {text} and --prototype {robot}; name one of them"
        )
    return robot or (named[0] if named else None)


def _keywords(found: type[Model], choice: NamedObject) -> dict[str, Any]:
    """The keyword arguments in parentheses, checked against what the class takes."""
    values: dict[str, Any] = {}
    parameters = inspect.signature(found).parameters
    open_end = any(parameter.kind is inspect.Parameter.VAR_KEYWORD for parameter in parameters.values())
    for text in choice.keywords:
        name, _, value = (part.strip() for part in text.partition("="))
        where = f"{found.__name__}({text})"
        if "." in name or "[" in name:
            raise CommandError(f"{where}: what lies deeper is set by an option, --set {name}={value}")
        if name not in parameters:
            if not open_end:
                raise CommandError(
                    f"{where}: {found.__name__} takes no '{name}'{similar(name, [*parameters])}"
                )
            try:
                check_member(found, name, found.__name__)
            except ModelError as error:
                raise CommandError(f"{where}: {error}") from error
        values[name] = number(f"{found.__name__}:", name, value)
    return values


def library() -> dict[str, type[Model]]:
    """The models of the library by name."""
    found = {name: getattr(gantrytau_models, name) for name in gantrytau_models.__all__}
    return {name: value for name, value in found.items() if value in MODEL}


def parts() -> dict[str, type[Model]]:
    """Those models of the library that are no whole: they have connectors, or wait for a component of a subclass."""
    return {name: found for name, found in library().items() if _is_part(found)}


def _is_part(found: type[Model]) -> bool:
    own = [cls for cls in found.__mro__ if issubclass(cls, Model) and cls is not Model]
    awaited = {
        name for cls in own for name in vars(cls).get("__annotations__", {}) if not hasattr(found, name)
    }
    connectors = (member for member in found.members().values() if isinstance(member, Connector))
    return bool(awaited) or any(connectors)


def prototype_names() -> tuple[str, ...]:
    """The names of the records of robots."""
    return tuple(prototypes.names())


def first_sentence(text: str | None) -> str:
    """The first line of a docstring."""
    return inspect.cleandoc(text or "").partition("\n")[0]


def _by_name(choice: NamedObject, kind: Kind) -> Any:
    """The class of a name: a model of the library, or a class by its full name, `package.module:Class`."""
    name = choice.name
    found = getattr(gantrytau_models, name) if name in gantrytau_models.__all__ else None
    if found in MODEL:
        return _checked(found, name, kind)
    path = Path(name.rpartition(":")[0] or name)
    if path.is_file() or len(path.parts) > 1:
        raise CommandError(f"{name} is no Python file, expected one, as {kind.example}")
    module = import_by_name(choice.module, source_of(name)) if choice.module else None
    last = name[len(choice.module) + 1 :]
    if module is not None and hasattr(module, last):
        return _checked(getattr(module, last), name, kind)
    if kind is not MODEL:
        raise CommandError(f"{name}: there is no {kind.word} of this name; name its file, as {kind.example}")
    raise CommandError(
        f"{name}: the library has no model of this name{similar(name, library())}\n"
        f"`gantrytau library` lists the models; one of your own is named by its file, as {kind.example}"
    )


def _in_file(file: Path, name: str, kind: Kind) -> Any:
    """The class or the instance of that name in a file; without a name, the only class in it."""
    module = load(file)
    classes = {
        key: value
        for key, value in vars(module).items()
        if value in kind and value.__module__ == module.__name__
    }
    if not name:
        if len(classes) == 1:
            return next(iter(classes.values()))
        what = f"several {kind.word}s ({', '.join(classes)})" if classes else f"no {kind.word} class"
        example = next(iter(classes), kind.example.rpartition(":")[2])
        expected = "" if classes or kind is MODEL else f", expected {kind}"
        raise CommandError(f"{file.name} holds {what}{expected}; name one, as {file.name}:{example}")
    if not hasattr(module, name):
        raise CommandError(f"{file.name} has no class '{name}'{similar(name, classes)}")
    return _checked(getattr(module, name), f"{file.name}:{name}", kind)


def _in_robot_file(file: Path, kind: Kind) -> type[Model]:
    """The robot of a file, of URDF with the loops of `robot.loops.toml` beside `robot.urdf` if that is there."""
    from gantrytau.mechanics.robot_files import read_mjcf, read_sdf, read_urdf

    if kind is not MODEL:
        raise CommandError(f"{file.name} is a robot, expected {kind}")
    loops = file.with_suffix(".loops.toml")
    if file.suffix.lower() == ".urdf":
        robot = read_urdf(file, loops if loops.is_file() else None)
    else:
        robot = read_sdf(file) if file.suffix.lower() == ".sdf" else read_mjcf(file)
    if robot.left_out:
        rest = f", and {len(robot.left_out) - TOLD} more" if len(robot.left_out) > TOLD else ""
        note(f"{file.name}: left out: {', '.join(robot.left_out[:TOLD])}{rest}")
    return robot


def _in_text(file: Path, name: str, kind: Kind) -> Any:
    """The class of a file of Modelica or Optimica; without a name, the only one in it of the kind."""
    library = _text_loader(file)(file)
    if not name:
        wanted = ("optimization",) if kind is PROBLEM else ("model", "block")
        models = [one for one in library.names if library.kind_of(one) in wanted]
        if len(models) != 1:
            what = f"several {kind.word}s ({', '.join(models)})" if models else f"no {kind.word}"
            raise CommandError(
                f"{file.name} holds {what}; name one, as {file.name}:{next(iter(models), kind.word.title())}"
            )
        (name,) = models
    return _checked(library[name], f"{file.name}:{name}", kind)


def _text_loader(file: Path) -> Callable[..., ModelicaLibrary]:
    if file.suffix == ".mo":
        return load_modelica
    from gantrytau_optimica import load_optimica  # which is not needed by most commands

    return load_optimica


def _checked(found: Any, name: str, kind: Kind) -> Any:
    if found in kind or isinstance(found, kind.base):
        return found
    what = f"a class {found.__name__}" if isinstance(found, type) else f"a {type(found).__name__}"
    raise CommandError(f"{name} is {what}, expected {kind}")


def _made(found: type[Model], wanted: str | None, keywords: dict[str, Any]) -> Chosen:
    """An instance of a model class, from a prototype if the class takes one."""
    needed, takes = _arguments(found)
    if wanted and not takes:
        raise CommandError(f"{found.__name__} takes no prototype; leave {wanted} out")
    if others := [name for name in needed if name != "prototype" and name not in keywords]:
        raise CommandError(
            f"{found.__name__} needs {', '.join(others)}; give numbers as '{found.__name__}({others[0]}=...)', and write "
            f"all else in a file: `model = {found.__name__}(...)` in robot.py is named as robot.py:model"
        )
    if wanted is None and "prototype" in needed:
        wanted = _first_prototype(found)
        note(f"{found.__name__} takes its measures from prototype {wanted}; choose another with --prototype")
    made: Any = found
    return Chosen(made(_prototype(found, wanted), **keywords) if wanted else made(**keywords), wanted)


def _arguments(found: type[Model]) -> tuple[list[str], bool]:
    """The arguments that a class cannot do without, and whether it takes a prototype."""
    kinds = inspect.Parameter
    parameters = [
        parameter
        for parameter in inspect.signature(found).parameters.values()
        if parameter.kind not in (kinds.VAR_KEYWORD, kinds.VAR_POSITIONAL)
    ]
    needed = [parameter.name for parameter in parameters if parameter.default is kinds.empty]
    return needed, any(parameter.name == "prototype" for parameter in parameters)


def takes_prototype(found: type[Model]) -> bool:
    """Whether a class is made from the measures of a robot."""
    return _arguments(found)[1]


def _first_prototype(found: type[Model]) -> str:
    """The robot that a class gets if none is named: L1, or the first of the kind that it takes."""
    fitting = fitting_prototypes(found)
    return FIRST_PROTOTYPE if FIRST_PROTOTYPE in fitting or not fitting else fitting[0]


def fitting_prototypes(found: type[Model]) -> tuple[str, ...]:
    """The prototypes of the kind that a class takes, by the annotation of its argument; all if it says none."""
    try:
        kind = typing.get_type_hints(found.__init__).get("prototype")
    except (NameError, SyntaxError, AttributeError, TypeError):  # an annotation for readers only
        kind = None
    names = prototype_names()
    return tuple(n for n in names if isinstance(_record(n), kind)) if isinstance(kind, type) else names


def _record(name: str) -> Any:
    """A prototype by name, without its warnings."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return getattr(prototypes, name)


def sources() -> dict[str, str]:
    """Name of each prototype -> where its numbers are from."""
    return {name: _record(name).source for name in prototype_names()}


def _prototype(found: type[Model], name: str) -> Any:
    """The prototype of that name for a class, with what it warns of."""
    with warnings.catch_warnings(record=True) as caught, refusing(f"--prototype {name}: "):
        warnings.simplefilter("always")
        record = prototype(name, prototypes)
    fitting = fitting_prototypes(found)
    if name not in fitting:
        raise CommandError(
            f"--prototype {name}: {found.__name__} cannot take the measures of this kind of robot, "
            f"expected one of {', '.join(fitting)}"
        )
    for warning in caught:
        note(f"Note: {warning.message}")
    return record
