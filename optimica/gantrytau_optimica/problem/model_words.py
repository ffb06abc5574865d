"""Names of the solver's quantities in the words of the model."""

from collections.abc import Callable
from typing import Any

import casadi as ca

from gantrytau import Dae, GantryTauError, ModelError
from gantrytau.errors import did_you_mean
from gantrytau.language.model import Declared
from gantrytau.language.symbols import derivative_name, split_derivative


def algebraic_words(dae: Dae) -> dict[str, tuple[str, str]]:
    """For each algebraic unknown of the lifted system: what its equation is, and what its limit means."""
    found: dict[str, tuple[str, str]] = {}
    for block in dae.blocks:
        names = [dae.equation_name(key) for key in block.equations]
        unknowns = [spoken(dae, y.name()) for y in block.tears]
        if block.root is not None:
            # the square root is of no concern to the user: the equation has no real solution beyond its zero
            where = f"{names[0]}, from which {unknowns[0]} follows"
            found[f"sqrt({block.tears[0].name()})"] = (
                f"{where},",
                f"{where}, at its turning point (singular)",
            )
            continue
        others = f" and {len(names) - 1} more" if len(names) > 1 else ""
        for tear, unknown in zip(block.tears, unknowns, strict=True):
            found[tear.name()] = (f"the equation of {unknown} ({names[0]}{others})", unknown)
    return found


def definition_words(dae: Dae) -> dict[str, str]:
    """For each symbol that the blocks solve for: which equation of the model it follows from."""
    found: dict[str, str] = {}
    for block in dae.blocks:
        names = [dae.equation_name(key) for key in block.equations]
        others = f" and {len(names) - 1} more" if len(names) > 1 else ""
        for symbol in (*block.tears, *(inner for inner, _ in block.inner)):
            name = symbol.name()
            found[name] = f"the equation of {spoken(dae, name)} ({names[0]}{others})"
    return found


def motion_words(dae: Dae) -> dict[str, str]:
    """For each state what its derivative follows from: the equation, or nothing but that it moves."""
    words = definition_words(dae)
    rates = (derivative_name(base, order + 1) for base, order in map(split_derivative, dae.choice.states))
    return {
        state: words.get(rate, f"the motion of {state}")
        for state, rate in zip(dae.states, rates, strict=True)
    }


def spoken(dae: Dae, name: str) -> str:
    """A derivative by the model's own name: der(tool.v[0]) for der(der(tool.r[0]))."""
    base, order = split_derivative(name)
    for k in range(order, 0, -1):
        own = dae._spoken_names.get(derivative_name(base, k))
        if own is not None:
            return derivative_name(own, order - k)
    return name


def told(place: str, evaluate: Callable[[], Any]) -> Any:
    """The value of `evaluate()`; errors of Python and CasADi are told with the place where they happened."""
    try:
        return evaluate()
    except GantryTauError as error:
        raise type(error)(f"{place}: {error}") from error
    except Exception as error:  # of statements that are not ours
        raise ModelError(f"{place}: {_why(error)}") from error


def _why(error: Exception) -> str:
    if "truth value" in str(error):
        return (
            "Python's chained comparison, `and` and the comparison of lists cannot work on symbols; write "
            "between(lower, x, upper), and join lists with casadi.vertcat(*list)"
        )
    if isinstance(error, AttributeError) and isinstance(error.obj, Declared):
        names = [n for n in vars(error.obj) if not n.startswith("_")]
        return f"{type(error.obj).__name__} has no '{error.name}'{did_you_mean(str(error.name), names)}"
    if "Wrong number or type of arguments" in str(error):
        return "found something that is no number or expression among symbols; join lists with casadi.vertcat(*list)"
    text = next((line for line in str(error).splitlines() if line.strip()), type(error).__name__)
    return text.split(": ", 1)[-1] if ".cpp" in text else text


def relation_text(left: ca.SX, right: ca.SX, sign: str) -> str:
    """`x >= 5` for what CasADi stores as `5 <= x`."""
    if left.is_constant() and not right.is_constant():
        left, right, sign = right, left, {"<=": ">=", "==": "=="}[sign]
    return f"{left} {sign} {right}"
