"""Equations of Modelica as the statements that `equations(self)` yields (Modelica 3.6, chapter 8)."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, TypeGuard, cast

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.language.declarations import Discrete
from gantrytau.language.events import Happening, WhenChain, reinit, terminate
from gantrytau.language.functions import if_else, logic_and, logic_not
from gantrytau.language.statements import connect, require
from gantrytau.language.symbols import of_parameters
from gantrytau.modelica import tree
from gantrytau.modelica.conditions import (
    BEFORE,
    Items,
    is_call,
    own_turn,
)
from gantrytau.modelica.elaboration import values
from gantrytau.modelica.elaboration.interpreter import Interpreter, first_result
from gantrytau.modelica.elaboration.kinds import check_type, fits, type_of
from gantrytau.modelica.elaboration.scopes import TextError
from gantrytau.modelica.elaboration.whens import chosen_actions, follows, when_chains
from gantrytau.modelica.overdetermined.spanning import asking, is_operator, way
from gantrytau.modelica.references import Members, nodes_of


class AbsentComponent(Exception):
    """A component whose condition does not hold stands in an expression."""


def stated(items: Items, reader: Interpreter) -> Iterator[Any]:
    """The statements of a section of equations, one after another; TextError with the line of what is wrong."""
    for item in items:
        try:
            yield from _stated_one(item, reader)
        except TextError:
            raise
        except ModelError as error:
            reader.scope.refuse(item.at, str(error))


def _stated_one(item: tree.EquationOrStatement, reader: Interpreter) -> Iterator[Any]:
    if remembers(item, reader.members) or _is_discrete(item, reader):
        yield from _following(item, reader)
    elif isinstance(item, tree.SimpleEquation):
        _check_types(item, reader)
        reader = replace(reader, settled=True) if _asks_before(item) else reader
        for left, right in sides(item, reader):
            yield left == right
    elif isinstance(item, tree.ConnectEquation):
        yield from _connections(item, reader)
    elif isinstance(item, tree.ForLoop):
        for inner in reader.looped(item.iterators):
            yield from stated(item.items, inner)
    elif isinstance(item, tree.Branching) and item.word == "when":
        yield from when_chains(item, reader, _actions)
    elif isinstance(item, tree.Branching):
        yield from _branches(item, reader)
    elif isinstance(item, tree.ProcedureCall):
        yield from _call(item, reader)
    else:
        raise ModelError("found a statement among equations, expected an equation")


def _check_types(item: tree.SimpleEquation, reader: Interpreter, assigned: bool = False) -> None:
    """TextError for sides of types that do not go together; assigned: whether the left one takes the other's value."""
    if isinstance(item.left, tree.OutputList):
        return
    left = type_of(item.left, reader)
    plain = isinstance(item.left, tree.ComponentReference) and not isinstance(
        item.right, tree.ComponentReference
    )
    if assigned or plain or not fits(type_of(item.right, reader), left):
        check_type(left, item.right, reader, f"the right side of an equation of {left}", item.right.at)


def _following(item: tree.SimpleEquation, reader: Interpreter) -> Iterator[WhenChain]:
    """What makes a Boolean or Integer follow an expression that asks for values before."""
    left = cast(tree.ComponentReference, item.left)
    taken, turn = reader.members.structure.values_of(left), reader.members.turn(own_turn(left.parts[0][0]))
    now = sides(item, replace(reader, settled=True))
    waits = not remembers(item, reader.members)  # else a pulse of one round would have passed
    for (variable, right), (_, settled) in zip(sides(item, reader), now, strict=True):
        if taken is None:
            chain = follows(settled, variable, turn, right)
            yield WhenChain(tuple(replace(one, waits=waits) for one in chain.branches))
            continue
        if reader.members.structure.type_of(left) == "Boolean":
            test = values.condition(right)
            tests = [logic_not(test), test]
        else:
            tests = [logic_and(right > k - 0.5, right < k + 0.5) for k in taken]
        acts = zip(taken, tests, strict=True)
        yield WhenChain(tuple(Happening(t, (variable == k,), initially=True, waits=waits) for k, t in acts))


def remembers(item: tree.EquationOrStatement, members: Members) -> TypeGuard[tree.SimpleEquation]:
    """Whether it is an equation of a Boolean or Integer outside of `when` that compares values beside instants."""
    if not _asks_before(item) or not isinstance(item.left, tree.ComponentReference):
        return False
    calls = [one for one in nodes_of(item.right) if isinstance(one, tree.Call) and one.arguments]
    asked = [one.arguments[0] for one in calls if one.function.parts[0][0] == "pre"]
    inside = {id(one) for one in asked}
    others = [one for one in nodes_of(item.right) if id(one) not in inside and one in asked]
    return members.structure.type_of(item.left) in ("Boolean", "Integer") and bool(
        others or item.left in asked
    )


