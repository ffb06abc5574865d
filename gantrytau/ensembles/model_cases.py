"""The cases of a model: what their names stand for, and the simulation of one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal, TypedDict

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.border.units import given
from gantrytau.compiler.parameters import with_values
from gantrytau.compiler.request import names
from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import translate_model
from gantrytau.ensembles.cases import SEED, Axes, Case
from gantrytau.language.model import Model
from gantrytau.results.result import Result
from gantrytau.simulation.simulate import simulate


class SimulationKeywords(TypedDict, total=False):
    """Keywords of `simulate` that are the same in all cases."""

    start: float
    parameters: Mapping[str, Any]
    starts: Mapping[str, Any]
    tolerance: float
    points: int
    max_step: float | None
    limits: Literal["warn", "stop", None]
    singular: Literal["stop", "cross"]


@dataclass(frozen=True, eq=False)
class ModelTask:
    """Simulates the case of a study: a parameter, a start value or an input by each name.

    places: name -> the keyword of `simulate` that takes it; policy: its other keywords.
    """

    dae: Translated
    places: Mapping[str, str]
    policy: Mapping[str, Any]

    def __getstate__(self) -> dict[str, Any]:
        plain = Translated(**{f.name: getattr(self.dae, f.name) for f in fields(Translated)})
        return {**self.__dict__, "dae": plain}

    def __call__(self, case: Case) -> Result:
        """The result of one case."""
        policy = dict(self.policy)
        for name, value in case.chosen.items():
            place = self.places[name]
            policy[place] = {**(policy.get(place) or {}), name: value}
        if case.seed is not None:
            policy[SEED] = case.seed
        return simulate(self.dae, **policy)


def model_task(
    model: Model | Translated,
    axes: Axes,
    stop: Any,
    inputs: Mapping[str, Any] | None,
    outputs: Sequence[str] | None,
    policy: SimulationKeywords,
) -> ModelTask:
    """The task of a model, translated once; ModelError for names that it does not have."""
    if stop is None:
        raise ModelError(
            "study: found no stop=, expected the time at which simulations end, in s", argument="stop"
        )
    known = [*SimulationKeywords.__annotations__]
    for name in policy:
        if name not in known:
            raise ModelError(f"study: there is no keyword '{name}'{did_you_mean(name, known)}", argument=name)
    dae = model if isinstance(model, Translated) else translate_model(model)
    places = {name: _place(dae, name) for name in axes.over}
    for name in (n for n, place in places.items() if place == "parameters"):
        for value in axes.over[name]:
            with_values(dae.flat, {name: value})  # refuses wrong shapes
    for name in names(outputs or ()):
        dae.expand(name)
    fixed = {"stop": stop, "inputs": inputs, "outputs": outputs, **policy}
    return ModelTask(dae, places, fixed)


def over_in_si(task: ModelTask, axes: Axes) -> dict[str, list[Any]]:
    """What varies, with texts such as "700 mm" brought to SI; ModelError for those of another kind."""
    flat = task.dae.flat
    return {
        name: [given(f"study: over: {name}", value, flat.unit(name)) for value in values]
        for name, values in axes.over.items()
    }


def labels(task: ModelTask) -> dict[str, str]:
    """What varies by each name that is also that of a variable: it is another thing than its course over time."""
    words = {"starts": "start", "inputs": "input"}
    return {name: f"{name}.{words[place]}" for name, place in task.places.items() if place in words}


def _place(dae: Translated, name: str) -> str:
    """The keyword of `simulate` that takes a name."""
    flat = dae.flat
    parameters = {n for p in flat.parameters for n in (p.name, *p.elements)}
    variables = {n for v in flat.variables for n in (v.name, *v.elements)}
    if name in parameters:
        return "parameters"
    if name in variables:
        return "inputs" if all(n in dae.inputs for n in flat.expand(name)) else "starts"
    remedy = did_you_mean(name, (*sorted(parameters), *sorted(variables)))
    if name.removesuffix(".start") in variables:
        remedy = f"; write '{name.removesuffix('.start')}', which varies its start value"
    raise ModelError(
        f"study: over: {flat.name} has no parameter, variable or input '{name}'{remedy}", argument="over"
    )
