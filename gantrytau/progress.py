"""A bar on the screen for what takes long."""

import sys
from typing import Any

LONG = 2.0  # s of waiting after which progress is shown


class Progress:
    """A bar on the screen for runs that take long, nothing otherwise."""

    def __init__(self, start: float, stop: float):
        self.start, self.stop, self.bar, self.task = start, stop, None, None

    def __enter__(self) -> "Progress":
        from time import monotonic

        self.clock = monotonic
        self.since = monotonic()
        return self

    def at(self, t: float) -> None:
        if self.bar is None and self.clock() - self.since > LONG and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import Progress

            self.bar = Progress(console=Console(stderr=True), transient=True)
            self.task = self.bar.add_task("simulating", total=self.stop - self.start)
            self.bar.start()
        if self.bar is not None and self.task is not None:
            self.bar.update(self.task, completed=t - self.start)

    def __exit__(self, *exception: Any) -> None:
        if self.bar is not None:
            self.bar.stop()
