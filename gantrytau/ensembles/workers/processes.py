"""Cases in processes of this machine, by loky.

A process that dies takes all that ran with it. What was running is then run again one by one, each in a process of its own:
a case whose process dies again is told, and the others are finished.
"""

import os
import signal
import threading
import time
from collections.abc import Iterator, Sequence
from typing import Any

from gantrytau.ensembles.cases import Case
from gantrytau.ensembles.workers.payloads import pack, unpack
from gantrytau.ensembles.workers.worker import (
    LOST,
    ONE_THREAD,
    Outcome,
    Parcel,
    Task,
    computed_there,
    processors,
    receive,
)

GLANCE = 0.5  # s between looks at whether the program is there
AHEAD = 2  # cases for each process that are sent before one is done, so that none waits


def in_processes(task: Task, cases: Sequence[Case], count: int | None = None) -> Iterator[Outcome]:
    """Outcomes of cases as they are finished; count: of processes, by default one for each processor."""
    count = min(count or processors(), len(cases))
    parcel = Parcel.of(task)
    waiting = list(cases)
    while waiting:
        running: dict[Any, Case] = {}
        yield from _until_broken(parcel, waiting, running, count)
        for case in running.values():  # their process died, or that of another one
            yield from _alone(parcel, case)


def _until_broken(
    parcel: Parcel, waiting: list[Case], running: dict[Any, Case], count: int
) -> Iterator[Outcome]:
    """Outcomes until all cases are done or a process dies; what was running then is left in `running`."""
    from concurrent.futures import FIRST_COMPLETED, wait

    from loky.process_executor import BrokenProcessPool

    with _Pool(parcel, count) as pool:
        while waiting or running:
            try:
                while waiting and len(running) < AHEAD * count:
                    future = pool.submit(computed_there, parcel.key, pack(waiting[0]))
                    running[future] = waiting.pop(0)
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                for future in done:
                    found = future.result()
                    del running[future]
                    yield unpack(found)
            except BrokenProcessPool:
                return


def _alone(parcel: Parcel, case: Case) -> Iterator[Outcome]:
    """The outcome of one case in a process of its own."""
    running: dict[Any, Case] = {}
    yield from _until_broken(parcel, [case], running, 1)
    if running:
        words = "its process died twice: it was killed, ran out of memory, or crashed in compiled code"
        yield Outcome(case.number, error=words, kind=LOST)


def _begin(parcel: Parcel) -> None:
    """What a process does first: it takes the task, and ends when the program that started it is killed."""
    receive(parcel)
    threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(GLANCE)
    os.kill(os.getpid(), signal.SIGTERM)


class _Pool:
    """Processes that have the task, and end with the block, at once if it is left by an error."""

    def __init__(self, parcel: Parcel, count: int):
        from loky import ProcessPoolExecutor

        self.pool: Any = ProcessPoolExecutor(count, initializer=_begin, initargs=(parcel,), env=ONE_THREAD)

    def __enter__(self) -> Any:
        return self.pool

    def __exit__(self, kind: Any, error: Any, trace: Any) -> None:
        self.pool.shutdown(wait=True, kill_workers=kind is not None)
