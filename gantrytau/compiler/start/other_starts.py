"""Other start values for a model that is translated already."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from gantrytau.border.refusal import Given, ModelError
from gantrytau.border.units import given as in_si
from gantrytau.compiler.start.consistent_start import consistent_start
from gantrytau.compiler.start.start_values import StartValues
from gantrytau.compiler.translated import Translated
from gantrytau.flattening.shapes import elements_of
from gantrytau.language.events import mode_number

SAME = 1e-9  # relative, below which two starts of one symbol agree


def with_starts(dae: Translated, starts: Mapping[str, Any]) -> Translated:
    """The same translation from other starts, name -> number, array, "40 deg", or name of a mode; others move before.

    A start that is fixed in the model stays fixed, at its new value. Equations and states are those that the old start
    chose. Raises ModelError for names that are no variables and for wrong shapes, InitializationError where no
    consistent values are found.
    """
    if not isinstance(starts, Mapping):
        raise ModelError("expected {name: value}", place=dae.name, found=Given("starts", starts))
    dae.flat.refuse_twice("starts", starts)
    values, given = dict(dae.start), dict[str, str]()
    for name, value in starts.items():
        elements = _variables(dae, name)
        if name in dae.flat.modes:
            value = mode_number(f"starts: {name}", dae.flat.modes[name], value)
        value = in_si(f"starts: {name}", value, dae.flat.unit(name))
        numbers = elements_of(f"starts: {name}", value, dae.flat.shape(name))
        for element, number in zip(elements, numbers, strict=True):
            symbol, start = _symbol(dae, element, number)
            if symbol in given and abs(values[symbol] - start) > SAME * max(abs(start), abs(values[symbol])):
                words = f"{element} contradicts {given[symbol]}, of which it is an alias; give one of them"
                raise ModelError(words, place="starts", argument="starts")
            values[symbol], given[symbol] = start, element
    asked = StartValues(values, frozenset(given) | dae.asked.fixed, dae.asked.fixed)
    found = consistent_start(dae.flat, dae.reduced, dae.indexed, asked)
    return replace(dae, asked=asked, start=found)


def _variables(dae: Translated, name: str) -> tuple[str, ...]:
    """The scalar variables of a name."""
    elements = dae.expand(name)
    words: tuple[str | Given, ...] = ()
    if any(n in dae.table.symbols for n in elements):
        words = ("is a parameter, expected a variable; give it in ", Given("parameters"))
    elif any(n in dae.inputs for n in elements):
        words = ("is an input, expected a variable; give it in ", Given("inputs"))
    elif any(n not in dae.reduced.aliases and n not in dae.known for n in elements):
        words = ("is no declared variable, but follows from others; give starts of those",)
    if words:
        raise ModelError(f"{name} ", *words, place="starts", argument="starts")
    return elements


def _symbol(dae: Translated, name: str, number: float) -> tuple[str, float]:
    """The symbol of the reduced equations behind a variable, and its value."""
    if name in dae.known:
        return name, number  # sampled: held until the first instant
    alias = dae.reduced.aliases[name]
    if alias.root is None:
        words = f"{name} is constant and equal to {dae.table.number(alias.offset):g}; leave it out"
        raise ModelError(words, place="starts", argument="starts")
    return alias.symbol, dae.table.number(alias.root_value(number))
