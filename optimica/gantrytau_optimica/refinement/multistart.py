"""`starts=`: several first guesses around the default one, and the branches of solutions they lead to."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from gantrytau.ensembles.each import each
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import ControlProblem, FreeNumber, Phase, Signal
from gantrytau_optimica.control.guesses import Guess, horizon, with_algebraics
from gantrytau_optimica.control.limits import signal_limits
from gantrytau_optimica.solving.clock import Clock
from gantrytau_optimica.transcription.program import Program

SEED = 20121
EXTENTS = (0.15, 0.6)  # of the way from start to end, between which it is drawn how far a guess is bent
SAME = 1e-3  # relative: objectives that are closer count as one branch
WAVES = 3  # half waves in the deviation of a guess


@dataclass(frozen=True)
class SolutionBranch:
    """Solutions with the same objective: how many first guesses led there, and the best of them."""

    objective: float
    count: int
    optimum: Optimum

    def __str__(self) -> str:
        times = "once" if self.count == 1 else f"{self.count} times"
        return f"objective {self.objective:.8g}, found {times}"


@dataclass(frozen=True)
class Search:
    """All branches, the best first, and how many guesses did not lead to a solution."""

    starts: int
    branches: tuple[SolutionBranch, ...]
    failures: int

    def __str__(self) -> str:
        lines = [
            f"{self.starts} first guesses led to {len(self.branches)} branches, {self.failures} to no solution:"
        ]
        return "\n".join([*lines, *(f"  {branch}" for branch in self.branches[:8])])


class Attempts(Protocol):
    """Solves from first guesses: here or in another process by a call, then as an optimum of this one."""

    def __call__(self, guesses: "Guesses") -> Any:
        """Where the solver ends."""

    def optimum(self, guesses: "Guesses", found: Any) -> Optimum:
        """That as an optimum."""
        ...


@dataclass(frozen=True, eq=False)
class Guesses:
    """First guesses of all signals by name, and of the free numbers."""

    signals: Mapping[str, Guess]
    free: tuple[float, ...]

    @classmethod
    def of(cls, problem: ControlProblem) -> "Guesses":
        """Those of a problem."""
        return cls({s.name: s.guess for s in problem.signals}, tuple(n.guess for n in problem.free))

    def on(self, program: Program) -> Program:
        """A program with these first guesses."""
        same = program.problem.with_signals(lambda _, s: replace(s, guess=self.signals[s.name]))
        free = tuple(
            replace(n, guess=guess) for n, guess in zip(program.problem.free, self.free, strict=True)
        )
        return program.with_numbers(replace(same, free=free))


def searched(attempts: Attempts, built: Built, starts: int, clock: Clock) -> Optimum:
    """The best optimum from `starts` first guesses, the default one first; if none is found, where that one ended.

    Every state that is not itself a derivative is bent by a few half waves, which vanish at the ends; those that are its
    derivatives follow; free numbers and inputs are drawn from their limits or around their guess. The seed is fixed. Where
    a solve takes its time the others run on all processors, with the same answers.
    """
    guesses: list[Guesses] = []

    def drawn() -> Iterator[Guesses]:
        random = np.random.default_rng(SEED)
        for k in range(starts):
            if k and not clock.left:
                return
            problem = with_algebraics(built, bent(built.problem, random)) if k else built.problem
            guesses.append(Guesses.of(problem))
            yield guesses[-1]

    ended: dict[int, Optimum] = {}
    clock.enter(f"first guess 1 of {starts}")
    for k, found in each(attempts, drawn(), starts):
        ended[k] = attempts.optimum(guesses[k], found)
        if not clock.left:
            break
        if len(ended) < starts:
            clock.enter(f"first guess {len(ended) + 1} of {starts}")
    tried = [ended[k] for k in sorted(ended)]
    found = sorted((o for o in tried if o.success), key=lambda o: o.objective)
    if not found:
        return tried[0]
    branches: list[SolutionBranch] = []
    for optimum in found:
        if branches and optimum.objective - branches[-1].objective <= SAME * abs(optimum.objective):
            branches[-1] = replace(branches[-1], count=branches[-1].count + 1)
        else:
            branches.append(SolutionBranch(optimum.objective, 1, optimum))
    return replace(found[0], search=Search(len(tried), tuple(branches), len(tried) - len(found)))


def bent(problem: ControlProblem, random: np.random.Generator) -> ControlProblem:
    """The problem with other first guesses, drawn around those it has."""
    free = tuple(_drawn(number, random) for number in problem.free)
    changed = replace(problem, free=free)
    try:
        spans = [horizon(changed, phase) for phase in changed.phases]
    except Exception:  # times out of order: keep those of the guess
        changed, spans = problem, [horizon(problem, phase) for phase in problem.phases]
    phases = tuple(
        _bent(phase, span, problem.name, random) for phase, span in zip(changed.phases, spans, strict=True)
    )
    return replace(changed, phases=phases)


def _drawn(number: FreeNumber, random: np.random.Generator) -> FreeNumber:
    if number.held:
        return number
    if np.isfinite(number.min) and np.isfinite(number.max) and random.uniform() < 0.5:
        guess = random.uniform(number.min, number.max)
    else:
        sign = -1.0 if number.min < 0 < number.max and random.uniform() < 0.5 else 1.0
        guess = sign * (number.guess or 1.0) * float(np.exp(random.normal(0.0, 0.7)))
    return replace(number, guess=float(np.clip(guess, number.min, number.max)))


def _bent(phase: Phase, span: tuple[float, float], name: str, random: np.random.Generator) -> Phase:
    limits = signal_limits(phase, name)
    states = {s.symbol.name(): s for s in phase.states}
    extents = _extents(phase, limits, float(np.exp(random.uniform(*np.log(EXTENTS)))))
    guesses: dict[str, Guess] = {}
    for key, state in states.items():
        base, order = split_derivative(key)
        if order and derivative_name(base, order - 1) in states:
            continue
        weights = random.normal(size=WAVES) / (1 + np.arange(WAVES)) ** 2 * extents[state.name]
        guesses[key] = _wave(state.guess, weights, limits[state.name])
        above = derivative_name(base, order + 1)
        if above in states:
            guesses[above] = _slope(states[above].guess, weights / (span[1] - span[0]))
    inputs = tuple(replace(u, guess=_level(u, limits[u.name], random)) for u in phase.inputs)
    bent_states = tuple(replace(s, guess=guesses.get(s.symbol.name(), s.guess)) for s in phase.states)
    return replace(phase, states=bent_states, inputs=inputs)


def _extents(phase: Phase, limits: Mapping[str, tuple[float, float]], share: float) -> dict[str, float]:
    """How far the guesses of states are bent: shares of the limits, else of the way that a whole vector goes."""
    shares = np.linspace(0.0, 1.0, 21)
    ways: dict[str, float] = {}
    for state in phase.states:
        vector = state.name.split("[")[0] if state.name.endswith("]") else state.name
        ways[vector] = float(np.hypot(ways.get(vector, 0.0), np.ptp(state.guess(shares))))
    found = {}
    longest = max(ways.values(), default=0.0)
    for state in phase.states:
        vector = state.name.split("[")[0] if state.name.endswith("]") else state.name
        low, high = limits[state.name]
        width = 0.25 * (high - low) if np.isfinite(low) and np.isfinite(high) else np.inf
        found[state.name] = min(width, max(share * max(ways[vector], 0.5 * longest), 0.1 * state.nominal))
    return found


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


def _level(signal: Signal, limits: tuple[float, float], random: np.random.Generator) -> Guess:
    """A constant input between its limits, else the guess as it is."""
    level = random.uniform(-0.5, 0.5)
    if not np.isfinite(limits).all():
        return signal.guess
    value = 0.5 * (limits[0] + limits[1]) + level * (limits[1] - limits[0])
    return lambda share: np.full(np.shape(share), value)
