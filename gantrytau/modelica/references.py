"""References in expressions, and what they may mean."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.modelica import tree


def nodes_of(expression: Any) -> Iterator[tree.TreeNode]:
    """An expression and all that is in it; not the names of functions."""
    left = [expression]
    while left:
        one = left.pop()
        if isinstance(one, tree.TreeNode):
            yield one
        if isinstance(one, tree.Call):
            left += [one.named, one.arguments]
        elif isinstance(one, (tuple, list)):
            left += reversed(one)
        elif isinstance(one, tree.TreeNode):
            left += [getattr(one, name) for name in one.own[::-1]]


def inner_items(item: tree.EquationOrStatement) -> list[tree.EquationOrStatement]:
    """The equations or statements in a loop, an `if` or a `when`; none in another one."""
    if isinstance(item, tree.Branching):
        return [one for _, items in item.branches for one in items] + [*(item.otherwise or ())]
    return [*item.items] if isinstance(item, (tree.ForLoop, tree.WhileLoop)) else []


def from_left(e: tree.Binary) -> list[tree.Binary]:
    """The operators of a sum, product or the like in the order of their values, those on the left side of another first.

    Without recursion: sums of machines have thousands of terms.
    """
    found = [e]
    while isinstance(left := found[-1].left, tree.Binary):
        found.append(left)
    return found[::-1]


def dotted(e: Any) -> str:
    """The name of a reference without subscripts, with dots; "" for another expression."""
    named = isinstance(e, tree.ComponentReference) and not any(subscripts for _, subscripts in e.parts)
    return ".".join(name for name, _ in e.parts) if named else ""


def whole_name(e: Any) -> str:
    """The name of a reference without the subscripts at its end, with dots; "" for another expression."""
    if not isinstance(e, tree.ComponentReference):
        return ""
    return dotted(replace(e, parts=(*e.parts[:-1], (e.parts[-1][0], ()))))


def references(expression: Any) -> list[tree.ComponentReference]:
    """The references in an expression, but for names of functions."""
    return [one for one in nodes_of(expression) if isinstance(one, tree.ComponentReference)]


def function_name(call: tree.Call) -> str:
    """The name of the function of a call, with dots."""
    return ".".join(part for part, _ in call.function.parts)


def called_function(call: tree.Call, reader: Any) -> tuple[str, Any]:
    """The name of the function that is called, and its class; None for one of the language."""
    name = function_name(call)
    if name.startswith("Connections."):
        return name, None
    if (component := component_of(call, reader)) is not None:
        owner, last = component.structure.scope, name.rpartition(".")[2]
        if (found := owner.inherited_class(last)) is None:
            raise ModelError(
                f"found '{name}', expected a function of {owner.name}{did_you_mean(last, owner.names())}"
            )
        return name, found
    start, first = (reader.scope.root, name[1:]) if name.startswith(".") else (reader.scope, name)
    found = None if name in ("der", "pure", "initial") else start.first(first.split(".")[0])
    if "." not in first and (found is None or found.predefined):
        return first, None
    return name, reader.scope.find_class(name, call.at)


def component_of(call: tree.Call, reader: Any) -> Any:
    """The component whose class has the function that is called, as `world` of `world.gravity(r)`; None without one."""
    *path, _ = call.function.parts
    if not path or path[0][0] in reader.local or not reader.members.has(path[0][0]):
        return None
    return reader.value(replace(call.function, parts=tuple(path)))


def subscripts_at_end(e: tree.Expression) -> tuple[tree.Expression, tuple[tree.Expression, ...]] | None:
    """An array and the subscripts at its end; None for all else."""
    if not isinstance(e, tree.ComponentReference) or not e.parts[-1][1]:
        return None
    return replace(e, parts=(*e.parts[:-1], (e.parts[-1][0], ()))), e.parts[-1][1]


def declared_shape(e: tree.Expression, reader: Any) -> tuple[int, ...] | None:
    """The sizes of a component by its plain name, which say nothing of its value; None for all else."""
    name = dotted(e)
    known = name and "." not in name and name not in reader.local and reader.members.has(name)
    return reader.members.structure.shape(name) if known else None


def connects_in(items: Iterable[Any]) -> tuple[Any, ...]:
    """The connections among equations, with the loops and conditions around them."""
    found = []
    for one in items:
        if isinstance(one, tree.ForLoop):
            found.append(replace(one, items=connects_in(one.items)))
        elif isinstance(one, tree.Branching) and one.word == "if":
            branches = tuple((test, connects_in(inner)) for test, inner in one.branches)
            kept = replace(one, branches=branches, otherwise=connects_in(one.otherwise or ()))
            found += [kept] if any(isinstance(n, tree.ConnectEquation) for n in nodes_of(kept)) else []
        elif isinstance(one, tree.ConnectEquation):
            found.append(one)
    return tuple(found)


def holding(members: Any, found: Iterable[tree.ComponentReference]) -> Any:
    """The instance, or the next around it, that has a component for one of the references; None without one."""
    names = [one.parts[0][0] for one in found]
    while members is not None and not any(map(members.has, names)):
        members = members.around
    return members


class Members:
    """An instance of a class, a package with its constants, or the members of a function; structure: what it consists of.

    What has no symbols, as a package, has no values before an instant.
    """

    structure: Any

    def has(self, name: str) -> bool:
        """Whether its class has a component of that name."""
        return name in self.structure.scope.elements

    def names(self) -> Sequence[str]:
        """Names of its components."""
        return [*self.structure.scope.elements]

    def member(self, name: str) -> Any:
        """The value of a component."""
        raise NotImplementedError

    def next_sample(self, call: tree.Call) -> Any:
        """The next instant of a `sample`; of `initial()` whether it is the start, 1 or 0."""
        raise ModelError(f"found {call.function.parts[0][0]}() in a value, expected it among equations")

    def before(self, name: str, asked: str) -> Any:
        """The Discrete that follows a variable of that dotted name, as `pre`, `edge` or `change` asks; None without one."""

    def turn(self, name: str) -> Any:
        """The parity of the changes of a variable that a Discrete follows; None for another one."""
