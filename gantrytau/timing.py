"""Processor time of a translation by stage: `check(model).timing`, and on the screen with GANTRYTAU_TIMING=1."""

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from time import process_time

_clock: ContextVar[dict[str, float] | None] = ContextVar("seconds by stage", default=None)


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
