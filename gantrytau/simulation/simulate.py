"""Simulation: CVODES or IDAS from CasADi on all coordinates of the model, held to its constraints.

The integrator sees every coordinate, not a choice of independent ones, so it cannot meet a singularity
that only the choice makes. Constraints and their derivatives are kept by projecting onto them.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from gantrytau.border.checks import check_words, number, whole
from gantrytau.border.refusal import DoubtfulResult, Given, ModelError, SolveError
from gantrytau.compiler.parameters import with_values
from gantrytau.compiler.request import names
from gantrytau.compiler.start.other_starts import with_starts
from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import retranslate, translate_flat, translate_model
from gantrytau.inputs.input_signal import check_seed
from gantrytau.language.model import Model
from gantrytau.language.symbols import split_derivative
from gantrytau.results.result import Result
from gantrytau.results.run_statistics import MAKING, VARIABLES, RunStatistics
from gantrytau.simulation.between.passed_limits import passed, stopping
from gantrytau.simulation.events.sticking import with_sticking
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.integration import Run
from gantrytau.simulation.motion import all_coordinates
from gantrytau.simulation.other_constraints import joined, other_constraints
from gantrytau.simulation.signals import Signal, read_signals, signal_key
from gantrytau.simulation.state_sizes import first_sizes, seen_sizes
from gantrytau.simulation.to_result import doubts, result_of

MARGIN = 0.1  # of the tolerance of the result, left to one step of the integrator: errors add up
NUMBERS: dict[str, dict[str, Any]] = dict(
    start=dict(unit="s"), tolerance=dict(above=0.0, below=1.0), max_step=dict(unit="s", above=0.0)
)
ROUNDS = 3  # of a run whose states prove to be smaller than was thought


def simulate(
    model: Model | Translated,
    *,
    stop: float | None = None,
    start: float = 0.0,
    inputs: Mapping[str, Any] | None = None,
    parameters: Mapping[str, Any] | None = None,
    outputs: Sequence[str] | None = None,
    tolerance: float = 1e-8,
    points: int = 501,
    starts: Mapping[str, Any] | None = None,
    max_step: float | None = None,
    seed: int | None = None,
    limits: Literal["warn", "stop", None] = "warn",
    singular: Literal["stop", "cross"] = "stop",
) -> Result:
    """Simulate a model from its start values and return all its variables over time.

    start, stop: begin and end of the run, s; without stop those of the model's `experiment`.
    inputs: name -> number, function of time, `Samples` ((times, values) for short) or a signal such as `white_noise`; other
    inputs keep their start values.
    parameters: name -> value, in place of the model's. Starts become consistent anew: those not fixed move as little as
    possible, whereas an FMU keeps the states of its export.
    starts: name -> start value, in place of the model's, without a new translation. Quantities without a start given here
    move first; a start that is fixed in the model is fixed at its new value.
    outputs: names of the variables to keep, by default all. points: number of output times. The result also has both
    sides of each event, at two equal times, and of each jump of sampled inputs if these are at most `points` (or 500).
    tolerance: of the result, relative, and absolute in units of a state's `nominal`; a step of the integrator gets a 500th
    of it or less, and errors of long motions add up. A state without nominal has the size 1, or that of a start below 1e-3.
    Where all coupled states stay below a thousandth of their sizes, the run is repeated with the sizes seen.
    max_step: longest step, s. The default resolves functions of time, in inputs and model, that rest and then change during
    a 10,000th of the run. Shorter smooth changes may be stepped over, and so may forces along a state that are narrower
    than a hundredth of its largest value. Switches (`if_else`) are located however often they turn.
    limits: "warn" reports the first passing of a variable's `min` or `max` with its time (DoubtfulResult), "stop" ends the
    run there as `terminate` does, None does not look.
    singular: "stop" at a pose with undetermined forces, or "cross" it with the speeds before it and a warning.
    The result's `.ended` is the text of the `terminate` that ended it; `.statistics` has steps, events, seconds.
    Raises SolveError with `.time` and the partial `.result` when the integration stops, InitializationError without a
    consistent start, ModelError for wrong names and values. Warns (DoubtfulResult) of variables that are not finite
    although the states are, and of passed limits.
    """
    policy = checked_policy("simulate", locals())
    start, tolerance, max_step = policy["start"], policy["tolerance"], policy["max_step"]
    if stop is not None:
        stop = number("simulate", "stop", stop, unit="s", above=start)
    check_seed("simulate", seed)
    wanted = names(outputs or ())
    dae = _changed(model, parameters, wanted)
    if stop is None:
        start, stop = _of_experiment(dae.flat.experiment, start)
    dae = stopping(dae) if limits == "stop" else dae
    dae = with_starts(dae, starts) if starts else dae
    signals = read_signals(inputs or {}, dae.flat, (start, stop), seed)
    _check_inputs(dae, signals)
    grid = np.linspace(start, stop, points)
    result = _all_runs(dae, signals, wanted, grid, tolerance, max_step, outputs, singular == "cross")
    for doubt in (doubts(result), passed(dae, result) if limits == "warn" else ""):
        if doubt:
            warnings.warn(f"{dae.name}: {doubt}", DoubtfulResult, stacklevel=2)
    return result


def _of_experiment(said: Mapping[str, float], start: float) -> tuple[float, float]:
    """Begin and end of a run as the model says them; ModelError where it does not."""
    start = start or said.get("StartTime", 0.0)
    if "StopTime" not in said:
        words = "expected the time in s at which to stop, as the model has no experiment with a StopTime"
        raise ModelError(words, place="simulate", found=Given("stop", None))
    return start, number("simulate", "stop", said.get("StopTime"), unit="s", above=start)


def checked_policy(place: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments of `simulate` that are given, numbers in SI; ModelError for words and numbers that they cannot be."""
    check_words(simulate, given, place)
    found = dict(given)
    for name, limits in NUMBERS.items():
        if name in found and not (found[name] is None and name == "max_step"):
            found[name] = number(place, name, found[name], **limits)
    if "points" in found:
        whole(place, "points", found["points"], least=2)
    return found


