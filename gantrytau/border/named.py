"""Objects that a text names: `Pendulum`, `robot.py:Robot`, `package.module:Class`, `GantryTau(L1, m=9)`."""

import ast
import difflib
import importlib
import importlib.util
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from gantrytau.border.refusal import GantryTauError, ModelError, did_you_mean, python_error, user_lines

_PYTHON = re.compile(r"(?P<file>.+\.(?:py|mop?))(?::(?P<name>.*))?", re.DOTALL)
_ROBOT = re.compile(r"(?P<file>.+\.(?:urdf|xml|mjcf|sdf))(?P<name>)", re.IGNORECASE | re.DOTALL)
_CALL = re.compile(r"(?P<place>.+?)\s*\((?P<arguments>[^()]*)\)", re.DOTALL)


class NotLoaded(ModelError):
    """A file or module of the user that is not there, or raises an error while it is imported."""


@dataclass(frozen=True)
class NamedObject:
    """A class or an instance by name, with its file (None for a module) and its arguments as texts."""

    name: str
    file: Path | None
    arguments: tuple[str, ...]

    @staticmethod
    def read(text: str, folder: Path | None = None) -> "NamedObject":
        """`Pendulum`, `GantryTau(D1)`, `package.module:Class`, `robot.py:Robot(m=2.5)`, `robot.py`, `robot.urdf`,
        `robot.xml` of MuJoCo, `robot.mo:Package.Model`.

        folder: the one that paths are relative to; None for the current one.
        """
        call = _CALL.fullmatch(text.strip())
        place, arguments = (call["place"], call["arguments"]) if call else (text.strip(), "")
        found = _PYTHON.fullmatch(place) or _ROBOT.fullmatch(place)
        file = Path(folder or "", found["file"]).absolute() if found else None
        name = (found["name"] or "") if found else place.removeprefix("gantrytau_models.")
        return NamedObject(name.strip(), file, listed([arguments]))

    @property
    def module(self) -> str:
        """The module of a class by its full name, `package.module:Class` or with a dot before the class."""
        return self.name.replace(":", ".").rpartition(".")[0]

    @property
    def prototypes(self) -> tuple[str, ...]:
        """The arguments without a keyword, of which a model takes one, its prototype."""
        return tuple(text.removeprefix("prototypes.") for text in self.arguments if "=" not in text)

    @property
    def keywords(self) -> tuple[str, ...]:
        """The arguments with a keyword, as `m=2.5`."""
        return tuple(text for text in self.arguments if "=" in text)


def named(text: str, folder: Path, library: str) -> Any:
    """The object that a text in a file names; a class, or a function with arguments, is called with its arguments.

    folder: that of the file; library: the module of names without one. Raises ModelError where there is no such object
    or prototype; errors of the call itself are not caught.
    """
    asked = NamedObject.read(text, folder)
    if asked.file is not None and asked.file.suffix in (".mo", ".mop"):
        raise ModelError(
            f"found {text!r}, expected a class in a file of Python, as Robot = load_modelica(...)[...]"
        )
    if asked.file is not None:
        module, name = load(asked.file), asked.name
    elif asked.module:
        found = import_by_name(asked.module, None)
        if found is None:
            raise NotLoaded(f"there is no module '{asked.module}'")
        module, name = found, asked.name[len(asked.module) + 1 :]
    else:
        module, name = importlib.import_module(library), asked.name
    public = [key for key in vars(module) if not key.startswith("_")]
    if not hasattr(module, name):
        raise ModelError(
            f"{asked.file.name if asked.file else module.__name__} has no '{name}'{similar(name, public)}"
        )
    made = getattr(module, name)
    if not isinstance(made, type) and not asked.arguments:
        return made
    records = getattr(module, "prototypes", None) or importlib.import_module(f"{library}.prototypes")
    pairs = (argument.partition("=") for argument in asked.keywords)
    keywords = {key.strip(): _value(value.strip()) for key, _, value in pairs}
    return made(*(prototype(one, records) for one in asked.prototypes), **keywords)


