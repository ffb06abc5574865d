"""Cases on a Dask cluster, one that is there by its address or one that is started on this machine.

Dask runs what a lost worker had anew on others, and gives a case up after it ended several of them. The task is a result
that workers pass on to each other, so that it is sent to each once.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from gantrytau.border.refusal import GantryTauError, ModelError
from gantrytau.ensembles.cases import Case
from gantrytau.ensembles.workers.payloads import pack, unpack
from gantrytau.ensembles.workers.worker import (
    LOST,
    Outcome,
    Parcel,
    Task,
    computed_there,
    processors,
    receive,
)

PATIENCE = 20.0  # s, in which a scheduler answers, and has workers


def on_cluster(task: Task, cases: Sequence[Case], where: str) -> Iterator[Outcome]:
    """Outcomes of cases as they are finished; where: "dask" or the address of a scheduler."""
    with _client(where) as client:
        parcel = Parcel.of(task)
        sent, doubtful = client.submit(_passed_on, parcel, pure=False), list[Case]()
        yield from _gathered(client, sent, cases, doubtful)
        for case in doubtful:  # their workers died, but it may have been for another case
            lost: list[Case] = []
            yield from _gathered(client, sent, [case], lost)
            if lost:
                words = "the workers that had it died, one after the other: killed, out of memory, or crashed"
                yield Outcome(case.number, error=words, kind=LOST)


def _gathered(client: Any, sent: Any, cases: Sequence[Case], lost: list[Case]) -> Iterator[Outcome]:
    """Outcomes as they come; cases that are given up are added to `lost`."""
    from dask.distributed import KilledWorker, as_completed

    futures = {client.submit(_case, sent, pack(case), pure=False): case for case in cases}
    try:
        for future in as_completed(list(futures), raise_errors=False):
            case = futures.pop(future)
            try:
                outcome = unpack(future.result())
            except KilledWorker:
                lost.append(case)
                continue
            future.release()
            yield outcome
    finally:
        client.cancel(list(futures))


def _passed_on(parcel: Parcel) -> Parcel:
    return parcel


def _case(parcel: Parcel, case: bytes) -> bytes:
    receive(parcel)
    return computed_there(parcel.key, case)


@contextmanager
def _client(where: str) -> Iterator[Any]:
    """A connection that ends with the block, and with it the cluster if it was started here."""
    try:
        from dask.distributed import Client, LocalCluster
    except ImportError as error:
        raise GantryTauError(
            "dask: not installed, but where='dask' and addresses need it; pip install 'gantrytau[cluster]'"
        ) from error
    if where == "dask":
        options: dict[str, Any] = dict(threads_per_worker=1, processes=True, dashboard_address=":0")
        try:
            local = LocalCluster(n_workers=processors(), **options)
        except RuntimeError as error:
            raise GantryTauError(
                "study: where='dask': found workers that did not start, expected a call that they do not repeat as they "
                "import the script; write it under `if __name__ == '__main__':`, or take where='processes', which needs no "
                "such line"
            ) from error
        with local, Client(local) as client:
            yield client
        return
    try:
        client = Client(where, timeout=PATIENCE)
    except (OSError, ValueError, TimeoutError) as error:
        raise ModelError(
            f"study: where: nobody answers at {where}, expected a scheduler of Dask; start one by `dask scheduler`, or take "
            "where='dask', which needs none",
            argument="where",
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError:
            raise ModelError(
                f"study: where: the scheduler at {where} has no workers; start some by `dask worker {where} --nthreads 1`",
                argument="where",
            ) from None
        yield client
