"""Ctrl-C while compiled code runs: noted at once, acted upon where it is safe."""

import _thread
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

SOON = 0.01  # s, after which CasADi has what it asked Python for


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


@contextmanager
def uninterrupted() -> Iterator[None]:
    """While it lasts, Ctrl-C waits for its end: what is half written would be an error of another kind."""
    pressed: list[bool] = []
    with on_interrupt(lambda: pressed.append(True)):
        yield
    if pressed:
        raise KeyboardInterrupt


@contextmanager
def heeding_interrupts() -> Iterator[None]:
    """While it lasts, no Ctrl-C is lost in CasADi, which asks Python for its arguments and drops what is raised there."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, _heed)
    try:
        yield
    except SystemError as error:  # what Python makes of Ctrl-C in a function that CasADi has called
        if isinstance(error.__cause__ or error.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, before or signal.SIG_DFL)


def _heed(number: int, frame: FrameType | None) -> None:
    if frame is None or frame.f_globals.get("__name__") != "casadi.casadi":
        raise KeyboardInterrupt
    again = threading.Timer(SOON, _thread.interrupt_main)
    again.daemon = True
    again.start()
