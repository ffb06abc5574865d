"""What takes long: a bar on the screen, and the processor time of each stage of a translation."""

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from time import process_time
from typing import Any

LONG = 2.0  # s of waiting after which progress is shown

_silent: ContextVar[bool] = ContextVar("silent", default=False)
_clock: ContextVar[dict[str, float] | None] = ContextVar("seconds by stage", default=None)


@contextmanager
def silent() -> Iterator[None]:
    """While it lasts, no bar is shown: what is computed is part of something that shows its own."""
    token = _silent.set(True)
    try:
        yield
    finally:
        _silent.reset(token)


class Progress:
    """A bar on the screen, with the time that is left, for runs that take long, nothing otherwise."""

    def __init__(self, start: float, stop: float, words: str = "simulating"):
        self.start, self.stop, self.words, self.bar, self.task = start, stop, words, None, None

    def __enter__(self) -> "Progress":
        from time import monotonic

        self.clock = monotonic
        self.since = monotonic()
        return self

    def at(self, t: float) -> None:
        if self.bar is None and self._wanted():
            from rich.console import Console
            from rich.progress import Progress

            self.bar = Progress(console=Console(stderr=True), transient=True)
            self.task = self.bar.add_task(self.words, total=self.stop - self.start)
            self.bar.start()
        if self.bar is not None and self.task is not None:
            self.bar.update(self.task, completed=t - self.start)

    def _wanted(self) -> bool:
        return not _silent.get() and self.clock() - self.since > LONG and sys.stderr.isatty()

    def __exit__(self, *exception: Any) -> None:
        if self.bar is not None:
            self.bar.stop()


@contextmanager
def stage(name: str) -> Iterator[None]:
    """What is computed while it lasts belongs to this stage; a stage has no stages inside."""
    seconds, begin = _clock.get(), process_time()
    try:
        yield
    finally:
        if seconds is not None:
            seconds[name] = seconds.get(name, 0.0) + process_time() - begin


@contextmanager
def timed(title: str) -> Iterator[Mapping[str, float]]:
    """Collects seconds by stage, in the order of the stages; the environment variable GANTRYTAU_TIMING=1 prints them."""
    seconds: dict[str, float] = {}
    begin, token = process_time(), _clock.set(seconds)
    try:
        yield seconds
    finally:
        _clock.reset(token)
        if os.environ.get("GANTRYTAU_TIMING") == "1":
            words = ", ".join(f"{name} {s:.3f}" for name, s in seconds.items())
            print(f"{title}: {process_time() - begin:.3f} s ({words})", file=sys.stderr)