def _asks_before(item: tree.EquationOrStatement) -> TypeGuard[tree.SimpleEquation]:
    names = (call.function.parts[0][0] for call in nodes_of(item) if isinstance(call, tree.Call))
    return isinstance(item, tree.SimpleEquation) and any(name in BEFORE for name in names)


def _is_discrete(item: Any, reader: Interpreter) -> TypeGuard[tree.SimpleEquation]:
    """Whether it is an equation of what is held between instants, as a Boolean whose `pre` is asked for."""
    left = item.left if isinstance(item, tree.SimpleEquation) else None
    members = type(cast(Any, reader.members).instance).members()
    return isinstance(left, tree.ComponentReference) and isinstance(members.get(left.parts[0][0]), Discrete)


def sides(item: tree.SimpleEquation, reader: Interpreter) -> Iterator[tuple[Any, Any]]:
    """The two sides of an equation as the language compares them; several for records and lists of outputs."""
    right = reader.results(item.right)
    if isinstance(item.left, tree.OutputList):
        if not isinstance(right, tuple):
            raise ModelError(
                "found one value beside a list of outputs, expected a function of several results"
            )
        if len(item.left.items) > len(right):
            raise ModelError(f"found {len(item.left.items)} outputs, expected at most {len(right)}")
        both = [(reader.value(a), b) for a, b in zip(item.left.items, right, strict=False) if a is not None]
    else:
        both = [(reader.value(item.left), first_result(right))]
    for a, b in both:
        yield from pairs(a, b)


def pairs(a: Any, b: Any) -> Iterator[tuple[Any, Any]]:
    """Two values that are equal, as expressions of the language."""
    if values.all_sizes(a) != values.all_sizes(b):
        raise ModelError(
            f"found sizes {values.size_words(a)} and {values.size_words(b)} beside '=', expected one size"
        )
    if isinstance(a, np.ndarray) and not (values.is_plain(a) and values.is_plain(b)):
        for one, other in zip(a.flat, b.flat, strict=True):
            yield from pairs(one, other)
        return
    both: list[Any] = [a, b]
    names, others = ([*one.names()] if hasattr(one, "member") else None for one in both)
    if (names is None) != (others is None) or not {*(names or ())} <= {*(others or ())}:
        kinds = " and ".join(f"a record of {', '.join(x)}" if x else "no record" for x in (names, others))
        raise ModelError(f"found {kinds} beside '=', expected two of one type")
    if names is not None:
        for name in names:
            yield from pairs(*(one.member(name) for one in both))
        return
    if isinstance(a, np.ndarray) and not a.size:
        return
    left, right = values.to_casadi(a), values.to_casadi(b)
    if not isinstance(left, ca.SX) and not isinstance(right, ca.SX):
        if not np.allclose(np.array(left, float), np.array(right, float), rtol=0, atol=0):
            raise ModelError(f"found {left} = {right}, which never holds, expected an equation of a variable")
        return
    left, right = ca.SX(left), ca.SX(right)
    if any(one.numel() > 1 and len(set(map(hash, one.elements()))) == 1 for one in (left, right)):
        yield from zip(
            left.elements(), right.elements(), strict=True
        )  # not taken for a scalar beside a vector
    else:
        yield left, right


def _connections(item: tree.ConnectEquation, reader: Interpreter) -> Iterator[Any]:
    try:
        a, b = reader.value(item.a), reader.value(item.b)
    except AbsentComponent:
        return
    kinds = [type_of(one, reader) for one in (item.a, item.b)]
    if kinds[0] != kinds[1]:
        words = " and ".join(kind or "members" for kind in kinds)
        raise ModelError(f"found connectors of {words}, expected connectors of one type")
    for one, other in _ends(a, b):
        yield connect(one, other)


def _ends(a: Any, b: Any) -> Iterator[tuple[Any, Any]]:
    if values.all_sizes(a) != values.all_sizes(b):
        words = " and ".join(map(values.size_words, (a, b)))
        raise ModelError(f"found connectors of the sizes {words}, expected one size")
    if 0 in values.all_sizes(a):
        return
    if isinstance(a, np.ndarray) and not values.is_plain(a):
        for one, other in zip(a.flat, b.flat, strict=True):
            yield from _ends(one, other)
        return
    found = [getattr(x, "instance", None) if hasattr(x, "member") else values.to_casadi(x) for x in (a, b)]
    if any(x is None or isinstance(x, (bool, int, float, str)) for x in found):
        raise ModelError("found what is no connector in connect(), expected two connectors")
    yield found[0], found[1]


def _branches(item: tree.Branching, reader: Interpreter) -> Iterator[Any]:
    """An `if` among equations: what is known chooses, else the sides are chosen at all times."""
    if (waiting := asking([test for test, _ in item.branches], [item], reader, stated)) is not None:
        yield waiting
        return
    tests, last = reader.open_branches(item.branches, item.otherwise or ())
    if not tests:
        yield from stated(last, reader)
        return
    yield from _guarded_asserts(tests, last, reader)
    found = _differences(last, reader)
    for test, items in reversed(tests):
        above = _differences(items, reader)
        if len(above) != len(found):
            raise ModelError(
                f"found {len(above)} and {len(found)} equations in the branches of an 'if' whose condition varies, "
                "expected as many in each"
            )
        found = [if_else(values.condition(test), a, b) for a, b in zip(above, found, strict=True)]
    for one in found:
        yield one == 0


