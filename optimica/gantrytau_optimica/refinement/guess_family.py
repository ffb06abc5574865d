"""First guesses around the default one: bent to each side of the straight line, then spread evenly.

A guess is the default one plus half waves that vanish at both ends,

    x(share) = x_0(share) + sum over k of a_k sin(k pi share),

along directions of the space of coordinates. The first guesses bend by one half wave, then two, to both sides of the way
from start to end, along directions across it; a single coordinate is bent along itself, by up to three half waves. Later
ones have directions, waves, free numbers and inputs from a sequence that leaves no large part of the space out,

    u_j(k) = frac(1/2 + k g^-j),   g^(n+1) = g + 1,   j = 1 ... n:

multiples of powers of the generalised golden ratio (Roberts 2018, "The unreasonable effectiveness of quasirandom
sequences").
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri  # the inverse of the normal distribution

from gantrytau import ModelError
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau_optimica.control.control_problem import ControlProblem, FreeNumber, Phase, Signal
from gantrytau_optimica.control.first_guesses.guesses import Guess, horizon
from gantrytau_optimica.control.limits import signal_limits

SHARE = 0.4  # of the way from start to end, by which the first guesses are bent: of 0.1, 0.25 and 0.4 it finds most branches
EXTENTS = (0.1, 0.6)  # the same of later ones, between which it is drawn
WAVES = 3  # half waves in the deviation of a guess
ASIDE = 3  # directions across the way along which the first guesses are bent: the longest
SPREAD = 0.7  # deviation of the logarithm of free numbers without limits
LEAST = 1e-6  # of a direction that is left across the way: less is rounding

FIXED = 60  # rounds of an iteration that halves its error at least

Draw = Callable[[], float]  # the next number between 0 and 1


@dataclass(frozen=True, eq=False)
class _Room:
    """The coordinates of a phase, which can be bent.

    extents: how far a share of one goes, (n,), in their units; across: orthonormal directions across the way, (m, n).
    """

    states: tuple[Signal, ...]
    extents: np.ndarray
    across: np.ndarray


def bends(problem: ControlProblem, count: int) -> Iterator[ControlProblem]:
    """The problem with `count` other first guesses, always the same ones."""
    rooms = [_room(phase, problem.name) for phase in problem.phases]
    systematic = list(_systematic(rooms))[:count]
    for number, waves in systematic:
        yield _bent(problem, [_amplitudes(room, number, waves) for room in rooms])
    left = count - len(systematic)
    inputs = sum(len(phase.inputs) for phase in problem.phases)
    numbers = 2 * len(problem.free) + inputs + sum(1 + WAVES * len(room.states) for room in rooms)
    if not numbers:
        return
    for row in _spread(left, numbers):
        yield _drawn(problem, rooms, iter(row.tolist()).__next__)


def _spread(count: int, size: int) -> np.ndarray:
    """Points that are spread evenly over the unit cube, (count, size)."""
    ratio = 2.0
    for _ in range(FIXED):  # a contraction: g = (g + 1)^(1 / (n + 1))
        ratio = (1.0 + ratio) ** (1.0 / (size + 1))
    return (0.5 + np.outer(1 + np.arange(count), ratio ** -(1.0 + np.arange(size)))) % 1.0


def _systematic(rooms: list[_Room]) -> Iterator[tuple[int, int]]:
    """(number of a direction, counted from 1, its sign that of the bend; number of half waves)."""
    longest = max((len(room.across) for room in rooms), default=0)
    alone = all(len(room.states) <= 1 for room in rooms)
    for waves in range(1, (WAVES if alone else WAVES - 1) + 1):
        for number in range(1, min(longest, ASIDE) + 1):
            yield number, waves
            yield -number, waves


def coordinates(phase: Phase) -> list[Signal]:
    """States of a phase that are no derivatives of others."""
    names = {s.symbol.name() for s in phase.states}
    found = []
    for state in phase.states:
        base, order = split_derivative(state.symbol.name())
        if not (order and derivative_name(base, order - 1) in names):
            found.append(state)
    return found


def _room(phase: Phase, name: str) -> _Room:
    states = coordinates(phase)
    extents = _extents(phase, signal_limits(phase, name))
    sizes = np.array([extents[s.name] for s in states])
    with np.errstate(divide="ignore", invalid="ignore"):
        way = np.array([float(s.guess(np.ones(1))[0] - s.guess(np.zeros(1))[0]) for s in states]) / sizes
    return _Room(tuple(states), sizes, _across(np.where(np.isfinite(way), way, 0.0), sizes))


def _across(way: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Orthonormal directions across a way, in coordinates by their sizes (n,): (n - 1, n), or all if there is no way.

    The coordinates with the largest sizes come first; a single one has no across.
    """
    if way.size <= 1:
        return np.ones((way.size, way.size))
    length = float(np.linalg.norm(way))
    found = [way / length] if length else []
    for k in np.argsort(-sizes, kind="stable"):
        direction = np.eye(way.size)[k]
        for other in found:
            direction = direction - other * (other @ direction)
        if np.linalg.norm(direction) > LEAST and len(found) < way.size:
            found.append(direction / np.linalg.norm(direction))
    return np.array(found[1:] if length else found).reshape(-1, way.size)


