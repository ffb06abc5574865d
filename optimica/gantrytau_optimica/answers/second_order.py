"""What the curvature of the objective says of an answer, in the model's words."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gantrytau.describing.record import Record
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.failures.constraint_labels import Meanings
from gantrytau_optimica.solving.curvature import FLAT, least_curvature
from gantrytau_optimica.solving.ipopt import Solution
from gantrytau_optimica.transcription.program import Program
from gantrytau_optimica.transcription.trajectory import Trajectory

LITTLE = 1e-3  # of what moves most: less does not tell a direction
Verdict = Literal["minimum", "flat", "saddle", "not known"]


@dataclass(frozen=True)
class SecondOrder(Record):
    """Whether a stationary answer is a minimum, along all motions that conditions and binding limits leave free.

    verdict: "minimum", "flat" where some motions leave the objective as it is, "saddle" where it falls to both sides, or
    "not known" without an objective, without a solution, or where rounding hides it. curvature: the least second derivative
    of the objective over its size, per squared typical size of what moves (root of the mean square over time); inf where
    nothing is free. direction: what moves most along it, and when. flat: how many such directions; left: maxima
    and saddles that were left before.
    """

    verdict: Verdict
    curvature: float
    direction: str = ""
    flat: int = 0
    left: int = 0

    def __str__(self) -> str:
        left = f"; {self.left} left on the way, where it fell to both sides" if self.left else ""
        return f"{self._words()}{left}."

    def _words(self) -> str:
        how = f"{self.curvature:.2g} of the objective"
        if self.verdict == "not known":
            return "Whether this is a minimum is not known from its curvature"
        if self.verdict == "saddle":
            return f"No minimum: the objective falls to both sides ({how}), most with {self.direction}"
        if self.verdict == "flat":
            many = "one direction" if self.flat == 1 else f"{self.flat} directions"
            return f"A minimum, but not the only one: flat (within {FLAT:.0e}) in {many}, most with {self.direction}"
        if not self.direction:
            return "A minimum: conditions and limits leave nothing free"
        return f"A minimum: curved upwards in all directions, least ({how}) with {self.direction}"


def second_order(
    built: Built, program: Program, solution: Solution, phases: Sequence[Trajectory], left: int
) -> SecondOrder:
    """The verdict on a solution; see SecondOrder."""
    if not solution.success:
        return SecondOrder("not known", np.nan, left=left)
    found = least_curvature(program, solution)
    if not found.known:
        return SecondOrder("not known", np.nan, left=left)
    words = ""
    if found.direction is not None:
        one = Meanings(built, program, phases).unknown(_moved_most(program, np.abs(found.direction)))
        words = f"{one.words}{one.when}"
    verdict: Verdict = "saddle" if found.falls else "flat" if found.flat else "minimum"
    return SecondOrder(verdict, found.least, words, found.flat, left)


def _moved_most(program: Program, amounts: np.ndarray) -> int:
    """The unknown that moves most along a direction, one that is chosen rather than one that follows from it."""
    chosen = np.zeros(amounts.size, bool)
    chosen[program.places.free] = True
    for layout in program.places.layouts:
        followers = len(layout.phase.states) + len(layout.phase.algebraics)
        chosen[layout.first : layout.first + layout.size] = layout.owner >= followers
    telling = np.where(chosen, amounts, 0.0)
    return int(np.argmax(telling if np.max(telling) > LITTLE else amounts))
