"""Numbers, Booleans and enumerations of text as quantities of the language; `free` and `initialGuess` of Optimica."""

from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau.border.dimensions import dimension
from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.border.units import known_scale
from gantrytau.language.declarations import (
    Discrete,
    Flow,
    Input,
    Output,
    Parameter,
    Quantity,
    Real,
    StateSelect,
)
from gantrytau.modelica import tree
from gantrytau.modelica.conditions import is_call
from gantrytau.modelica.elaboration.kinds import check_type
from gantrytau.modelica.elaboration.modifiers import Modifier, annotated
from gantrytau.modelica.elaboration.placed import Bound
from gantrytau.modelica.elaboration.structure import ClassMember, Structure
from gantrytau.modelica.overdetermined.records import is_overdetermined, is_propagated, propagated_quantity
from gantrytau.modelica.references import nodes_of, references

KINDS = {"flow": Flow, "input": Input, "output": Output}
NUMBERS = ("start", "min", "max", "nominal")
TEXTS = {"unit": "unit", "displayUnit": "display"}
IGNORED = {"quantity", "unbounded"}
GUESS = 1.0  # of a free parameter of which nothing is said


def add_quantity(body: dict[str, Any], one: ClassMember, held: bool, before: Bound | None) -> None:
    """The declaration of a number, Boolean, text or enumeration; nothing for a constant that is no plain value."""
    name, structure = one.name, one.owner
    refuse_free(one)
    if one.is_folded:
        if one.full.value is not None:
            value = structure.member(name)
            body[name] = value if isinstance(value, (bool, int, float, str)) else None
        return
    said = _attributes(one, without_optimica(one, one.own, True), structure)
    words: dict[str, Any] = {"description": one.element.declaration.description or ""}
    words |= {k: v for k, v in said.items() if k not in ("value", "prefer")}
    if 0 in one.shape:
        return
    if len(one.shape) > 2:
        one.element.scope.refuse(
            one.element.declaration.at, f"found {len(one.shape)} dimensions of '{name}', expected at most two"
        )
    if one.is_parameter:
        for key in ("start", "fixed", "free"):
            words.pop(key, None)
        said_fold = annotated(one.element.declaration.annotation, "Evaluate")
        fold = said_fold is not None and said_fold.value == tree.BooleanLiteral(0, True)
        body[name] = made = Parameter(said.get("value"), shape=one.shape, evaluate=fold, **words)
        made.final = one.full.final
        made.free = is_free(one)
        return
    words.pop("free", None)
    if "start" not in one.full.inner and is_fixed(one):
        words.setdefault("start", 0.0)
    if held:
        start = words.pop("start", 0.0)
        start = before or start
        words.pop("fixed", None)
        body[name] = Discrete(start, shape=one.shape, **words)
        return
    words_of = one.prefixes - {"input", "output"} if one.element.protected else one.prefixes
    kind = next((made for word, made in KINDS.items() if word in words_of), Real)
    if is_propagated(structure):
        body[name] = propagated_quantity(name, structure, one.shape, words)
        return
    if is_free(one) and not _is_differentiated(one):
        kind = Input
    elif kind is Input and inside_optimization(structure):
        kind = Real  # which the equations around it determine
    found: Quantity = kind(one.shape, **words, prefer=said.get("prefer", StateSelect.DEFAULT))
    found.inlined = kind is Real and is_overdetermined(structure)  # type: ignore[attr-defined]
    if "value" in said:
        found.value = said["value"]  # type: ignore[attr-defined]
    body[name] = found


def _is_differentiated(one: ClassMember) -> bool:
    """Whether its derivative stands in the equations of its class: a free state is one whose start is free."""
    nodes = (node for section in one.owner.scope.sections for node in nodes_of(section.items))
    calls = (node for node in nodes if isinstance(node, tree.Call) and is_call(node, "der"))
    return any(x.parts[0][0] == one.name for call in calls for x in references(call.arguments))


def _attributes(one: ClassMember, said: Modifier, structure: Structure) -> dict[str, Any]:
    """The attributes of a quantity that a modification in a class sets, by the names of the language."""
    found: dict[str, Any] = {}
    if said.value is not None:
        if not any(isinstance(step, str) for step in said.path):
            reader = structure.interpreter(said.scope, said.node)
            check_type(one.type_name, said.value, reader, f"'{one.name}'", said.at)
        found["value"] = Bound(said, structure, one.shape)
    for name, attribute in said.inner.items():
        if attribute.value is None or name in IGNORED:
            continue
        if name == "start" and "fixed" not in said.inner and _is_solved(structure, attribute.value):
            continue  # a guess that is known after the start only
        if name in NUMBERS and not structure.is_fixed(attribute.value):
            words = f"found a variable in '{name}', expected parameters; a value at the start is an initial equation"
            attribute.scope.refuse(attribute.at, words)
        elif name in NUMBERS:
            found[name] = Bound(attribute, structure, one.shape)
        elif name in TEXTS:
            text = structure.folded(attribute.seen_from(structure))
            if isinstance(text, np.ndarray):  # one for each element: kept where all are alike
                text = text.flat[0] if len(set(text.flat)) == 1 else ""
            found[TEXTS[name]] = text
            if not isinstance(text, str):
                attribute.scope.refuse(attribute.at, f"found {text!r} as {name}, expected a text")
        elif name in ("fixed", "free"):
            value = np.array(structure.folded(attribute.seen_from(structure)), dtype=bool)
            alike = value.all() or not value.any()
            if not alike and (one.is_parameter or name == "free"):
                words = f"found '{name}' of some elements of '{one.name}', expected all or none; declare two arrays"
                attribute.scope.refuse(attribute.at, words)
            # of Booleans and Integers it says pre(b) = start, not b = start (chapter 8.6)
            if one.is_parameter or one.kind == "Real" or name == "free":
                found[name] = bool(value.any()) if alike else value
        elif name == "stateSelect":
            found["prefer"] = StateSelect(int(structure.folded(attribute.seen_from(structure))) - 1)
        else:
            known = (*NUMBERS, *TEXTS, "fixed", "stateSelect", "quantity")
            known += ("free", "initialGuess") if attribute.scope.source.optimica else ()
            attribute.scope.refuse(
                attribute.at, f"found '{name}', unknown to {one.kind}{did_you_mean(name, known)}"
            )
    if not _has_dimension(found.get("unit", "")):
        found.pop("unit", None)
    if "display" in found and not _displayed(found["display"], found.get("unit")):
        del found["display"]
    return found