def prototype(name: str, records: Any) -> Any:
    """The prototype of a name among records, a module with `names()`; ModelError where there is none."""
    names = records.names() if hasattr(records, "names") else vars(records)
    if name not in names:
        raise ModelError(f"there is no prototype '{name}'{similar(name, [*names])}")
    return getattr(records, name)


def _value(text: str) -> Any:
    """A number, a vector or a truth value as Python writes them; else the text, which may bring a unit."""
    try:
        return ast.literal_eval({"true": "True", "false": "False"}.get(text, text))
    except (ValueError, SyntaxError):
        return text


def source_of(text: str) -> Path | None:
    """The Python file in a text such as `robot.py:Robot`, or of a module in the current folder; None for other names."""
    asked = NamedObject.read(text)
    if asked.file or not asked.module:
        return asked.file
    file = Path(*asked.module.split(".")).with_suffix(".py").absolute()
    return file if file.is_file() else None


def load(file: Path) -> ModuleType:
    """The user's file as a module; it may import its neighbours. Raises NotLoaded with the lines that failed."""
    if not file.is_file():
        there = sorted(path.name for path in file.parent.glob("*.py")) if file.parent.is_dir() else []
        raise NotLoaded(f"{file}: there is no such file{similar(file.name, there)}")
    specification = importlib.util.spec_from_file_location(f"{file.stem}__model", file)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    sys.modules[module.__name__] = module
    before = set(sys.modules)
    importlib.invalidate_caches()
    try:
        with _loading(file.name, file.parent, file):
            specification.loader.exec_module(module)
    finally:
        for name in sys.modules.keys() - before:
            if _is_neighbour(name.partition(".")[0], file.parent, before):
                del sys.modules[name]
    return module


def _is_neighbour(name: str, folder: Path, before: set[str]) -> bool:
    """Whether a module is a file or a package in a folder, imported just now: another robot may have one of that name."""
    source = getattr(sys.modules.get(name), "__file__", None) if name not in before else None
    return source is not None and Path(source) in (folder / f"{name}.py", folder / name / "__init__.py")


def import_by_name(name: str, source: Path | None) -> ModuleType | None:
    """The module `package.module`, also of the current folder; None if there is no module of this name.

    source: its file, if it is one of the user's, of which the lines that fail are shown. Raises NotLoaded.
    """
    with _loading(name, Path.cwd(), source):
        try:
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name is None or not f"{name}.".startswith(f"{error.name}."):
                raise  # it is there, but imports something that is not
        except (ValueError, TypeError):  # no name of a module, as 'a..b'
            pass
    return None


@contextmanager
def _loading(name: str, folder: Path, source: Path | None) -> Iterator[None]:
    """A context in which modules of `folder` can be imported, and print to stderr."""
    sys.path.insert(0, str(folder))
    try:
        with redirect_stdout(sys.stderr):
            yield
    except GantryTauError:
        raise
    except (Exception, SystemExit) as error:
        raise NotLoaded(
            f"{name} cannot be loaded. {python_error(error, user_lines(error, source))}"
        ) from error
    finally:
        if str(folder) in sys.path:
            sys.path.remove(str(folder))


def listed(texts: Sequence[str] | None) -> tuple[str, ...]:
    """Parts of one or several texts, separated by commas outside of brackets."""
    found: list[str] = []
    for text in texts or ():
        depth, begin = 0, 0
        for place, letter in enumerate(text):
            depth += (letter in "([") - (letter in ")]")
            if letter == "," and depth == 0:
                found.append(text[begin:place])
                begin = place + 1
        found.append(text[begin:])
    return tuple(name.strip() for name in found if name.strip())


def similar(wrong: str, names: Sequence[str] | dict[str, Any]) -> str:
    """The closest name, whatever its capitals, as a question; else all names."""
    lower = {name.lower(): name for name in names}
    close = difflib.get_close_matches(wrong.lower(), lower, n=1, cutoff=0.5)
    return did_you_mean(lower[close[0]] if close else wrong, names)
