"""Ends that the model cannot reach, found before solving: a square root of what is negative there."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau_optimica.building import Built
from gantrytau_optimica.sorting import known_states

WORDS = {"initial": "start", "final": "end"}


@dataclass(frozen=True)
class OutOfReach:
    """An equation of the model without solution at an end that the problem demands."""

    when: str  # "start" or "end", with the phase
    equation: str
    conditions: tuple[str, ...]
    missing: float  # how much its square falls short


def reach_text(lost: Sequence[OutOfReach]) -> str:
    """What cannot be reached, by end and conditions, the worst equation first."""
    groups: dict[tuple[str, tuple[str, ...]], list[OutOfReach]] = {}
    for one in sorted(lost, key=lambda x: -x.missing):
        groups.setdefault((one.when, one.conditions), []).append(one)
    return "; ".join(
        f"the {when} is out of reach: {', '.join(f'`{c}`' for c in conditions)} leave no solution of "
        + ", nor of ".join(f"{x.equation} (the square there would be {-x.missing:.4g})" for x in found)
        for (when, conditions), found in groups.items()
    )


def out_of_reach(built: Built) -> list[OutOfReach]:
    """Equations that have no solution where the conditions decide them."""
    problem = built.problem
    held = {n.symbol.element_hash(): n.guess for n in problem.free if n.held}
    found: list[OutOfReach] = []
    for (number, when), states in known_states(problem).items():
        phase = problem.phases[number]
        values = {h: (row.lower, row.name) for h, row in states.items()}
        for k, algebraic in enumerate(phase.algebraics):
            if algebraic.name not in built.closed or algebraic.min != 0.0:
                continue
            radicand = ca.substitute(-phase.residuals[k], algebraic.symbol, 0)
            leaves = ca.symvar(radicand)
            if not all(leaf.element_hash() in values or leaf.element_hash() in held for leaf in leaves):
                continue
            numbers = [values[h][0] if (h := leaf.element_hash()) in values else held[h] for leaf in leaves]
            value = (
                float(ca.evalf(ca.substitute(radicand, ca.vertcat(*leaves), ca.DM(numbers))))
                if leaves
                else 0.0
            )
            if value < -1e-9 * max(1.0, float(np.max(np.abs(numbers), initial=0.0)) ** 2):
                names = tuple(values[h][1] for leaf in leaves if (h := leaf.element_hash()) in values)
                where = f"{WORDS[when]} of {phase.name}" if phase.name else WORDS[when]
                found.append(OutOfReach(where, phase.residual_names[k].rstrip(","), names, -value))
    return found
