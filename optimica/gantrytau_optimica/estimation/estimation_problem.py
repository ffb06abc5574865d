"""Experiments as one optimisation problem: a phase for each, in which the estimated parameters are the same.

The problem has one component per experiment, an Optimization that holds the model. Before it is translated, the
estimated parameters of all models are bound to one free parameter, and start values to theirs.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Model, ModelError, Samples, der
from gantrytau.border.refusal import did_you_mean
from gantrytau.flattening.flat_model import FlatModel, FlatParameter, FlatVariable
from gantrytau.flattening.shapes import check_shape, numpy_shape
from gantrytau.language.model import Declared
from gantrytau.language.symbols import split_derivative
from gantrytau_optimica.estimation.experiments import Experiment, is_free
from gantrytau_optimica.problem.optimization import Free, Optimization, sum_of_squares
from gantrytau_optimica.problem.problem_checks import static
from gantrytau_optimica.problem.read_problem import read_problem
from gantrytau_optimica.problem.symbolic_problem import SymbolicProblem

PART = re.compile(r"([A-Za-z_]\w*)((?:\[\d+(?:, ?\d+)*\])?)")


@dataclass(frozen=True, eq=False)
class Estimated:
    """A number to be estimated: its name in the answer, guess, limits and typical size."""

    name: str
    guess: float
    min: float
    max: float

    @property
    def size(self) -> float:
        """A typical magnitude, from the guess or else the limits."""
        limits = [abs(x) for x in (self.min, self.max) if np.isfinite(x) and x != 0.0]
        return abs(self.guess) or (min(limits) if limits else 1.0)


@dataclass(frozen=True, eq=False)
class Plan:
    """The problem that was read, and the numbers to be estimated in the order of the answer."""

    read: SymbolicProblem
    numbers: tuple[Estimated, ...]
    experiments: tuple[Experiment, ...]
    static: bool

    @property
    def outputs(self) -> np.ndarray:
        """For every measured value, in the order of the residuals, the number of its name among all measured, (N,)."""
        measured = [(name, s.values.size) for e in self.experiments for name, s in e.measured.items()]
        order = list(dict.fromkeys(name for name, _ in measured))
        return np.repeat([order.index(name) for name, _ in measured], [size for _, size in measured])


def plan(
    model: Any, parameters: Mapping[str, Any], experiments: tuple[Experiment, ...], noise: Mapping[str, float]
) -> Plan:
    """Read the problem of estimating `parameters`; noise: deviations by name where none were given. Raises ModelError."""
    instance = model() if isinstance(model, type) and issubclass(model, Model) else model
    if not isinstance(instance, Model) or isinstance(instance, Optimization):
        raise ModelError(f"estimate: found {model!r}, expected a Model (its class or an instance)")
    change = _Change(type(instance).__name__, parameters, experiments)
    phases = {e.name: _phase(instance, e, noise) for e in experiments}
    problem = type(type(instance).__name__, (Optimization,), phases)
    read = read_problem(problem, change)
    _check_inputs(read, experiments)
    for one in experiments:
        for name, samples in one.measured.items():
            samples.check_unit(f"measured {name}", read.dae.flat.unit(f"{one.name}.model.{name}"))
    still = static(read.dae)
    if still:
        read = _as_rows(read, experiments)
    elif any(e.static for e in experiments):
        raise ModelError(f"{read.name}: found measured values without times, expected Samples(times, values)")
    return Plan(read, tuple(change.numbers), experiments, still)


def _phase(model: Model, experiment: Experiment, noise: Mapping[str, float]) -> Optimization:
    """The phase of one experiment, not yet with free parameters."""

    def objective(self: Any) -> Any:
        total = 0.0
        for name, samples in experiment.measured.items():
            found = member(self.model, name)
            columns = samples.values.shape[1]
            if found.numel() != columns:
                raise ModelError(
                    f"measured {name}: found samples of {columns} columns, expected {found.numel()}"
                )
            samples.check_shape(f"measured {name}", numpy_shape(found))
            given = noise.get(name)
            for one, column in zip(ca.vec(found).elements(), single_columns(samples, given), strict=True):
                total = total + sum_of_squares(one, column)
        return total

    begin, stop = experiment.horizon
    body = dict(
        model=model,
        start_time=begin if not experiment.static else 0.0,
        final_time=stop,
        inputs={f"model.{name}": value for name, value in experiment.inputs.items()},
        objective=objective,
    )
    return type(experiment.name, (Optimization,), body)()


def member(model: Any, name: str) -> Any:
    """The symbol of a variable of an instantiated model by its name, derivatives and elements included."""
    base, order = split_derivative(name)
    found = model
    for part in base.split("."):
        match = PART.fullmatch(part)
        known = [n for n in vars(found) if not n.startswith("_")] if isinstance(found, Declared) else []
        if match is None or match[1] not in known:
            raise ModelError(
                f"measured {name}: {type(model).__name__} has no '{name}'{did_you_mean(part, known)}"
            )
        found = vars(found)[match[1]]
        if match[2]:
            index = [int(i) for i in match[2][1:-1].split(",")]
            try:
                found = found[tuple(index) if len(index) > 1 else index[0]]
            except (IndexError, RuntimeError, TypeError):
                raise ModelError(f"measured {name}: there is no element {match[2]} of {match[1]}") from None
    if not isinstance(found, ca.SX):
        raise ModelError(f"measured {name}: found a {type(found).__name__}, expected a variable of the model")
    for _ in range(order):
        found = der(found)
    return found


def single_columns(samples: Samples, noise: float | None) -> list[Samples]:
    """Samples of one column each; noise: their deviation if they have none."""
    deviations = samples.deviations if noise is None else np.full(samples.values.shape, noise)
    return [
        Samples(samples.times, values, deviation=deviation)
        for values, deviation in zip(samples.values.T, deviations.T[:, :, None], strict=True)
    ]


class _Change:
    """Binds the estimated parameters and the starts of all phases to free numbers, which it remembers."""

    def __init__(self, model: str, parameters: Mapping[str, Any], experiments: Sequence[Experiment]):
        self.model, self.parameters, self.experiments = model, parameters, experiments
        self.numbers: list[Estimated] = []
        self.added: list[FlatParameter] = []

    def __call__(self, flat: FlatModel) -> FlatModel:
        found: dict[str, FlatVariable] = {v.name: v for v in (*flat.variables, *flat.parameters)}
        for name, value in self.parameters.items():
            self._shared(found, name, value)
        for experiment in self.experiments:
            prefix = f"{experiment.name}." if len(self.experiments) > 1 else ""
            for name, value in experiment.parameters.items():
                place = self._find(found, experiment, name, "parameters")
                self._set_parameter(
                    found, place, self._values(f"{prefix}{name}", found[place[0]], place[1], value)
                )
            for name, value in experiment.start.items():
                place = self._find(found, experiment, name, "start")
                values = self._values(f"{prefix}start({name})", found[place[0]], place[1], value)
                self._set_start(found, place, values, experiment)
            for name in experiment.inputs:
                self._find(found, experiment, name, "inputs")
        parameters = tuple(found[p.name] for p in flat.parameters)
        return replace(
            flat,
            variables=tuple(found[v.name] for v in flat.variables),
            parameters=(*parameters, *self.added),
        )

    def _find(
        self, found: Mapping[str, FlatVariable], experiment: Experiment, name: str, which: str
    ) -> tuple[str, list[int]]:
        """Name of the whole quantity in the problem, and which of its elements are meant."""
        path = f"{experiment.name}.model."
        wanted = [v for v in found.values() if v.name.startswith(path)]
        for one in wanted:
            full = path + name
            if full != one.name and full not in one.elements:
                continue
            if isinstance(one, FlatParameter) != (which == "parameters"):
                kind = "a parameter, expected it in parameters" if isinstance(one, FlatParameter) else (
                    "a variable, expected a parameter; an initial value belongs in start of its Experiment"
                )  # fmt: skip
                raise ModelError(f"{self.model}: {which}: {name} is {kind}")
            return one.name, list(range(len(one.elements))) if full == one.name else [
                one.elements.index(full)
            ]
        names = [
            v.name[len(path) :] for v in wanted if isinstance(v, FlatParameter) == (which == "parameters")
        ]
        raise ModelError(f"{which}: {self.model} has no '{name}'{did_you_mean(name, names)}")

    def _shared(self, found: dict[str, FlatVariable], name: str, value: Any) -> None:
        places = [
            self._find(found, e, name, "parameters") for e in self.experiments if name not in e.parameters
        ]
        if not places:
            raise ModelError(f"estimate: every experiment has its own {name}; take it out of parameters")
        free = value if is_free(value) else Free(value)
        values = self._values(name, found[places[0][0]], places[0][1], free)
        for place in places:
            self._set_parameter(found, place, values)

    def _values(self, name: str, quantity: FlatVariable, which: list[int], value: Any) -> list[ca.SX]:
        """One expression for each element: numbers, or symbols of free numbers."""
        guess = value.value if is_free(value) else value
        try:
            given = np.asarray(guess, dtype=float)
            if given.ndim and given.size != len(which):  # one number may stand for all
                raise ValueError
        except (TypeError, ValueError):
            raise ModelError(f"{name}: found {guess!r}, expected {len(which)} numbers or Free(...)") from None
        if given.ndim:
            check_shape(name, given.shape, _shape(quantity, which))
        given = np.broadcast_to(given.ravel(order="F"), len(which))
        if not np.all(np.isfinite(given)):
            raise ModelError(f"{name}: found {guess!r}, expected finite numbers")
        if not is_free(value):
            return [ca.SX(float(x)) for x in given]
        names = [name] if len(which) == 1 else [name + e[len(quantity.name) :] for e in quantity.elements]
        if name.endswith(")") and len(which) > 1:
            names = [name[:-1] + e[len(quantity.name) :] + ")" for e in quantity.elements]
        ends = [_ends(name, end, len(which)) for end in (value.min, value.max)]
        limits = [_declared(quantity, k) for k in which]
        symbols = []
        for k, one in enumerate(names):
            low = limits[k][0] if ends[0] is None else float(ends[0][k])
            high = limits[k][1] if ends[1] is None else float(ends[1][k])
            symbols.append(self._free(one, quantity, float(given[k]), low, high))
        return symbols

    def _free(self, name: str, quantity: FlatVariable, guess: float, low: float, high: float) -> ca.SX:
        if not low < high:
            raise ModelError(f"{name}: limits {low:g} and {high:g}, expected the first to be the smaller")
        if not low <= guess <= high:
            raise ModelError(
                f"{name}: the guess {guess:g} lies outside of its limits {low:g} and {high:g}; correct it"
            )
        symbol = ca.SX.sym(name)
        self.numbers.append(Estimated(name, guess, low, high))
        self.added.append(
            FlatParameter(
                name, "parameter", (), (name,), symbol, quantity.unit, quantity.description,
                min=(ca.SX(low),), max=(ca.SX(high),), free=True, value=(ca.SX(guess),),
            )
        )  # fmt: skip
        return symbol

    def _set_parameter(
        self, found: dict[str, FlatVariable], place: tuple[str, list[int]], values: list[ca.SX]
    ) -> None:
        old: Any = found[place[0]]
        bound = list(old.value)
        for k, value in zip(place[1], values, strict=True):
            bound[k] = value
        # limits are those of the free number
        found[old.name] = replace(old, value=tuple(bound), min=None, max=None, free=False)

    def _set_start(
        self,
        found: dict[str, FlatVariable],
        place: tuple[str, list[int]],
        values: list[ca.SX],
        experiment: Experiment,
    ) -> None:
        old = found[place[0]]
        if len(place[1]) < len(old.elements) and not old.fixed:
            path = f"{experiment.name}.model."
            given = {n for n in experiment.start if f"{path}{n}" in old.elements}
            if len(given) < len(old.elements):
                missing = next(e[len(path) :] for e in old.elements if e[len(path) :] not in given)
                raise ModelError(
                    f"{experiment.name}: start of {missing} is missing, expected that of all of {old.name[len(path) :]}"
                )
        start = list(old.start or [ca.SX(0)] * len(old.elements))
        for k, value in zip(place[1], values, strict=True):
            start[k] = value
        found[old.name] = replace(old, start=tuple(start), fixed=True)


def _shape(quantity: FlatVariable, which: list[int]) -> tuple[int, ...]:
    return quantity.shape if len(which) == len(quantity.elements) else ()


def _ends(name: str, end: Any, count: int) -> np.ndarray | None:
    if end is None:
        return None
    try:
        return np.broadcast_to(np.asarray(end, dtype=float).ravel(order="F"), (count,))
    except (TypeError, ValueError):
        raise ModelError(f"{name}: found the limit {end!r}, expected a number or {count}") from None


def _declared(quantity: FlatVariable, k: int) -> tuple[float, float]:
    """Limits that the model declares, where they are numbers."""
    ends = [-np.inf, np.inf]
    for i, limit in enumerate((quantity.min, quantity.max)):
        if limit is not None and limit[k].is_constant():
            ends[i] = float(limit[k])
    return ends[0], ends[1]


def _check_inputs(read: SymbolicProblem, experiments: Sequence[Experiment]) -> None:
    """ModelError for inputs that are not known, or not everywhere."""
    missing = [n for n in read.dae.inputs if n not in read.courses]
    if missing:
        where, name = missing[0].split(".model.", 1)
        raise ModelError(
            f"{read.name}: the input {name} of {where} is not known, expected it among the inputs of that experiment",
            argument="inputs",
        )
    for experiment in experiments:
        for name, value in experiment.inputs.items():
            if isinstance(value, Samples) and not static(read.dae):
                value.require(f"{experiment.name}, input {name}", *experiment.horizon, between=True)


def _as_rows(read: SymbolicProblem, experiments: Sequence[Experiment]) -> SymbolicProblem:
    """A static problem: every sample is a row of its own, at which the inputs have the values of that row."""
    phases, courses = [], dict(read.courses)
    for phase, experiment in zip(read.phases, experiments, strict=True):
        times = sample_times(experiment)
        first = times[0] - (times[1] - times[0] if times.size > 1 else 1.0)
        phases.append(replace(phase, start_time=ca.SX(first), final_time=ca.SX(times[-1])))
        for name, course in courses.items():
            if phase.owns(name) and isinstance(course, tuple):
                samples, column = course
                if times[0] < samples.times[0] or times[-1] > samples.times[-1]:
                    raise ModelError(
                        f"{phase.name}: the samples of {name} do not reach over the measured ones; add rows"
                    )
                courses[name] = (Samples(times, samples.at(times, column), largest_gap=np.inf), 0)
    return replace(read, phases=tuple(phases), courses=courses)


def sample_times(experiment: Experiment) -> np.ndarray:
    """All times at which something was measured, in s."""
    return np.unique(np.concatenate([s.times for s in experiment.measured.values()]))
