"""Public names: what the packages export, and where each of them is written.

A package that has `__all__` is public, and so is each module right in `gantrytau.mechanics`, which says by the absence of an
underscore what it offers. Rooms that the command line alone uses are left out.
"""

import ast
import importlib
import inspect
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any

from notebooks.site.builder.places import PACKAGES, modules

LISTLESS = "gantrytau.mechanics"  # whose modules have no `__all__`
INSIDES = ("gantrytau.commands",)


@dataclass(frozen=True)
class PublicName:
    """A name that `package` exports, from the module `home`; `same_as` is the full name that it repeats, if it does."""

    package: str
    name: str
    home: str
    value: Any
    line: int
    same_as: str = ""

    @property
    def full(self) -> str:
        """The name as it is imported."""
        return f"{self.package}.{self.name}"


@cache
def public_names() -> tuple[PublicName, ...]:
    """All of them, the packages in the order of `PACKAGES`, the shorter names of packages first.

    What several export is told of where it is written, if that exports it, or else by the first of them.
    """
    held = [(package, *one) for package in public_packages() for one in _exported(package)]
    first: dict[tuple[str, str], str] = {}
    for package, name, home, value in held:
        key = _key(name, home, value)
        if key not in first or package == home:
            first[key] = f"{package}.{name}"
    found = []
    for package, name, home, value in held:
        place = first[_key(name, home, value)]
        same_as = "" if place == f"{package}.{name}" else place
        found.append(PublicName(package, name, home, value, _line(home, name), same_as))
    return tuple(found)


def _key(name: str, home: str, value: Any) -> tuple[str, str]:
    return name, getattr(value, "__module__", None) or home


@cache
def public_packages() -> tuple[str, ...]:
    """Dotted names of packages with `__all__`, and of the modules of mechanics."""
    order = list(PACKAGES)
    found = [
        name
        for name, path in modules().items()
        if not name.startswith(INSIDES)
        and (
            (path.name == "__init__.py" and "__all__" in path.read_text(encoding="utf-8"))
            or (path.name != "__init__.py" and name.rpartition(".")[0] == LISTLESS)
        )
    ]
    return tuple(sorted(found, key=lambda name: (order.index(name.split(".")[0]), name.count("."), name)))


def _exported(package: str) -> Iterator[tuple[str, str, Any]]:
    """The names of a package, the modules that they come from, and what they are."""
    module = importlib.import_module(package)
    if hasattr(module, "__all__"):
        origins = _origins(package)
        for name in module.__all__:
            yield name, origins.get(name, package), getattr(module, name)
    else:
        for name, value in vars(module).items():
            own = getattr(value, "__module__", "") == package
            if own and not name.startswith("_") and isinstance(value, type | type(_exported)):
                yield name, package, value


@cache
def _origins(package: str) -> dict[str, str]:
    """Of the names that a package imports, the modules that they stand in."""
    found: dict[str, str] = {}
    for node in ast.walk(_tree(package)):
        if isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                place = f"{node.module}.{alias.name}"
                found[alias.asname or alias.name] = place if place in modules() else node.module
    for name, home in found.items():
        if home != package and home in modules() and modules()[home].name == "__init__.py":
            found[name] = home if name == home.rpartition(".")[2] else _origins(home).get(name, home)
    return found


@cache
def _tree(module: str) -> ast.Module:
    return ast.parse(modules()[module].read_text(encoding="utf-8"))


def _line(home: str, name: str) -> int:
    """Where a name is defined in its module, or 0."""
    for node in _tree(home).body:
        targets = [node.target] if isinstance(node, ast.AnnAssign) else getattr(node, "targets", [])
        names = {getattr(node, "name", ""), *(getattr(target, "id", "") for target in targets)}
        if name in names:
            return node.lineno
    return 0


def kind_of(value: Any) -> str:
    """The directive of Sphinx' domain for Python that describes a value."""
    if isinstance(value, ModuleType):
        return "module"
    if isinstance(value, type):
        return "exception" if issubclass(value, BaseException) else "class"
    return "function" if inspect.isroutine(value) else "data"
