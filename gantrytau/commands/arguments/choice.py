"""What MODEL or PROBLEM says on the command line: a name, the file it is in, the arguments in parentheses."""

import re
from dataclasses import dataclass
from pathlib import Path

from gantrytau.commands.arguments.values import listed

_PYTHON = re.compile(r"(?P<file>.+\.py)(?::(?P<name>.*))?", re.DOTALL)
_URDF = re.compile(r"(?P<file>.+\.urdf)(?P<name>)", re.IGNORECASE | re.DOTALL)
_CALL = re.compile(r"(?P<place>.+?)\s*\((?P<arguments>[^()]*)\)", re.DOTALL)


@dataclass(frozen=True)
class Choice:
    """A class or an instance by name, its file if it is in one, and the arguments as they were written."""

    name: str
    file: Path | None
    arguments: tuple[str, ...]

    @staticmethod
    def read(text: str) -> "Choice":
        """`Pendulum`, `GantryTau(D1)`, `package.module:Class`, `robot.py:Robot(m=2.5)`, `robot.py`, `robot.urdf`."""
        call = _CALL.fullmatch(text.strip())
        place, arguments = (call["place"], call["arguments"]) if call else (text.strip(), "")
        found = _PYTHON.fullmatch(place) or _URDF.fullmatch(place)
        file = Path(found["file"]).absolute() if found else None
        name = (found["name"] or "") if found else place.removeprefix("gantrytau_models.")
        return Choice(name.strip(), file, listed([arguments]))

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


def source_of(text: str) -> Path | None:
    """The file of the user that MODEL names, if it names one: itself, or as a module of the current folder."""
    choice = Choice.read(text)
    if choice.file or not choice.module:
        return choice.file
    file = Path(*choice.module.split(".")).with_suffix(".py").absolute()
    return file if file.is_file() else None
