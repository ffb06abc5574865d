"""The loop of a predictive controller and a plant with other parameters, measured with noise."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.checks import number
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau_optimica.predictive.plan import PlannedMotion, StepTimes, motion_result
from gantrytau_optimica.predictive.stages import HorizonStages

PARTS = 4  # steps of the plant in a period


@dataclass(frozen=True, eq=False)
class ClosedLoop(Record):
    """A closed loop, looked up by the model's names as its `result`: `loop["crane.s"]`, (times,).

    result: all variables of the plant at the samples, inputs held; statuses: of the controller at each sample; timing: of
    its steps; cost: the integral of the problem's integrand along the motion; parameters: of the plant.
    """

    result: Result
    statuses: tuple[str, ...]
    timing: StepTimes
    cost: float
    parameters: Mapping[str, float]

    def __getitem__(self, name: str) -> np.ndarray:
        return self.result[name]

    @property
    def time(self) -> np.ndarray:
        """The samples in s."""
        return self.result.time

    def plot(self, *names: str, **keywords: Any):
        """Variables over time, as Result.plot."""
        return self.result.plot(*names, **keywords)

    def __str__(self) -> str:
        words = {status: self.statuses.count(status) for status in dict.fromkeys(self.statuses)}
        said = ", ".join(f"{count} {status}" for status, count in words.items())
        return f"{self.result.title}: {self.result.time[-1]:g} s, cost {self.cost:.6g}; {said}\n{self.timing}"


def closed_loop(
    mpc: Any,
    plant: tuple[Any, HorizonStages],
    stop: float,
    start: Mapping[str, Any],
    noise: Mapping[str, float],
    seed: int,
) -> ClosedLoop:
    """An Mpc and a plant from start to stop; between samples the plant is integrated in steps of a quarter of a period."""
    built, stages = plant
    if (
        tuple(s.name for s in stages.phase.states) != mpc.states
        or tuple(s.name for s in stages.phase.inputs) != mpc.inputs
    ):
        raise ModelError(
            f"plant has the states {', '.join(s.name for s in stages.phase.states)}, expected those of the controller, "
            f"{', '.join(mpc.states)}: give the same problem with other parameters",
            place=mpc.name,
        )
    count = round(number("run", "stop", stop, unit="s", above=0.0) / mpc.period)
    if count < 1:
        raise ModelError(
            f"expected at least one period of {mpc.period:g} s", place="run", found=Given("stop", stop)
        )
    spread = np.zeros(stages.nx)
    for name, value in noise.items():
        if name not in mpc.states:
            raise ModelError(
                f"expected states of {', '.join(mpc.states)}", place="run", found=Given("noise", name)
            )
        spread[mpc.states.index(name)] = number("run", f"noise[{name}]", value, least=0.0)
    random = np.random.default_rng(seed)
    guessed = [s.guess(np.zeros(1))[0] for s in (*stages.phase.states, *stages.phase.algebraics)]
    w = np.tile(np.array(guessed, dtype=float), 2) / stages.size_w
    # the plant may have other sizes than the controller: between them go numbers in their units
    x = mpc.whole_state(dict(zip(mpc.states, guessed, strict=False)) | dict(start)) / stages.sizes_x
    w[: stages.nx] = w[stages.last] = x
    states, unknowns, inputs, statuses, cost = [x], [], [], [], 0.0
    waiting = mpc.held
    for k in range(count):
        t = k * mpc.period
        measured = x * stages.sizes_x + spread * random.standard_normal(stages.nx)
        given = mpc.step(dict(zip(mpc.states, measured.tolist(), strict=True)), t)
        statuses.append(mpc.status)
        mpc.prepare()
        now, waiting = (waiting, given) if mpc.delay else (given, given)
        u = np.array(list(now.values())) / stages.sizes_u
        for part in range(PARTS):
            at = t + part * stages.step
            w = stages.moved(x, w, u, at)
            cost += stages.spent(w, u, at)
            x = w[stages.last]
        states.append(x)
        unknowns.append(w)
        inputs.append(u)
    motion = PlannedMotion(np.array(states), np.array(unknowns), np.array(inputs), 0.0)
    found = motion_result(built, stages, motion, mpc.period, f"{mpc.name}, closed loop")
    return ClosedLoop(found, tuple(statuses), mpc.timing, cost, dict(built.read.dae.parameter_values))
