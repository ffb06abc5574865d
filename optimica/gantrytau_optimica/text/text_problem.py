"""An optimization of Optimica text as an Optimization: its costs and constraints read from the tree."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Literal

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau.modelica import tree
from gantrytau.modelica.elaboration import values
from gantrytau.modelica.elaboration.classes import ModelicaModel
from gantrytau.modelica.elaboration.placed import PlacedMembers
from gantrytau.modelica.elaboration.scopes import ClassScope, TextError
from gantrytau_optimica.problem.optimization import Optimization
from gantrytau_optimica.text.timed_values import TimedInterpreter

OWN = {"given", "inputs", "objective", "integrand", "constraints", "start_time", "final_time", "static"}


class TextOptimization(ModelicaModel, Optimization):
    """An optimization of Optimica text; its times are parameters of it."""

    startTime: Any
    finalTime: Any
    _kinds = frozenset({"optimization"})
    _taken = ModelicaModel._taken | OWN

    @property
    def start_time(self) -> Any:
        """When it begins, in s."""
        return self.startTime

    @property
    def final_time(self) -> Any:
        """When it ends, in s."""
        return self.finalTime

    @property
    def static(self) -> bool:
        """Whether all is at rest."""
        found = argument_of(type(self).structure.scope, "static")
        if found is None:
            return False
        scope, expression = found
        value = self._reader(scope).value(expression)
        if not isinstance(value, bool):
            scope.refuse(expression.at, f"found {value!r} as static, expected true or false")
        return value

    def objective(self) -> Any:
        return self._cost("objective", "may" if self.static else "only")

    def integrand(self) -> Any:
        return self._cost("objectiveIntegrand", "never")

    def constraints(self) -> Iterator[Any]:
        for section in type(self).structure.scope.sections:
            if section.kind == "constraint":
                yield from _constraints(section.items, self._reader(section.scope))

    def _cost(self, name: str, instants: Literal["only", "may", "never"]) -> Any:
        found = argument_of(type(self).structure.scope, name)
        if found is None:
            return 0.0
        scope, expression = found
        value = replace(self._reader(scope), instants=instants).value(expression)
        if isinstance(value, (bool, str, np.ndarray)) or hasattr(value, "member"):
            scope.refuse(expression.at, f"found {_kind(value)} as {name}, expected a number")
        return value

    def _reader(self, scope: ClassScope) -> TimedInterpreter:
        return TimedInterpreter(scope, PlacedMembers(self), type(self).structure.library)


def _kind(value: Any) -> str:
    return f"an array {values.size_words(value)}" if isinstance(value, np.ndarray) else "what is no number"


def argument_of(scope: ClassScope, name: str) -> tuple[ClassScope, tree.Expression] | None:
    """The value of an argument of an optimization, its own or that of an optimization it extends, and where it is said."""
    body = scope.definition.body
    for one in body.arguments or () if isinstance(body, tree.Composition) else ():
        if isinstance(one, tree.Argument) and one.name == name:
            if one.modification is None or one.modification.value is None:
                scope.refuse(one.at, f"found '{name}' without a value, expected {name} = ...")
            return scope, one.modification.value
    inherited = (argument_of(base, name) for base, _ in scope.bases)
    return next((found for found in inherited if found is not None), None)


def _constraints(items: Sequence[Any], reader: TimedInterpreter) -> Iterator[Any]:
    for item in items:
        try:
            yield from _constraint(item, reader)
        except TextError:
            raise
        except ModelError as error:
            reader.scope.refuse(item.at, str(error))


def _constraint(item: Any, reader: TimedInterpreter) -> Iterator[Any]:
    if isinstance(item, tree.SimpleEquation):
        if isinstance(item.right, tree.Binary) and item.right.operator in values.RELATIONS:
            raise ModelError(
                f"found a second relation '{item.right.operator}', expected one; write two constraints"
            )
        yield from _rows(item.relation, reader.value(item.left), reader.value(item.right))
    elif isinstance(item, tree.ForLoop):
        for inner in reader.looped(item.iterators):
            yield from _constraints(item.items, inner)
    elif isinstance(item, tree.Branching) and item.word == "if":
        tests, chosen = reader.open_branches(item.branches, item.otherwise or ())
        if tests:
            raise ModelError(
                "found a condition that varies, expected one of parameters; write a limit that holds always"
            )
        yield from _constraints(chosen, reader)
    else:
        raise ModelError("found what is no constraint, expected '=', '<=', '>=', 'for' or 'if'")


def _rows(relation: str, left: Any, right: Any) -> Iterator[Any]:
    """The scalars of a relation; one number may stand beside an array."""
    if not all(values.is_plain(side) and not isinstance(side, str) for side in (left, right)):
        raise ModelError(f"found a component or a text beside '{relation}', expected numbers")
    try:
        pairs = np.broadcast(values.boxed(left), values.boxed(right))
    except ValueError:
        sizes = f"{values.size_words(left)} and {values.size_words(right)}"
        raise ModelError(f"found the sizes {sizes} beside '{relation}', expected one size") from None
    for a, b in pairs:
        found = _related(relation, a, b)
        if isinstance(found, ca.SX) and not found.is_constant():
            yield found
        elif not bool(found):
            raise ModelError(f"found {a} {relation} {b}, which never holds, expected a variable in it")


def _related(relation: str, a: Any, b: Any) -> Any:
    return a == b if relation == "=" else a <= b if relation == "<=" else a >= b
