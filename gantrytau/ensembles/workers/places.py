"""Where cases are computed: in this process, in processes of this machine, on a Dask cluster."""

from collections.abc import Iterator, Sequence
from time import perf_counter
from typing import Any

from gantrytau.border.refusal import Given, ModelError, did_you_mean
from gantrytau.ensembles.cases import Case
from gantrytau.ensembles.workers.cluster import on_cluster
from gantrytau.ensembles.workers.processes import in_processes
from gantrytau.ensembles.workers.worker import Outcome, Task, computed, here, processors, within_a_case

Place = str
PROCESSES = "processes"
BEGIN = 3.0  # s, in which a process starts, imports, reads its task and makes what later cases find made
LONG = 10.0  # s, of a first case behind which it is not worth waiting for a second to tell what the first one made
NAMES = (PROCESSES, "dask")


def read_place(where: Any) -> Place:
    """Where cases are to be computed; ModelError for what is neither a name nor an address."""
    if where in NAMES or (isinstance(where, str) and "://" in where):
        return where
    hint = did_you_mean(where, NAMES) if isinstance(where, str) else ""
    raise ModelError(
        f"expected 'processes', 'dask' or an address, as 'tcp://host:8786'{hint}",
        place="study",
        found=Given("where", where),
    )


def outcomes(task: Task, cases: Sequence[Case], place: Place, *, safe: bool = False) -> Iterator[Outcome]:
    """Outcomes of cases as they are finished; one case, one processor and a study within a case need no processes.

    safe: whether a case cannot end its process; then cases that are done before processes have begun are computed here.
    """
    here_is_enough = place == PROCESSES and (processors() == 1 or len(cases) == 1)
    if within_a_case() or here_is_enough:
        return here(task, cases)
    if place == PROCESSES:
        return _begun_here(task, cases) if safe else in_processes(task, cases)
    return on_cluster(task, cases, place)


def _begun_here(task: Task, cases: Sequence[Case]) -> Iterator[Outcome]:
    """Cases here for as long as processes take to begin, and to the end where these would gain less; the rest in processes.

    What the first case took longer than the last one was spent on what later ones find made, in every process anew: a
    second one tells how much that is, unless the first was long.
    """
    begin, first, last = perf_counter(), 0.0, 0.0
    for number, case in enumerate(cases):
        since = perf_counter()
        gain = last * (len(cases) - number) * (1 - 1 / processors())
        told = number != 1 or first > LONG
        if told and since - begin > BEGIN and gain > BEGIN + max(first - last, 0.0):
            yield from in_processes(task, cases[number:])
            return
        yield computed(task, case)
        last = perf_counter() - since
        first = first or last
