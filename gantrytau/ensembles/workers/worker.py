"""One case after the other, or many at once: here, in processes of this machine, or on a cluster.

A task is a function of a case. Each worker process has one thread of linear algebra, takes the task once, and computes a
study that is called within a case itself, so that processes do not multiply.
"""

import os
import signal
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextvars import ContextVar
from dataclasses import dataclass, replace
from typing import Any

from gantrytau.border.refusal import USERS_ERRORS, DoubtfulResult
from gantrytau.ensembles.cases import Case
from gantrytau.ensembles.digests import digest
from gantrytau.ensembles.workers.payloads import pack, unpack
from gantrytau.progress import silent

Task = Callable[[Case], Any]
Told = tuple[type[Warning], str]  # a warning
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
LOST = "WorkerDied"  # the kind of failure of a case that ends its process

_inside: ContextVar[bool] = ContextVar("inside", default=False)
_parcels: dict[str, "Parcel"] = {}  # of this process: the last one that it was sent
_tasks: dict[str, Task] = {}  # the task in it
_turn = threading.Lock()  # CasADi builds expressions in one thread of a process at a time


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of a case: its value, or the words and the class of its error; and warnings on the way."""

    number: int
    value: Any = None
    error: str = ""
    kind: str = ""
    told: tuple[Told, ...] = ()

    @property
    def good(self) -> bool:
        """Whether there is a value."""
        return not self.kind

    @property
    def lost(self) -> bool:
        """Whether its process died."""
        return self.kind == LOST


@dataclass(frozen=True)
class Parcel:
    """A task as bytes, and a number by which a process knows that it has it."""

    contents: bytes
    key: str

    @classmethod
    def of(cls, task: Task) -> "Parcel":
        """The task, packed."""
        contents = pack(task)
        return cls(contents, digest(contents))


def processors() -> int:
    """How many processors this process may use."""
    available = getattr(os, "sched_getaffinity", None)
    return len(available(0)) if available else os.cpu_count() or 1


def within_a_case() -> bool:
    """Whether this is computed by a worker."""
    return _inside.get()


def computed(task: Task, case: Case) -> Outcome:
    """The outcome of one case in this process; an error is an outcome, Ctrl-C is not."""
    with silent(), warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always", DoubtfulResult)
        try:
            found = Outcome(case.number, task(case))
        except USERS_ERRORS as error:
            if getattr(error, "interrupted", False):
                raise KeyboardInterrupt from error
            words = str(error) or type(error).__name__
            if isinstance(error, SystemExit):
                words = f"the case called sys.exit({error.code!r}), expected a value or an error; raise one"
            found = Outcome(case.number, error=words, kind=type(error).__name__)
    told = dict.fromkeys((warning.category, str(warning.message)) for warning in heard)
    return replace(found, told=tuple(told))


def receive(parcel: Parcel) -> None:
    """What a worker process does first: it keeps the task as bytes, and leaves Ctrl-C to whoever waits for it."""
    if parcel.key not in _parcels:
        _parcels.clear()
        _parcels[parcel.key] = parcel
    if threading.current_thread() is threading.main_thread() and hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})


def computed_there(key: str, case: bytes) -> bytes:
    """The outcome of one case, both as bytes, in a worker that received the task of that key."""
    with _turn:
        token = _inside.set(True)
        try:
            return _computed(key, unpack(case))
        finally:
            _inside.reset(token)


def _computed(key: str, case: Case) -> bytes:
    try:
        if key not in _tasks:
            _tasks.clear()
            _tasks[key] = unpack(_parcels[key].contents)
    except Exception as error:
        words = f"the worker cannot read what it was sent: {error}; install there what is installed here"
        return pack(Outcome(case.number, error=words, kind=type(error).__name__))
    outcome = computed(_tasks[key], case)
    try:
        return pack(outcome)
    except Exception as error:
        words = f"found a {type(outcome.value).__name__}, expected what Python can pickle: {error}; return its numbers"
        return pack(Outcome(case.number, error=words, kind=type(error).__name__))


def here(task: Task, cases: Sequence[Case]) -> Iterator[Outcome]:
    """Outcomes of cases, one after the other in this process."""
    for case in cases:
        yield computed(task, case)
