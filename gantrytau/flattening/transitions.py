"""Transitions of modes, written as whens: one chain for each mode, of which the first branch that may act does.

A branch acts where the mode is in its source and its guard is true, so that a guard that is true already when the mode is
entered acts in the next round. Before the branches of a source stand those that end a run where two guards are true at once
and no priorities say which one is first. A guard that is looked at every period counts up, where it holds, a sampled
variable `mode.due[k]`, and is open while that is ahead of the Discrete `mode.seen[k]`, which every transition brings up.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.flattening.instantiation import Instance, Leaf, Placed
from gantrytau.flattening.whens import condition_of
from gantrytau.language.declarations import Discrete, Quantity, Real
from gantrytau.language.events import CurrentMode, Happening, Mode, Sampling, Transition, WhenChain
from gantrytau.language.functions import if_else, logic_and, logic_not
from gantrytau.language.statements import place_of
from gantrytau.language.symbols import element_names

Where = tuple[str, str, int]  # path, class and number of a statement
SHOWN = 60  # letters of a guard


@dataclass(frozen=True, eq=False)
class _Arrow:
    """A transition with its guard as an expression, what opens it, and where it is stated."""

    said: Transition
    where: Where
    guard: ca.SX
    opens: Any = None

    @property
    def words(self) -> str:
        return f"transition of {self.said.mode.path} from {self.said.source} to {self.said.target}"

    @property
    def short(self) -> str:
        text = str(self.guard)
        text = text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."
        return f"to {self.said.target} ({place_of(*self.where)}: {text})"


def read_transitions(
    stated: Sequence[tuple[str, str, int, Transition]], instance: Instance
) -> tuple[
    list[tuple[str, str, int, Sampling]], list[tuple[str, str, int, WhenChain]], dict[str, tuple[str, ...]]
]:
    """Transitions (path, class, number, transition) as samplings and chains of whens, and the names of all modes.

    ModelError for modes that do not exist or that nothing reaches, guards that are none, and priorities that are none.
    """
    modes = {p.name: p for p in instance.quantities if isinstance(p.declaration, Mode)}
    inside = {name: _inside(placed, modes) for name, placed in modes.items()}
    arrows: dict[str, list[_Arrow]] = {name: [] for name in modes}
    for path, model, number, said in stated:
        found = _read(said, (path, model, number), modes, inside, instance)
        arrows[said.mode.path].append(found)
    samplings: list[tuple[str, str, int, Sampling]] = []
    chains: list[tuple[str, str, int, WhenChain]] = []
    for name, placed in modes.items():
        mine = arrows[name]
        _refuse_unreached(placed, mine)
        mine, seen = _sampled(placed, mine, instance, samplings)
        chains.append((*mine[0].where, WhenChain(tuple(_branches(placed, mine, seen, inside[name])))))
    return samplings, chains, {name: placed.declaration.names for name, placed in modes.items()}


def _inside(placed: Placed, modes: dict[str, Placed]) -> Any:
    """The condition under which a mode with `within=` may change; None without it."""
    one, above = placed, []
    while (told := one.declaration.within) is not None:
        outer = told.rpartition(".")[0]
        full = f"{placed.path}.{outer}" if placed.path else outer
        if full not in modes or full in [placed.name, *above]:
            free = [p for n, p in modes.items() if p.path == placed.path and n not in (placed.name, *above)]
            beside = [f"{p.name.rpartition('.')[2]}.{state}" for p in free for state in p.declaration.names]
            near = did_you_mean(told, beside) if beside else "; declare one"
            raise ModelError(
                f"{one.name}: found within={told!r}, expected a mode of another one beside it that is not within this "
                f"one{near}"
            )
        one = modes[full]
        above.append(full)
    if not above:
        return None
    outer = modes[above[0]]
    current = CurrentMode(outer.symbol, outer.declaration.names, outer.name)
    return current.is_in(placed.declaration.within.rpartition(".")[2])


def _read(
    said: Transition, where: Where, modes: dict[str, Placed], inside: dict[str, Any], instance: Instance
) -> _Arrow:
    place = place_of(*where)
    if not isinstance(said.mode, CurrentMode) or said.mode.path not in modes:
        raise ModelError(
            f"{place}: found a transition of {said.mode!r}, expected a declared Mode of this model, as self.mode"
        )
    names = said.mode.names
    for role, name in (("from", said.source), ("to", said.target)):
        if name not in names:
            raise ModelError(
                f"{place}: found a transition of {said.mode.path} {role} {name!r}, expected one of its modes"
                f"{did_you_mean(str(name), names)}"
            )
    if said.source == said.target:
        raise ModelError(
            f"{place}: found a transition of {said.mode.path} from {said.source} to itself, expected two modes; what "
            f"happens within one is when(logic_and(self.mode.is_in('{said.source}'), ...), ...)"
        )
    guard = condition_of(said.guard, instance.symbols, (), place)
    if inside[said.mode.path] is not None:
        guard = logic_and(inside[said.mode.path], guard)
    return _Arrow(said, where, guard, guard)


def _refuse_unreached(placed: Placed, arrows: Sequence[_Arrow]) -> None:
    names = placed.declaration.names
    if not arrows:
        raise ModelError(
            f"{placed.name}: found a Mode without transitions, expected some, yield transition(self.mode, "
            f"'{names[0]}', '{names[1]}', guard)"
        )
    start = placed.attributes["start"].value
    reached, left = set(), [names[start]]
    while left:
        name = left.pop()
        reached.add(name)
        left += [a.said.target for a in arrows if a.said.source == name and a.said.target not in reached]
    lost = [name for name in names if name not in reached]
    if lost:
        raise ModelError(
            f"{placed.name}: found no transition that leads from {names[start]}, where it starts, to {', '.join(lost)}, "
            "expected a way to every mode; add one, or leave the name out"
        )


def _sampled(
    placed: Placed,
    arrows: Sequence[_Arrow],
    instance: Instance,
    samplings: list[tuple[str, str, int, Sampling]],
) -> tuple[list[_Arrow], list[Any]]:
    """Transitions with a period get a counter `due`, which a sampling raises, and open while it is above `seen`.

    Returns all transitions, and the equations seen = due of the actions taken when a transition fires.
    """
    timed = [a for a in arrows if a.said.period is not None]
    if not timed:
        return list(arrows), []
    words = "transitions that were due at instants of their periods"
    due = _added(
        placed, "due", Real(len(timed), unit="1", start=np.zeros(len(timed)), description=words), instance
    )
    words = "transitions among those due that were dealt with"
    seen = _added(placed, "seen", Discrete(np.zeros(len(timed)), unit="1", description=words), instance)
    found = []
    for arrow in arrows:
        if arrow not in timed:
            found.append(arrow)
            continue
        k = timed.index(arrow)
        holds = logic_and(arrow.said.mode.is_in(arrow.said.source), arrow.guard)
        step = Sampling(due[k], due[k] + if_else(holds, 1.0, 0.0), arrow.said.period)
        samplings.append((*arrow.where, step))
        found.append(_Arrow(arrow.said, arrow.where, arrow.guard, due[k] > seen[k] + 0.5))
    return found, [seen[k] == due[k] for k in range(len(timed))]


def _added(placed: Placed, name: str, declaration: Quantity, instance: Instance) -> ca.SX:
    """The symbol of a further variable beside a mode."""
    full, shape = f"{placed.name}.{name}", (int(np.prod(np.shape(declaration.start))),)
    names = element_names(full, shape)
    symbol = ca.vertcat(*(instance.symbols.add(element, declaration.kind).sx for element in names))
    told = {
        key: getattr(declaration, key) for key in ("start", "unit", "description", "fixed", "undetermined")
    }
    attributes = {key: Leaf(value, instance.root) for key, value in told.items()}
    instance.quantities.append(Placed(placed.path, full, declaration, shape, symbol, attributes, names))
    return symbol


def _branches(
    placed: Placed, arrows: Sequence[_Arrow], seen: Sequence[Any], inside: Any
) -> Iterator[Happening]:
    """The branches of a mode's chain: for each source state the refused transitions, then the others by priority.

    A nested mode without history returns to its start when the outer state is left. Transitions of the outer mode go first.
    """
    waits = inside is not None
    if waits and not placed.declaration.history:
        current, begin = arrows[0].said.mode, placed.attributes["start"].value
        others = current.is_in(*(n for k, n in enumerate(current.names) if k != begin))
        words = f"return of {placed.name} to {current.names[begin]}"
        back = (current.number == begin, *seen)
        yield Happening(
            logic_and(logic_not(inside), others), back, words, initially=True, where=arrows[0].where
        )
    for source in placed.declaration.names:
        out = [a for a in arrows if a.said.source == source]
        for one, other in combinations(out, 2):
            ranks = {one.said.priority, other.said.priority}
            if None in ranks or len(ranks) == 1:
                both = logic_and(one.said.mode.is_in(source), one.opens, other.opens)
                failure = (
                    f"two transitions of {placed.name} out of {source} may act at once, {one.short} and {other.short}, "
                    "and no priorities say which; give both, as priority=1 and priority=2, of which the lower acts, or "
                    "guards that exclude each other"
                )
                words = f"transitions of {placed.name} out of {source}"
                yield Happening(
                    both, (), words, initially=True, failure=failure, where=one.where, waits=waits
                )
        for arrow in sorted(out, key=lambda a: np.inf if a.said.priority is None else a.said.priority):
            said = arrow.said
            condition = logic_and(said.mode.is_in(source), arrow.opens)
            to = said.mode.number == said.mode.names.index(said.target)
            actions = (to, *seen, *said.actions)
            yield Happening(condition, actions, arrow.words, initially=True, where=arrow.where, waits=waits)
