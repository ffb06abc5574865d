"""The loop of a predictive controller and a plant with other parameters, measured with noise."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.checks import number
from gantrytau.border.refusal import Given
from gantrytau.describing.record import Record
from gantrytau_optimica.predictive.estimators.state_estimator import StateEstimator
from gantrytau_optimica.predictive.outputs import Outputs
from gantrytau_optimica.predictive.plan import PlannedMotion, StepTimes, motion_result
from gantrytau_optimica.predictive.stages import HorizonStages

PARTS = 4  # steps of the plant in a period


@dataclass(frozen=True, eq=False)
class ClosedLoop(Record):
    """A closed loop, looked up by the model's names as its `result`: `loop["crane.s"]`, (times,).

    result: all variables of the plant at the samples, inputs held; statuses: of the controller at each sample; timing: of
    its steps; cost: the integral of the problem's integrand along the motion; estimates: what an estimator gave at each
    sample but the last, by name; parameters: of the plant.
    """

    result: Result
    statuses: tuple[str, ...]
    timing: StepTimes
    cost: float
    estimates: Mapping[str, np.ndarray] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)

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
    estimator: StateEstimator | None = None,
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
    sensors = _Sensors(mpc, plant, noise, seed, estimator)
    guessed = [s.guess(np.zeros(1))[0] for s in (*stages.phase.states, *stages.phase.algebraics)]
    w = np.tile(np.array(guessed, dtype=float), 2) / stages.size_w
    # the plant may have other sizes than the controller: between them go numbers in their units
    x = mpc.whole_state(dict(zip(mpc.states, guessed, strict=False)) | dict(start)) / stages.sizes_x
    w[: stages.nx] = w[stages.last] = x
    states, unknowns, inputs, statuses, cost = [x], [], [], [], 0.0
    now = waiting = mpc.held
    for k in range(count):
        t = k * mpc.period
        given = mpc.step(sensors.state(x, w[stages.last.stop :], now, t), t)
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
    parameters = dict(built.read.dae.parameter_values)
    return ClosedLoop(found, tuple(statuses), mpc.timing, cost, sensors.estimates, parameters)


class _Sensors:
    """What the controller is told of the plant at a sample: its state with noise, or what an estimator makes of outputs."""

    def __init__(
        self,
        mpc: Any,
        plant: tuple[Any, HorizonStages],
        noise: Mapping[str, float],
        seed: int,
        estimator: StateEstimator | None,
    ):
        self.mpc, self.stages, self.estimator = mpc, plant[1], estimator
        self.names = mpc.states if estimator is None else estimator.outputs
        self._spread = np.zeros(len(self.names))
        for name, value in noise.items():
            if name not in self.names:
                raise ModelError(
                    f"expected {'states of' if estimator is None else 'some of what is measured,'} "
                    f"{', '.join(self.names)}",
                    place="run",
                    found=Given("noise", name),
                )
            self._spread[self.names.index(name)] = number("run", f"noise[{name}]", value, least=0.0)
        self._random = np.random.default_rng(seed)
        self._estimates: list[dict[str, float]] = []
        if estimator is not None:
            self._check(estimator)
            self._outputs = Outputs(*plant, self.names)
            estimator.reset()

    def _check(self, estimator: StateEstimator) -> None:
        mpc, given = self.mpc, (*estimator.states, *estimator.parameters)
        lacking = [name for name in (*mpc.states, *mpc.estimated) if name not in given]
        if lacking:
            words = f"the estimator does not estimate {', '.join(lacking)}, which the controller takes"
            raise ModelError(
                f"{words}; let both have the same problem, parameters= and disturbance=", place=mpc.name
            )
        if estimator.period != mpc.period:
            words = f"the estimator has a period of {estimator.period:g} s, expected {mpc.period:g} s as the controller has"
            raise ModelError(words, place=mpc.name)

    @property
    def estimates(self) -> dict[str, np.ndarray]:
        """Courses of the estimates by name."""
        first = self._estimates[0] if self._estimates else {}
        return {name: np.array([one[name] for one in self._estimates]) for name in first}

    def state(self, x: np.ndarray, z: np.ndarray, inputs: Mapping[str, float], t: float) -> dict[str, float]:
        """The state as the controller is told it, with estimates; inputs: those held until t."""
        stages, noise = self.stages, self._spread * self._random.standard_normal(len(self.names))
        if self.estimator is None:
            return dict(zip(self.names, (x * stages.sizes_x + noise).tolist(), strict=True))
        u = np.array(list(inputs.values())) / stages.sizes_u
        z = self._outputs.settled(x, z, u, t)
        y = self._outputs.at(x[None], z[None], u[None], np.array([t]))[0][0] + noise
        found = self.estimator.step(dict(zip(self.names, y.tolist(), strict=True)), inputs, t)
        self._estimates.append(found)
        return {name: found[name] for name in (*self.mpc.states, *self.mpc.estimated)}
