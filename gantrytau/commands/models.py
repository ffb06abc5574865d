"""From what stands on the command line to a model: found in the library or in a file, built, modified."""

import difflib
import importlib
import importlib.util
import inspect
import re
import sys
import typing
import warnings
from collections.abc import Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from gantrytau.commands.reporting import CommandError, in_words, note, places
from gantrytau.commands.settings import with_setting
from gantrytau.commands.values import number, split
from gantrytau.errors import GantryTauError, did_you_mean
from gantrytau.model import Model

FIRST_PROTOTYPE = "L1"
_PYTHON = re.compile(r"(?P<file>.+\.py)(?::(?P<name>.*))?", re.DOTALL)
_CALL = re.compile(r"(?P<name>.+?)\s*\(\s*(?P<argument>[\w.]*)\s*\)")


@dataclass(frozen=True)
class Choice:
    """What MODEL says: the class or instance by name, the file it is in, and the prototype in parentheses."""

    name: str
    file: Path | None
    prototype: str | None

    @staticmethod
    def read(text: str) -> "Choice":
        """`Pendulum`, `GantryTau(D1)`, `package.module.Class`, `robot.py:Robot`, `robot.py`."""
        call = _CALL.fullmatch(text.strip())
        place, argument = (call["name"], call["argument"]) if call else (text.strip(), "")
        found = _PYTHON.fullmatch(place)
        file = Path(found["file"]).absolute() if found else None
        name = (found["name"] or "") if found else place.removeprefix("gantrytau_models.")
        return Choice(name.strip(), file, argument.removeprefix("prototypes.") or None)


@dataclass(frozen=True)
class Chosen:
    """A model that is ready for use, and the name of the prototype it was made from, if it has one."""

    model: Model
    prototype: str | None

    @property
    def name(self) -> str:
        """Class of the model."""
        return type(self.model).__name__


def source_of(text: str) -> Path | None:
    """The file of the user that MODEL names, if it names one."""
    return Choice.read(text).file


def build(text: str, prototype: str | None = None, settings: Sequence[str] = ()) -> Chosen:
    """The model that MODEL, `--prototype` and `--set` describe; CommandError with a remedy if there is none."""
    choice = Choice.read(text)
    if prototype and choice.prototype and prototype != choice.prototype:
        raise CommandError(
            f"found the prototype {choice.prototype} in {text} and --prototype {prototype}; name one of them"
        )
    wanted = prototype or choice.prototype
    found = _in_file(choice.file, choice.name) if choice.file else _in_library(choice.name)
    if isinstance(found, Model):
        if wanted:
            raise CommandError(f"{choice.name} is ready-made and takes no prototype; leave {wanted} out")
        chosen = Chosen(found, None)
    else:
        chosen = _made(found, wanted)
    model = chosen.model
    for setting in settings:
        name, value = split("--set", setting)
        model = with_setting(model, name, number("--set", name, value))
    return Chosen(model, chosen.prototype)


def library() -> dict[str, type[Model]]:
    """The models of the library by name."""
    import gantrytau_models

    found = {name: getattr(gantrytau_models, name) for name in gantrytau_models.__all__}
    return {name: value for name, value in found.items() if _is_model(value)}


def prototype_names() -> tuple[str, ...]:
    """The names of the records of robots."""
    from gantrytau_models import prototypes

    return tuple(prototypes.names())


def first_sentence(text: str | None) -> str:
    """The first line of a docstring."""
    return inspect.cleandoc(text or "").partition("\n")[0]


def _in_library(name: str) -> Any:
    """The class of a name: a model of the library, or a class by its full name, `package.module.Class`."""
    models = library()
    if name in models:
        return models[name]
    path = Path(name.rpartition(":")[0] or name)
    if path.is_file() or len(path.parts) > 1:
        raise CommandError(f"{name} is no Python file, expected one, as robot.py:Robot")
    module, dot, last = name.rpartition(".")
    try:
        if dot and hasattr(found := importlib.import_module(module), last):
            return _checked(getattr(found, last), name)
    except (ImportError, ValueError):
        pass
    raise CommandError(
        f"{name}: the library has no model of this name{_similar(name, models)}\n"
        "`gantrytau library` lists the models; one of your own is named by its file, as robot.py:Robot"
    )


