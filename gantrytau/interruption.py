"""Ctrl-C while compiled code runs: noted at once, acted upon where it is safe."""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def on_interrupt(act: Callable[[], Any]) -> Iterator[None]:
    """While it lasts, Ctrl-C calls `act` instead of raising inside of a solver, which would take it for a failure.

    Outside of the main thread, where signals do not arrive, it does nothing.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, lambda number, frame: act())
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before or signal.SIG_DFL)
