"""Forces of friction in the actuators as columns of a regression.

f = f_c sign(v) + f_v v                                   Dressler (2012), (6.8)
f = (f_c (1 - e) + f_s e) sign(v) + f_v v,  e = exp(-(v / v_stribeck)^2)
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

Law = Literal["symmetric", "asymmetric", "stribeck"]
SIDES = ("[0]", "[1]")  # at positive and at negative speed, as AsymmetricFriction counts


@dataclass(frozen=True)
class FrictionColumns:
    """Which frictions of n joints are columns, and which are known.

    known: a value of `coulomb[i]` and the like, or two, at positive and at negative speed; fall: Stribeck speed, m/s.
    """

    n: int
    law: Law
    known: Mapping[str, float | tuple[float, float]]
    fall: float = 0.1

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        found = []
        for word in words(self.law):
            for i in range(self.n):
                name = f"{word}[{i}]"
                if name not in self.known:
                    found += [name + side for side in SIDES] if self.law == "asymmetric" else [name]
        return tuple(n for n in found if n not in self.known)

    def columns(self, v: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Columns (N, n, k) at speeds v (N, n); speed: whose sign counts, (N, n)."""
        found = np.zeros((*v.shape, len(self.names)))
        for j, name in enumerate(self.names):
            word, _, rest = name.partition("[")
            i = int(rest[: rest.index("]")])
            found[:, i, j] = self._of(word, v[:, i], speed[:, i])
            if self.law == "asymmetric":
                found[:, i, j] *= speed[:, i] > 0 if name.endswith(SIDES[0]) else speed[:, i] < 0
        return found

    def given(self, v: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Forces (N, n) of what is known."""
        found = np.zeros(v.shape)
        for name, value in self.known.items():
            word, _, rest = name.partition("[")
            i = int(rest[: rest.index("]")])
            one = rest.endswith(SIDES)  # of one direction
            plus, minus = np.broadcast_to(np.asarray(value, dtype=float), 2)
            sides = np.where(speed[:, i] > 0, plus, minus)
            if one and rest.count("[") == 1:
                sides = sides * (speed[:, i] > 0 if name.endswith(SIDES[0]) else speed[:, i] < 0)
            found[:, i] += sides * self._of(word, v[:, i], speed[:, i])
        return found

    def _of(self, word: str, v: np.ndarray, speed: np.ndarray) -> np.ndarray:
        if word == "viscous":
            return v
        if self.law != "stribeck":
            return np.sign(speed)
        fallen = np.exp(-((speed / self.fall) ** 2))
        return np.sign(speed) * (fallen if word == "static" else 1 - fallen)


def words(law: Law) -> tuple[str, ...]:
    """The families of parameters of a law."""
    return ("coulomb", "viscous", "static") if law == "stribeck" else ("coulomb", "viscous")