def _in_file(file: Path, name: str) -> Any:
    """The class or the instance of that name in a file; without a name, the only class in it."""
    module = _load(file)
    classes = {
        key: value
        for key, value in vars(module).items()
        if _is_model(value) and value.__module__ == module.__name__
    }
    if not name:
        if len(classes) == 1:
            return next(iter(classes.values()))
        what = f"several models ({', '.join(classes)})" if classes else "no model class"
        raise CommandError(
            f"{file.name} holds {what}; name one, as {file.name}:{next(iter(classes), 'Robot')}"
        )
    if not hasattr(module, name):
        raise CommandError(f"{file.name} has no class '{name}'{_similar(name, classes)}")
    return _checked(getattr(module, name), f"{file.name}:{name}")


def _load(file: Path) -> ModuleType:
    """The user's file as a module; what it prints goes to stderr, what fails in it is told with its lines."""
    if not file.is_file():
        there = sorted(path.name for path in file.parent.glob("*.py")) if file.parent.is_dir() else []
        raise CommandError(f"{file}: there is no such file{_similar(file.name, there)}")
    specification = importlib.util.spec_from_file_location(f"{file.stem}__model", file)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[module.__name__] = module
    sys.path.insert(0, str(file.parent))  # the file may import its neighbours
    try:
        with redirect_stdout(sys.stderr):
            specification.loader.exec_module(module)
    except GantryTauError:
        raise
    except (Exception, SystemExit) as error:
        raise CommandError(f"{file.name} cannot be loaded. {in_words(error, places(error, file))}") from error
    finally:
        sys.path.remove(str(file.parent))
    return module


def _checked(found: Any, name: str) -> Any:
    if _is_model(found) or isinstance(found, Model):
        return found
    kind = f"a class {found.__name__}" if isinstance(found, type) else f"a {type(found).__name__}"
    raise CommandError(f"{name} is {kind}, expected a model: a class that inherits from gantrytau.Model")


def _made(found: type[Model], wanted: str | None) -> Chosen:
    """An instance of a model class, from a prototype if the class takes one."""
    needed, takes = _arguments(found)
    if wanted and not takes:
        raise CommandError(f"{found.__name__} takes no prototype; leave {wanted} out")
    if others := [name for name in needed if name != "prototype"]:
        raise CommandError(
            f"{found.__name__} needs {', '.join(others)}, which the command line cannot give; write "
            f"`model = {found.__name__}(...)` in a file robot.py and name it as robot.py:model"
        )
    if wanted is None and "prototype" in needed:
        wanted = _first_prototype(found)
        note(f"{found.__name__} takes its measures from prototype {wanted}; choose another with --prototype")
    return Chosen(found(_prototype(found, wanted)) if wanted else found(), wanted)  # pyright: ignore[reportArgumentType]


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


def _first_prototype(found: type[Model]) -> str:
    """The robot that a class gets if none is named: L1, or the first of the kind that it takes."""
    fitting = _fitting(found)
    return FIRST_PROTOTYPE if FIRST_PROTOTYPE in fitting or not fitting else fitting[0]


def _fitting(found: type[Model]) -> tuple[str, ...]:
    """The prototypes of the kind that a class takes, by the annotation of its argument; all if it says none."""
    try:
        kind = typing.get_type_hints(found.__init__).get("prototype")
    except (NameError, SyntaxError, AttributeError, TypeError):  # an annotation for readers only
        kind = None
    names = prototype_names()
    return tuple(n for n in names if isinstance(_record(n), kind)) if isinstance(kind, type) else names


def _record(name: str) -> Any:
    """A prototype by name, without its warnings."""
    from gantrytau_models import prototypes

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return getattr(prototypes, name)


def sources() -> dict[str, str]:
    """Name of each prototype -> where its numbers are from."""
    return {name: _record(name).source for name in prototype_names()}


def _prototype(found: type[Model], name: str) -> Any:
    """The prototype of that name for a class, with what it warns of."""
    from gantrytau_models import prototypes

    names, fitting = prototype_names(), _fitting(found)
    if name not in names:
        raise CommandError(f"--prototype {name}: there is no such robot{_similar(name, names)}")
    if name not in fitting:
        raise CommandError(
            f"--prototype {name}: {found.__name__} cannot take the measures of this kind of robot, "
            f"expected one of {', '.join(fitting)}"
        )
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        record = getattr(prototypes, name)
    for warning in caught:
        note(f"Note: {warning.message}")
    return record


def _is_model(value: Any) -> bool:
    return isinstance(value, type) and issubclass(value, Model) and value is not Model


def _similar(wrong: str, names: Sequence[str] | dict[str, Any]) -> str:
    """The closest name, whatever its capitals, as a question; else all names."""
    lower = {name.lower(): name for name in names}
    close = difflib.get_close_matches(wrong.lower(), lower, n=1, cutoff=0.5)
    return did_you_mean(lower[close[0]] if close else wrong, names)
