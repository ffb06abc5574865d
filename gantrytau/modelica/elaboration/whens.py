"""What `when` of Modelica text amounts to: chains of the language, and Discretes that follow variables (chapter 8.3.5)."""

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import reduce
from typing import Any, cast

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.language.events import Happening, Reinit, WhenChain, refuse_change, reinit, terminate
from gantrytau.language.functions import ceil, floor, if_else, logic_and, logic_not, logic_or
from gantrytau.language.symbols import pre, time
from gantrytau.modelica import tree
from gantrytau.modelica.conditions import (
    Items,
    changed_in,
    checks_in,
    first_valued,
    instant_and_rest,
    is_call,
    sample_calls,
    sample_name,
)
from gantrytau.modelica.elaboration import values
from gantrytau.modelica.elaboration.interpreter import Interpreter, changed
from gantrytau.modelica.elaboration.kinds import type_of

ROUNDING = 1e-6  # of a period, by which an instant may be located early


def when_chains(
    item: tree.Branching, reader: Interpreter, actions: Callable[[Items, Interpreter], Iterator[Any]]
) -> Iterator[WhenChain]:
    """The chains of a `when`: its own, one for each sample, and those that end the run. actions: reads a branch."""
    yield WhenChain(tuple(_branches(item, reader, actions)))
    for call in (call for test, _ in item.branches for call in sample_calls(test)):
        instant, period = reader.members.next_sample(call), reader.value(call.arguments[1])
        passed = 1 + floor((time - pre(instant)) / period + ROUNDING)  # several where the run begins late
        action = instant == pre(instant) + passed * period
        advance = Happening(time >= instant, (action,), "sample", True)
        begin = reader.value(call.arguments[0])
        late = if_else(
            time > begin, ceil((time - begin) / period - ROUNDING), 0
        )  # periods before the run begins
        yield WhenChain((at_start((instant == begin + late * period,)), advance))
        if (turn := reader.members.turn(sample_name(call))) is not None:
            yield WhenChain((replace(advance, actions=(turn == 1 - pre(turn),)),))
    for call in (call for _, items in item.branches for call in checks_in(items)):
        words = reader.value(call.arguments[-1 if is_call(call, "terminate") else 1])
        flag = reader.members.next_sample(call)
        ends = () if is_call(call, "assert") else (terminate(words),)
        yield WhenChain((Happening(flag > 0.5, ends, words, failure="" if ends else words),))


def _branches(
    item: tree.Branching, reader: Interpreter, read: Callable[[Items, Interpreter], Iterator[Any]]
) -> Iterator[Happening]:
    """The branches of a chain; those of `sample(...) and rest` come last, as their rest is looked at with new values."""
    plain: list[list[Happening]] = []
    guarded: list[list[Happening]] = []
    guards: list[tuple[Any, tuple[Any, ...]]] = []
    for test, items in item.branches:
        inner = replace(reader, following=frozenset(changed_in(test, items)))
        actions = tuple(read(items, inner))
        instant, rest = instant_and_rest(test)
        rest = rest if len(item.branches) == 1 or is_call(instant, "sample") else None
        now = None if rest is None else values.condition(inner.value(rest))
        own = actions if now is None else tuple(chosen_actions(now, actions, ()))
        for before, others in reversed(guards):
            own = tuple(chosen_actions(before, others, own))
        found = list(_happenings(test if rest is None else instant, items, inner, own))
        (plain if rest is None else guarded).append(found)
        if rest is not None and (turn := inner.members.turn(sample_name(instant))) is not None:
            guards.append((logic_and((turn - pre(turn)) ** 2 > 0.5, now), actions))
    for branch in (*plain, *reversed(guarded)):
        yield from branch


def _happenings(
    test: tree.Expression, items: Items, reader: Interpreter, actions: tuple[Any, ...]
) -> Iterator[Happening]:
    """A branch for each condition of a vector: each acts when it becomes true."""
    for one in test.items if isinstance(test, tree.ArrayConstructor) else (test,):
        if is_call(one, "initial"):
            yield at_start(actions)
            continue
        edge = cast(tree.Call, one).arguments[0] if is_call(one, "edge") else one
        found = _stays(edge, reader)
        if isinstance(found, np.ndarray):  # a vector of conditions
            each = (Happening(values.condition(test), actions) for test in found)
            yield from each
            continue
        found = values.condition(found)
        if isinstance(found, ca.SX):
            refuse_change(found)
        elif found is False:
            found = time < -1e30  # never
        sampled = any(sample_calls(one))
        turns = map(reader.members.turn, sorted(set(changed_in(edge, items))))
        for each in _both(found, [one for turn in turns if turn is not None for one in turn.elements()]):
            yield Happening(each, actions, "sample" if sampled else "", sampled)


