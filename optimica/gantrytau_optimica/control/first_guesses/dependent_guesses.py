"""First guesses of what depends on states and inputs: from closed forms, else by Newton's method along the guess."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from gantrytau_optimica.control.built import Built, with_values
from gantrytau_optimica.control.control_problem import Course, Phase, Signal
from gantrytau_optimica.control.first_guesses.completion import Completion, Driven, driven

Guess = Callable[[np.ndarray], np.ndarray]
LEAST_ROOT = 0.1  # of its largest value on the guess: roots are kept away from zero, where forces explode
MOST_PLACES = 120  # at which Newton's method completes a guess; between them it is drawn straight
MOST_KEPT = 4  # answers that are remembered: at places, and beside them for derivatives
APART = 1e-4  # of the horizon: between values of which derivatives of guesses are taken


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
    moving = _driven(built, phase, own)
    whole = _Whole(built, phase, dict(symbols), own, span, moving)
    speeds = whole.turning()
    whole.symbols.update(speeds)
    along = whole.along()
    if along is None and moving.rates:
        moving = Driven()
        along = _Whole(built, phase, whole.symbols, own, span, moving).along()
    if along is None:
        return _in_closed_form(built, phase, symbols, own, span)
    found = {s.name: own.get(s.symbol.name(), guess) for s, guess in along.guesses()}
    for signal, speed in zip(moving.rates, along.speeds, strict=True):
        found[signal.name] = own.get(signal.symbol.name(), _GuessedRate(speed, span[1] - span[0]))
    return found | {s.name: speeds[s.symbol.name()] for s in phase.states if s.symbol.name() in speeds}


@dataclass(frozen=True, eq=False)
class _Whole:
    """A phase with guesses of what is known, by symbol, and what moves it."""

    built: Built
    phase: Phase
    symbols: dict[str, Guess]
    own: Mapping[str, Guess]
    span: tuple[float, float]
    moving: Driven

    def turning(self) -> dict[str, Guess]:
        """Speeds that are no rates of states, as angular velocities are, from the rates of the other states."""
        phase, places = self.phase, {s.symbol.element_hash() for s in self.phase.states}
        odes = phase.ode.elements()
        direct = {e.element_hash() for e in odes} & places
        speeds = [phase.states[k] for k in self.moving.speeds]
        turning = [
            s for s in speeds if s.symbol.element_hash() not in direct and s.symbol.name() not in self.own
        ]
        moved = [
            k for k, e in enumerate(odes) if k not in self.moving.speeds and e.element_hash() not in places
        ]
        if not turning or len(turning) != len(moved):
            return {}
        found = self.along(turning, moved)
        return {s.symbol.name(): guess for s, guess in found.guesses()[-len(turning) :]} if found else {}

    def along(self, turning: Sequence[Signal] = (), moved: Sequence[int] = ()) -> "_Along | None":
        """What gives the unknowns along the guess, None where the equations do not determine them.

        turning: states that are unknown as well, in the rates of the states `moved`; forces do not matter then.
        """
        phase, moving, problem = self.phase, self.moving, self.built.problem
        fixed, chosen = ({s.name for s in part} for part in (moving.rates, (*moving.inputs, *turning)))
        unknowns = [*(a for a in phase.algebraics if a.name not in fixed), *moving.inputs, *turning]
        known = [s for s in (*phase.states, *phase.inputs, *phase.courses) if s.name not in chosen]
        completion = self._completion(known, unknowns, moved)
        if not completion.determined:
            return None
        still = _Constant(0.0)
        guesses = [self.symbols[s.symbol.name()] for s in known]
        rates = [self.symbols[phase.states[k].symbol.name()] for k in (moved or moving.speeds)]
        return _Along(
            completion,
            np.array([self._at_start(s, self.own) for s in unknowns]),
            tuple(unknowns),
            (*guesses, *((still,) * len(moving.rates) if moved else ())),
            tuple(rates),
            np.array(
                [
                    self.span[0],
                    *(self._at_start(s, {}) for s in known),
                    *(0.0 for _ in (*moving.rates, *moved)),
                    *(n.guess for n in problem.free),
                ]
            ),
            self.span,
        )

    def _completion(
        self, known: Sequence[Signal | Course], unknowns: Sequence[Signal], moved: Sequence[int]
    ) -> Completion:
        """What solves for these unknowns, kept with the model: guesses of other durations have the same equations."""
        built, phase, dae = self.built, self.phase, self.built.read.dae
        same = phase.residuals, phase.ode, built.closed, built.numbers
        key = ("completion", phase.name, *(s.name for s in known), "", *(s.name for s in unknowns), *moved)
        before, completion = dae.made.get(key, ((), None))
        if completion is None or any(x is not y for x, y in zip(before, same, strict=True)):
            rates = ca.SX.sym("rate", len(moved))
            outright = {
                k: built.closed[s.name]
                for k, s in enumerate(unknowns)
                if s.is_root and s.name in built.closed
            }
            forms = with_values([*outright.values()], built.read, built.numbers)
            completion = Completion(
                ca.vertcat(phase.residuals, phase.ode[list(moved), 0] - rates),
                ca.vertcat(
                    built.problem.time,
                    *(s.symbol for s in (*known, *self.moving.rates)),
                    rates,
                    built.problem.numbers,
                ),
                ca.vertcat(*(s.symbol for s in unknowns)),
                dict(zip(outright, forms, strict=True)),
            )
            dae.made[key] = same, completion
        return completion

    def _at_start(self, signal: Signal | Course, own: Mapping[str, Guess]) -> float:
        """A value near which the model starts."""
        name = signal.symbol.name()
        if name in own:
            return float(own[name](np.zeros(1))[0])
        otherwise = 1.0 if isinstance(signal, Signal) and signal.is_root else 0.0
        return self.built.read.dae.start.get(name, otherwise)


def _driven(built: Built, phase: Phase, own: Mapping[str, Guess]) -> Driven:
    """What moves the phase, where the caller guesses none of it."""
    found = driven(phase, built.system.orders)
    return Driven() if any(s.symbol.name() in own for s in (*found.rates, *found.inputs)) else found


@dataclass(frozen=True)
class _GuessedRate:
    """The rate of a guess over a time of `span` seconds."""

    guess: Guess
    span: float

    def __call__(self, fraction: np.ndarray) -> np.ndarray:
        fraction = np.atleast_1d(np.asarray(fraction, dtype=float))
        before, after = np.clip(fraction - APART, 0.0, 1.0), np.clip(fraction + APART, 0.0, 1.0)
        return (self.guess(after) - self.guess(before)) / (after - before) / self.span


@dataclass(eq=False)
class _Along:
    """All unknowns along the guess; remembers the last answers, for which their parts ask one after another.

    start: unknowns near a solution; known: guesses of what is known; speeds: guesses whose derivatives are known;
    begin: values of what is known where the model starts, free numbers last.
    """

    completion: Completion
    start: np.ndarray
    unknowns: tuple[Signal, ...]
    known: tuple[Guess, ...]
    speeds: tuple[Guess, ...]
    begin: np.ndarray
    span: tuple[float, float]
    last: dict[bytes, np.ndarray] = field(default_factory=dict)

    def guesses(self) -> list[tuple[Signal, Guess]]:
        """All unknowns with their guesses."""
        return [(s, _Unknown(self, k, s.is_root)) for k, s in enumerate(self.unknowns)]

    def __call__(self, fraction: np.ndarray) -> np.ndarray:
        """Unknowns (n, m) at shares (n,); from where there are none those before."""
        asked = fraction.tobytes()
        if asked in self.last:
            return self.last[asked]
        if fraction.size <= MOST_PLACES:
            found = self._completed(fraction)
        else:
            places = np.linspace(np.min(fraction), np.max(fraction), MOST_PLACES)
            found = np.column_stack([np.interp(fraction, places, y) for y in self._completed(places).T])
        if len(self.last) == MOST_KEPT:
            del self.last[next(iter(self.last))]
        self.last[asked] = found
        return found

    def _completed(self, fraction: np.ndarray) -> np.ndarray:
        order = np.argsort(fraction, kind="stable")
        shares = fraction[order]
        start, stop = self.span
        rows = [start + (stop - start) * shares, *(guess(shares) for guess in self.known)]
        rows += [_GuessedRate(guess, stop - start)(shares) for guess in self.speeds]
        rows += [np.full(shares.size, number) for number in self.begin[len(rows) :]]
        values = self.completion.along(self.begin, self.start, np.array(rows, dtype=float).T)
        lost = np.isnan(values).any(axis=1)
        if np.any(lost):
            first = int(np.argmax(lost))
            values[first:] = values[first - 1] if first else self.start
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
