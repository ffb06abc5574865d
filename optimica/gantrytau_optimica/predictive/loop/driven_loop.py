"""The loop of a predictive controller and a plant that runs by itself."""

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from gantrytau import ModelError, SolveError
from gantrytau.border.checks import instance
from gantrytau.simulation.to_result import labels
from gantrytau_optimica.predictive.loop.closed_loop import ClosedLoop, planned_by
from gantrytau_optimica.predictive.loop.model_loop import PARTS, samples
from gantrytau_optimica.predictive.loop.plant import DrivenPlant, check_fit, joined
from gantrytau_optimica.predictive.loop.sensors import Sensors
from gantrytau_optimica.predictive.plan import PlannedMotion, motion_result
from gantrytau_optimica.predictive.stages import HorizonStages


def driven_loop(
    mpc: Any,
    plant: DrivenPlant,
    stop: float,
    sensors: Sensors,
    wires: Mapping[str, str] | None,
    begun: Any = None,
) -> ClosedLoop:
    """An Mpc as the law of a plant until stop.

    What the plant does not tell of its motion is as the controller's model has it, held to the plant's state at each sample.
    """
    if begun:
        words = (
            "found start= or after=, expected none: this plant begins by itself, as Controller(..., starts=)"
        )
        raise ModelError(words, place="run", argument="plant")
    every, count = check_fit(mpc, plant), samples(stop, mpc.period)
    instance("run", "wires", wires, Mapping | None, "{name: name in the plant}")
    joins: dict[str, str] = dict(wires or {})
    if odd := [name for name in joins if name not in (*mpc.inputs, *sensors.names)]:
        known = ", ".join(dict.fromkeys((*mpc.inputs, *sensors.names)))
        raise ModelError(f"found '{odd[0]}', expected some of {known}", place="run", argument="wires")
    measured = joined(mpc, "output", sensors.names, plant.plant_outputs, joins)
    units = labels(mpc.built.read.dae)[0]
    if plant.plant_inputs is None:
        given = {name: str(joins.get(name, name)) for name in mpc.inputs}
    else:
        given = joined(mpc, "input", mpc.inputs, plant.plant_inputs, joins)
    law = _Law(mpc, sensors, measured, given, count)
    gives = {own: units.get(name) or "1" for name, own in given.items()}
    record = plant.under(
        law, every=every, known=list(measured.values()), gives=gives, stop=count * mpc.period
    )
    periods = min(count, (len(record.time) - 1) // every)
    if periods < 1:
        raise SolveError(f"{mpc.name}: the plant ended before a period was over", time=record.time[-1])
    rows = every * np.arange(periods + 1)
    made = [
        int(np.searchsorted(law.samples, k, side="right")) - 1 for k in range(periods)
    ]  # that is in force
    statuses = [law.statuses[i] if law.samples[i] == k else "late" for k, i in enumerate(made)]
    word = "applied" if plant.plant_inputs is not None else "mpc"
    inputs = np.column_stack([record[f"{word}.{own}"][rows[:-1]] for own in given.values()])
    told = {name: record[own][rows] for name, own in _told(mpc, plant, joins).items()}
    motion, cost = _motion(mpc, inputs, told, [law.states[i] for i in made])
    title = f"{mpc.name}, closed loop with {record.title or 'a plant'}"
    found = motion_result(mpc.built, mpc.stages, motion, mpc.period, title, told=told)
    planned: Any = planned_by(mpc, [law.made[i] for i in made], found.time)
    parameters = dict(mpc.built.read.dae.parameter_values)
    kept: Any = dict(estimates=sensors.estimates, record=record, parameters=parameters)
    return ClosedLoop(found, tuple(statuses), mpc.timing, cost, **planned, **kept)


class _Law:
    """An Mpc as a function of time and what is measured, by the names of a plant."""

    def __init__(
        self, mpc: Any, sensors: Sensors, measured: Mapping[str, str], given: Mapping[str, str], count: int
    ):
        self._mpc, self._sensors, self._measured, self._given = mpc, sensors, measured, given
        self._count = count
        self.samples = list[int]()  # at which it was asked: one that is busy is not
        self.made, self.statuses, self.states = list[PlannedMotion](), list[str](), list[list[float]]()
        self._now = self._waiting = mpc.held

    def __call__(self, t: float, known: Mapping[str, float]) -> dict[str, float]:
        """The inputs of the controller, in the last sample those of before."""
        mpc, k = self._mpc, round(t / self._mpc.period)
        if k < self._count:
            self.samples.append(k)
            y = np.array([known[own] for own in self._measured.values()])
            state = self._sensors.told(y, self._now, t)
            given = mpc.step(state, t)
            self.statuses.append(mpc.status)
            self.states.append([state[name] for name in mpc.states])
            self.made.append(mpc.planned_motion(np.array(self.states[-1]), t).without_stages())
            mpc.prepare()
            self._now, self._waiting = (self._waiting, given) if mpc.delay else (given, given)
        return {own: self._waiting[name] for name, own in self._given.items()}


def _told(mpc: Any, plant: DrivenPlant, wires: Mapping[str, str]) -> dict[str, str]:
    """All variables of the controller's model that the plant tells, by its names."""
    found = dict[str, str]()
    for name in mpc.built.read.dae.variables:
        if name not in mpc.inputs:
            with suppress(ModelError):
                found |= joined(mpc, "output", [name], plant.plant_outputs, wires)
    return found


def _motion(
    mpc: Any, inputs: np.ndarray, told: Mapping[str, np.ndarray], states: list[list[float]]
) -> tuple[PlannedMotion, float]:
    """The motion of the controller's model from the plant's state at each sample, and its cost, NaN where there is none."""
    stages = HorizonStages(mpc.built.problem, mpc.period / PARTS)
    x = np.vstack([states, states[-1:]])[: len(inputs) + 1]
    for k, name in enumerate(mpc.states):
        x[:, k] = told.get(name, x[:, k])
    x, u = x / stages.sizes_x, inputs / stages.sizes_u
    w, cost, all_w = mpc.planned_motion(x[0] * stages.sizes_x, 0.0).w[0], 0.0, []
    for k in range(len(u)):
        w = w.copy()
        w[: stages.nx] = w[stages.last] = x[k]
        for part in range(PARTS):
            at = k * mpc.period + part * stages.step
            try:
                w = stages.moved(w[stages.last], w, u[k], at)
                cost += stages.spent(w, u[k], at)
            except ModelError:  # the plant was where the model cannot be
                cost = np.nan
        all_w.append(w)
    if mpc.states[0] not in told:
        x[-1] = all_w[-1][stages.last]
    return PlannedMotion(x, np.array(all_w), u, 0.0), float(cost)