def _stays(test: tree.Expression, reader: Interpreter) -> Any:
    """A condition; of Integers, Booleans or literals that are equal or differ as a range, in which they stay for a while."""
    if isinstance(test, tree.Binary) and test.operator in ("and", "or"):
        left, decisive = _stays(test.left, reader), test.operator == "or"
        return left if left is decisive else values.binary(test.operator, left, _stays(test.right, reader))
    found = reader.value(test)
    if not (isinstance(test, tree.Binary) and test.operator in ("==", "<>") and isinstance(found, ca.SX)):
        return found
    if "Real" in (type_of(test.left, reader), type_of(test.right, reader)):
        return found
    left, right = (values.to_casadi(reader.value(one)) for one in (test.left, test.right))
    within = logic_and(left > right - 0.5, left < right + 0.5)
    return within if test.operator == "==" else logic_not(within)


def at_start(actions: tuple[Any, ...]) -> Happening:
    """What happens at the start and never again: a condition on the time that always holds."""
    return Happening(time > -1e30, actions, "at the start", True)


def chosen_actions(test: Any, then: Iterable[Any], otherwise: Iterable[Any]) -> Iterator[Any]:
    """Actions where a condition holds with the new values, and others where it does not; what neither sets stays."""
    above, below = _by_variable(then), _by_variable(otherwise)
    for key in {**above, **below}:
        variable, old, _ = above.get(key) or below[key]
        value, other = (one[key][2] if key in one else old for one in (above, below))
        found = if_else(test, value, other)
        yield reinit(variable, found) if key[1] is Reinit else variable == found


def _by_variable(actions: Iterable[Any]) -> dict[tuple[str, type], tuple[Any, Any, Any]]:
    """Scalar actions by what they set: the variable, its value without them, and the new one."""
    found: dict[tuple[str, type], tuple[Any, Any, Any]] = {}
    for one in actions:
        if isinstance(one, Reinit):
            found[str(one.variable), Reinit] = one.variable, one.variable, one.value
        elif isinstance(one, ca.SX):
            for e in one.elements():
                found[e.dep(0).name(), ca.SX] = e.dep(0), pre(e.dep(0)), e.dep(1)
        else:
            raise ModelError("found terminate() beside sample() and another condition, expected another when")
    return found


def follows(value: ca.SX, held: ca.SX, turn: ca.SX, then: ca.SX | None = None) -> WhenChain:
    """What makes a Discrete follow a value one round later; turn: the parity of its changes; then: that of an action."""
    change, act = changed(value, held), (held == (value if then is None else then), turn == 1 - pre(turn))
    return WhenChain(tuple(Happening(test, act, initially=True) for test in _both(change, [turn])))


def _both(change: Any, turns: Sequence[ca.SX]) -> Iterator[Any]:
    """The two conditions of which one becomes true by each change, also by one in the round after another."""
    if not turns:
        yield change
        return
    odd = [turn > 0.5 for turn in turns]
    other = reduce(lambda a, b: logic_or(logic_and(a, logic_not(b)), logic_and(b, logic_not(a))), odd)
    yield from (logic_and(change, other), logic_and(change, logic_not(other)))


def set_by_whens(items: Iterable[Any], held: Collection[str]) -> list[tree.Assignment]:
    """The initial equations of what a `when` sets, as assignments."""
    found = (
        (one, tree.ComponentReference(one.at, ((name, ()),)))
        for one in items
        if (name := first_valued(one)) in held
    )
    return [tree.Assignment(one.at, None, None, False, (left,), one.right) for one, left in found]


def begun(stated: Any, firsts: Sequence[ca.SX]) -> Any:
    """A statement; a chain of `when` also gives what it sets the values of initial sections."""
    if not isinstance(stated, WhenChain) or not firsts:
        return stated
    actions = [action for one in stated.branches for action in one.actions if isinstance(action, ca.SX)]
    names = {one.dep(0).name() for action in actions for one in action.elements() if one.dep(0).is_symbolic()}
    scalars = (scalar for one in firsts for scalar in one.elements())
    own = tuple(one for one in scalars if one.dep(0).name() in names)
    return WhenChain((at_start(own), *stated.branches)) if own else stated
