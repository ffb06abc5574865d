"""Errors of functions in the words of a command: options in place of arguments, and no name of the function."""

import re
import sys
from collections.abc import Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from typing import Any

from gantrytau import GantryTauError, Model
from gantrytau.border import Given, short

DOMAINS = ("calibration", "estimation", "identification", "learning", "procedure", "vision")
# of gantrytau: packages with functions
DOORS = ("", "_fmu", "_fmu.controller", "_optimica", *(f"_optimica.{name}" for name in DOMAINS))


@dataclass(frozen=True)
class Spelling:
    """How arguments of functions are written: as options of the command that runs, or as keys of a file.

    options: by argument; flags: those that take no value.
    """

    options: Mapping[str, str] = field(default_factory=dict)
    flags: frozenset[str] = frozenset()

    @classmethod
    def of(cls, command: Any) -> "Spelling":
        """The options of a command, whose parameters have the names of the function's arguments."""
        options = {p.name: (max(p.opts, key=len), p) for p in command.params if p.param_type_name == "option"}
        flags = frozenset(option for option, p in options.values() if p.is_flag)
        return cls({name: option for name, (option, _) in options.items()}, flags)

    def with_names(self, names: Mapping[str, str]) -> "Spelling":
        """With arguments that have options of other names, or places in a file."""
        return replace(self, options={**self.options, **names})

    def write(self, given: Given) -> str:
        """An argument with its value as an option, `--method ipopt`, or as a key of a file, `goal.error = 5`."""
        option = self.options.get(given.name)
        if option is None or given.value is ... or option in self.flags:
            return option or str(given)
        return f"{option} {shell(given.value)}" if option[0] == "-" else f"{option} = {short(given.value)}"

    def part(self, part: object) -> str:
        """A part of a sentence."""
        return self.write(part) if isinstance(part, Given) else str(part)

    def message(self, error: GantryTauError) -> str:
        """An error, without its place where that is the function which found it."""
        words, option = error.words(self.write), self.options.get(error.argument or "")
        if option and error.found:
            return f"{self.write(error.found)}: {words}"
        places = [place for place in error.place.split(": ") if place and not is_function(place)]
        places = [place for place in places if not (option and place == error.argument)]
        found = [f"found {error.found}, {words}"] if error.found else [words]
        text = ": ".join([*places, *found])
        return text if option is None or option in text else f"{option}: {text}"


NEUTRAL = Spelling()
RUNNING: ContextVar[Spelling] = ContextVar("RUNNING", default=NEUTRAL)  # of the command that runs


def spelled(error: GantryTauError) -> str:
    """An error in the words of the command that runs."""
    return RUNNING.get().message(error)


def shell(value: Any) -> str:
    """A value as it stands behind an option."""
    if isinstance(value, Mapping):
        return ",".join(f"{name}={shell(one)}" for name, one in value.items())
    if isinstance(value, (list, tuple)):
        return ",".join(map(shell, value))
    if value is None or isinstance(value, bool):
        return str(value).lower()
    return value if isinstance(value, str) and re.fullmatch(r"[\w.,:/+-]+", value) else short(value)


def is_function(place: str) -> bool:
    """Whether a place is the name of a function, or of a class of settings, that the packages offer."""
    packages = (sys.modules.get(f"gantrytau{door}") for door in DOORS)
    found = next((getattr(package, place) for package in packages if hasattr(package, place)), None)
    return callable(found) and not (isinstance(found, type) and issubclass(found, Model))
