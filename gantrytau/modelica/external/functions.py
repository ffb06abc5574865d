"""External functions by their names in C: tables, texts, files."""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from gantrytau.border.refusal import ModelError
from gantrytau.modelica.external import tables
from gantrytau.modelica.source import SourceText

PATH = "ModelicaInternal_fullPathName"


class Package(Protocol):
    """A class of Modelica text and where it stands."""

    @property
    def source(self) -> SourceText: ...


def external_value(name: str, arguments: Sequence[Any], package: Callable[[str], Package | None]) -> Any:
    """The value of an external function that is known, several as a tuple.

    package: the package of a name, in whose folder resources are found.
    """
    return _full_path(arguments[0], package) if name == PATH else FUNCTIONS[name](*arguments)


def check_known(name: str) -> None:
    """ModelError for an external function that is not known."""
    if name not in (PATH, *FUNCTIONS):
        raise ModelError(f"found the external function {name}(), which is not supported; write an algorithm")


def _full_path(name: str, package: Callable[[str], Package | None]) -> str:
    """The path of a file, or of a resource `modelica://Package/path`."""
    if not name.lower().startswith("modelica://"):
        return os.path.abspath(name)
    first, _, rest = name[len("modelica://") :].partition("/")
    found = package(first.partition(".")[0])
    if found is None:
        raise ModelError(f"found the resource {name}, expected one of a package that is read")
    folder = Path(found.source.name).resolve().parent
    return str(folder.joinpath(*first.split(".")[1:], *rest.split("/")))


def _compared(one: str, other: str, case: bool) -> int:
    """1, 2 or 3 for a text that comes before, is equal to, or comes behind another."""
    one, other = (one, other) if case else (one.lower(), other.lower())
    return 1 if one < other else 2 if one == other else 3


def _behind_blanks(text: str, start: int = 1) -> int:
    """The index of the first character that is no blank."""
    rest = text[start - 1 :]
    return start + len(rest) - len(rest.lstrip())


FUNCTIONS: Mapping[str, Callable[..., Any]] = {
    **tables.FUNCTIONS,
    "ModelicaStrings_length": len,
    "ModelicaStrings_substring": lambda text, first, last: text[first - 1 : last],
    "ModelicaStrings_compare": _compared,
    "ModelicaStrings_skipWhiteSpace": _behind_blanks,
    "ModelicaInternal_print": lambda *_: (),
}
