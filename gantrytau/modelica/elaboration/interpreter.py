"""Expressions of Modelica as values: numbers where all is known, else expressions of the symbols of an instance."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self, cast

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean, in_words
from gantrytau.language.functions import logic_or
from gantrytau.language.symbols import time
from gantrytau.modelica import tree
from gantrytau.modelica.elaboration import values
from gantrytau.modelica.elaboration.modifiers import Element
from gantrytau.modelica.elaboration.scopes import ClassScope, TextError
from gantrytau.modelica.elaboration.values import EnumerationValue
from gantrytau.modelica.overdetermined.spanning import answered, is_operator
from gantrytau.modelica.records.operators import called, operated
from gantrytau.modelica.references import (
    Members,
    called_function,
    component_of,
    declared_shape,
    from_left,
    function_name,
    subscripts_at_end,
    whole_name,
)

FAULTS = (RuntimeError, TypeError, NotImplementedError, ValueError, IndexError, KeyError, ArithmeticError)


def changed(new: Any, old: Any) -> Any:
    """Whether a Boolean, Integer or number of an enumeration is another one."""
    return logic_or(new > old + 0.5, new < old - 0.5)


def first_result(value: Any) -> Any:
    """The first of several results of a function, which is its value in an expression."""
    return next(iter(value), None) if isinstance(value, tuple) else value


@dataclass(frozen=True, eq=False)
class Interpreter:
    """Evaluates expressions of a class in an instance.

    library: the ModelicaLibrary, which has the constants of packages and calls functions;
    local: values of iterators and of what a function computes; end: the size that `end` means; quiet: no events;
    settled: values before an instant are those behind it; following: inside of a `when`, the variables whose changes are its
    condition.
    """

    scope: ClassScope
    members: Members
    library: Any
    local: Mapping[str, Any] = field(default_factory=dict)
    end: int | None = None
    quiet: bool = False
    settled: bool = False
    following: frozenset[str] | None = None

    def with_local(self, **values: Any) -> Self:
        """The same with further iterators."""
        return replace(self, local={**self.local, **values})

    def value(self, expression: Any) -> Any:
        """The value of an expression; ModelError with its line for what has none. A plain value is itself."""
        return first_result(self.results(expression))

    def results(self, expression: Any) -> Any:
        """The same; the call of a function with several results has all of them, as a tuple."""
        if not isinstance(expression, tree.TreeNode):
            return expression
        try:
            return _EVALUATE[type(expression)](self, expression)
        except TextError:
            raise
        except ModelError as error:
            self.scope.refuse(expression.at, str(error))
        except FAULTS as error:
            self.scope.refuse(expression.at, f"found what has no value: {in_words(error)}")

    def _literal(self, e: tree.StringLiteral) -> str:
        plain = "\\" not in e.text
        return e.text if plain else e.text.encode("latin-1", "backslashreplace").decode("unicode_escape")

    def _mark(self, e: tree.Mark) -> Any:
        if e.word != "end" or self.end is None:
            raise ModelError(f"found '{e.word}', expected a value")
        return self.end

    def _binary(self, e: tree.Binary) -> Any:
        above = from_left(e)
        found = self.value(above[0].left)
        for one in above:
            if one.operator not in ("and", "or") or found is not (one.operator == "or"):
                found = operated(one.operator, [found, self.value(one.right)], self.library.call)
        return found  # beside `or` and `and` the other side may have no value

    def _range(self, e: tree.RangeExpression) -> Any:
        start, stop = self.value(e.start), self.value(e.stop)
        if isinstance(start, EnumerationValue) and whole_name(e.start).endswith(f".{start.literal}"):
            return self.value(tree.ComponentReference(e.at, cast(Any, e.start).parts[:-1]))[start - 1 : stop]
        step = 1 if e.step is None else self.value(e.step)
        if not all(map(values.is_number, (start, stop, step))):
            raise ModelError("found a range of variables, expected one that is known at translation")
        count = int(np.floor((stop - start) / step + 1e-9)) + 1
        return values.array([start + k * step for k in range(max(count, 0))])

    def open_branches(
        self, branches: Sequence[tuple[Any, Any]], last: Any
    ) -> tuple[list[tuple[Any, Any]], Any]:
        """Branches of an `if` whose conditions vary, with the conditions, and the branch that acts where none holds."""
        tests: list[tuple[Any, Any]] = []
        for test, then in branches:
            known = values.tested(self.value(test))
            if isinstance(known, ca.SX):
                tests.append((known, then))
            elif known:
                return tests, then
        return tests, last

    def _conditional(self, e: tree.Conditional) -> Any:
        tests, otherwise = self.open_branches(e.branches, e.otherwise)
        found = self.value(otherwise)
        for test, then in reversed(tests):
            found = values.chosen(test, self.value(then), found, self.quiet)
        return found

    def _array(self, e: tree.ArrayConstructor) -> Any:
        if e.iterators:
            return values.array(list(self._iterated(e.items[0], e.iterators)))
        return values.array([self.value(one) for one in e.items])

    def _iterated(self, item: tree.Expression, iterators: Sequence[tree.Iterator]) -> Iterator[Any]:
        *others, (name, over) = iterators
        for one in self.steps(over):
            inner = self.with_local(**{name: one})
            yield values.array(list(inner._iterated(item, others))) if others else inner.value(item)

    def looped(self, iterators: Sequence[tree.Iterator]) -> "list[Self]":
        """What reads the body of a loop, once for each value of its iterators."""
        found = [self]
        for name, over in iterators:
            found = [inner.with_local(**{name: one}) for inner in found for one in inner.steps(over)]
        return found

    def steps(self, over: tree.Expression | None) -> Sequence[Any]:
        """The values of an iterator."""
        if over is None:
            raise ModelError("found an iterator without a range, expected 'in' and a range, as for i in 1:n")
        found = self.value(over)
        if isinstance(found, type) and issubclass(found, EnumerationValue):
            raise ModelError("found an enumeration as a range, expected numbers")
        if not isinstance(found, np.ndarray) or found.ndim != 1:
            raise ModelError("found what is no vector as the range of an iterator, expected one, as 1:n")
        return list(found)

    def _matrix(self, e: tree.Matrix) -> Any:
        rows = [[np.atleast_1d(values.boxed(self.value(one))) for one in row] for row in e.rows]
        rows = [[one[:, None] if one.ndim == 1 else one for one in row] for row in rows]
        return np.concatenate([np.concatenate(row, axis=1) for row in rows], axis=0).astype(object)

    def _outputs(self, e: tree.OutputList) -> Any:
        raise ModelError("found a list of outputs, expected one value; it stands left of '=' and ':=' only")

    def _reference(self, e: tree.ComponentReference) -> Any:
        (first, subscripts), *rest = e.parts
        if first in self.local:
            found = self.local[first]
            if found is None:
                raise ModelError(f"found '{first}', which has no value yet, expected one before it is used")
        elif self.members.has(first):
            found = self.members.member(first)
        elif first == "time" and not rest:
            return time
        else:
            found, subscripts, rest = self._constant(e)
        found = self.indexed(found, subscripts)
        for name, subscripts in rest:
            found = self.indexed(self.part(found, name), subscripts)
        return found

    def _constant(self, e: tree.ComponentReference) -> tuple[Any, tuple[tree.Expression, ...], list[Any]]:
        """The constant to which a reference leads, its subscripts, and what follows behind it."""
        parts = list(e.parts)
        owner = self.scope.constant(parts[0][0])
        if owner is not None:
            return self._of_package(*owner, parts)
        here = self.scope.root if parts[0][0] == "" else self.scope
        if parts[0][0] == "":
            parts = parts[1:]
        found = here.first(parts[0][0])
        if found is None and (known := here.imported_literal(parts[0][0])) is not None:
            found, parts = known[0], [parts[0], (known[1], ()), *parts[1:]]
        if found is None:
            name, near = parts[0][0], [*self.local, *self.members.names(), *self.scope.known_names()]
            raise ModelError(f"found the name '{name}', expected a declared one{did_you_mean(name, near)}")
        parts = parts[1:]
        while parts and (inner := found.inherited_class(parts[0][0])) is not None:
            found, parts = inner, parts[1:]
        literals = found.literals
        if not parts:
            if literals is not None:
                every = [EnumerationValue(k + 1, n, found.name) for k, n in enumerate(literals)]
                return values.array(every), (), []
            raise ModelError(f"found the class {found.name}, expected a value")
        name = parts[0][0]
        if literals is not None and name in literals:
            return EnumerationValue(literals.index(name) + 1, name, found.name), (), parts[1:]
        if name not in found.elements:
            known = literals or [*found.elements, *found.names()]
            raise ModelError(f"found '{name}', which {found.name} does not have{did_you_mean(name, known)}")
        return self._of_package(found, found.elements[name], parts)

    def _of_package(
        self, owner: ClassScope, element: Element, parts: Sequence[Any]
    ) -> tuple[Any, Any, list[Any]]:
        name, (subscripts, *rest) = element.declaration.name, (parts[0][1], *parts[1:])
        if not {"constant", "parameter"} & set(element.clause.prefixes):
            raise ModelError(
                f"found '{name}' of {owner.name}, which is around this class, expected a constant"
            )
        return self.library.package(owner).member(name), subscripts, rest

    def part(self, value: Any, name: str) -> Any:
        """A member of a component or record, or of each in an array."""
        if isinstance(value, np.ndarray):
            return values.array([self.part(one, name) for one in value])
        if hasattr(value, "member") and value.has(name):
            return value.member(name)
        known = getattr(value, "names", tuple)()
        raise ModelError(f"found '{name}' behind a dot, expected a member{did_you_mean(name, known)}")

    def indexed(self, value: Any, subscripts: Sequence[tree.Expression]) -> Any:
        """The elements of an array that subscripts choose."""
        if not subscripts:
            return value
        shape = values.all_sizes(value)
        if len(subscripts) > len(shape):
            raise ModelError(f"found {len(subscripts)} subscripts, expected at most {len(shape)}")
        if value.size and values.is_plain(value) and any(map(self.varies, subscripts, shape)):
            return self._chosen(value, subscripts)
        places = [self.places(one, size) for one, size in zip(subscripts, shape, strict=False)]
        for axis in reversed(range(len(places))):
            value = np.take(value, places[axis], axis=axis)
        return value

    def varies(self, subscript: tree.Expression, size: int) -> bool:
        """Whether a subscript is known while a model runs only."""
        if isinstance(subscript, (tree.Mark, tree.Number)):
            return False
        found = replace(self, end=size).value(subscript)
        return isinstance(found, ca.SX) and not found.is_constant()

    def _chosen(self, value: Any, subscripts: Sequence[tree.Expression]) -> Any:
        """The elements of an array at places of which some vary; beyond the array no number, which ends a run."""
        (first, *rest), size = subscripts, len(value)
        if not self.varies(first, size):
            chosen = self.places(first, size)
            each = [self.indexed(value[k], rest) for k in ([chosen] if isinstance(chosen, int) else chosen)]
            return each[0] if isinstance(chosen, int) else values.array(each)
        place = replace(self, end=size).value(first)
        each = [self.indexed(one, rest) for one in value]
        beyond: Any = ca.sqrt(-1 - place**2)
        if isinstance(each[0], np.ndarray):
            beyond = values.called("fill", [beyond, *np.shape(each[0])], {})
        found = beyond
        for k in reversed(range(size)):
            found = values.chosen(place < k + 1.5, each[k], found, self.quiet)
        return values.chosen(place < 0.5, beyond, found, self.quiet)

    def places(self, subscript: tree.Expression, size: int) -> int | list[int]:
        """Indices from 0 that a subscript chooses of so many; ModelError beyond."""
        if isinstance(subscript, tree.Mark) and subscript.word == ":":
            return list(range(size))
        found = replace(self, end=size).value(subscript)
        if isinstance(found, ca.SX) or not values.is_number(found):
            raise ModelError("found a subscript that varies, expected one that is known at translation")
        numbers = list(found) if isinstance(found, np.ndarray) else [found]
        wrong = next((n for n in numbers if int(n) != n or not 1 <= n <= size), None)
        if wrong is not None:
            raise ModelError(f"found the index {wrong}, expected 1 to {size}")
        places = [int(n) - 1 for n in numbers]
        return places if isinstance(found, np.ndarray) else places[0]

    def _call(self, e: tree.Call) -> Any:
        name = function_name(e)
        if is_operator(e):
            return answered(e, self)
        quiet = name == "noEvent" or (name == "smooth" and self.value(e.arguments[0]) > 0)
        inner = replace(self, quiet=True) if quiet else self
        if e.iterators:
            found = values.array(list(inner._iterated(e.arguments[0], e.iterators)))
            return found if name == "array" else called(name, [np.ravel(found)], {}, self.library.call)
        if name == "size" and e.arguments and (shape := declared_shape(e.arguments[0], self)) is not None:
            return values.called(name, [np.empty(shape), *map(self.value, e.arguments[1:])], {})
        if name in ("size", "ndims") and e.arguments:
            return values.called(name, [inner.value(one) for one in e.arguments], {})
        if name in ("sample", "initial"):
            instant = self.members.next_sample(e)
            return time >= instant if name == "sample" else instant > 0.5
        if name == "getInstanceName":
            return self.members.structure.instance_name
        before = name in ("pre", "edge", "change") and len(e.arguments) == 1
        if name == "pre" and before and (at := subscripts_at_end(e.arguments[0])):
            whole = self.value(replace(e, arguments=at[:1]))
            if any(map(self.varies, at[1], values.all_sizes(whole))):
                return self.indexed(whole, at[1])  # their values now, of what was before
        if before and (found := self._before(name, e.arguments[0])) is not None:
            return found
        if before and (name_of := whole_name(e.arguments[0]).split(".")[0]) and self.members.has(name_of):
            inner = replace(inner, local={n: x for n, x in self.local.items() if n != name_of})
        name, function = called_function(e, self)
        arguments, named = [*map(inner.value, e.arguments)], {key: inner.value(one) for key, one in e.named}
        if function is not None:
            return self.library.call(function, arguments, named, component_of(e, self) or self.members)
        if self.members.has(name):
            raise ModelError(
                f"found the variable '{name}' with a time, expected that in costs and constraints of an optimization only"
            )
        return arguments[0] if name == "pure" else called(name, arguments, named, self.library.call)

    def _before(self, asked: str, e: tree.Expression) -> Any:
        """`pre`, `edge` or `change` of what is settled, or is followed by a Discrete; None for all else."""
        name = whole_name(e)
        inside = self.following is not None and name in self.following
        old = self.members.before(name, "edge" if inside else asked) if name else None
        if self.settled and (asked == "pre" or old is None):
            return self.value(e) if asked == "pre" else False
        if old is None:
            return None
        old = self.indexed(old, cast(tree.ComponentReference, e).parts[-1][1])
        old, new = old if self.following is None else values.called("pre", [old], {}), self.value(e)
        if asked == "pre":
            return old
        test = changed if asked == "change" else lambda a, b: a > b + 0.5
        return np.frompyfunc(test, 2, 1)(new, old) if isinstance(new, np.ndarray) else test(new, old)

    def _partial(self, e: tree.PartialCall) -> Any:
        raise ModelError("found a function as an argument, which is not supported, expected a value")


_EVALUATE: Mapping[type, Callable[[Interpreter, Any], Any]] = {
    tree.Number: lambda reader, e: e.value,
    tree.StringLiteral: Interpreter._literal,
    tree.BooleanLiteral: lambda reader, e: e.value,
    tree.Mark: Interpreter._mark,
    tree.Unary: lambda reader, e: operated(e.operator, [reader.value(e.operand)], reader.library.call),
    tree.Binary: Interpreter._binary,
    tree.RangeExpression: Interpreter._range,
    tree.Conditional: Interpreter._conditional,
    tree.ArrayConstructor: Interpreter._array,
    tree.Matrix: Interpreter._matrix,
    tree.Subscripted: lambda reader, e: reader.indexed(reader.value(e.array), e.subscripts),
    tree.OutputList: Interpreter._outputs,
    tree.ComponentReference: Interpreter._reference,
    tree.Call: Interpreter._call,
    tree.PartialCall: Interpreter._partial,
}
