"""Phases: the arguments of periodic functions, which say how often an expression may turn in a time."""

import casadi as ca
import numpy as np

from gantrytau.language.instructions import applied, computed
from gantrytau.simulation.events.at_places import AtPlaces

SHARE = np.pi / 4  # rad, of the turn of a phase, by which it may move between two looks
PERIODIC = {ca.OP_SIN: 1.0, ca.OP_COS: 1.0, ca.OP_TAN: 2.0}  # turns in 2 pi


def phases(expressions: ca.SX, moving: ca.SX) -> ca.SX:
    """The arguments of periodic functions in expressions that depend on some symbols, (n,), in rad of a whole turn."""
    leaves = ca.symvar(expressions)
    found: dict[int, ca.SX] = {}

    def operation(operator: int, operands: list[ca.SX]) -> ca.SX:
        if operator in PERIODIC and ca.depends_on(operands[0], moving):
            found[operands[0].element_hash()] = PERIODIC[operator] * operands[0]
        return applied(operator, operands)

    function = ca.Function("periodic", leaves, [ca.densify(expressions)], {"cse": True})
    if any(function.instruction_id(k) in PERIODIC for k in range(function.n_instructions())):
        computed(function, lambda k, _: leaves[k], ca.SX, operation)
    return ca.vertcat(ca.SX(0, 1), *found.values())


def phases_along(expressions: ca.SX, arguments: list[ca.SX], moving: ca.SX, along: ca.SX) -> AtPlaces | None:
    """Phases and their rates as a function of arguments, by the rates `along` of the symbols `moving`; None without any."""
    found = phases(expressions, moving)
    rates = ca.densify(ca.jtimes(found, moving, along))
    function = ca.Function("phases", arguments, [ca.densify(found), rates], {"cse": True})
    return AtPlaces(function) if found.numel() else None


def moved(h: np.ndarray, values: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Largest movement of phases in intervals h (n,) in s, in shares of a turn, from values and rates at the ends."""
    fastest = np.abs(np.nan_to_num(rates)).max(axis=1)
    turned = np.abs(np.diff(np.nan_to_num(values), axis=0)).max(axis=1)
    return np.maximum(turned, h * np.maximum(fastest[1:], fastest[:-1])) / SHARE
