"""Names of the solver's quantities in the words of the model."""

import casadi as ca

from gantrytau import Dae


def algebraic_words(dae: Dae) -> dict[str, tuple[str, str]]:
    """For each algebraic unknown of the lifted system: what its equation is, and what its limit means."""
    found: dict[str, tuple[str, str]] = {}
    for origin in dae.origins:
        first, *more = origin.equations
        unknowns = [dae.spoken(n) for n in origin.tears]
        if origin.root:
            # the square root is of no concern to the user: the equation has no real solution beyond its zero
            where = f"{first}, from which {unknowns[0]} follows"
            found[f"sqrt({origin.tears[0]})"] = (
                f"{where},",
                f"{where}, at its turning point (singular)",
            )
            continue
        others = f" and {len(more)} more" if more else ""
        for tear, unknown in zip(origin.tears, unknowns, strict=True):
            found[tear] = (f"the equation of {unknown} ({first}{others})", unknown)
    return found


def definition_words(dae: Dae) -> dict[str, str]:
    """For each symbol that the blocks solve for: which equation of the model it follows from."""
    found: dict[str, str] = {}
    for origin in dae.origins:
        first, *more = origin.equations
        others = f" and {len(more)} more" if more else ""
        for name in (*origin.tears, *origin.inner):
            found[name] = f"the equation of {dae.spoken(name)} ({first}{others})"
    return found


def motion_words(dae: Dae) -> dict[str, str]:
    """For each state what its derivative follows from: the equation, or nothing but that it moves."""
    words = definition_words(dae)
    rates = {state: dae.root(f"der({state})") for state in dae.states}
    return {
        state: words.get(rate.symbol if rate else "", f"the motion of {state}")
        for state, rate in rates.items()
    }


def relation_text(left: ca.SX, right: ca.SX, sign: str) -> str:
    """`x >= 5` for what CasADi stores as `5 <= x`."""
    if left.is_constant() and not right.is_constant():
        left, right, sign = right, left, {"<=": ">=", "==": "=="}[sign]
    return f"{left} {sign} {right}"
