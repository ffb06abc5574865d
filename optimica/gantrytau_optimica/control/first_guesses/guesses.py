"""First guesses: what the caller gives, else a straight line between given ends, else the start values."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import casadi as ca
import numpy as np

from gantrytau import Dae, ModelError, Result
from gantrytau.border.refusal import USERS_ERRORS
from gantrytau.flattening.shapes import check_shape
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import ControlProblem, Course, Phase
from gantrytau_optimica.control.first_guesses.dependent_guesses import Guess, dependent_guesses
from gantrytau_optimica.control.first_guesses.ends import values_at_ends

RAMP = 0.3  # share of the time in which a motion from rest to rest speeds up, and again slows down


def first_guesses(built: Built, given: Mapping[str, Any]) -> dict[str, Guess]:
    """A function of shares of the horizon (n,) for every signal of the control problem, by name."""
    dae, problem = built.read.dae, built.problem
    horizons = [horizon(problem, phase) for phase in problem.phases]
    ends = values_at_ends(dae, built.points, built.constraints, {n.name: n.guess for n in problem.free})
    found: dict[str, Guess] = {}
    for phase, span in zip(problem.phases, horizons, strict=True):
        own = _given(dae, given, span)
        symbols: dict[str, Guess] = {}
        for signal in phase.states:
            key = signal.symbol.name()
            symbols[key] = found[signal.name] = own.get(key) or _from_ends(dae, key, ends, span[1] - span[0])
        for signal in phase.inputs:
            key = signal.symbol.name()
            symbols[key] = found[signal.name] = own.get(key) or _constant(dae.start.get(key, 0.0))
        for course in phase.courses:
            symbols[course.symbol.name()] = _course(course, span)
        found.update(dependent_guesses(built, phase, symbols, own, span))
    return found


def with_algebraics(built: Built, problem: ControlProblem) -> ControlProblem:
    """The problem with algebraics guessed anew from the guesses of its other signals, where these give them outright."""
    built = replace(built, problem=problem)
    phases = []
    for phase in problem.phases:
        span = horizon(problem, phase)
        symbols = {s.symbol.name(): s.guess for s in (*phase.states, *phase.inputs)}
        symbols |= {c.symbol.name(): _course(c, span) for c in phase.courses}
        own = {a.symbol.name(): a.guess for a in phase.algebraics if a.name not in built.closed}
        found = dependent_guesses(built, phase, symbols, {} if built.system.loops else own, span)
        states, algebraics, inputs = (
            tuple(replace(s, guess=found.get(s.name, s.guess)) for s in part)
            for part in (phase.states, phase.algebraics, phase.inputs)
        )
        phases.append(replace(phase, states=states, algebraics=algebraics, inputs=inputs))
    return replace(problem, phases=tuple(phases))


def horizon(problem: ControlProblem, phase: Phase) -> tuple[float, float]:
    """Start and end of a phase in s by the guesses of the free numbers. Raises ModelError if they are not in order."""
    evaluate = ca.Function("horizon", [problem.numbers], [phase.start_time, phase.final_time])
    start, stop = (float(x) for x in evaluate(ca.DM([n.guess for n in problem.free])))
    if not start < stop:
        where = f"{problem.name}.{phase.name}" if phase.name else problem.name
        raise ModelError(
            f"{where}: start_time {start:g} s and final_time {stop:g} s, expected the first to be the smaller"
        )
    return start, stop


def _course(course: Course, span: tuple[float, float]) -> Guess:
    return lambda share: course.value(span[0] + np.asarray(share) * (span[1] - span[0]))


def number_guess(name: str, guess: Mapping[str, Any], otherwise: float) -> float:
    """The guess of a free number; ModelError if it is none."""
    if name not in guess:
        return otherwise
    try:
        value = float(np.asarray(guess[name], dtype=float).item())
    except (TypeError, ValueError):
        raise ModelError(f"guess {name}: found {guess[name]!r}, expected a number") from None
    if not np.isfinite(value):
        raise ModelError(f"guess {name}: found {value}, expected a finite number")
    return value


def _constant(value: float) -> Guess:
    return lambda fraction: np.full(np.shape(fraction), value)


def _given(dae: Dae, given: Mapping[str, Any], horizon: tuple[float, float]) -> dict[str, Guess]:
    """The caller's guesses by symbol of the reduced equations."""
    found: dict[str, Guess] = {}
    span = horizon[1] - horizon[0]
    for name, value in given.items():
        elements = dae.expand(name)
        if elements[0] in dae.parameter_symbols:
            continue
        for k, element in enumerate(elements):
            alias = dae.root(element)
            if alias is None or alias.root is None:
                continue
            offset = dae.number(alias.offset)
            scale = (alias.factor, offset)
            found[alias.symbol] = _one(name, value, k, dae.flat.shape(name), scale, horizon[0], span)
    return found


