"""What takes long: a line on a terminal or in a notebook, and the processor time of each stage of a translation."""

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from contextvars import ContextVar
from functools import wraps
from html import escape
from threading import Event, Thread
from time import monotonic, process_time
from typing import Any, Self, TypeVar, cast

LONG = 2.0  # s of waiting after which progress is shown
EVERY = 0.2  # s between two pictures of it

F = TypeVar("F", bound=Callable[..., Any])
_shown: ContextVar["Progress | None"] = ContextVar("the progress that is shown", default=None)
_clock: ContextVar[dict[str, float] | None] = ContextVar("seconds by stage", default=None)


class Progress:
    """A line on a terminal or in a notebook for a call that takes long: a bar, what is at work, and seconds that passed.

    start, stop: what `at` reaches; without a stop the bar has no end. The outermost progress alone is shown; none is where
    the environment variable GANTRYTAU_PROGRESS is 0, where standard error is no terminal, and where wanted is False.
    """

    def __init__(self, words: str, start: float = 0.0, stop: float | None = None, *, wanted: bool = True):
        self.words, self.start, self.stop, self.wanted = words, start, stop, wanted
        self.done, self.stage = 0.0, ""
        self._token, self._thread, self._over = None, None, Event()

    def __enter__(self) -> Self:
        if _shown.get() is not None:
            return self
        self._token = _shown.set(self)
        screen = _screen() if self.wanted else None
        if screen is not None:
            self._thread = Thread(target=self._show, args=(screen,), daemon=True)
            self._thread.start()
        return self

    def __exit__(self, *exception: Any) -> None:
        self._over.set()
        if self._thread is not None:
            self._thread.join()
        if self._token is not None:
            _shown.reset(self._token)

    def at(self, t: float) -> None:
        """How far it is, between start and stop."""
        self.done = t

    @staticmethod
    def shown() -> "Progress | None":
        """The outermost progress, if one is at work; its `stage` says in words what it is at."""
        return _shown.get()

    def _show(
        self, screen: Callable[[], AbstractContextManager[Callable[[str, float | None], None]]]
    ) -> None:
        begin = monotonic()
        if self._over.wait(LONG):
            return
        with screen() as picture:
            while True:
                share = None if self.stop is None else (self.done - self.start) / (self.stop - self.start)
                words = ": ".join(filter(None, (self.words, self.stage)))
                picture(f"{words}, {monotonic() - begin:.0f} s", share)
                if self._over.wait(EVERY):
                    return


def tell(stage: str) -> None:
    """What the call is at, in words, for the line on the screen, if there is one."""
    if (shown := _shown.get()) is not None:
        shown.stage = stage


def shows_progress(function: F) -> F:
    """A public function with a line on the screen under its name, unless its caller gives it a `progress=`."""

    @wraps(function)
    def shown(*arguments: Any, **keywords: Any) -> Any:
        with Progress(function.__name__, wanted=keywords.get("progress") is None):
            return function(*arguments, **keywords)

    return cast("F", shown)


def silent() -> Progress:
    """While it lasts, no progress is shown: what is computed is part of something that shows its own."""
    return Progress("", wanted=False)


def _screen() -> Any:
    """Where progress is shown: a notebook, a terminal, or nowhere, which is None."""
    if os.environ.get("GANTRYTAU_PROGRESS") == "0":
        return None
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    if hasattr(shell, "kernel"):
        return _in_notebook
    return _on_terminal if sys.stderr.isatty() else None


@contextmanager
def _on_terminal() -> Iterator[Callable[[str, float | None], None]]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = BarColumn(), TextColumn("{task.description}", markup=False)
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("", total=None)
        yield lambda words, share: bars.update(
            task, description=words, completed=share or 0.0, total=None if share is None else 1.0
        )


@contextmanager
def _in_notebook() -> Iterator[Callable[[str, float | None], None]]:
    from IPython.display import HTML, display

    shown: Any = display(HTML(""), display_id=True)
    try:
        yield lambda words, share: shown.update(
            HTML(f"<progress{'' if share is None else f' value={share:.3f}'}></progress> {escape(words)}")
        )
    finally:
        shown.update(HTML(""))


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
