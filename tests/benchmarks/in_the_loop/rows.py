"""Steps of controllers in closed loops: processor times, and cost beside do-mpc and rockit."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from time import process_time
from typing import Any

import numpy as np

from gantrytau_optimica import Mpc
from tests.benchmarks.in_the_loop import problems
from tests.benchmarks.table import Row, at_most, print_table, shown
from tests.optimica.predictive.test_mpc import Upright


@dataclass(frozen=True)
class Case:
    """A loop over so many periods; elements: those of the horizon.

    limit: ms, of 99 % of the steps after the first; beside: whether peers run the loop, too.
    """

    title: str
    problem: type
    period: float  # s
    elements: int
    periods: int
    limit: float
    beside: bool = False


CASES = (
    Case("cart and pole", Upright, 0.05, 40, 100, 1.0, beside=True),
    Case("crane", problems.CraneInTime, 0.1, 30, 60, 5.0, beside=True),
    Case("arm of six joints", problems.ArmMoves, 0.04, 10, 10, 5.0, beside=True),
    Case("four tanks", problems.TanksFilled, 5.0, 20, 60, 5.0, beside=True),
    Case("Delta", problems.DeltaReaches, 0.02, 10, 60, 2.0),
    Case("Stewart platform", problems.StewartMoves, 0.02, 10, 60, 5.0),
    Case("six links", problems.SixLinksMove, 0.02, 10, 60, 5.0),
    Case("Gantry-Tau", problems.GantryTauMoves, 0.02, 10, 60, 5.0),
)


class Timed(Mpc):
    """A controller; `took`, `prepared`: processor time of each step and preparation in s."""

    def reset(self) -> None:
        """Begin anew."""
        super().reset()
        self.took: list[float] = []
        self.prepared: list[float] = []

    def step(self, measured: Any, t: float = 0.0) -> dict[str, float]:
        """The inputs."""
        begin = process_time()
        given = super().step(measured, t)
        self.took.append(process_time() - begin)
        return given

    def prepare(self) -> None:
        """What is done before the next measurement."""
        begin = process_time()
        super().prepare()
        self.prepared.append(process_time() - begin)


def rows(cases: tuple[Case, ...] = CASES) -> Iterator[Row]:
    """Times of each loop's steps; cost and converged solves beside those of peers that are installed."""
    for case in cases:
        yield from _of(case)


def _of(case: Case) -> Iterator[Row]:
    title = f"{case.title} x {case.elements}"
    quick = Timed(case.problem, period=case.period, elements=case.elements)
    cost = _cost(quick, case)
    for name, times in (("a step", quick.took[1:]), ("its preparation", quick.prepared)):
        median, most = 1e3 * np.percentile(times, [50, 99])
        yield at_most(f"{title}: 99 % of {name} (median {median:.2f} ms)", most, case.limit, "ms cpu")
    if not case.beside:
        return
    whole = Timed(case.problem, period=case.period, elements=case.elements, iterations="converged")
    costs = {"real time": cost, "converged": _cost(whole, case)}
    times = {"converged": whole.took[1:]}
    try:
        from tests.benchmarks.in_the_loop.with_do_mpc import WithDoMpc
        from tests.benchmarks.in_the_loop.with_rockit import WithRockit
    except ImportError:
        return
    for name, kind in (("do-mpc", WithDoMpc), ("rockit", WithRockit)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            peer = kind(case.problem, period=case.period, elements=case.elements)
            costs[name], times[name] = _cost(peer, case), peer.took[1:]
    for name, found in times.items():
        median, most = 1e3 * np.percentile(found, [50, 99])
        yield shown(f"{title}: {name}, median and 99 %", f"{median:.1f}, {most:.1f} ms cpu")
    spread = max(costs.values()) / min(costs.values()) - 1
    yield at_most(f"{title}: spread of the four costs", spread, 0.01)
    ratio = float(np.median(times["converged"]) / np.median(times["do-mpc"]))
    yield at_most(f"{title}: converged step against do-mpc", ratio, 0.5, "x")


def _cost(mpc: Any, case: Case) -> float:
    """Of the closed loop, the controller's functions compiled."""
    mpc.compiled()
    return mpc.run(stop=case.periods * case.period).cost


if __name__ == "__main__":
    chosen: Any = tuple(case for case in CASES if not sys.argv[1:] or case.title.startswith(sys.argv[1]))
    sys.exit(print_table("Controllers in closed loops", [rows(chosen)]))
