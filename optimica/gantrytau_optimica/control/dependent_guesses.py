"""First guesses of what depends on states and inputs: from closed forms, else by Newton's method along the guess."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.completion import Completion, Driven, driven
from gantrytau_optimica.control.control_problem import Course, Phase, Signal

Guess = Callable[[np.ndarray], np.ndarray]
LEAST_ROOT = (
    0.1  # of its largest value on the guess: square roots are kept away from zero, where forces explode
)
MOST_PLACES = 120  # at which Newton's method completes a guess; between them it is drawn straight
SLOPE = 1e-4  # of the horizon: between values of which slopes of guesses are taken


def dependent_guesses(
    built: Built,
    phase: Phase,
    symbols: Mapping[str, Guess],
    own: Mapping[str, Guess],
    span: tuple[float, float],
) -> dict[str, Guess]:
    """Algebraics, and inputs that accelerations decide, along the guess of the rest.

    symbols: guesses of states, inputs and courses by symbol; own: those of the caller; span: start and end in s.
    """
    if all(a.name in built.closed or a.symbol.name() in own for a in phase.algebraics):
        return _in_closed_form(built, phase, symbols, own, span)
    return _completed(built, phase, symbols, own, span)


def _in_closed_form(
    built: Built,
    phase: Phase,
    symbols: Mapping[str, Guess],
    own: Mapping[str, Guess],
    span: tuple[float, float],
) -> dict[str, Guess]:
    """Algebraics from their closed forms along the guess of the rest, where they have one, one after another."""
    dae, free = built.read.dae, built.problem.free
    old = ca.vertcat(*(dae.parameter_symbols[n] for n in built.numbers), built.problem.numbers)
    values = ca.DM([*built.numbers.values(), *(n.guess for n in free)])
    leaves = [s.symbol for s in (*phase.states, *phase.inputs, *phase.courses)]
    signals = [symbols[s.name()] for s in leaves]
    found: dict[str, Guess] = {}
    for algebraic in phase.algebraics:
        closed = built.closed.get(algebraic.name)
        if algebraic.symbol.name() in own:
            guess = own[algebraic.symbol.name()]
        elif closed is None:
            guess = _Constant(dae.start.get(algebraic.name, 1.0))
        else:
            closed = ca.substitute(closed, old, values) if old.numel() else closed
            function = ca.Function(
                "closed", [built.problem.time, ca.vertcat(ca.SX(0, 1), *leaves)], [ca.densify(closed)]
            )
            guess = _Closed(function, tuple(signals), span, root=algebraic.is_root)
        found[algebraic.name] = guess
        leaves.append(algebraic.symbol)
        signals.append(guess)
    return found


def _completed(
    built: Built,
    phase: Phase,
    symbols: Mapping[str, Guess],
    own: Mapping[str, Guess],
    span: tuple[float, float],
) -> dict[str, Guess]:
    """Algebraics from the equations of the phase along the guess of the rest; the caller's own stay as they are."""
    dae, problem = built.read.dae, built.problem
    old = ca.vertcat(*(dae.parameter_symbols[n] for n in built.numbers), problem.numbers)
    values = ca.DM([*built.numbers.values(), *(n.guess for n in problem.free)])

    def numbered(expression: ca.SX) -> ca.SX:
        return ca.substitute(expression, old, values) if old.numel() else expression

    moving = _driven(phase, own)
    completion, known, unknowns = _completion(built, phase, own, moving, numbered)
    if not completion.determined and moving.rates:
        moving = Driven()
        completion, known, unknowns = _completion(built, phase, own, moving, numbered)
    if not completion.determined:
        return _in_closed_form(built, phase, symbols, own, span)
    along = _Along(
        completion,
        tuple(symbols[s.symbol.name()] for s in known),
        tuple(symbols[phase.states[k].symbol.name()] for k in moving.speeds),
        np.array([span[0], *(_at_start(dae.start, s, {}) for s in known), *(0.0 for _ in moving.rates)]),
        span,
    )
    found: dict[str, Guess] = {
        s.name: own.get(s.symbol.name(), _Unknown(along, k, s.is_root)) for k, s in enumerate(unknowns)
    }
    for signal, slope in zip(moving.rates, along.speeds, strict=True):
        found[signal.name] = own.get(signal.symbol.name(), _Slope(slope, span[1] - span[0]))
    return found


def _completion(
    built: Built,
    phase: Phase,
    own: Mapping[str, Guess],
    moving: Driven,
    numbered: Callable[[ca.SX], ca.SX],
) -> tuple[Completion, list[Signal | Course], list[Signal]]:
    """What solves the equations of a phase, and the signals that it needs and finds; those of the accelerations apart."""
    fixed, chosen = ({s.name for s in part} for part in (moving.rates, moving.inputs))
    unknowns = [*(a for a in phase.algebraics if a.name not in fixed), *moving.inputs]
    known = [*phase.states, *(u for u in phase.inputs if u.name not in chosen), *phase.courses]
    completion = Completion(
        numbered(phase.residuals),
        ca.vertcat(built.problem.time, *(s.symbol for s in (*known, *moving.rates))),
        ca.vertcat(*(s.symbol for s in unknowns)),
        {
            k: numbered(built.closed[s.name])
            for k, s in enumerate(unknowns)
            if s.is_root and s.name in built.closed
        },
        np.array([_at_start(built.read.dae.start, s, own) for s in unknowns]),
    )
    return completion, known, unknowns