def _changed(
    model: Model | Translated, parameters: Mapping[str, Any] | None, wanted: Sequence[str]
) -> Translated:
    """A model with other parameters, in which the wanted derivatives are found."""
    dae = with_sticking(model if isinstance(model, Translated) else translate_model(model))
    if parameters:
        dae = retranslate(dae, with_values(dae.flat, parameters))
    for name in wanted:
        dae.expand(name)
    if any(split_derivative(name)[1] for name in wanted):
        dae = translate_flat(dae.flat, replace(dae.request, find=(*dae.request.find, *wanted)))
    return dae


def _all_runs(
    dae: Translated,
    signals: Mapping[str, Signal],
    wanted: Sequence[str],
    grid: np.ndarray,
    tolerance: float,
    max_step: float | None,
    outputs: Sequence[str] | None,
    crosses: bool,
) -> Result:
    """One run over a grid, or several where constraints that repeat others are chosen anew; SolveError with the result so
    far where it stops before its end.
    """
    parts: list[Result] = []
    work = RunStatistics()
    crossed: list[float] = []
    left = grid
    while True:
        with work.spent_on(MAKING):
            coordinates = _coordinates(dae, signals, wanted)
        run, error = _sized_run(coordinates, signals, left, tolerance, max_step, crosses, work)
        run.count_events()
        crossed += run.crossed
        ended = run.ended if error is None else str(error) or "interrupted"
        with work.spent_on(VARIABLES):
            parts.append(result_of(run.coordinates, *run.so_far(), outputs, ended, run.instants()))
        found = other_constraints(run) if isinstance(error, SolveError) and not dae.flat.delays else None
        if found is None:
            break
        left, dae = found
    work.sizes = dict(zip(run.coordinates.states, run.integrators.sizes.tolist(), strict=True))
    result = joined(parts, grid).with_statistics(work)
    if crossed:
        times = ", ".join(f"{t:.6g}" for t in crossed)
        warnings.warn(
            f"{dae.name}: singular poses were crossed with the speeds before them at t = {times} s; forces are not "
            "determined there",
            DoubtfulResult,
            stacklevel=3,
        )
    if isinstance(error, SolveError):
        error.result = result
        raise error
    if error is not None:
        raise SolveError(
            f"{dae.name}: simulation interrupted at t = {result.time[-1]:.4g} s; .result holds what was computed",
            time=float(result.time[-1]),
            result=result,
        ) from error
    return result


def _coordinates(dae: Translated, signals: Mapping[str, Signal], wanted: Sequence[str]) -> Coordinates:
    """All coordinates of a model, made once for signals of one kind."""
    key = "all coordinates", tuple(wanted), tuple((n, signal_key(s)) for n, s in sorted(signals.items()))
    if key not in dae.made:
        dae.made[key] = all_coordinates(dae, signals, wanted)
    return dae.made[key]


def _sized_run(
    coordinates: Coordinates,
    signals: Mapping[str, Signal],
    grid: np.ndarray,
    tolerance: float,
    max_step: float | None,
    crosses: bool,
    work: RunStatistics,
) -> tuple[Run, SolveError | KeyboardInterrupt | None]:
    """A run by sizes of the states that it shows itself, and why it stopped before its end, if it did."""
    coordinates = coordinates.sized(first_sizes(coordinates))
    left = ROUNDS
    while True:
        run = Run(coordinates, signals, grid, MARGIN * tolerance, max_step, crosses, work)
        try:
            run.go()
        except (SolveError, KeyboardInterrupt) as error:
            return run, error
        sizes = seen_sizes(coordinates, run.trail, run.done, MARGIN * tolerance) if left else None
        if sizes is None:
            return run, None
        coordinates, left = coordinates.sized(sizes), left - 1


def _check_inputs(dae: Translated, signals: Mapping[str, Signal]) -> None:
    for name in signals:
        if name not in dae.inputs:
            raise ModelError(
                f"{name} is not an input of {dae.name} (inputs: {', '.join(dae.inputs) or 'none'}); to impose it, translate "
                "with given=..., to change a parameter use ",
                Given("parameters"),
                argument="inputs",
            )
