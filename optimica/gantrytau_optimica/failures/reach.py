"""Ends that the model cannot reach, found before solving: a square root of what is negative there."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import Limit
from gantrytau_optimica.control.limits import known_states, value_at

WORDS = {"initial": "start", "final": "end"}


@dataclass(frozen=True)
class OutOfReach:
    """An equation of the model without solution at an end that the problem demands."""

    when: str  # "start" or "end", with the phase
    equation: str
    conditions: tuple[str, ...]
    missing: float  # how much its square falls short
    nearest: str = ""  # what is in reach instead, in words


def reach_text(lost: Sequence[OutOfReach]) -> str:
    """What cannot be reached, by end and conditions, the worst equation first."""
    groups: dict[tuple[str, tuple[str, ...]], list[OutOfReach]] = {}
    for one in sorted(lost, key=lambda x: -x.missing):
        groups.setdefault((one.when, one.conditions), []).append(one)
    return "; ".join(
        f"the {when} is out of reach: {', '.join(f'`{c}`' for c in conditions)} leave no solution of "
        + ", nor of ".join(f"{x.equation} (the square there would be {-x.missing:.4g})" for x in found)
        + (f"; the nearest in reach: {found[0].nearest}" if found[0].nearest else "")
        for (when, conditions), found in groups.items()
    )


def out_of_reach(built: Built) -> list[OutOfReach]:
    """Equations that have no solution where the conditions decide them."""
    problem = built.problem
    held = {n.symbol.element_hash(): n.guess for n in problem.free if n.held}
    found: list[OutOfReach] = []
    for (number, when), states in known_states(problem).items():
        phase = problem.phases[number]
        values = {**held, **{h: row.lower for h, row in states.items()}}
        radicands: list[ca.SX] = []
        lost: list[OutOfReach] = []
        for k, algebraic in enumerate(phase.algebraics):
            if algebraic.name not in built.closed or not algebraic.is_root:
                continue
            radicand = ca.substitute(-phase.residuals[k], algebraic.symbol, 0)
            leaves = ca.symvar(radicand)
            if not all(leaf.element_hash() in values for leaf in leaves):
                continue
            numbers = [values[leaf.element_hash()] for leaf in leaves]
            value = value_at(radicand, values) if leaves else 0.0
            radicands.append(_with_held(radicand, held))
            if value < -1e-9 * max(1.0, float(np.max(np.abs(numbers), initial=0.0)) ** 2):
                names = tuple(states[h].name for leaf in leaves if (h := leaf.element_hash()) in states)
                where = f"{WORDS[when]} of {phase.name}" if phase.name else WORDS[when]
                lost.append(OutOfReach(where, phase.residual_names[k].rstrip(","), names, -value))
        if lost:
            near = _nearest(radicands, states)
            found += [replace(one, nearest=near) for one in lost]
    return found


def _with_held(expression: ca.SX, held: Mapping[int, float]) -> ca.SX:
    leaves = [leaf for leaf in ca.symvar(expression) if leaf.element_hash() in held]
    numbers = ca.DM([held[leaf.element_hash()] for leaf in leaves])
    return ca.substitute(expression, ca.vertcat(*leaves), numbers) if leaves else expression


def _nearest(radicands: Sequence[ca.SX], states: Mapping[int, Limit]) -> str:
    """The values nearest to those demanded (least squares) at which no square is negative, in words; "" if not found."""
    leaves = {leaf.element_hash(): leaf for leaf in ca.symvar(ca.vertcat(*radicands))}
    rows = [states[h] for h in leaves]
    wanted = np.array([row.lower for row in rows])
    x = ca.vertcat(*leaves.values())
    nlp = {"x": x, "f": ca.sumsqr(x - wanted), "g": ca.vertcat(*radicands)}
    ipopt = {"print_level": 0, "sb": "yes", "max_cpu_time": 1.0, "max_iter": 200}
    solver = ca.nlpsol("nearest", "ipopt", nlp, {"print_time": False, "ipopt": ipopt})
    found = np.array(solver(x0=wanted, lbg=0.0)["x"]).ravel()
    if not solver.stats()["success"]:
        return ""
    moved = [(row, value) for row, value in zip(rows, found, strict=True) if abs(value - row.lower) > 5e-5]
    return ", ".join(f"{row.name.split(' == ')[0]} = {value:.4f}" for row, value in moved)
