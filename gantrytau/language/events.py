"""What a model states of instants: what is sampled and held, what happens when, modes, stick-slip friction, and delays.

`sampled`, `when`, `transition` and `stick_slip` are yielded by `equations(self)` like equations. A sampled variable, a
Discrete and the force of such a friction count as known in the equations, as inputs do; what they are is kept beside.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.checks import number
from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.language.declarations import Discrete
from gantrytau.language.functions import if_else, logic_and, logic_or
from gantrytau.language.symbols import delayed


@dataclass(frozen=True, eq=False)
class Sampling:
    """`sampled(variable, expression, period=..., start=...)`."""

    variable: Any
    expression: Any
    period: Any
    start: Any = None


@dataclass(frozen=True, eq=False)
class Lawful:
    """`by_law(found, law, given)`."""

    found: Sequence[Any]
    law: Callable[[float, np.ndarray], Sequence[float]]
    given: Sequence[Any]


@dataclass(frozen=True, eq=False)
class Sticking:
    """`stick_slip(force, speed, coulomb=..., smooth=..., breakaway=...)`."""

    force: Any
    speed: Any
    coulomb: Any
    smooth: Any
    breakaway: Any


@dataclass(frozen=True, eq=False)
class Reinit:
    """`reinit(variable, value)`."""

    variable: Any
    value: Any


@dataclass(frozen=True, eq=False)
class Terminate:
    """`terminate(words)`."""

    words: str


@dataclass(frozen=True, eq=False)
class Happening:
    """One branch of a chain: actions where a condition becomes true.

    words: what it is, where its condition does not say it; initially: whether it acts at the start, too, if its condition
    holds there; failure: words of the error that it is instead of acting, "" if it is none; where: path, class and number
    of its statement, if that is not the chain's; waits: whether it acts in rounds in which no other kind does.
    """

    condition: Any
    actions: tuple[Any, ...]
    words: str = ""
    initially: bool = False
    failure: str = ""
    where: tuple[str, str, int] | None = None
    waits: bool = False


@dataclass(frozen=True, eq=False)
class WhenChain:
    """`when(condition, action, ...)`, and what is tried after it: branches of which one acts at an instant."""

    branches: tuple[Happening, ...]

    def elsewhen(self, condition: Any, *actions: Any) -> "WhenChain":
        """The same, and further actions where another condition becomes true and none before it does."""
        return WhenChain((*self.branches, Happening(condition, actions)))


def when(condition: Any, *actions: Any) -> WhenChain:
    """State what happens at the instants at which a condition becomes true; one that is true at the start does not.

    condition: a comparison (`<`, `<=`, `>`, `>=`) of variables and time, `between`, a Discrete that is 0 or 1, or some of
    these joined by `logic_and`, `logic_or`, `logic_not`. actions: `discrete == expression`, which gives a Discrete a new
    value, `reinit(state, expression)`, `terminate("words")`. In an expression `pre(x)` is the value just before; a Discrete
    without it has its new value, any other variable the one just before. All whens whose conditions become true at an
    instant act together; then the conditions are looked at again, until none becomes true any more.
    `.elsewhen(condition, action, ...)` continues the chain, of which the first whose condition becomes true acts: a
    variable may be set by one chain only.
    """
    return WhenChain((Happening(condition, actions),))


def refuse_change(condition: ca.SX, place: str = "") -> None:
    """ModelError for a condition that is true at an instant only, as n > pre(n): it is looked at between instants."""
    names = {symbol.name() for symbol in ca.symvar(condition)}
    for name in sorted(names):
        if f"pre({name})" in names:
            raise ModelError(
                f"found {name} beside pre({name}) in the condition of when, which is true at instants of change only and is "
                f"never seen, expected a condition that stays true; act in the when that changes {name}",
                place=place,
            )


def reinit(variable: Any, value: Any) -> Reinit:
    """An action of `when`: a state, scalar or vector, takes another value, and what follows from it with it."""
    return Reinit(variable, value)


def terminate(words: str) -> Terminate:
    """An action of `when`: the simulation ends there, and says these words as `.ended` of its result."""
    if not isinstance(words, str) or not words.strip():
        raise ModelError(f"terminate: found {words!r}, expected a text that says why the simulation ends")
    return Terminate(words)


def sampled(variable: Any, expression: Any, *, period: Any, start: Any = None) -> Sampling:
    """State that a variable is sampled: it takes a new value every period, and holds it in between.

    variable: a declared Real or Output, scalar or vector, for which there is no other equation; expression:
    of the same shape; at t0 + k * period, k = 0, 1, ..., with t0 where the simulation starts, the variable takes
    the value that it had just before; period: s, a number or an expression of parameters; start: before the
    first instant (else the variable's own start, or zero). What is sampled at the same instant does not see
    each other's new values.
    """
    return Sampling(variable, expression, period, start)


def by_law(
    found: Sequence[Any], law: Callable[[float, np.ndarray], Sequence[float]], given: Sequence[Any]
) -> Lawful:
    """State that a Python function gives the values of sampled scalars, in place of the expressions of `sampled`.

    law(t, values of given behind the instant) -> values of found, at every instant of found; all have one period.
    The same arguments must give the same values, however often it is asked: what it remembers goes by a counter among the
    given. `simulate` calls it; what needs formulas refuses it.
    """
    return Lawful(tuple(found), law, tuple(given))


def delay(x: Any, T: Any) -> ca.SX:
    """What an expression was a time T ago, for use in equations(self); a vector element by element.

    x: an expression of variables, scalar or vector; T: s, a number or an expression of parameters, above zero. Before the
    start it was what it is there. What jumps or bends does so again T later. The order of its interpolation is that of the
    integrator. `simulate` and FMUs have it; linear systems, functions and optimisation refuse it, where a Pade approximation
    or a chain of first-order lags can stand for it. Raises ModelError for a T that is not above zero.
    """
    expression = ca.densify(ca.SX(x))
    time = ca.SX(T)
    if time.numel() != 1 or (time.is_constant() and not 0 < float(time) < float("inf")):
        raise ModelError(
            f"delay: found T={T}, expected a finite time above zero, in s; what has no delay stands in the equation as it is"
        )
    return ca.reshape(ca.vertcat(*delayed(expression.elements(), time)), *expression.shape)


def stick_slip(force: Any, speed: Any, *, coulomb: Any, smooth: Any, breakaway: Any) -> Sticking:
    """State friction that sticks exactly, in `simulate` and FMUs: its equations change at instants, which they locate.

    force: a declared Real for which there is no other equation, positive against positive speed; speed: a
    declared variable. In motion force == coulomb + smooth, or -coulomb + smooth where the speed is negative; at
    rest it holds the speed at zero, while |force| <= breakaway. coulomb >= 0 and breakaway >= coulomb.
    """
    return Sticking(force, speed, coulomb, smooth, breakaway)


class Mode(Discrete):
    """Which of some named modes a component is in: `mode = Mode("free", "contact", "released")`.

    It begins in the first, or in `start`, and only `transition` changes it. In equations `self.mode.is_in("contact")` is a
    condition and `self.mode.choose(free=..., contact=..., released=...)` a value for each. Results, FMUs and files have the
    number of the mode, from 0 in the order of the names, which stand in its description.

    within: a mode of another one beside it, as "phase.moving", inside of which alone it changes: a state chart in a state.
    Outside it rests in its start, in which it is entered anew, or with history=True where it was left. Several modes within
    the same one go on in parallel. Where both may change at once the outer one does.
    """

    def __init__(
        self,
        *names: str,
        start: str | None = None,
        within: str | None = None,
        history: bool = False,
        description: str = "",
    ):
        wrong = next((n for n in names if not isinstance(n, str) or not n.isidentifier()), None)
        if wrong is not None or len(names) < 2 or len(set(names)) < len(names):
            raise ModelError(
                f"Mode: found the names {names!r}, expected at least two different words of letters, digits and _"
            )
        numbers = ", ".join(f"{k} {name}" for k, name in enumerate(names))
        super().__init__(0, unit="1", description=f"{description or 'mode'}: {numbers}")
        if not isinstance(within, str | None) or (history and within is None):
            raise ModelError(
                f"Mode: found within={within!r}, expected a mode of another one, as 'phase.moving'"
            )
        self.names = names
        self.within, self.history = within, history
        self.start = 0 if start is None else mode_number("Mode", names, start)

    def __repr__(self) -> str:
        start = f", start={self.names[self.start]!r}" if self.start else ""
        within = f", within={self.within!r}, history={self.history!r}" if self.within else ""
        return f"Mode({', '.join(map(repr, self.names))}{start}{within}, description={self.description!r})"


def mode_number(place: str, names: Sequence[str], start: Any) -> int:
    """The number of a mode by its name or as it is; ModelError for what is neither."""
    if isinstance(start, str):
        return _number_of(place, names, start)
    if isinstance(start, (int, float, np.number)) and start in range(len(names)):
        return int(start)
    raise ModelError(f"{place}: found the start {start!r}, expected one of the modes {', '.join(names)}")


class CurrentMode:
    """The mode of a component in its equations: `self.mode`. number: its symbol; names, path: of the declaration."""

    def __init__(self, number: ca.SX, names: tuple[str, ...], path: str):
        self.number, self.names, self.path = number, names, path

    def is_in(self, *names: str) -> Any:
        """The condition that it is one of some modes, for `if_else`, `when` and guards."""
        if not names:
            raise ModelError(f"{self.path}.is_in: found no name, expected some of {', '.join(self.names)}")
        return logic_or(*(self._is(_number_of(f"{self.path}.is_in", self.names, name)) for name in names))

    def choose(self, **values: Any) -> Any:
        """The value that belongs to the mode: one for each, numbers or expressions of one shape."""
        for name in values:
            _number_of(f"{self.path}.choose", self.names, name)
        missing = [name for name in self.names if name not in values]
        if missing:
            raise ModelError(
                f"{self.path}.choose: found no value for {', '.join(missing)}, expected one for each of "
                f"{', '.join(self.names)}"
            )
        found = values[self.names[-1]]
        for k, name in reversed(list(enumerate(self.names[:-1]))):
            found = if_else(self.number < k + 0.5, values[name], found)
        return found

    def _is(self, k: int) -> Any:
        above, below = self.number > k - 0.5, self.number < k + 0.5
        return below if k == 0 else above if k == len(self.names) - 1 else logic_and(above, below)

    def __eq__(self, other: object) -> Any:
        raise ModelError(f"{self.path}: found == on a mode, expected {self.path}.is_in('{self.names[-1]}')")

    __hash__ = object.__hash__


def _number_of(place: str, names: Sequence[str], name: Any) -> int:
    if name in names:
        return list(names).index(name)
    raise ModelError(f"{place}: there is no mode {name!r}{did_you_mean(str(name), names)}")


@dataclass(frozen=True, eq=False)
class Transition:
    """`transition(mode, source, target, guard, action, ..., priority=..., period=...)`."""

    mode: Any
    source: str
    target: str
    guard: Any
    actions: tuple[Any, ...]
    priority: float | None
    period: Any


def transition(
    mode: Any,
    source: str,
    target: str,
    guard: Any,
    *actions: Any,
    priority: float | None = None,
    period: Any = None,
) -> Transition:
    """State that a mode changes from `source` to `target` where it is in `source` and a guard is true.

    mode: a declared Mode; guard: a condition, as of `when`. It acts when it becomes true, and at once where it is true
    already as the mode is entered, or at the start. actions: as of `when`. Of several transitions out of one mode whose
    guards are true at once that with the lowest `priority` acts; without different priorities that is an error of the
    simulation. period: s, a number or an expression of parameters: the guard is looked at only at t0 + k * period, with the
    values just before.
    """
    if priority is not None:
        priority = number("transition", "priority", priority)
    return Transition(mode, source, target, guard, actions, priority, period)
