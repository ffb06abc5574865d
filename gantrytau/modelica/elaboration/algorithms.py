"""Functions and algorithms, carried out on values and on expressions of symbols alike (Modelica 3.6, chapters 11 and 12)."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.modelica import tree
from gantrytau.modelica.conditions import Items, joined_whens, targets
from gantrytau.modelica.elaboration import values
from gantrytau.modelica.elaboration.interpreter import Interpreter, first_result
from gantrytau.modelica.elaboration.kinds import fits, is_array_type, is_longer, type_of, type_of_value
from gantrytau.modelica.elaboration.modifiers import Element
from gantrytau.modelica.elaboration.scopes import ClassScope
from gantrytau.modelica.elaboration.statements import action_of, pairs
from gantrytau.modelica.elaboration.whens import when_chains
from gantrytau.modelica.external.functions import check_known, external_value
from gantrytau.modelica.records.assigned import most_rounds, with_part
from gantrytau.modelica.records.operators import function_for
from gantrytau.modelica.records.record_values import RecordValue, mapped, scalars
from gantrytau.modelica.references import Members, holding, references

MOST_ROUNDS = 100_000  # of a `while`


class LeftBlock(Exception):
    """`break` or `return`: the word."""


@dataclass
class Execution:
    """A run of statements. reader: evaluates their expressions; known: the values of what is assigned, None before.

    shapes: the sizes of what is declared with sizes; left: by `break` and `return`, whether what follows is left out.
    """

    reader: Interpreter
    known: dict[str, Any] = field(default_factory=dict)
    shapes: dict[str, tuple[int, ...]] = field(default_factory=dict)
    left: dict[str, Any] = field(default_factory=lambda: {"break": False, "return": False})

    def run(self, items: Items, local: Mapping[str, Any] | None = None) -> None:
        """Carry out statements, one after another; local: values of the iterators around them."""
        for item in items:
            reader = replace(self.reader, local={**self.reader.local, **self.known, **(local or {})})
            if isinstance(item, tree.Assignment):
                self._assign(item, reader)
            elif isinstance(item, tree.ForLoop):
                self._repeat(item, reader, local or {})
            elif isinstance(item, tree.WhileLoop):
                self._while(item, local or {})
            elif isinstance(item, tree.Branching) and item.word == "if":
                self._branch(item, reader, local or {})
            elif isinstance(item, tree.Leave):
                raise LeftBlock(item.word)
            elif isinstance(item, tree.ProcedureCall):
                self._call(item, reader)
            else:
                reader.scope.refuse(
                    item.at,
                    "found a statement that is not supported here, expected ':=', 'if' or 'for'",
                )

    def _call(self, item: tree.ProcedureCall, reader: Interpreter) -> None:
        if item.call.function.parts[-1][0] != "assert":
            reader.results(item.call)
            return
        holds = reader.value(item.call.arguments[0])
        if not isinstance(holds, ca.SX) and not holds:
            reader.scope.refuse(item.at, f"found what does not hold: {reader.value(item.call.arguments[1])}")

    def _assign(self, item: tree.Assignment, reader: Interpreter) -> None:
        value = reader.results(item.value)
        found = value if isinstance(value, tuple) else (value,)
        if len(item.targets) > len(found):
            reader.scope.refuse(item.at, f"found {len(item.targets)} names to assign, expected {len(found)}")
        for target, one in zip(item.targets, found, strict=False):
            if target is not None:
                name = target.parts[0][0]
                if name not in self.known:
                    hint = did_you_mean(name, self.known)
                    reader.scope.refuse(
                        target.at,
                        f"found '{name}' assigned, expected a variable of the function{hint}",
                    )
                self._refuse_given(target, reader)
                wanted, whole = reader.members.structure.type_of(target), isinstance(value, tuple)
                kind = type_of_value(one) or ("" if whole else type_of(item.value, reader))
                if not fits(wanted, kind):
                    reader.scope.refuse(target.at, f"found {kind} for '{name}', expected {wanted}")
                try:
                    if target.parts == ((name, ()),):
                        self._check_shape(name, one)
                    found = with_part(self.known[name], target.parts, one, reader)
                    for gone in self.left.values():
                        found = (
                            found if gone is False else values.chosen(gone, self.known[name], found, False)
                        )
                    self.known[name] = found
                except ModelError as error:
                    reader.scope.refuse(target.at, str(error))

    def acting(self, items: Items, reader: Interpreter) -> Iterator[Any]:
        """The actions of a branch of `when` in an algorithm of a model."""
        run = Execution(replace(reader, local=self.reader.local), dict(self.known), self.shapes)
        for item in items:
            if isinstance(item, tree.ProcedureCall):
                yield action_of(item.call, replace(reader, local={**self.reader.local, **run.known}))
            else:
                run.run([item])
        for name in dict.fromkeys(targets(items)):
            for left, right in pairs(reader.members.member(name), run.known[name]):
                yield left == right

    def _refuse_given(self, target: tree.ComponentReference, reader: Interpreter) -> None:
        """TextError where what is assigned is known from outside."""
        name = target.parts[0][0]
        prefixes = reader.scope.elements[name].clause.prefixes if name in reader.scope.elements else ()
        given = next((word for word in ("input", "parameter", "constant") if word in prefixes), "")
        if given == "input" or (given and reader.members.structure.is_fixed(target)):
            words = f"found the {given} '{name}' assigned, expected a variable; assign to one of another name"
            reader.scope.refuse(target.at, words)

    def _check_shape(self, name: str, value: Any) -> None:
        shape, plain = self.shapes.get(name), (np.ndarray, bool, int, float, ca.SX)
        if shape is not None and isinstance(value, plain) and np.shape(values.boxed(value)) != shape:
            wanted = values.size_words(np.empty(shape))
            words = f"found {values.size_words(value)} for '{name}' of {self.reader.scope.name}, expected {wanted}"
            raise ModelError(words)

    def declare(self, name: str, element: Element, value: Any) -> None:
        """Let a variable of a function have a value; ModelError for one of another type or size than is declared."""
        self.known[name] = value
        reader = replace(self.reader, scope=element.scope, local={**self.reader.local, **self.known})
        sizes = [*element.declaration.subscripts, *element.clause.subscripts]
        wanted = reader.members.structure.type_of(tree.ComponentReference(0, ((name, ()),)))
        if not fits(wanted, kind := type_of_value(value)):
            raise ModelError(f"found {kind} for '{name}' of {self.reader.scope.name}, expected {wanted}")
        if not any(isinstance(one, tree.Mark) for one in sizes) and not is_array_type(element):
            self.shapes[name] = tuple(reader.value(one) for one in sizes)
            if value is not None:
                self._check_shape(name, value)

    def _repeat(self, item: tree.ForLoop, reader: Interpreter, local: Mapping[str, Any]) -> None:
        outer = self.left["break"]
        for inner in reader.looped(item.iterators):
            steps = {name: inner.local[name] for name, _ in item.iterators}
            try:
                self.run(item.items, {**local, **steps})
            except LeftBlock as left:
                if str(left) == "return":
                    raise
                break
        self.left["break"] = outer

    def _while(self, item: tree.WhileLoop, local: Mapping[str, Any]) -> None:
        for _ in range(MOST_ROUNDS):
            reader = replace(self.reader, local={**self.reader.local, **self.known, **local})
            test = reader.value(item.condition)
            if isinstance(test, ca.SX):
                self._unrolled(item, reader, local)
                return
            if not test:
                return
            try:
                self.run(item.items, local)
            except LeftBlock as left:
                if str(left) == "return":
                    raise
                return
        self.reader.scope.refuse(item.at, f"found a loop of {MOST_ROUNDS} rounds, expected one that ends")

    def _unrolled(self, item: tree.WhileLoop, reader: Interpreter, local: Mapping[str, Any]) -> None:
        """A `while` of varying length: its statements once for each possible round, each time under its condition."""
        count = most_rounds(item, reader)
        if count is None:
            words = "found a loop whose length varies, expected 'while i < n' with a known n and a subscript i, or"
            reader.scope.refuse(item.at, f"{words} 'while a[i] < x', and i := i + 1 in it")
        once = tree.Branching(item.at, None, None, "if", ((item.condition, item.items),), None)
        outer = self.left["break"]
        for _ in range(count):
            self.run([once], local)
        self.left["break"] = outer

    def _branch(self, item: tree.Branching, reader: Interpreter, local: Mapping[str, Any]) -> None:
        """An `if`: what is known chooses, else all branches are carried out and each value is chosen."""
        tests, last = reader.open_branches(item.branches, item.otherwise or ())
        if not tests:
            self.run(last, local)
            return
        before, gone = self.known, self.left
        self._carry_out(last, local, before, gone)
        for test, items in reversed(tests):
            other, left = self.known, self.left
            self._carry_out(items, local, before, gone)
            self.known = {
                name: values.chosen(test, one, other[name], False) for name, one in self.known.items()
            }
            self.left = {word: values.chosen(test, one, left[word], False) for word, one in self.left.items()}
        for word in (word for word, one in self.left.items() if one is True):
            self.left = gone
            raise LeftBlock(word)

    def _carry_out(
        self, items: Items, local: Mapping[str, Any], known: Mapping[str, Any], gone: Mapping[str, Any]
    ) -> None:
        """Carry out a branch from the values before it."""
        self.known, self.left = dict(known), dict(gone)
        try:
            self.run(items, local)
        except LeftBlock as left:
            here = reduce(
                lambda a, b: values.binary("and", a, values.unary("not", b)), self.left.values(), True
            )
            self.left[str(left)] = values.binary("or", self.left[str(left)], here)


def stated_by_algorithm(
    items: Items, reader: Interpreter, wanted: Collection[str] | None = None
) -> Iterator[Any]:
    """What an algorithm of a model amounts to: whens, and an equation for each variable assigned, or for each wanted."""
    items = joined_whens(items)
    whens = [one for one in items if isinstance(one, tree.Branching) and one.word == "when"]
    held = dict.fromkeys(name for one in whens for _, inner in one.branches for name in targets(inner))
    names = [n for n in dict.fromkeys(targets(items)) if n not in held]
    run = Execution(reader, {n: mapped(lambda _: None, reader.members.member(n)) for n in names})
    run.shapes |= {n: shape for n in (*names, *held) if (shape := reader.members.structure.shape(n))}
    run.known |= {n: reader.members.member(n) for n in held}
    old = {n: mapped(values.FUNCTIONS["pre"], one) for n, one in run.known.items() if n in held}
    for item in items:
        if item in whens:
            before = replace(run, known={**run.known, **old})
            yield from when_chains(
                item, replace(reader, local={**reader.local, **before.known}), before.acting
            )
            for name in (n for _, inner in item.branches for n in targets(inner)):
                old.pop(name, None)  # what follows has its new value
        else:
            run.run([item])
    for name in names:
        if wanted is not None and name not in wanted:
            continue
        if any(one is None for one in scalars(run.known[name])):
            raise ModelError(
                f"found '{name}' without a value behind an algorithm, expected one in each branch"
            )
        for left, right in pairs(reader.members.member(name), run.known[name]):
            yield left == right


def called_class(
    scope: ClassScope,
    arguments: Sequence[Any],
    named: Mapping[str, Any],
    library: Any,
    holder: Members | None,
) -> Any:
    """The value of a function, several as a tuple, or of the constructor of a record; as `ModelicaLibrary.call`."""
    definition = scope.definition
    if scope.is_external_object and (made := scope.inherited_class("constructor")) is not None:
        scope = made
    if definition.kind == "record" and (
        made := function_for(scope, "constructor", (*arguments, *named.values()))
    ):
        return library.call(made, arguments, named)
    record = definition.kind == "record" or scope.definition is not definition
    if not record and definition.kind != "function":
        raise ModelError(f"found a call of {scope.name}, which is a {definition.kind}, expected a function")
    external = definition.body.external if isinstance(definition.body, tree.Composition) else None
    whole = definition.kind == "record"
    inputs = {n: e for n, e in scope.elements.items() if whole or "input" in e.clause.prefixes}
    given = _given(scope, inputs, arguments, named)
    longer = [] if record else [n for n, one in given.items() if is_longer(inputs[n], one)]
    if len({len(given[n]) for n in longer}) > 1:
        found = " and ".join(values.size_words(given[n]) for n in longer)
        raise ModelError(f"found arrays of the sizes {found} for scalars of {scope.name}, expected one size")
    if longer:  # a function of scalars is called with each element
        each = zip(*(given[n] for n in longer), strict=True)
        calls = [given | dict(zip(longer, one, strict=True)) for one in each]
        return values.array([called_class(scope, (), one, library, holder) for one in calls])
    if external is not None and external.language == "builtin":
        return values.called(external.function or definition.name, [given[n] for n in inputs], {})
    run = Execution(Interpreter(scope, library.package(scope), library))
    for name, element in (scope.elements if external is None and not record else inputs).items():
        run.declare(
            name, element, given[name] if name in given else _initial(element, run, holder, name in inputs)
        )
    if record:
        return RecordValue(run.known, scope)
    if external is not None:
        return _external(scope, external, run)
    try:
        for section in scope.sections:
            run.reader = replace(run.reader, scope=section.scope)
            run.run(section.items)
    except LeftBlock:
        pass
    outputs = [n for n, e in scope.elements.items() if "output" in e.clause.prefixes]
    missing = next((n for n in outputs if any(one is None for one in scalars(run.known[n]))), None)
    if missing is not None:
        raise ModelError(f"found {scope.name} to end without a value of its output '{missing}', expected one")
    found = tuple(run.known[n] for n in outputs)
    return found if len(found) != 1 else first_result(found)


def _external(scope: ClassScope, external: tree.ExternalFunction, run: Execution) -> Any:
    """The value of an external function, whose outputs may stand among the arguments."""
    name = external.function or scope.definition.name
    check_known(name)
    outputs = [n for n, e in scope.elements.items() if "output" in e.clause.prefixes]
    reader, given, written = replace(run.reader, local=run.known), [], []
    for e in external.arguments:
        if isinstance(e, tree.ComponentReference) and e.parts[0][0] in outputs:
            written.append(e.parts[0][0])
        else:
            given.append(reader.value(e))
    found = external_value(name, given, scope.root.inherited_class)
    several = dict(zip(written, found, strict=True)) if len(written) > 1 else {}
    return tuple(several[n] for n in outputs) if several else found


def _given(
    scope: ClassScope, inputs: Mapping[str, Element], arguments: Sequence[Any], named: Mapping[str, Any]
) -> dict[str, Any]:
    if len(arguments) > len(inputs):
        raise ModelError(f"found {len(arguments)} arguments of {scope.name}, expected at most {len(inputs)}")
    found = dict(zip(inputs, arguments, strict=False))
    for name, one in named.items():
        if name not in inputs:
            raise ModelError(f"found '{name}', which {scope.name} does not take{did_you_mean(name, inputs)}")
        if name in found:
            raise ModelError(f"found two values for '{name}' of {scope.name}, expected one")
        found[name] = one
    return found


def _initial(element: Element, run: Execution, holder: Members | None, needed: bool) -> Any:
    """The value of what a function declares, before its algorithm; None, or an array of None, where it has none."""
    reader = replace(run.reader, scope=element.scope, local={**run.reader.local, **run.known})
    said, name = element.modifier, element.declaration.name
    if said.value is not None:
        holder = None if said.scope is element.scope else holding(holder, references(said.value))
        if holder is not None:
            return Interpreter(said.scope, holder, reader.library).value(said.value)
        return replace(reader, scope=said.scope).value(said.value)
    if needed:
        raise ModelError(f"found no value for '{name}' of {run.reader.scope.name}, expected one")
    return _unset(element, reader)


def _unset(element: Element, reader: Interpreter) -> Any:
    """What a variable of a function is before it is assigned: None, also for each element and each member of a record."""
    sizes, said = [*element.declaration.subscripts, *element.clause.subscripts], element.modifier.inner
    if any(isinstance(one, tree.Mark) for one in sizes):
        return None
    kind, found = element.scope.find_class(element.clause.type, element.clause.at), None
    if kind.definition.kind == "record":
        given = {n: one for n in kind.elements if (one := said.get(n)) is not None and one.value is not None}
        known = {n: replace(reader, scope=one.scope).value(one.value) for n, one in given.items()}
        inner = {n: e for n, e in kind.elements.items() if n not in known}
        own = {n: _unset(e, replace(reader, scope=e.scope, local={})) for n, e in inner.items()}
        found = RecordValue({n: {**known, **own}[n] for n in kind.elements}, kind)
    return values.called("fill", [found, *map(reader.value, sizes)], {}) if sizes else found
