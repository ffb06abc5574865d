"""What a call has reached so far: kept outside of what searches, so that Ctrl-C and the end of time find it."""

import _thread
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

from gantrytau import SolveError, heeding_interrupts
from gantrytau.border.refusal import Given
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.solving.clock import Clock

OVER = 1.5  # s, beyond the end of time until what does not look at the clock is interrupted
SOON = 0.1  # s, in which an interruption arrives
INTERRUPTED, LATE = "interrupted", "time limit reached"
KEPT = "What was reached so far is in .optimum."


class BestSoFar:
    """One call's clock, and the best optimum until now: a solved one on the finest mesh, else where the solver was."""

    def __init__(self, clock: Clock, name: str):
        self.clock, self.name = clock, name
        self.finished = False
        self.best: Optimum | None = None
        self.late = False  # whether the clock has interrupted

    def keep(self, optimum: Optimum) -> None:
        """Take note of where a solve ended."""
        if self.best is None or _beats(optimum, self.best):
            self.best = optimum

    def finish(self, optimum: Optimum) -> Optimum:
        """Take note of the answer of the whole call."""
        self.best, self.finished = optimum, True
        return optimum

    @property
    def reason(self) -> str:
        """Why a call is being interrupted: by its clock, or by Ctrl-C."""
        return LATE if self.late else INTERRUPTED

    @contextmanager
    def kept(self) -> Iterator[None]:
        """While it lasts, Ctrl-C is heeded everywhere, and leaves with SolveError as soon as anything was reached."""
        try:
            with heeding_interrupts():
                yield
        except KeyboardInterrupt as pressed:
            if self.best is None or self.late:
                raise
            raise self.stopped(INTERRUPTED) from pressed

    @contextmanager
    def within_time(self) -> Iterator[None]:
        """While it lasts, and on the main thread, the end of time interrupts what does not look at the clock by itself:
        translation, transcription, playback. A refinement or search ends with the best it has, which is in `answer`
        then; else SolveError is raised.
        """
        lock, ended = threading.Lock(), threading.Event()

        def interrupt() -> None:
            with lock:
                if not ended.is_set():
                    self.late = True
                    _interrupt_main()

        alarm = threading.Timer(min(self.clock.left + OVER, threading.TIMEOUT_MAX), interrupt)
        alarm.daemon = True
        if threading.current_thread() is threading.main_thread():
            alarm.start()
        try:
            with self.kept():
                try:
                    yield
                finally:
                    alarm.cancel()
                    with lock:
                        ended.set()
                    if self.late:  # a Ctrl-C of the clock that has not come yet must not come to the caller
                        time.sleep(SOON)
        except KeyboardInterrupt:
            if not self.late:
                raise
        if self.late:
            self._end_late()

    def _end_late(self) -> None:
        if self.finished:
            return
        over = TimeoutError(f"{self.clock.passed:.1f} s")
        if self.best is None:
            doing = f" at {self.clock.stage}" if self.clock.stage else ""
            early = f"{LATE}{doing} after {over}, before there was anything to keep; allow more with "
            remedy = Given("max_time"), ", or take fewer ", Given("elements")
            raise SolveError(early, *remedy, place=self.name) from over
        told = self.best.refinement is not None or self.best.search is not None  # that it was not finished
        if not (self.best.success and told):
            raise self.stopped(LATE) from over

    @property
    def answer(self) -> Optimum:
        """The best optimum of a call that the clock has ended."""
        assert self.best is not None
        return self.best

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


def _interrupt_main() -> None:
    """Ctrl-C for the main thread, also where it waits; Windows has no signals for threads."""
    main = threading.main_thread().ident
    if main is not None and hasattr(signal, "pthread_kill"):
        signal.pthread_kill(main, signal.SIGINT)
    else:
        _thread.interrupt_main()


def _beats(new: Optimum, old: Optimum) -> bool:
    if new.success != old.success or not new.success:
        return new.success or not old.success
    sizes = new.program.places.size, old.program.places.size
    return sizes[0] > sizes[1] or (sizes[0] == sizes[1] and new.objective <= old.objective)
