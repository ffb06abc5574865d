"""Components along an axis and about it: the same laws in other words, so that one test serves both."""

from dataclasses import dataclass
from types import ModuleType
from typing import Any

from gantrytau import Fixed
from gantrytau.mechanics import rotational, translational


@dataclass(frozen=True)
class Axis:
    """What a package calls mass, coordinate, speed and force: their letters, and their words in class names."""

    kind: ModuleType
    m: str
    s: str
    v: str
    f: str
    inert: str
    force: str
    position: str

    def mass(self, m: float, s: float | None = None, v: float | None = None) -> Any:
        """A mass or an inertia, which starts there with that speed where they are given."""
        starts = {self.s: s, self.v: v}
        fixed = {name: Fixed(value) for name, value in starts.items() if value is not None}
        return getattr(self.kind, self.inert)(**{self.m: m}, **fixed)

    def part(self, name: str, **parameters: Any) -> Any:
        """A component, `Spring` or `{force}Sensor`, whose parameters have the letters of translation: f_c, s_rel0."""
        letters = {"s": self.s, "v": self.v, "f": self.f}
        own = {
            letters[key[0]] + key[1:] if "_" in key or key in letters else key: x
            for key, x in parameters.items()
        }
        return getattr(self.kind, name.format(force=self.force, position=self.position))(**own)


ALONG = Axis(translational, "m", "s", "v", "f", "Mass", "Force", "Position")
ABOUT = Axis(rotational, "J", "phi", "w", "tau", "Inertia", "Torque", "Angle")
