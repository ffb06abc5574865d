"""First guesses: what the caller gives, else a straight line between given ends, else the start values."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from gantrytau import Dae, ModelError, Result
from gantrytau.symbols import derivative_name, split_derivative
from gantrytau.system import System
from gantrytau_optimica.records import ControlProblem
from gantrytau_optimica.optimization import Point
from gantrytau_optimica.reading import Constraint, ReadProblem

if TYPE_CHECKING:
    from gantrytau_optimica.optimum import Optimum

Guess = Callable[[np.ndarray], np.ndarray]
RAMP = 0.3  # share of the time in which a motion from rest to rest speeds up, and again slows down


def first_guesses(
    read: ReadProblem,
    draft: ControlProblem,
    system: System,
    numbers: Mapping[str, float],
    points: Sequence[Point],
    constraints: Sequence[Constraint],
    given: Mapping[str, Any],
) -> dict[str, Guess]:
    """A function of fractions of the horizon (n,) for every signal of the control problem, by name."""
    dae = read.dae
    horizon = _horizon(draft)
    own = _given(dae, given, horizon)
    ends = _ends(dae, points, constraints)
    found: dict[str, Guess] = {}
    symbols: dict[str, Guess] = {}
    for name, symbol in zip(system.states, system.x.elements(), strict=True):
        key = symbol.name()
        symbols[key] = found[name] = own.get(key) or _from_ends(dae, key, ends, horizon[1] - horizon[0])
    for name, symbol in zip(system.inputs, system.u.elements(), strict=True):
        key = symbol.name()
        symbols[key] = found[name] = own.get(key) or _constant(dae.start.get(key, 0.0))
    found.update(_algebraics(draft, system, numbers, symbols, own, horizon))
    return found


def _horizon(draft: ControlProblem) -> tuple[float, float]:
    numbers = ca.vertcat(*(n.symbol for n in draft.free)) if draft.free else ca.SX(0, 1)
    evaluate = ca.Function("horizon", [numbers], [draft.start_time, draft.final_time])
    start, stop = (float(x) for x in evaluate(ca.DM([n.guess for n in draft.free])))
    if not start < stop:
        raise ModelError(
            f"start_time {start:g} s and final_time {stop:g} s, expected the first to be the smaller"
        )
    return start, stop


def _constant(value: float) -> Guess:
    return lambda fraction: np.full(np.shape(fraction), value)


def _given(dae: Dae, given: Mapping[str, Any], horizon: tuple[float, float]) -> dict[str, Guess]:
    """The caller's guesses by symbol of the reduced equations."""
    from gantrytau_optimica.building import derivative_symbol

    found: dict[str, Guess] = {}
    span = horizon[1] - horizon[0]
    for name, value in given.items():
        elements = dae.expand(name)
        if elements[0] in dae.table.symbols:
            continue
        for k, element in enumerate(elements):
            target = derivative_symbol(dae, element)
            if target is None:
                continue
            symbol, factor, offset = target
            found[symbol] = _one(name, value, k, len(elements), factor, offset, horizon[0], span)
    return found


def _one(name, value, k: int, size: int, factor: float, offset: float, start: float, span: float) -> Guess:
    def guess(fraction: np.ndarray) -> np.ndarray:
        if callable(value):
            raw = np.array([np.ravel(value(start + f * span)) for f in np.atleast_1d(fraction)], dtype=float)
        else:
            raw = np.tile(np.ravel(np.asarray(value, dtype=float)), (np.size(fraction), 1))
        if raw.shape[1] != size:
            raise ModelError(f"guess {name}: found {raw.shape[1]} values, expected {size}")
        if not np.all(np.isfinite(raw)):
            raise ModelError(f"guess {name}: found values that are not finite")
        return (raw[:, k] - offset) / factor

    return guess


