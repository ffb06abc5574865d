"""One more modification of a model, deep inside if need be, without losing others.

A modification of a component keeps what was modified or redeclared there before: setting `carts[0].law.f_c`
leaves the friction law of that cart, and its other parameters, as the model or its prototype chose them.
"""

import copy
import re
from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.language.declarations import Array, Bounds, Parameter, Quantity, Start
from gantrytau.language.model import Declared, Outer, check_member, merge

Step = str | int | tuple[int, ...]
Part = TypeVar("Part", bound=Declared)

ATTRIBUTES = ("start", "fixed", "min", "max", "nominal")
_STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[(\d+(?:,\d+)*)\]")


def with_setting(model: Part, name: str, value: Any) -> Part:
    """A copy of `model` in which the parameter or attribute `name` has a value.

    name: `m`, `carts[0].m`, `carts.m` (of all carts), `x.start`. ModelError for what cannot be set.
    """
    try:
        steps = _steps(name)
        changed = _modified(type(model), model.modifications, {}, steps, value, type(model).__name__)
        return model.modified(changed, [name.removesuffix(".start")] if steps[-1] == "start" else ())
    except ModelError as error:
        raise ModelError(f"{name}: {error}") from error


def _steps(name: str) -> list[Step]:
    """The parts of a dotted name with indices: `carts[0].m` -> carts, 0, m."""
    found: list[Step] = []
    place = 0
    while place < len(name):
        match = _STEP.match(name, place)
        if match is None:
            raise ModelError("expected a name as the model prints it, such as carts[0].m or x.start")
        found.append(match[1] or _index(match[2]))
        place = match.end()
    return found


def _index(numbers: str) -> int | tuple[int, ...]:
    first, *rest = map(int, numbers.split(","))
    return (first, *rest) if rest else first


def _changed(part: Part, steps: Sequence[Step], value: Any, path: str) -> Part:
    """A copy of a component with one more modification."""
    return part.modified(_modified(type(part), part.modifications, {}, steps, value, path))


def _modified(
    component: type[Declared],
    above: Mapping[str, Any],
    below: Mapping[str, Any],
    steps: Sequence[Step],
    value: Any,
    path: str,
) -> dict[str, Any]:
    """The modifications `above` of a component with one more; `below` are those it carries by itself.

    What lies below stays there, because its formulas speak of the model that holds the component; only a
    redeclared component is taken up, or the new modification would undo its redeclaration.
    """
    head, *rest = steps
    head = str(head)
    check_member(component, head, path)
    member, old, under, path = (
        component.members().get(head),
        above.get(head),
        below.get(head),
        f"{path}.{head}",
    )
    if isinstance(member, Quantity):
        new = _quantity(member, under if old is None else old, rest, value, path)
    elif isinstance(member, Outer):
        raise ModelError(f"{path} refers to a component further out; set it there")
    elif isinstance(member, Array):
        if rest and not isinstance(rest[0], str):
            rest[0] = _place(rest[0], member.shape, component.first_index)
        new = _array(member, old, under, rest, value, path)
    elif isinstance(member, Declared):
        new = _component(member, old, under, rest, value, path)
    else:
        new = value  # a plain constant that shapes the model
    return {**above, head: new}


def _place(index: int | tuple[int, ...], shape: tuple[int, ...], first: int) -> int:
    """The place of an element that stands row after row; minus 1 where there is none."""
    if isinstance(index, int) and len(shape) == 1:
        return index - first
    places = [one - first for one in (index if isinstance(index, tuple) else (index,))]
    inside = len(places) == len(shape) and all(0 <= k < n for k, n in zip(places, shape, strict=True))
    return int(np.ravel_multi_index(places, shape)) if inside else -1


def _component(
    member: Declared, old: Any, under: Any, steps: Sequence[Step], value: Any, path: str
) -> Declared | dict[str, Any]:
    """What to say about a component: modifications, or the component that replaces it, modified."""
    if not steps or isinstance(steps[0], int):
        found = f"found [{steps[0]}] behind it, " if steps else ""
        raise ModelError(f"{path} is a {type(member).__name__}; {found}expected one of its members")
    replaced = old or under
    if isinstance(replaced, Declared):
        return _changed(replaced, steps, value, path)
    below = merge(dict(member.modifications), under or {})
    return _modified(type(member), old or {}, below, steps, value, path)


def _array(
    member: Array[Any], old: Any, under: Any, steps: Sequence[Step], value: Any, path: str
) -> Array[Any] | list[Any]:
    """What to say about the element of an array that `steps` names, or about each of them."""
    replaced = old or under
    array = replaced if isinstance(replaced, Array) else member
    chosen: Sequence[int] = range(len(array))
    if steps and isinstance(steps[0], int):
        if steps[0] not in chosen:
            raise ModelError(f"{path} has [0] to [{len(array) - 1}], found [{steps[0]}]")
        chosen, steps = [steps[0]], steps[1:]
    if array is replaced:
        new = copy.copy(array)
        new.elements = list(array.elements)
        for k in chosen:
            new.elements[k] = _component(array[k], array[k], None, steps, value, f"{path}[{k}]")
        return new
    carried = _each(under, len(array))
    kept = [part if isinstance(part, Declared) else {} for part in carried]  # a list speaks of every element
    said = [new or part for new, part in zip(_each(old, len(array)), kept, strict=True)]
    for k in chosen:
        said[k] = _component(array[k], said[k], carried[k], steps, value, f"{path}[{k}]")
    return said


def _each(modification: Any, count: int) -> list[Any]:
    """The modification of each element of an array."""
    return list(modification) if isinstance(modification, list) else [modification or {}] * count


def _quantity(member: Quantity, old: Any, steps: Sequence[Step], value: Any, path: str) -> Any:
    """The modification of a parameter or variable."""
    if steps and isinstance(steps[0], int):
        raise ModelError(f"{path} is set as a whole: give the vector or matrix, '[1, 2, 3]'")
    before = _attributes(old)
    if not steps:
        if not isinstance(member, Parameter):
            raise ModelError(
                f"{path} is a variable ({member.words()}), expected a parameter; its start value is "
                f"{path.partition('.')[2]}.start, and inputs are given a value"
            )
        return {**before, "value": value}
    attribute = steps[0]
    if len(steps) > 1 or attribute not in ATTRIBUTES:
        raise ModelError(
            f"{path} has no '{'.'.join(map(str, steps))}'; what can be set is {', '.join(ATTRIBUTES)}"
        )
    return {**before, attribute: value}


def _attributes(old: Any) -> dict[str, Any]:
    """What an earlier modification of a quantity said, by attribute."""
    if old is None:
        return {}
    if isinstance(old, Mapping):
        return dict(old)
    if isinstance(old, (Start, Bounds)):
        return old.attributes()
    return {"value": old}