def _is_solved(structure: Structure, value: Any) -> bool:
    """Whether an expression depends on parameters that initial equations determine, and on no variable."""
    leaves = [structure.leaf(one) for one in references(value) if not structure.is_fixed(one)]
    return bool(leaves) and all(one is not None and (one.is_solved or one.follows) for one in leaves)


def _has_dimension(unit: str) -> bool:
    """Whether a unit of text is one of SI; others are informative."""
    try:
        return bool(unit) and bool(dimension(unit))
    except ModelError:
        return False


def _displayed(display: str, unit: str | None) -> bool:
    try:
        known_scale("", display, unit)
    except ModelError:
        return False
    return True


def keywords_of(child: Structure, said: Modifier, structure: Structure) -> dict[str, Any]:
    """What a modification in a class says of a component, as keywords of its class."""
    found: dict[str, Any] = {}
    names = [*said.inner] if said.value is None else [*child.members]
    for name in names:
        one = child.members.get(name)
        inner = said.of_member(name)
        if one is None or inner is None or not one.present or (said.value is not None and one.own.final):
            continue  # a class that is redeclared, what is not there, or has its value whatever the record's is
        if one.primitive is None and not one.shape:
            found[name] = keywords_of(one.children[0], inner, structure)
        elif one.primitive is None:
            found[name] = [
                keywords_of(x, each, structure)
                for x, each in zip(one.children, inner.of_elements(one.shape), strict=True)
            ]
        elif not one.is_folded and 0 not in one.shape:
            attributes = _attributes(one, without_optimica(one, inner, False), structure)
            left_out = ("start", "fixed") if one.is_parameter else ("free",)
            attributes = {k: v for k, v in attributes.items() if k not in left_out}
            found[name] = attributes
    return {name: one for name, one in found.items() if one}


def is_free(one: ClassMember) -> bool:
    """Whether a text leaves a quantity to the optimiser."""
    said = one.full.inner.get("free")
    if said is None or said.value is None:
        return False
    found = {bool(value) for value in np.ravel(one.owner.folded(said))}
    if len(found) > 1:
        words = f"found some elements of '{one.name}' free, expected all or none; declare two arrays"
        said.scope.refuse(said.at, words)
    return found.pop()


def refuse_free(one: ClassMember) -> None:
    """TextError for a parameter that is left to the optimiser, but shapes the model or is no Real."""
    if is_free(one) and (one.is_folded or one.kind != "Real"):
        said = one.full.inner["free"]
        shapes = "shapes the model" if one.is_folded else f"is {one.kind}"
        said.scope.refuse(
            said.at, f"found '{one.name}' free, which {shapes}, expected a Real on which no size depends"
        )


def inside_optimization(structure: Structure) -> bool:
    """Whether an instance is a component of an optimization, whose own inputs alone are known from outside."""
    *_, root = structure.outward()
    return root is not structure and root.scope.definition.kind == "optimization"


def without_optimica(one: ClassMember, said: Modifier, declared: bool) -> Modifier:
    """A modification whose initial guess is a value of a free parameter, and a start value of a variable that is not fixed.

    declared: whether it is that of the declaration, where a free parameter needs a value.
    """
    inner = dict(said.inner)
    guess, free = inner.pop("initialGuess", None), inner.get("free")
    for name, attribute in (("initialGuess", guess), ("free", free)):
        if attribute is not None and not attribute.scope.source.optimica:
            attribute.scope.refuse(
                attribute.at, f"found '{name}', which is Optimica, expected it in a .mop file"
            )
    if one.is_parameter and is_free(one):
        guess = guess or inner.get("start")
        if guess is not None:
            return replace(_as_value(one, guess), inner=inner)
        if said.value is None and declared:
            return Modifier(_spread(one, GUESS), said.scope, inner=inner, at=said.at)
    elif guess is not None and not is_fixed(one):
        inner["start"] = guess
    return replace(said, inner=inner)


def is_fixed(one: ClassMember) -> bool:
    """Whether the start value of a variable holds, of an array that of some elements at least."""
    said = one.full.inner.get("fixed")
    return said is not None and said.value is not None and bool(np.any(one.owner.folded(said)))


def _as_value(one: ClassMember, guess: Modifier) -> Modifier:
    if not (one.shape and guess.each):
        return guess
    number = one.owner.folded(guess.seen_from(one.owner))
    return replace(guess, value=_spread(one, number), path=())


def _spread(one: ClassMember, number: Any) -> Any:
    return np.full(one.shape, number, dtype=object) if one.shape else number
