"""Names of the solver's quantities in the words of the model."""

import casadi as ca

from gantrytau import Dae
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


def relation_text(left: ca.SX, right: ca.SX, sign: str) -> str:
    """`x >= 5` for what CasADi stores as `5 <= x`."""
    if left.is_constant() and not right.is_constant():
        left, right, sign = right, left, {"<=": ">=", "==": "=="}[sign]
    return f"{left} {sign} {right}"