def _one(
    name: str,
    value: Any,
    k: int,
    shape: tuple[int, ...],
    scale: tuple[float, float],
    start: float,
    span: float,
) -> Guess:
    """The course of the k-th element of a quantity, which is factor * symbol + offset by its `scale`."""
    function: Any = value

    def guess(fraction: np.ndarray) -> np.ndarray:
        try:
            if isinstance(value, Stretched):
                arrays = list(np.asarray(value.at(fraction)))
            elif callable(value):
                arrays = [
                    np.asarray(function(start + f * span), dtype=float) for f in np.atleast_1d(fraction)
                ]
            else:
                arrays = [np.asarray(value, dtype=float)]
        except USERS_ERRORS as error:  # of a function that is not ours
            raise ModelError(
                f"guess {name}: {type(error).__name__}: {error}; expected a number, an array or a function of time"
            ) from error
        for one in arrays:
            check_shape(f"guess {name}", np.shape(one), () if isinstance(value, Stretched) else shape)
        column = np.array([np.ravel(one, order="F")[k] for one in arrays])
        if not np.all(np.isfinite(column)):
            raise ModelError(f"guess {name}: found values that are not finite")
        return (np.broadcast_to(column, np.shape(fraction)) - scale[1]) / scale[0]

    return guess


class GivenSolution(Protocol):
    """A solution of another problem: its variables by name, each over the times of its phase."""

    @property
    def free(self) -> Mapping[str, float]: ...  # numbers that were chosen
    def __contains__(self, name: object) -> bool: ...
    def __getitem__(self, name: str) -> Any: ...
    def time_of(self, name: str) -> np.ndarray: ...


class Stretched(ABC):
    """A signal of another solution, given over shares of its own horizon."""

    @abstractmethod
    def at(self, fraction: np.ndarray) -> np.ndarray:
        """Values at shares (n,)."""


@dataclass(frozen=True, eq=False)
class _Stretched(Stretched):
    """Straight lines between samples."""

    share: np.ndarray
    values: np.ndarray

    def at(self, fraction: np.ndarray) -> np.ndarray:
        return np.interp(np.atleast_1d(fraction), self.share, self.values)


def guess_of(source: Result | GivenSolution, dae: Dae, component: str = "") -> dict[str, Any]:
    """Guesses from another solution by name: signals, their time stretched onto the new horizon, and free numbers. In a
    result of several phases a signal is NaN outside of its own.

    component: path of the component that the solution is of. What the solution does not have keeps its default guess;
    ModelError if it has no variable and no free number of the model at all.
    """
    before = f"{component}." if component else ""
    times: dict[str, np.ndarray] = {}
    for name in dae.variables:
        own = name[len(before) :]
        if name.startswith(before) and own in source:
            times[name] = _times(source, own)
    numbers = {before + n: x for n, x in getattr(source, "free", {}).items() if before + n in dae.parameters}
    if not times and not numbers:
        what = f"none of the variables of {component}" if component else "no variable of the problem"
        raise ModelError(
            f"the given solution has {what}, as {next(iter(dae.states), 'its variables')}; give a solution of the same "
            "model, or say of which component it is, as {'component': solution}",
            place="guess",
            argument="guess",
        )
    found: dict[str, Any] = {}
    for name, every in times.items():
        values = np.asarray(source[name[len(before) :]])
        known = np.isfinite(values)
        if np.any(known):
            t = every[known]
            found[name] = _Stretched((t - t[0]) / (t[-1] - t[0]), values[known])
    return {**found, **numbers}


def _times(source: Result | GivenSolution, name: str) -> np.ndarray:
    """The times of a variable, in an optimum those of its phase."""
    return np.asarray(source.time if isinstance(source, Result) else source.time_of(name))


def _from_ends(dae: Dae, symbol: str, ends: Mapping[str, Mapping[str, float]], span: float) -> Guess:
    base, order = split_derivative(symbol)
    own, below = ends.get(symbol, {}), ends.get(derivative_name(base, order - 1), {}) if order else {}
    if order and len(below) == 2:  # the speed of a motion between two given positions
        distance = below["final"] - below["initial"]
        rest = own.get("initial") == 0.0 and own.get("final") == 0.0
        return (lambda f: distance / span * trapezoid(f)[1]) if rest else _constant(distance / span)
    if len(own) == 2:
        a, b = own["initial"], own["final"]
        speed = ends.get(derivative_name(base, order + 1), {})
        rest = speed.get("initial") == 0.0 and speed.get("final") == 0.0
        return lambda f: a + (b - a) * (trapezoid(f)[0] if rest else np.asarray(f))
    return _constant(own.get("initial", dae.start.get(symbol, 0.0)))


def trapezoid(fraction: Any) -> tuple[np.ndarray, np.ndarray]:
    """Way and speed of a motion from 0 to 1 in unit time with trapezoidal speed."""
    f = np.asarray(fraction, dtype=float)
    top = 1 / (1 - RAMP)
    left = np.minimum(f, 1 - f)
    half = np.where(left < RAMP, top * left**2 / (2 * RAMP), top * (left - RAMP / 2))
    return np.where(f < 0.5, half, 1 - half), top * np.minimum(left / RAMP, 1.0)
