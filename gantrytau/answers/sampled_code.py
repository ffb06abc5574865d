"""A sampled controller in C: one header, one source, the same three names whatever it does."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal


@dataclass(frozen=True, kw_only=True)
class SampledCode:
    """C99 of a sampled controller: `controller_init`, `controller_step` and their memory `controller_state`, no heap.

    given, find: names of scalars in the order of the arrays; period: s; real: type of C; units: by name;
    starts: of what is given, until it is, by name, default 0; header, source: texts of `controller.h` and `controller.c`.
    """

    name: str
    given: tuple[str, ...]
    find: tuple[str, ...]
    period: float
    real: Literal["double", "float"] = "double"
    units: Mapping[str, str] = field(default_factory=dict)
    starts: Mapping[str, float] = field(default_factory=dict)
    header: str = field(repr=False)
    source: str = field(repr=False)

    def write(self, folder: str | os.PathLike[str]) -> list[Path]:
        """Write `controller.h` and `controller.c` into a folder; their paths."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        texts = {"controller.h": self.header, "controller.c": self.source}
        for name, text in texts.items():
            (target / name).write_text(text, encoding="utf-8", newline="\n")
        return [target / name for name in texts]
