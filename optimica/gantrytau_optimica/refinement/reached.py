"""What a call has reached so far: kept outside of what searches, so that Ctrl-C and the end of time find it."""

from collections.abc import Iterator
from contextlib import contextmanager

from gantrytau import SolveError, heeding_interrupts
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.solving.clock import Clock

INTERRUPTED, LATE = "interrupted", "time limit reached"
KEPT = "What was reached so far is in .optimum."


class BestSoFar:
    """One call's clock, and the best optimum until now: a solved one on the finest mesh, else where the solver was."""

    def __init__(self, clock: Clock):
        self.clock = clock
        self.best: Optimum | None = None

    def keep(self, optimum: Optimum) -> None:
        """Take note of where a solve ended."""
        if self.best is None or _beats(optimum, self.best):
            self.best = optimum

    @contextmanager
    def kept(self) -> Iterator[None]:
        """While it lasts, Ctrl-C is heeded everywhere, and leaves with SolveError as soon as anything was reached."""
        try:
            with heeding_interrupts():
                yield
        except KeyboardInterrupt as pressed:
            if self.best is None:
                raise
            raise self.stopped(INTERRUPTED) from pressed

    def stopped(self, why: str) -> SolveError:
        """The error that says where the call was, and has the best optimum."""
        best = self.best
        assert best is not None
        if not best.success:
            return SolveError(f"{best.report()}\n{KEPT}", optimum=best)
        elements = sum(layout.mesh.elements for layout in best.program.places.layouts)
        where = f" at {self.clock.stage}" if self.clock.stage else ""
        found = f"a solution on {elements} elements with the objective {best.objective:.8g}"
        refined = f"\n{best.refinement}" if best.refinement is not None else ""
        return SolveError(
            f"{best.name}: {why}{where}; found until then: {found}{refined}\n{KEPT}", optimum=best
        )


def _beats(new: Optimum, old: Optimum) -> bool:
    if new.success != old.success or not new.success:
        return new.success or not old.success
    sizes = new.program.places.size, old.program.places.size
    return sizes[0] > sizes[1] or (sizes[0] == sizes[1] and new.objective <= old.objective)
