"""Studies: what many cases cost beside one after the other, and what a cluster would make of them."""

import sys
import time
from collections.abc import Iterator

from gantrytau import study
from tests.benchmarks.pose_sweep import sweep
from tests.benchmarks.table import Row, at_most, print_table, shown

PAIRS = 200  # minimum-time problems that are solved
MANY, WORKERS = 10_000, 32  # problems, and workers of a cluster, for which the time is told
SMALL = 1000  # cases that do nothing, for what a case costs by itself


def rows() -> Iterator[Row]:
    """All figures of studies."""
    yield from _pose_pairs()


def _pose_pairs() -> Iterator[Row]:
    """Minimum-time problems on clusters of one and two workers of this machine, and what follows for a larger one.

    A worker takes a time to begin, in which it starts and builds the problem, and then one problem after the other; the
    scheduler hands out one case after the other, too: time(n) = begin + problems * max(problem / n, hand-over). A problem
    counts with the time that it takes of a processor: workers of a cluster have theirs for themselves.
    """
    from dask.distributed import LocalCluster

    walls, used = {}, {}
    for count in (1, 2):
        with LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=":0") as local:
            begin = time.perf_counter()
            sweep(count, 0, where=local.scheduler_address)  # builds the problem on each
            first = time.perf_counter()
            found = sweep(PAIRS, 1, where=local.scheduler_address)
            walls[count] = time.perf_counter() - first
            used[count] = sum(v.seconds for v in found.values if v is not None)
            if count == 1:
                start = first - begin
                study(_nothing, over={"a": range(2)}, where=local.scheduler_address)
                first = time.perf_counter()
                study(_nothing, over={"a": range(SMALL)}, where=local.scheduler_address)
                handed = (time.perf_counter() - first) / SMALL
            missed = len(found.failures) + sum(not v.success for v in found.values if v is not None)
            yield shown(
                f"{PAIRS} minimum-time problems, {count} of dask's workers",
                f"{walls[count]:.1f} s, {used[count]:.1f} s of processors",
            )
            yield at_most(f"of these {PAIRS} not solved", missed, 0)
    figure = "two workers against one: time of processors for a problem"
    yield at_most(figure, used[2] / used[1], 1.25, "x")
    yield shown("two workers against one: time of the wall for all", f"{walls[2] / walls[1]:.2f} x")
    yield shown("handing a case over and back", f"{1e3 * handed:.2f} ms")
    problem = max(used.values()) / PAIRS
    ahead = start + MANY * max(problem / WORKERS, handed)
    yield shown(
        f"{MANY} of them on {WORKERS} workers, by that",
        f"{ahead:.0f} s, {MANY * problem / 60:.0f} min on one",
    )


def _nothing(a: int) -> int:
    return a


if __name__ == "__main__":
    sys.exit(print_table("Studies", [rows()]))
