"""`study`: a model or a function for many values and seeds, on all processors or on a cluster."""

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, Unpack

from gantrytau.border.checks import number
from gantrytau.border.refusal import SolveError
from gantrytau.compiler.translated import Translated
from gantrytau.ensembles.cases import Axes, Case, read_axes
from gantrytau.ensembles.digests import digest
from gantrytau.ensembles.function_cases import FunctionTask, function_task
from gantrytau.ensembles.kept_cases import KeptCases
from gantrytau.ensembles.model_cases import ModelTask, SimulationKeywords, labels, model_task, over_in_si
from gantrytau.ensembles.study_record import Study
from gantrytau.ensembles.workers.places import Place, outcomes, read_place
from gantrytau.language.model import Model
from gantrytau.progress import Progress
from gantrytau.simulation.simulate import checked_policy


def study(
    model: Model | Translated | Callable[..., Any],
    *,
    stop: float | None = None,
    over: Mapping[str, Sequence[Any]] | None = None,
    seeds: int | Sequence[int] | None = None,
    inputs: Mapping[str, Any] | None = None,
    outputs: Sequence[str] | None = None,
    combine: Literal["grid", "zip"] = "grid",
    where: str = "processes",
    folder: str | os.PathLike[str] | None = None,
    **policy: Unpack[SimulationKeywords],
) -> Study:
    """Simulate a model, or call a function, for many values and seeds.

    over: name -> values; a name is a parameter, a variable (its start value) or an input, of a function a keyword argument.
    combine: "grid" takes every combination, "zip" the first values of all, then the second ones. seeds: how many, from 0,
    or a list; every combination is run with each, as `simulate(seed=...)`, of a function as its argument `seed`.
    where: "processes" takes all processors of this machine, "dask" starts a local cluster on them, "tcp://host:8786" is the
    address of a scheduler whose workers have this package (dask worker --nthreads 1). Cases of a model that are done before
    processes have begun, some seconds, are simulated right here.
    folder: keeps every finished case, whatever happens to the program; the same call goes on with the rest.
    stop, inputs, outputs and further keywords are those of `simulate`; without outputs= every case keeps all variables.
    The model is translated once. A case that fails is one of `.failures`; one that ends its process is tried again first.
    Raises ModelError for what is written wrongly, SolveError with `.result`, the cases that are finished, at Ctrl-C.
    """
    checked_policy("study", policy)
    stop = None if stop is None else number("study", "stop", stop, unit="s")
    axes = read_axes(over, seeds, combine)
    place = read_place(where)
    task: ModelTask | FunctionTask
    if isinstance(model, (Model, Translated)):
        task = model_task(model, axes, stop, inputs, outputs, policy)
        title, axes = task.dae.name, replace(axes, over=over_in_si(task, axes), labels=labels(task))
    else:
        task = function_task(model, axes, {"stop": stop, "inputs": inputs, "outputs": outputs, **policy})
        title = task.name
    kept = None if folder is None else KeptCases(folder, _fingerprint(task, axes))
    return _finished(title, axes, task, place, kept)


def _fingerprint(task: ModelTask | FunctionTask, axes: Axes) -> dict[str, str]:
    """What tells a study from others, part by part."""
    if isinstance(task, ModelTask):
        found = {"equations and values": digest(task.dae.flat, task.dae.states, task.dae.known)}
        found |= {name: digest(value) for name, value in sorted(task.policy.items())}
    else:
        found = {"function": digest(task.function)}
    return found | {"over": digest(list(axes.over.items()), axes.combine), "seeds": digest(axes.seeds)}


def _finished(
    title: str, axes: Axes, task: Callable[[Case], Any], place: Place, kept: KeptCases | None
) -> Study:
    """All cases: those that are kept, and the others computed."""
    cases = axes.cases
    found = {outcome.number: outcome for outcome in kept or () if outcome.number < len(cases)}
    left = [case for case in cases if case.number not in found]
    try:
        with Progress(f"{title}: {len(cases)} cases", 0.0, len(cases)) as progress:
            progress.at(len(found))
            for outcome in outcomes(task, left, place, safe=isinstance(task, ModelTask)):
                found[outcome.number] = outcome
                if kept is not None:
                    kept.keep(outcome)
                progress.at(len(found))
    except KeyboardInterrupt as error:
        rest = "; the same call goes on with the rest" if kept else "; with folder= they would be kept"
        raise SolveError(
            f"{title}: study interrupted, {len(found)} of {len(cases)} cases are finished, which .result holds{rest}",
            result=Study(title, axes, cases, found),
        ) from error
    for case, outcome in sorted(found.items()):
        for category, words in outcome.told:
            warnings.warn(f"{cases[case]}: {words}", category, stacklevel=3)
    return Study(title, axes, cases, found)
