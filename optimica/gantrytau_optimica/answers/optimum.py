"""`Optimum`: what `optimize` found, with all that can be done with it."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from gantrytau import ModelError
from gantrytau.results.display_units import SI, Display
from gantrytau_optimica.answers.archive.optimum_files import SUFFIX, save_optimum
from gantrytau_optimica.answers.playback.arcs import Arc, arcs
from gantrytau_optimica.answers.playback.playback import Playback, play_back
from gantrytau_optimica.answers.program_answer import ProgramAnswer
from gantrytau_optimica.answers.second_order import SecondOrder, second_order
from gantrytau_optimica.failures.failure_report import report
from gantrytau_optimica.failures.relaxation import Relaxed, relax


@dataclass(frozen=True, eq=False, repr=False)
class Optimum(ProgramAnswer):
    """What `optimize` found. `optimum["robot.tool.r"]` is a variable over `time`, free numbers are floats.

    `time` holds the start and all collocation points, in s; build_time and solve_time are in s.
    """

    def with_notes(self, **notes: Any) -> "Optimum":
        """The same answer with `refinement` or `search`; what was found out about it already stays."""
        noted = replace(self, **notes)
        for name in {"playback", "phases", "second_order"} & vars(self).keys():
            object.__setattr__(noted, name, vars(self)[name])
        return noted

    def save(self, path: Any, *, display: Display = None):
        """Save all variables over time, as Result.save; with the ending .optimum the whole solution, for load_optimum."""
        if Path(path).suffix != SUFFIX:
            return super().save(path, display=display)
        if display not in (None, SI):
            raise ModelError(
                f"{path}: save: found display={display!r}, expected none: a solution is kept in SI; leave it out",
                argument="display",
            )
        return save_optimum(self, path)

    @cached_property
    def playback(self) -> Playback:
        """The model driven anew by the inputs found, with all limits and conditions looked at between the nodes."""
        return play_back(self)

    @cached_property
    def second_order(self) -> SecondOrder:
        """Whether it is a minimum, by the curvature of the objective."""
        return second_order(self.built, self.program, self.solution, list(self.phases.values()), self.left)

    @cached_property
    def arcs(self) -> tuple[Arc, ...]:
        """Which inputs are at their limits or between them, and which other limits bind, from when to when in s."""
        return tuple(arc for phase in self.phases.values() for arc in arcs(phase))

    def report(self) -> str:
        """How it ended, what remains violated or binds, and what becomes of it when played back, in the model's words."""
        found = report(self.built, self.program, self.solution, list(self.phases.values()))
        lines = [found, str(self.second_order), str(self.playback)] if self.success else [found]
        if self.success and self.refinement is not None and self.arcs:
            lines.append("\n".join(["Arcs:", *(f"  {arc}" for arc in self.arcs)]))
        if self.success and self.search is None and (moving := self.program.problem.moving_times):
            lines.append(
                f"Best near the guess of {' and '.join(moving)}; other times may be better, try starts=."
            )
        more = [str(x) for x in (self.refinement, self.search) if x is not None]
        return "\n".join([*lines, *more])

    @cached_property
    def relaxed(self) -> Relaxed:
        """Which limits and conditions would have to give for a solution, and by how much; takes some seconds."""
        return relax(self.built, self.program, self.solution)

    @property
    def nearest(self) -> "Optimum":
        """The motion of the model that violates limits and conditions least, as a guess or to look at."""
        return replace(self, solution=self.relaxed.solution)
