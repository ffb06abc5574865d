"""The examples of components, as `gallery.toml` lists them: benches, and what stands in them."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from string import Template
from typing import Any

from notebooks.site.builder.places import SOURCES

ROTATIONAL = "gantrytau.mechanics.rotational"
TWINS = {  # places, names and letters of rotation, and those of translation
    "load.flange_a": "load.flange",
    "rotational": "translational",
    "Inertia": "Mass",
    "Torque": "Force",
    "TorqueSensor": "ForceSensor",
    "AngleSensor": "PositionSensor",
    "tau": "f",
    "phi": "s",
    "w": "v",
    "J": "m",
    "torque": "force",
    "angle": "position",
    "shaft": "slide",
}
WORD = re.compile(rf"(?<![A-Za-z])({'|'.join(TWINS)})(?![A-Za-z])")


@dataclass(frozen=True)
class Example:
    """An example of the component `full`, in a part of the gallery: code, whose last line shows what `shows` says."""

    part: str
    full: str
    code: str
    shows: str

    @property
    def name(self) -> str:
        """The name without its package."""
        return self.full.rpartition(".")[2]

    @property
    def alt(self) -> str:
        """The words for those who do not see the picture."""
        return f"{self.name}: {self.shows}"


@cache
def examples() -> dict[str, Example]:
    """All examples, by the full names of their components."""
    parts = tomllib.loads((SOURCES / "gallery.toml").read_text(encoding="utf-8"))["part"]
    found = [one for part in parts for bench in part["bench"] for one in _of_bench(part, bench)]
    return {one.full: one for one in found}


def _of_bench(part: Mapping[str, Any], bench: Mapping[str, Any]) -> Iterator[Example]:
    for module, components in bench["of"].items():
        for name, given in components.items():
            words = {"arguments": given} if isinstance(given, str) else given
            call = f"{name}({words.get('arguments', '')})"
            known = {"name": name, "module": module, "part": call, **bench.get("words", {}), **words}
            code, shows = (Template(bench[key]).substitute(known).strip() for key in ("code", "shows"))
            yield Example(part["title"], f"{module}.{name}", code, shows)
            if bench.get("twins"):
                yield Example(part["twin"], _twin(f"{module}.{name}"), _twin(code), _twin(shows))


def _twin(text: str) -> str:
    """What is said of rotation, said of translation."""
    return WORD.sub(lambda found: TWINS[found[1]], text)
