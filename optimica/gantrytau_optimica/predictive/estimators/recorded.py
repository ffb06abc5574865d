"""An estimator along what was recorded: samples and inputs of an `Experiment`, a period after the other."""

from typing import Any

import casadi as ca
import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.checks import instance
from gantrytau.language.symbols import time
from gantrytau.simulation.signals import SampledCourse, read_signals
from gantrytau_optimica.estimation.experiments import Experiment

BESIDE = 1e-6  # of a period: how far samples may lie from whole ones


def recorded_estimates(estimator: Any, experiment: Experiment) -> Result:
    """All estimates at whole periods from the first sample on, by names; periods without samples are lost ones.

    Raises ModelError for samples between whole periods, and for what the estimator does not take.
    """
    place = estimator.name
    instance(place, "experiment", experiment, Experiment)
    own = [word for word in ("start", "parameters") if getattr(experiment, word)]
    if experiment.static or own:
        found = f"{own[0]} of the experiment" if own else "samples without times"
        remedy = "give it to the estimator itself" if own else "give Samples(times, values)"
        raise ModelError(f"found {found}, expected samples and inputs alone; {remedy}", place=place)
    begin = min(
        s.times[s.times >= experiment.begin].min(initial=np.inf) for s in experiment.measured.values()
    )
    stop = experiment.horizon[1]
    if not begin <= stop:
        raise ModelError(f"found no sample from {experiment.begin:g} to {stop:g} s", place=place)
    times = begin + estimator.period * np.arange(int((stop - begin) / estimator.period + BESIDE) + 1)
    y = _on_grid(estimator, experiment, times)
    u = _held(estimator, experiment, times)
    estimator.reset()
    rows = []
    for k, t in enumerate(times.tolist()):
        measured = dict(zip(estimator.outputs, y[k].tolist(), strict=True))
        held = dict(zip(estimator.inputs, u[max(k - 1, 0)].tolist(), strict=True))
        rows.append(estimator.step(measured, held, t))
    flat = estimator.observed.flat
    named = {e: v for v in flat.vectors.values() for e in v.elements}
    return Result(
        times,
        {name: np.array([row[name] for row in rows]) for name in rows[0]},
        units={name: named[name].unit for name in rows[0]},
        descriptions={name: named[name].description for name in rows[0]},
        title=f"{estimator.observed.built.problem.name}, estimated",
    )


def _on_grid(estimator: Any, experiment: Experiment, times: np.ndarray) -> np.ndarray:
    """Samples (n, outputs) at whole periods, NaN where there is none."""
    flat, found = estimator.observed.flat, np.full((times.size, len(estimator.outputs)), np.nan)
    for name, samples in experiment.measured.items():
        samples.check_unit(f"measured {name}", flat.unit(name))
        elements = flat.expand(name)
        samples.check_shape(f"measured {name}", flat.shape(name))
        rows = (samples.times - times[0]) / estimator.period
        apart = np.abs(rows - np.round(rows)) > BESIDE * np.maximum(1.0, np.abs(rows))
        if apart.any():
            words = f"the sample of {name} at {samples.times[apart][0]:.9g} s lies between whole periods of"
            raise ModelError(
                f"{words} {estimator.period:g} s; take the period of the samples", place=estimator.name
            )
        rows = np.round(rows).astype(int)
        some = (rows >= 0) & (rows < times.size)
        for element, column in zip(elements, samples.values.T, strict=True):
            if element not in estimator.outputs:
                words = f"{element} is not among what is measured, {', '.join(estimator.outputs)}"
                raise ModelError(f"found samples of {name}; {words}", place=estimator.name)
            found[rows[some], estimator.outputs.index(element)] = column[some]
    return found


def _held(estimator: Any, experiment: Experiment, times: np.ndarray) -> np.ndarray:
    """Inputs (n, inputs) in the middle of the periods that begin at the times."""
    middle = times + estimator.period / 2
    signals = read_signals(experiment.inputs, estimator.observed.flat, (times[0], times[-1]))
    missing = [name for name in estimator.inputs if name not in signals]
    if missing:
        raise ModelError(f"inputs of the experiment lack {', '.join(missing)}", place=estimator.name)
    found = np.zeros((times.size, len(estimator.inputs)))
    for k, name in enumerate(estimator.inputs):
        one = signals[name]
        if not isinstance(one, SampledCourse):
            found[:, k] = np.asarray(ca.Function("input", [time], [ca.densify(one)])(middle[None])).ravel()
        elif one.held:
            found[:, k] = one.values[np.clip(np.searchsorted(one.times, middle) - 1, 0, None)]
        else:
            found[:, k] = np.interp(middle, one.times, one.values)
    return found
