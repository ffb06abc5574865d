"""Conditions of `when` as they stand in a text, and what is asked for before an instant."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeGuard

from gantrytau.modelica import tree
from gantrytau.modelica.references import dotted, inner_items, nodes_of, references, whole_name

BEFORE = frozenset({"pre", "edge", "change"})
Items = Sequence[tree.EquationOrStatement]
SAMPLE = "next_sample"  # begins the name of what holds the next instant of a `sample`
AT_START = "initial"  # a keyword, which no component has as its name
BEHIND = "before_"  # and a variable: its value before an instant
TURN = "turn_"  # and a variable: the parity of its changes


def is_call(e: object, name: str) -> TypeGuard[tree.Call]:
    """Whether an expression calls a function of that name."""
    return isinstance(e, tree.Call) and e.function.parts[0][0] == name


def instants(test: tree.Expression) -> tuple[tree.Expression, ...]:
    """The conditions of a `when` one by one; of `sample(...) and rest` and `edge(...) and rest` the call alone."""
    conditions = test.items if isinstance(test, tree.ArrayConstructor) else (test,)
    return tuple(instant_and_rest(one)[0] for one in conditions)


def instant_and_rest(test: tree.Expression) -> tuple[tree.Expression, tree.Expression | None]:
    """A condition in two parts: `sample(...)` or `edge(...)`, and the rest, joined by `and`; else the whole and None."""
    if isinstance(test, tree.Binary) and test.operator == "and":
        for one, other in ((test.left, test.right), (test.right, test.left)):
            if is_call(one, "sample") or is_call(one, "edge"):
                return one, other
    return test, None


def guarded_samples(whens: Iterable[tree.Branching]) -> Iterator[tree.Call]:
    """The calls of `sample` beside another condition, by `and`, in a `when` with `elsewhen`."""
    for item in whens:
        pairs = [instant_and_rest(test) for test, _ in item.branches] if len(item.branches) > 1 else []
        for instant, rest in pairs:
            if rest is not None and isinstance(instant, tree.Call) and is_call(instant, "sample"):
                yield instant


def sample_calls(test: tree.Expression) -> Iterator[tree.Call]:
    """The calls of `sample` in a condition of `when`."""
    left = [test]
    for one in left:
        if isinstance(one, tree.Call) and is_call(one, "sample") and len(one.arguments) == 2:
            yield one
        elif isinstance(one, tree.ArrayConstructor):
            left += one.items
        elif isinstance(one, tree.Binary):
            left += [one.left, one.right]


def calls_before(e: Any) -> Iterator[tree.Call]:
    """Calls of `pre`, `edge` and `change` of variables, whole or with subscripts at the end."""
    for one in nodes_of(e):
        if (
            isinstance(one, tree.Call)
            and one.function.parts[0][0] in BEFORE
            and one.arguments
            and whole_name(one.arguments[0])
        ):
            yield one


def targets(items: Items) -> Iterator[str]:
    """Names of the variables that statements, or the equations in a `when`, set."""
    for item in items:
        yield from targets(inner_items(item))
        left = item.left if isinstance(item, tree.SimpleEquation) else None
        several = left.items if isinstance(left, tree.OutputList) else (left,)
        for each in item.targets if isinstance(item, tree.Assignment) else several:
            if isinstance(each, tree.ComponentReference):
                yield each.parts[0][0]


def joined_whens(items: Items) -> list[tree.EquationOrStatement]:
    """Statements in which neighbouring `when` that set the same variables are one chain, the later one first.

    What the former one sets alone, or does beside, stays a `when` before the chain.
    """
    found: list[Any] = []
    for item in items:
        both = [one for one in (*found[-1:], item) if isinstance(one, tree.Branching) and one.word == "when"]
        if len(both) == 2 and (parts := _parted(*both)) is not None:
            alone, common = parts
            found[-1:] = [replace(both[0], branches=alone)] if any(inner for _, inner in alone) else []
            item = replace(both[1], branches=(*both[1].branches, *common))
        found.append(item)
    return found


def _parted(first: tree.Branching, last: tree.Branching) -> tuple[Any, Any] | None:
    """The branches of a `when` in an algorithm in two parts: its own variables, and those of the next `when`, too.

    None where there is nothing to join, or the two depend on each other.
    """
    own, others = (set(targets([one])) for one in (first, last))
    shared = own & others
    sure = [set(targets([i for i in items if isinstance(i, tree.Assignment)])) for _, items in last.branches]
    each = [(one, set(targets([one]))) for _, items in first.branches for one in items]
    mixed = any(names & shared and not names <= shared for _, names in each)
    tests = [test for one in (first, last) for test, _ in one.branches]
    if not shared or mixed or not all(shared <= names for names in sure):
        return None
    alone = any(not names & shared for _, names in each)
    sampled = any(call for test, _ in first.branches for call in sample_calls(test))
    read = [
        one.value for one in nodes_of([last, first] if alone else last) if isinstance(one, tree.Assignment)
    ]
    if (alone and sampled) or _read_now([tests, read]) & own:
        return None
    return tuple(
        tuple(
            (test, tuple(i for i in items if bool({*targets([i])} & shared) is common))
            for test, items in first.branches
        )
        for common in (False, True)
    )  # type: ignore[return-value]


def _read_now(e: Any) -> set[str]:
    """Names of the variables of which an expression has another value than that before an instant."""
    calls = [one for one in nodes_of(e) if isinstance(one, tree.Call) and is_call(one, "pre")]
    before = {id(one) for call in calls for one in references(call.arguments)}
    return {one.parts[0][0] for one in references(e) if id(one) not in before}


def whens_in(structure: Any) -> Iterator[tree.Branching]:
    """All `when` among the equations of a class."""
    left = [item for section in structure.scope.sections for item in section.items]
    for item in left:
        if isinstance(item, tree.Branching) and item.word == "when":
            yield item
        else:
            left += inner_items(item)


def checks_in(items: Items, inside: bool = False) -> Iterator[tree.Call]:
    """Calls of `assert`, and of `terminate` under a further condition, in a `when`."""
    for item in items:
        yield from checks_in(inner_items(item), inside or isinstance(item, tree.Branching))
        if isinstance(item, tree.ProcedureCall) and (
            is_call(item.call, "assert") or (inside and is_call(item.call, "terminate"))
        ):
            yield item.call


def changed_in(test: tree.Expression, items: Items) -> Iterator[str]:
    """Names of variables whose changes are a condition, by `edge` or `change`, or as b beside pre(b)."""
    own = set(targets(items))
    calls = [one for one in calls_before(test) if whole_name(one.arguments[0]) not in own]
    inside = {id(one.arguments[0]) for one in calls}
    bare = [one for one in references(test) if id(one) not in inside]
    yield from (
        whole_name(one.arguments[0]) for one in calls if not is_call(one, "pre") or one.arguments[0] in bare
    )


def first_valued(item: tree.EquationOrStatement) -> str:
    """The name in an initial equation `pre(name) = value` or `name = value`; "" for another one."""
    left: Any = item.left if isinstance(item, tree.SimpleEquation) else None
    if isinstance(left, tree.Call) and is_call(left, "pre"):
        (left,) = left.arguments
    return left.parts[0][0] if isinstance(left, tree.ComponentReference) and len(left.parts) == 1 else ""


def gives_value_before(item: tree.EquationOrStatement) -> bool:
    """Whether it is an initial equation of `pre(x)`."""
    return (
        isinstance(item, tree.SimpleEquation)
        and isinstance(item.left, tree.Call)
        and is_call(item.left, "pre")
    )


def outer_name(name: str) -> str:
    """The name for the outer side of a component that is `inner` and `outer` at once."""
    return f"outer {name}"


def followed_name(kind: str, name: str) -> str:
    """The name of a Discrete that follows a variable."""
    return kind + name.replace(".", "_")


def own_turn(name: str) -> str:
    """The name for the parity of a Discrete that follows the expression of its equation."""
    return f"{name}.own"


def sample_name(call: tree.Expression) -> str:
    """The name of the Discrete of a call: the next instant of `sample`, whether it is the start, whether the run ends."""
    assert isinstance(call, tree.Call)
    kind = SAMPLE if call.function.parts[0][0] == "sample" else "ends"
    return f"{kind}_{call.at}" if call.arguments else AT_START


def chain_of(name: str, sections: Sequence[Any]) -> list[str]:
    """A name and its equals, by equations `a = b`, up to the first `b = pre(c)`; without such an end the name alone."""
    equal: dict[str, tuple[str, bool]] = {}
    for item in (item for section in sections if section.kind == "equation" for item in section.items):
        if isinstance(item, tree.SimpleEquation) and dotted(item.left):
            right: Any = item.right
            before = is_call(right, "pre")
            if other := dotted(right.arguments[0] if before else right):
                equal[dotted(item.left)] = other, before
    found, before = [name], False
    while found[-1] in equal and not before:
        other, before = equal[found[-1]]
        if other in found:
            return [name]
        found.append(other)
    return found if before else [name]


def bound_pulses(declared: Mapping[str, Any]) -> Iterator[tree.EquationOrStatement]:
    """What the components of a class that are declared as `b = sample(...)` amount to; declared: by name."""
    for name, one in declared.items():
        said = one.declaration.modification
        if said is not None and said.value is not None and is_call(said.value, "sample"):
            left = tree.ComponentReference(said.at, ((name, ()),))
            yield from with_pulses([tree.SimpleEquation(said.at, None, None, "=", left, said.value)])


def read_section(section: tree.ClassSection) -> tuple[str, tuple[tree.EquationOrStatement, ...]]:
    """The kind and statements of a section; an algorithm whose assignments ask for their own values before is equations."""
    items = tuple(with_pulses(one for one in section.items if not isinstance(one, tree.Element)))
    each = [_assigned(one) for one in items] if section.kind == "algorithm" else []
    names = [name for name, _ in each]
    asked = {
        whole_name(one.arguments[0])
        for one in calls_before([value for _, value in each])
        if is_call(one, "pre")
    }
    alone = "" not in names and len(set(names)) == len(names) and asked & {*names}
    if not alone or any(_read_now(value) & {*names[k:]} for k, (_, value) in enumerate(each)):
        return section.kind, items
    left = [tree.ComponentReference(one.at, ((name, ()),)) for one, name in zip(items, names, strict=True)]
    return "equation", tuple(
        tree.SimpleEquation(one.at, None, None, "=", name, value)
        for one, name, (_, value) in zip(items, left, each, strict=True)
    )


def _assigned(item: tree.EquationOrStatement) -> tuple[str, Any]:
    """The name and the value of the one variable that an assignment, or each branch of an `if`, sets; "" for all else."""
    if isinstance(item, tree.Assignment) and len(item.targets) == 1 and item.targets[0] is not None:
        (name, subscripts), *rest = item.targets[0].parts
        return ("", None) if subscripts or rest else (name, item.value)
    if isinstance(item, tree.Branching) and item.word == "if" and item.otherwise:
        branches = [*(items for _, items in item.branches), item.otherwise]
        each: list[tuple[str, Any]] = [
            _assigned(items[0]) if len(items) == 1 else ("", None) for items in branches
        ]
        if len({name for name, _ in each}) == 1:
            *found, last = (value for _, value in each)
            tests = (test for test, _ in item.branches)
            return each[0][0], tree.Conditional(item.at, tuple(zip(tests, found, strict=True)), last)
    return "", None


def with_pulses(items: Iterable[tree.EquationOrStatement]) -> Iterator[tree.EquationOrStatement]:
    """Equations with each `b = sample(...)` replaced by a `when`, which sets b at the instant and resets it there."""
    for item in items:
        if not isinstance(item, tree.SimpleEquation) or not is_call(item.right, "sample"):
            yield item
            continue
        at, name = item.at, item.left
        on, off = (
            tree.SimpleEquation(at, None, None, "=", name, tree.BooleanLiteral(at, true))
            for true in (True, False)
        )
        yield tree.Branching(at, None, None, "when", ((item.right, (on,)), (name, (off,))), None)
