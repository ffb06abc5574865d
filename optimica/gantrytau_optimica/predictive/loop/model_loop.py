"""The loop of a predictive controller and a model with other parameters, measured with noise."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import instance, number
from gantrytau.border.refusal import Given
from gantrytau_optimica.predictive.loop.closed_loop import ClosedLoop, LoopEnd, planned_by
from gantrytau_optimica.predictive.loop.sensors import Sensors
from gantrytau_optimica.predictive.outputs import Outputs
from gantrytau_optimica.predictive.plan import PlannedMotion, motion_result
from gantrytau_optimica.predictive.stages import HorizonStages

PARTS = 4  # steps of the plant in a period


class _ModelPlant:
    """The course of a model under inputs that are held, in scaled variables, and the integral of the integrand."""

    def __init__(
        self, mpc: Any, plant: tuple[Any, HorizonStages], start: Mapping[str, Any], sensors: Sensors
    ):
        self.built, self.stages = built, stages = plant
        if (
            tuple(s.name for s in stages.phase.states) != mpc.states
            or tuple(s.name for s in stages.phase.inputs) != mpc.inputs
        ):
            raise ModelError(
                f"plant has the states {', '.join(s.name for s in stages.phase.states)}, expected those of the controller, "
                f"{', '.join(mpc.states)}: give the same problem with other parameters",
                place=mpc.name,
            )
        self._outputs = None if sensors.estimator is None else Outputs(built, stages, sensors.names)
        guessed = [s.guess(np.zeros(1))[0] for s in (*stages.phase.states, *stages.phase.algebraics)]
        self._w = np.tile(np.array(guessed, dtype=float), 2) / stages.size_w
        # the plant may have other sizes than the controller: between them go numbers in their units
        x = mpc.whole_state(dict(zip(mpc.states, guessed, strict=False)) | dict(start)) / stages.sizes_x
        self._w[: stages.nx] = self._w[stages.last] = x
        self.states, self.unknowns, self.inputs, self.cost = [x], list[Any](), list[Any](), 0.0

    def goes_on(self, motion: PlannedMotion, cost: float) -> None:
        """Be where a motion ended."""
        self.states, self.unknowns, self.inputs = list(motion.x), list(motion.w), list(motion.u)
        self._w, self.cost = self.unknowns[-1], cost

    def state(self) -> np.ndarray:
        """The state (nx,) in its units."""
        return self.states[-1] * self.stages.sizes_x

    def measured(self, inputs: Mapping[str, float], t: float) -> np.ndarray:
        """What sensors are given, without noise; inputs: those held until t."""
        if self._outputs is None:
            return self.state()
        x, u = self.states[-1], np.array(list(inputs.values())) / self.stages.sizes_u
        z = self._outputs.settled(x, self._w[self.stages.last.stop :], u, t)
        return self._outputs.at(x[None], z[None], u[None], np.array([t]))[0][0]

    def hold(self, inputs: Mapping[str, float], t: float) -> None:
        """Go on by a period with inputs held, in steps of a quarter of it."""
        u, w = np.array(list(inputs.values())) / self.stages.sizes_u, self._w
        for part in range(PARTS):
            at = t + part * self.stages.step
            w = self.stages.moved(w[self.stages.last], w, u, at)
            self.cost += self.stages.spent(w, u, at)
        self._w = w
        self.states.append(w[self.stages.last])
        self.unknowns.append(w)
        self.inputs.append(u)

    @property
    def motion(self) -> PlannedMotion:
        """The whole course."""
        return PlannedMotion(np.array(self.states), np.array(self.unknowns), np.array(self.inputs), 0.0)


def model_loop(
    mpc: Any,
    model: tuple[Any, HorizonStages],
    stop: float,
    start: Mapping[str, Any],
    sensors: Sensors,
    after: ClosedLoop | None = None,
) -> ClosedLoop:
    """An Mpc and a plant from start, or from where a loop ended, to stop."""
    plant = _ModelPlant(mpc, model, start, sensors)
    parameters = dict(plant.built.read.dae.parameter_values)
    now, waiting, made, statuses = mpc.held, mpc.held, list[PlannedMotion](), list[str]()
    if after is not None:
        instance("run", "after", after, ClosedLoop, "what run returned")
        before = end_of(mpc, after, parameters, start)
        sensors.goes_on(before, after.estimates)
        plant.goes_on(before.motion, after.cost)
        made, statuses, now, waiting = list(before.made), list(after.statuses), before.now, before.waiting
    for k in range(len(made), samples(stop, mpc.period, len(made))):
        t = k * mpc.period
        given = mpc.step(sensors.told(plant.measured(now, t), now, t), t)
        statuses.append(mpc.status)
        made.append(mpc.planned_motion(plant.state(), t).without_stages())
        mpc.prepare()
        now, waiting = (waiting, given) if mpc.delay else (given, given)
        plant.hold(now, t)
    found = motion_result(plant.built, plant.stages, plant.motion, mpc.period, f"{mpc.name}, closed loop")
    end = LoopEnd(
        mpc.key,
        mpc.memory,
        tuple(made),
        now,
        waiting,
        plant.motion,
        sensors.random.bit_generator.state,
        sensors.memory,
    )
    kept: Any = dict(estimates=sensors.estimates, parameters=parameters, end=end)
    planned = planned_by(mpc, made, found.time)
    return ClosedLoop(found, tuple(statuses), mpc.timing, plant.cost, **planned, **kept)


def samples(stop: float, period: float, begun: int = 0) -> int:
    """Periods until stop; ModelError for less than one behind those that have begun."""
    count = round(number("run", "stop", stop, unit="s", above=0.0) / period)
    if count <= begun:
        words = f"expected at least one period of {period:g} s" + (
            f" after {begun * period:g} s" if begun else ""
        )
        raise ModelError(words, place="run", found=Given("stop", stop))
    return count


def end_of(mpc: Any, after: Any, parameters: Mapping[str, float], start: Mapping[str, Any]) -> LoopEnd:
    """Where a loop ended, its controller as it was then; ModelError for one that this controller cannot go on with."""
    end, words = after.end, ""
    if end is None:
        words = "a plant that runs by itself, expected one that is a model; run it to the later stop from its beginning"
    elif mpc.key != end.controller:
        words = (
            f"the states, inputs, period and elements {end.controller}, expected those of this one, {mpc.key}"
        )
    elif other := [name for name in parameters if after.parameters.get(name) != parameters[name]]:
        was, now = after.parameters.get(other[0]), parameters[other[0]]
        words = f"{other[0]} = {was} of its plant and {now} of this one, expected the same plant"
    elif start:
        words = "start= beside it, expected none: the loop goes on from where it ended"
    if end is None or words:
        raise ModelError(f"found after= a loop with {words}", place="run", argument="after")
    mpc.resume(end.memory, after.timing)
    return end
