"""A sampled model with what is measured of it: states, slow parameters and disturbances as one state.

    x_(k+1) = F(x_k, u_k) + q v_k        v_k of unit covariance, q = deviation in a second times sqrt(period)
    y_k = h(x_k, z_k, u_(k-1)) + r e_k   0 = g(x_k, z_k, u_(k-1)), sampled just before the input changes

F is one stage of the horizon, as `Mpc` has it. Parameters and disturbances are states with the derivative zero.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import number
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import FreeNumber, Signal
from gantrytau_optimica.control.limits import signal_limits
from gantrytau_optimica.predictive.outputs import Outputs
from gantrytau_optimica.predictive.stages import HorizonStages
from gantrytau_optimica.predictive.unknowns import disturbance_of, named_values, with_unknowns


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviations by name. measured: of samples; process: of what a state strays from the model in a second, and a
    parameter from a constant; parameters, prior: of start values; disturbance: of its change in a second.
    """

    measured: Mapping[str, Any]
    process: Mapping[str, Any]
    parameters: Mapping[str, Any]
    disturbance: Mapping[str, Any]
    prior: Mapping[str, Any]


class ObservedModel:
    """Stages, outputs and covariances of a model, in scaled variables."""

    def __init__(self, place: str, problem: Any, period: float, noise: Noise, start: Mapping[str, Any]):
        self.place = place
        draft = with_unknowns(problem, noise.parameters, noise.disturbance, place)
        self.model_states = tuple(s.name for s in draft.problem.phases[0].states)
        self.flat, known = (
            draft.read.dae.flat,
            draft.read.dae.inputs,
        )  # known states: integrals of what is commanded
        variables = tuple(draft.read.dae.variables)
        draft = _as_states(draft)
        states = draft.problem.phases[0].states
        self.names = names = tuple(s.name for s in states)
        measured = self._deviations("measured", noise.measured, variables)
        if not measured:
            raise ModelError("found nothing measured, expected {name: standard deviation}", place=place)
        self.outputs, self.r = tuple(measured), np.array([*measured.values()])
        wandering = self._deviations("noise", noise.process, names, least=True)
        for name, value in self._deviations("disturbance", noise.disturbance, variables).items():
            wandering[disturbance_of(name)] = value
        prior = self._deviations("prior", noise.prior, names, least=True)
        prior |= self._deviations("parameters", noise.parameters, names)
        begin = {s.name: float(s.guess(np.zeros(1))[0]) for s in states}
        begin |= named_values(self.flat, place, "start", start, names)
        self.built = built = _sized(draft, {n: max(prior.get(n, 0.0), abs(begin[n])) for n in names})
        (phase,) = built.problem.phases
        self.inputs = tuple(s.name for s in phase.inputs)
        limits = signal_limits(phase, built.problem.name)
        self.stages = stages = HorizonStages(
            replace(built.problem, phases=(replace(phase, path_limits=(), integrand=ca.SX(0.0)),)), period
        )
        sizes = dict(zip(names, stages.sizes_x, strict=True))
        self.bounds = (
            np.array([limits[name] for name in names], dtype=float).reshape(-1, 2).T / stages.sizes_x
        )
        self.q = np.array([wandering.get(n, 0.0) / sizes[n] for n in names]) * np.sqrt(period)
        self.p = np.array([prior.get(n, 0.0 if n in known else sizes[n]) / sizes[n] for n in names])
        self.x0 = np.array([begin[n] / sizes[n] for n in names])
        for name, value, low, high in zip(names, self.x0, *self.bounds, strict=True):
            if not low <= value <= high:
                words = f"the start of {name} lies beyond its limits"
                ends = f"{low * sizes[name]:g} to {high * sizes[name]:g}"
                raise ModelError(f"{words}, expected {ends}", place=place)
        added = [self._disturbance(name) for name in self.outputs]
        self.shown = Outputs(built, stages, self.outputs, ca.vertcat(*added))
        self.z0 = np.array([s.guess(np.zeros(1))[0] for s in phase.algebraics]).reshape(-1) / stages.sizes_z

    def _deviations(
        self, argument: str, given: Mapping[str, Any], names: Any, least: bool = False
    ) -> dict[str, float]:
        """Standard deviations by scalar name, above zero, or zero as well; one number stands for a whole vector."""
        limits: Any = {"least": 0.0} if least else {"above": 0.0}
        found: dict[str, float] = {}
        for name, value in given.items():
            unit = self.flat.unit(name)
            one = (
                value
                if np.ndim(value)
                else number(self.place, f"{argument}[{name}]", value, unit=unit, **limits)
            )
            found |= named_values(self.flat, self.place, argument, {name: one}, tuple(names), alike=True)
        for name, value in found.items():
            number(self.place, f"{argument}[{name}]", value, **limits)
        return found

    def _disturbance(self, name: str) -> ca.SX:
        """What is added to an output."""
        if name in self.built.read.dae.inputs:
            return ca.SX(0.0)
        own = disturbance_of(name)
        return next((s.symbol for s in self.stages.phase.states if s.name == own), ca.SX(0.0))

    def in_units(self, x: np.ndarray) -> dict[str, float]:
        """A scaled state by names."""
        return dict(zip(self.names, (x * self.stages.sizes_x).tolist(), strict=True))


def _as_states(built: Built) -> Built:
    """The problem with its free numbers as states that do not change; those of its horizon alone are left out."""
    problem = built.problem
    (phase,) = problem.phases
    times = {"start_time", "final_time"}
    numbers = [n for n in problem.free if n.name not in times]
    if not (phase.states or numbers):
        raise ModelError("there is no state to estimate", place=problem.name)
    sizes = {s.name: s.nominal for s in phase.signals}
    states = tuple(_constant(n, sizes) for n in numbers)
    ode = ca.vertcat(phase.ode, ca.SX.zeros(len(states), 1))
    phase = replace(phase, states=(*phase.states, *states), ode=ode)
    return replace(built, problem=replace(problem, phases=(phase,), free=()))


def _sized(built: Built, least: Mapping[str, float]) -> Built:
    """The problem with states of at least these sizes, by name."""
    (phase,) = built.problem.phases
    states = tuple(replace(s, nominal=max(s.nominal, least[s.name])) for s in phase.states)
    return replace(built, problem=replace(built.problem, phases=(replace(phase, states=states),)))


def _constant(one: FreeNumber, sizes: Mapping[str, float]) -> Signal:
    """A free number as a signal; a disturbance has the size of what it is added to."""
    size = sizes.get(one.name.removeprefix("disturbance(")[:-1], one.size)
    return Signal(
        one.name, one.symbol, one.min, one.max, size, lambda t, guess=one.guess: np.full(t.shape, guess)
    )
