"""The attributes `free` and `initialGuess` of Optimica, in terms of those of the language."""

from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau.modelica.elaboration.modifiers import Modifier
from gantrytau.modelica.elaboration.structure import ClassMember, Structure

GUESS = 1.0  # of a free parameter of which nothing is said


def is_free(one: ClassMember) -> bool:
    """Whether a text leaves a quantity to the optimiser."""
    said = one.full.inner.get("free")
    return said is not None and said.value is not None and _flag(one, said)


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
    root = structure
    while root.around is not None:
        root = root.around
    return root is not structure and root.scope.definition.kind == "optimization"


def _flag(one: ClassMember, said: Modifier) -> bool:
    found = {bool(value) for value in np.ravel(one.owner.folded(said))}
    if len(found) > 1:
        words = f"found some elements of '{one.name}' set, expected all or none; declare two arrays"
        said.scope.refuse(said.at, words)
    return found.pop()


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
    """Whether the start value of a variable holds."""
    said = one.full.inner.get("fixed")
    return said is not None and said.value is not None and _flag(one, said)


def _as_value(one: ClassMember, guess: Modifier) -> Modifier:
    if not (one.shape and guess.each):
        return guess
    number = one.owner.folded(guess.seen_from(one.owner))
    return replace(guess, value=_spread(one, number), path=())


def _spread(one: ClassMember, number: Any) -> Any:
    return np.full(one.shape, number, dtype=object) if one.shape else number
