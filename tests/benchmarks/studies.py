"""Studies: what many cases cost beside one after the other, and what a cluster would make of them."""

import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau import Input, connect, simulate, study, translate, white_noise
from gantrytau.inputs.input_signal import seed_of
from gantrytau_fmu import export_fmu
from gantrytau_models import ControlledRobot, prototypes
from tests.benchmarks.fmus import Running
from tests.benchmarks.pose_sweep import sweep
from tests.benchmarks.table import Row, at_most, in_turn, print_table, shown

SEEDS, STOP, PERIOD = 20, 16.0, 0.004  # of a noisy reference, held for a period of the controller, s

PAIRS = 40  # minimum-time problems that are solved
MANY, WORKERS = 10_000, 32  # problems, and workers of a cluster, for which the time is told
SMALL = 300  # cases that do nothing, for what a case costs by itself


def rows() -> Iterator[Row]:
    """All figures of studies."""
    yield from _seeds()
    yield from _pose_pairs()


class Shaken(ControlledRobot):
    """The controlled robot, whose reference is noisy."""

    noise = Input(3, unit="m", start=0.0, description="noise of the reference, resolved in the world")

    def equations(self):
        for k, cart in enumerate(self.robot.carts):
            yield self.controller.r_ref[k] == self.r_ref[k] + self.noise[k]
            yield cart.f == self.controller.f[k]
        yield connect(self.robot.q, self.controller.q)
        yield connect(self.robot.v, self.controller.v)
        yield self.r == self.robot.tool.r
        yield self.error == self.controller.feedforward.r - self.r


def _seeds() -> Iterator[Row]:
    """A robot under a sampled controller, once for each seed: as a study, call by call, and as an FMU through FMPy."""
    dae = translate(Shaken(prototypes.GT_A), events=True)
    asked: dict[str, Any] = dict(
        stop=STOP, inputs={"noise": white_noise(std=1e-3, period=PERIOD)}, tolerance=1e-6, outputs=["r"]
    )
    with tempfile.TemporaryDirectory() as name:
        outputs = [f"r[{k}]" for k in range(3)]
        path = export_fmu(Shaken(prototypes.GT_A), Path(name) / "shaken.fmu", fmi="2.0", find=outputs)
        slave = Running(path, [f"noise[{k}]" for k in range(3)], outputs)
        programs = {
            "study": lambda: study(dae, seeds=SEEDS, **asked),
            "calls": lambda: [simulate(dae, seed=seed, **asked) for seed in range(SEEDS)],
            "FMU": lambda: [_driven(slave, seed) for seed in range(SEEDS)],
        }
        simulate(dae, seed=0, **asked)  # what later runs find made
        ends = simulate(dae, seed=3, **asked)["r"][-1], _driven(slave, 3)
        assert np.abs(ends[0] - ends[1]).max() < 1e-6  # m: the same robot, the same noise
        times = in_turn(programs, 3)
        slave.close()
    title = f"{SEEDS} seeds x {STOP:g} s of a sampled robot"
    yield at_most(f"{title}, study against runs of its FMU", times["study"] / times["FMU"], 1.0, "x")
    yield shown(f"{title}, study against calls of simulate", f"{times['study'] / times['calls']:.2f} x")
    yield shown(f"{title}: study, calls, FMU", ", ".join(f"{t:.2f} s" for t in times.values()))


def _driven(slave: Running, seed: int) -> np.ndarray:
    """Where the tool is at the end of a run of the FMU, driven by the noise of a seed."""
    signal = white_noise(std=(1e-3,) * 3, period=PERIOD, seed=seed_of("white_noise", seed, "noise"))
    slave.fmu.reset()
    slave.initialize()
    for k, row in enumerate(signal.samples(0.0, STOP).values[: round(STOP / PERIOD)].tolist()):
        slave.fmu.setReal(slave.inputs, row)
        slave.fmu.doStep(k * PERIOD, PERIOD)
        slave.values()
    return np.array(slave.values())


def _pose_pairs() -> Iterator[Row]:
    """Minimum-time problems on clusters of one and two workers of this machine, and what follows for a larger one.

    A worker takes a time to begin, in which it starts and builds the problem, and then one problem after the other; the
    scheduler hands out one case after the other, too: time(n) = begin + problems * max(problem / n, hand-over). A problem
    counts with the time that it takes of a processor: workers of a cluster have theirs for themselves.
    """
    from dask.distributed import LocalCluster

    walls, used, start, handed = {}, {}, 0.0, 0.0
    for count in (1, 2):
        local: Any = LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=":0")
        with local:
            where, begin = local.scheduler_address, time.perf_counter()
            sweep(count, 0, where=where)  # builds the problem on each
            first = time.perf_counter()
            start = max(start, first - begin)
            found = sweep(PAIRS, 1, where=where)
            walls[count] = time.perf_counter() - first
            first = time.perf_counter()
            study(_nothing, over={"a": range(SMALL)}, where=where)
            handed = max(handed, (time.perf_counter() - first) / SMALL)
        used[count] = sum(v.seconds for v in found.values if v is not None)
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