def _extents(phase: Phase, limits: Mapping[str, tuple[float, float]]) -> dict[str, float]:
    """How far the guesses of states may be bent: by the way that a whole vector goes, or a quarter of its limits."""
    shares = np.linspace(0.0, 1.0, 21)
    ways: dict[str, float] = {}
    for state in phase.states:
        ways[vector_of(state.name)] = float(
            np.hypot(ways.get(vector_of(state.name), 0.0), np.ptp(state.guess(shares)))
        )
    longest = max(ways.values(), default=0.0)
    found = {}
    for state in phase.states:
        low, high = limits[state.name]
        width = 0.25 / SHARE * (high - low) if np.isfinite(low) and np.isfinite(high) else np.inf
        wanted = max(ways[vector_of(state.name)], 0.5 * longest, 0.1 / SHARE * state.nominal)
        found[state.name] = min(width, wanted)
    return found


def vector_of(name: str) -> str:
    """The vector of which a scalar is an element, else the scalar itself."""
    return name[: name.rindex("[")] if name.endswith("]") else name


def _amplitudes(room: _Room, number: int, waves: int) -> np.ndarray:
    """Of the half waves of a systematic guess, (n, waves), in units of the coordinates."""
    found = np.zeros((len(room.states), waves))
    if len(room.across):
        direction = room.across[(abs(number) - 1) % len(room.across)]
        found[:, -1] = np.sign(number) * SHARE * room.extents * direction
    return found


def _drawn(problem: ControlProblem, rooms: list[_Room], draw: Draw) -> ControlProblem:
    """The problem with everything drawn: free numbers, waves, levels of inputs."""
    free = tuple(_number(number, draw(), draw()) for number in problem.free)
    changed = replace(problem, free=free)
    amplitudes = []
    for room in rooms:
        share = float(np.exp(np.interp(draw(), [0.0, 1.0], np.log(EXTENTS))))
        normal = ndtri([[draw() for _ in range(WAVES)] for _ in room.states])
        normal = np.reshape(normal, (len(room.states), WAVES))
        amplitudes.append(share * room.extents[:, None] * normal / (1 + np.arange(WAVES)) ** 2)
    phases = []
    for phase in changed.phases:
        limits = signal_limits(phase, problem.name)
        inputs = tuple(replace(u, guess=_level(u, limits[u.name], draw())) for u in phase.inputs)
        phases.append(replace(phase, inputs=inputs))
    changed = replace(changed, phases=tuple(phases))
    try:
        return _bent(changed, amplitudes)
    except ModelError:  # times out of order: keep those of the guess
        return _bent(replace(changed, free=problem.free), amplitudes)


def _number(number: FreeNumber, kind: float, place: float) -> FreeNumber:
    """A free number anywhere between its limits, or around its guess."""
    if number.held:
        return number
    if np.isfinite(number.min) and np.isfinite(number.max) and kind < 0.5:
        guess = number.min + place * (number.max - number.min)
    else:
        sign = -1.0 if number.min < 0 < number.max and kind % 0.5 < 0.25 else 1.0
        guess = sign * (number.guess or 1.0) * float(np.exp(SPREAD * ndtri(place)))
    return replace(number, guess=float(np.clip(guess, number.min, number.max)))


def _bent(problem: ControlProblem, amplitudes: list[np.ndarray]) -> ControlProblem:
    """The problem with its states bent, those that are derivatives following. ModelError if its times are out of order."""
    phases = []
    for phase, waves in zip(problem.phases, amplitudes, strict=True):
        start, stop = horizon(problem, phase)
        phases.append(_bent_phase(phase, waves, stop - start, problem.name))
    return replace(problem, phases=tuple(phases))


def _bent_phase(phase: Phase, amplitudes: np.ndarray, span: float, name: str) -> Phase:
    limits = signal_limits(phase, name)
    states = {s.symbol.name(): s for s in phase.states}
    guesses: dict[str, Guess] = {}
    for state, waves in zip(coordinates(phase), amplitudes, strict=True):
        key = state.symbol.name()
        guesses[key] = _wave(state.guess, waves, limits[state.name])
        above = derivative_name(*_next(key))
        if above in states:
            guesses[above] = _slope(states[above].guess, waves / span)
    bent = tuple(replace(s, guess=guesses.get(s.symbol.name(), s.guess)) for s in phase.states)
    return replace(phase, states=bent)


def _next(key: str) -> tuple[str, int]:
    base, order = split_derivative(key)
    return base, order + 1


def _wave(guess: Guess, weights: np.ndarray, limits: tuple[float, float]) -> Guess:
    def bent_guess(share: np.ndarray) -> np.ndarray:
        share = np.asarray(share, dtype=float)
        waves = np.sin(np.pi * np.outer(np.atleast_1d(share), 1 + np.arange(weights.size))) @ weights
        return np.clip(guess(share) + waves, *limits)

    return bent_guess


def _slope(guess: Guess, weights: np.ndarray) -> Guess:
    def bent_guess(share: np.ndarray) -> np.ndarray:
        share = np.asarray(share, dtype=float)
        k = np.pi * (1 + np.arange(weights.size))
        return guess(share) + np.cos(np.outer(np.atleast_1d(share), k)) @ (k * weights)

    return bent_guess


def _level(signal: Signal, limits: tuple[float, float], place: float) -> Guess:
    """A constant input between its limits, else the guess as it is."""
    if not np.isfinite(limits).all():
        return signal.guess
    value = limits[0] + place * (limits[1] - limits[0])
    return lambda share: np.full(np.shape(share), value)
