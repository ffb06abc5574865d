"""Motions from components beside the same ones by hand, with Opti and with rockit: what building and solving take."""

import statistics
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from time import process_time
from typing import Any

from gantrytau.commands.demo.motion_problems import FreePath, OnLine
from gantrytau_optimica import prepare
from tests.benchmarks.gta import Task
from tests.benchmarks.peers import by_hand, crane, delta, six_link, three_link, with_opti
from tests.benchmarks.peers.written import Motion, Outcome
from tests.benchmarks.table import Row, at_most, print_table, shown

MESHES = (20, 50, 200, 400)  # elements
ROUNDS = 3  # of the programs that take less than SHORT s
SHORT = 3.0


@dataclass(frozen=True)
class Case:
    """One motion: as a problem of components, and as written by hand. usual: elements on which all peers solve it."""

    title: str
    problem: type
    written: Callable[[], Motion]
    usual: int
    branches: bool = False  # whether programs may end on different ones


CASES = (
    Case("three links, free path", FreePath, three_link.motion, 50, branches=True),
    Case("three links, line", OnLine, partial(three_link.motion, Task(line=True)), 50),
    Case("six links", six_link.SixLinkMotion, six_link.motion, 20),
    Case("delta robot", delta.DeltaMotion, delta.motion, 20),
    Case("crane with limited rates", crane.CraneMotion, crane.motion, 50),
)


def rows(cases: tuple[Case, ...] = CASES) -> Iterator[Row]:
    """For each motion and mesh the processor time of all programs, and ours against the one by hand."""
    ours([case for case in CASES if not case.branches][-1], 5)  # what is loaded only once
    for case in cases:
        for elements in MESHES:
            yield from _compared(case, elements, peers=elements == case.usual)


def _compared(case: Case, elements: int, *, peers: bool) -> Iterator[Row]:
    title = f"{case.title}, {elements} elements"
    programs: dict[str, Callable[[], Outcome]] = {
        "components": partial(ours, case, elements),
        "by hand": partial(by_hand.solve, case.written, elements),
    }
    if peers:
        programs["Opti"] = partial(with_opti.solve, case.written, elements)
        try:
            from tests.benchmarks.peers import with_rockit

            programs["rockit"] = partial(with_rockit.solve, case.written, elements)
        except ImportError:
            pass
    found = {name: median(program) for name, program in programs.items()}
    for name, one in found.items():
        if isinstance(one, Outcome):
            yield shown(
                f"{title}, {name}",
                f"{one.build:.2f} + {one.solve:.2f} s cpu, {one.iterations} it, {one.time:.5f} s",
            )
        else:
            yield shown(f"{title}, {name}", one)
    mine, hand = found["components"], found["by hand"]
    if isinstance(mine, Outcome) and isinstance(hand, Outcome):
        yield at_most(f"{title}: build and solve against by hand", mine.total / hand.total, 1.0, "x")
        if not case.branches:
            yield at_most(f"{title}: duration against by hand", abs(mine.time / hand.time - 1), 1e-4)
    else:
        yield at_most(f"{title}: programs of these two that fail", 2 - _solved(mine) - _solved(hand), 0)


def _solved(found: Outcome | str) -> int:
    return int(isinstance(found, Outcome) and found.success)


def ours(case: Case, elements: int) -> Outcome:
    """The problem of components, from its class to its answer."""
    begin = process_time()
    prepared = prepare(case.problem, elements=elements)
    built = process_time()
    optimum = prepared.solve()
    return Outcome(
        optimum.final_time,
        optimum.iterations,
        built - begin,
        process_time() - built,
        optimum.success,
        optimum.program.places.size,
    )


def median(program: Callable[[], Outcome]) -> Outcome | str:
    """The run of median time, of one if that is long; in words why there is none."""
    runs: list[Outcome] = []
    while not runs or (len(runs) < ROUNDS and runs[0].total < SHORT):
        try:
            runs.append(program())
        except Exception as error:  # whatever a peer says: the table goes on
            return f"no answer: {type(error).__name__}"
    total = statistics.median_low(run.total for run in runs)
    return next(run for run in runs if run.total == total)


if __name__ == "__main__":
    chosen: Any = tuple(case for case in CASES if not sys.argv[1:] or case.title.startswith(sys.argv[1]))
    sys.exit(print_table("Motions beside programs by hand", [rows(chosen)]))