def _guarded_asserts(tests: Sequence[tuple[Any, Items]], last: Items, reader: Interpreter) -> Iterator[Any]:
    """The assertions of branches, each where its condition holds and none before it."""
    before: Any = False
    for test, items in (*tests, (True, last)):
        here = values.binary("and", values.unary("not", before), values.condition(test))
        for item in filter(_is_assert, items):
            yield from _call(cast(tree.ProcedureCall, item), reader, here)
        before = values.binary("or", before, values.condition(test))


def _is_assert(item: tree.EquationOrStatement) -> bool:
    return isinstance(item, tree.ProcedureCall) and is_call(item.call, "assert")


def _differences(items: Items, reader: Interpreter) -> list[ca.SX]:
    """The scalar equations of a branch as differences of their sides."""
    found: list[ca.SX] = []
    for one in stated([item for item in items if not _is_assert(item)], reader):
        if not isinstance(one, ca.SX):
            raise ModelError(
                "found connect, when or assert under a condition that varies, expected equations"
            )
        found += [e.dep(0) - e.dep(1) for e in one.elements()]
    return found


def _call(item: tree.ProcedureCall, reader: Interpreter, where: Any = True) -> Iterator[Any]:
    """The assertion of a call. where: a condition; outside of it nothing is asserted."""
    name = item.call.function.parts[-1][0]
    if is_operator(item.call):
        yield way(item.call, reader)
        return
    if name != "assert":
        raise ModelError(f"found {name}() among equations, expected it in 'when', or an equation")
    arguments = dict(zip(("condition", "message", "level"), item.call.arguments, strict=False)) | dict(
        item.call.named
    )
    if not _is_error(item.call, reader):
        return
    holds, words = reader.value(arguments["condition"]), reader.value(arguments["message"])
    if where is not True:
        holds = values.binary("or", values.unary("not", where), values.condition(holds))
    if isinstance(holds, ca.SX):
        words = words or "an assertion does not hold"
        if where is True and of_parameters(holds):
            yield require(holds, words)
        else:
            yield WhenChain((Happening(logic_not(values.condition(holds)), (), words, True, words),))
    elif not holds:
        raise ModelError(f"found an assertion that does not hold: {words}")


def _is_error(call: tree.Call, reader: Interpreter) -> bool:
    """Whether an `assert` is no warning."""
    level = dict(call.named).get("level") or next(iter(call.arguments[2:]), None)
    return level is None or reader.value(level) == 2


def _actions(items: Items, reader: Interpreter, inside: bool = False) -> Iterator[Any]:
    """The actions of statements in a `when`; inside: under a further condition."""
    for item in items:
        call = item.call if isinstance(item, tree.ProcedureCall) else None
        if isinstance(item, tree.SimpleEquation):
            _check_types(item, reader, assigned=True)
            for left, right in sides(item, reader):
                yield left == right
        elif isinstance(item, tree.ForLoop):
            for inner in reader.looped(item.iterators):
                yield from _actions(item.items, inner, inside)
        elif isinstance(item, tree.Branching) and item.word == "if":
            yield from _chosen(item, reader)
        elif call is not None:
            yield action_of(call, reader, inside)
        else:
            reader.scope.refuse(item.at, "found another statement in 'when', expected an equation or a call")


def action_of(call: tree.Call, reader: Interpreter, inside: bool = False) -> Any:
    """What `reinit`, `terminate` or `assert` does in a `when`; inside: under a further condition."""
    if is_call(call, "reinit"):
        variable, value = (reader.value(one) for one in call.arguments)
        return reinit(values.to_casadi(variable), values.to_casadi(value))
    if is_call(call, "terminate") and not inside:
        return terminate(reader.value(call.arguments[0]))
    if is_call(call, "assert"):
        holds = reader.value(call.arguments[0]) if _is_error(call, reader) else True
        fails = if_else(values.condition(holds), 0, 1) if isinstance(holds, ca.SX) else int(not holds)
    elif not is_call(call, "terminate"):
        reader.scope.refuse(call.at, "found another call in 'when', expected reinit, terminate or assert")
    else:
        fails = 1
    return reader.members.next_sample(call) == fails


def _chosen(item: tree.Branching, reader: Interpreter) -> Iterator[Any]:
    """An `if` in a `when`."""
    tests, last = reader.open_branches(item.branches, item.otherwise or ())
    found: Iterable[Any] = _actions(last, reader, bool(tests))
    for test, items in reversed(tests):
        found = chosen_actions(values.condition(test), _actions(items, reader, True), found)
    yield from found
