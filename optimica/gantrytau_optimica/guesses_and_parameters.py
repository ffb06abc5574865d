"""What a call gives by name: first guesses, solutions that stand for them, and parameters."""

from collections.abc import Mapping
from typing import Any

from gantrytau import ModelError, Result
from gantrytau.border.refusal import Given
from gantrytau.border.units import given as in_si
from gantrytau.flattening.shapes import elements_of
from gantrytau_optimica.answers.answer import Answer
from gantrytau_optimica.answers.archive.saved_optimum import SavedOptimum
from gantrytau_optimica.control.first_guesses.guesses import guess_of
from gantrytau_optimica.problem.symbolic_problem import SymbolicProblem


def solution_given(guess: Any) -> bool:
    """Whether a guess is an optimum, on whose branch the search should stay."""
    return isinstance(guess, Answer)


def read_guesses(guess: Any, read: SymbolicProblem) -> dict[str, Any]:
    """Guesses by name, from those of the caller or from another solution. Raises ModelError for unknown names."""
    if isinstance(guess, SavedOptimum):
        return guess.guesses(read.dae)
    if isinstance(guess, (Result, Answer)):
        return guess_of(guess, read.dae)
    if guess is not None and not isinstance(guess, Mapping):
        expected = "expected {name: number, array or function of time}, a Result or an Optimum"
        raise ModelError(expected, found=Given("guess", guess))
    found: dict[str, Any] = {}
    for name, value in (guess or {}).items():
        if isinstance(value, (Result, Answer)):
            found.update(guess_of(value, read.dae, name))
        else:
            elements, shape = read.dae.expand(name), read.dae.flat.shape(name)
            value = in_si(f"guess {name}", value, read.dae.flat.unit(name))
            if shape and elements[0] in read.dae.parameter_symbols:  # free numbers are guessed one by one
                found.update(zip(elements, elements_of(f"guess {name}", value, shape), strict=True))
            else:
                found[name] = value
    return found


def parameter_names(read: SymbolicProblem, name: str) -> tuple[str, ...]:
    """Scalar names of a parameter; ModelError if it is none."""
    elements = read.dae.expand(name)
    if elements[0] not in read.dae.parameter_symbols:
        why = f"{name} is no parameter, expected one; declare it as a Parameter"
        raise ModelError(why, place=read.name, argument="parameters")
    return tuple(elements)