def _at_start(start: Mapping[str, float], signal: Signal | Course, own: Mapping[str, Guess]) -> float:
    name = signal.symbol.name()
    if name in own:
        return float(own[name](np.zeros(1))[0])
    return start.get(name, 1.0 if isinstance(signal, Signal) and signal.is_root else 0.0)


def _driven(phase: Phase, own: Mapping[str, Guess]) -> Driven:
    """What moves the phase, where the caller guesses none of it."""
    found = driven(phase)
    return Driven() if any(s.symbol.name() in own for s in (*found.rates, *found.inputs)) else found


@dataclass(frozen=True)
class _Slope:
    """The rate of a guess over a time of `span` seconds."""

    guess: Guess
    span: float

    def __call__(self, fraction: np.ndarray) -> np.ndarray:
        fraction = np.atleast_1d(np.asarray(fraction, dtype=float))
        before, after = np.clip(fraction - SLOPE, 0.0, 1.0), np.clip(fraction + SLOPE, 0.0, 1.0)
        return (self.guess(after) - self.guess(before)) / (after - before) / self.span


@dataclass(eq=False)
class _Along:
    """All unknowns along the guess; remembers the last answer, for which their parts ask one after another.

    known: guesses of what is known; speeds: those whose slopes are known; begin: all that where the model starts.
    """

    completion: Completion
    known: tuple[Guess, ...]
    speeds: tuple[Guess, ...]
    begin: np.ndarray
    span: tuple[float, float]
    last: tuple[np.ndarray, np.ndarray] | None = None

    def __call__(self, fraction: np.ndarray) -> np.ndarray:
        """Unknowns (n, m) at shares (n,); from where there are none those before."""
        if self.last is not None and np.array_equal(self.last[0], fraction):
            return self.last[1]
        if fraction.size <= MOST_PLACES:
            found = self._completed(fraction)
        else:
            places = np.linspace(np.min(fraction), np.max(fraction), MOST_PLACES)
            found = np.column_stack([np.interp(fraction, places, y) for y in self._completed(places).T])
        self.last = (fraction, found)
        return found

    def _completed(self, fraction: np.ndarray) -> np.ndarray:
        order = np.argsort(fraction, kind="stable")
        shares = fraction[order]
        start, stop = self.span
        rows = [start + (stop - start) * shares, *(guess(shares) for guess in self.known)]
        rows += [_Slope(guess, stop - start)(shares) for guess in self.speeds]
        values = self.completion.along(self.begin, np.array(rows, dtype=float).T)
        lost = np.isnan(values).any(axis=1)
        if np.any(lost):
            first = int(np.argmax(lost))
            values[first:] = values[first - 1] if first else self.completion.start
        found = np.empty_like(values)
        found[order] = values
        return found


@dataclass(frozen=True, eq=False)
class _Unknown:
    """One of the unknowns along the guess."""

    along: _Along
    place: int
    root: bool

    def __call__(self, fraction: np.ndarray) -> np.ndarray:
        found = self.along(np.atleast_1d(np.asarray(fraction, dtype=float)))[:, self.place]
        return np.maximum(found, LEAST_ROOT * (np.max(found) or 1.0)) if self.root else found


class _Closed:
    """A closed form evaluated along the guess; remembers its last answer, which later ones ask for again."""

    def __init__(self, function: ca.Function, signals: tuple[Guess, ...], horizon, root: bool):
        self.function, self.signals, self.horizon, self.root = function, signals, horizon, root
        self.last: tuple[np.ndarray, np.ndarray] | None = None

    def __call__(self, fraction: np.ndarray) -> np.ndarray:
        fraction = np.atleast_1d(fraction)
        if self.last is not None and np.array_equal(self.last[0], fraction):
            return self.last[1]
        start, stop = self.horizon
        columns = np.array([signal(fraction) for signal in self.signals]).reshape(-1, fraction.size)
        found = np.array(self.function(start + (stop - start) * fraction[None, :], columns)).ravel()
        found = np.where(np.isfinite(found), found, 1.0)
        if self.root:
            found = np.maximum(found, LEAST_ROOT * (np.max(found) or 1.0))
        self.last = (fraction, found)
        return found


@dataclass(frozen=True)
class _Constant:
    """The same value at all times."""

    value: float

    def __call__(self, fraction: np.ndarray) -> np.ndarray:
        return np.full(np.shape(fraction), self.value)