def guess_of(source: "Result | Optimum", dae: Dae) -> dict[str, Callable[[float], Any]]:
    """Guesses from another solution: its signals by name, its time stretched onto the new horizon."""
    times = np.asarray(source.time)
    names = [n for n in dae.variables if n in source]
    missing = [n for n in dae.states if n not in source]
    if missing:
        raise ModelError(f"guess: the given solution has no {missing[0]}; give a solution of the same model")

    def signal(name: str) -> Guess:
        values = np.asarray(source[name])
        share = (times - times[0]) / (times[-1] - times[0])
        return lambda fraction: np.interp(fraction, share, values)

    return {name: signal(name) for name in names}


def _ends(
    dae: Dae, points: Sequence[Point], constraints: Sequence[Constraint]
) -> dict[str, dict[str, float]]:
    """Values given at the start and at the end, by symbol."""
    from gantrytau_optimica.building import derivative_symbol

    meaning = {
        s.element_hash(): (p.time, e)
        for p in points
        if isinstance(p.time, str)
        for s, e in zip(p.symbol.elements(), p.expression.elements(), strict=True)
        if e.is_symbolic()
    }
    found: dict[str, dict[str, float]] = {}
    for constraint in constraints:
        if not constraint.expression.is_symbolic() or not constraint.lower.is_constant():
            continue
        known = meaning.get(constraint.expression.element_hash())
        if (
            known is None
            or not constraint.upper.is_constant()
            or float(constraint.lower) != float(constraint.upper)
        ):
            continue
        which, leaf = known
        target = derivative_symbol(dae, leaf.name())
        if target is not None:
            symbol, factor, offset = target
            found.setdefault(symbol, {})[which] = (float(constraint.lower) - offset) / factor
    return found


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


def _algebraics(
    draft, system: System, numbers, symbols: Mapping[str, Guess], own, horizon
) -> dict[str, Guess]:
    """Algebraics from their closed forms along the guess of the rest, where they have one."""
    found: dict[str, Guess] = {}
    if not system.algebraics:
        return found
    closed = system.closed_algebraics
    dae = system.dae
    for position, algebraic in enumerate(system.algebraics):
        if algebraic.name in own:
            found[algebraic.name] = own[algebraic.name]
        elif closed is None:
            found[algebraic.name] = _constant(dae.start.get(algebraic.name, 1.0))
        else:
            found[algebraic.name] = _Closed(closed[position], draft, system, numbers, symbols, horizon)
    return found


class _Closed:
    """A closed form evaluated along the guess."""

    def __init__(self, expression: ca.SX, draft: ControlProblem, system: System, numbers, symbols, horizon):
        table = system.dae.table
        known = [*(table.symbols[n] for n in numbers), *(n.symbol for n in draft.free)]
        values = [*numbers.values(), *(n.guess for n in draft.free)]
        expression = ca.substitute(expression, ca.vertcat(*known), ca.DM(values)) if known else expression
        self.signals = [symbols[s.name()] for s in (*system.x.elements(), *system.u.elements())]
        self.horizon = horizon
        self.function = ca.Function(
            "closed", [draft.time, ca.vertcat(system.x, system.u)], [ca.densify(expression)]
        )

    def __call__(self, fraction: np.ndarray) -> np.ndarray:
        fraction = np.atleast_1d(fraction)
        start, stop = self.horizon
        columns = np.array([signal(fraction) for signal in self.signals]).reshape(
            len(self.signals), fraction.size
        )
        found = np.array(self.function(start + (stop - start) * fraction[None, :], columns)).ravel()
        return np.where(np.isfinite(found), found, 1.0)


def typical_size(guess: Guess, bounds: tuple[float, float]) -> float:
    """A typical magnitude from limits, else from the guess."""
    finite = [abs(b) for b in bounds if np.isfinite(b) and b != 0.0]
    size = max(finite) if finite else float(np.max(np.abs(guess(np.linspace(0.0, 1.0, 11)))))
    return size if 1e-6 < size < 1e9 else 1.0
