"""Algebraics that keep their values whatever moves, as the orientation of a plate that parallel rods keep level.

    0 = g(t, x, z, c, u, p)       c: numbers at which the first guess keeps some of the algebraics

They are taken out where their sensitivities along the guess vanish, and where with these numbers, at random t, x, z, u and
p, as many equations are combinations of the others, with the same factors everywhere. Then c solves them, and nothing else
does nearby, as the Jacobian by all algebraics is regular.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import ControlProblem, Limit, Phase
from gantrytau_optimica.control.first_guesses.dependent_guesses import Guess
from gantrytau_optimica.control.first_guesses.guesses import first_guesses, horizon

SHARES = np.array([0.0, 0.21, 0.48, 0.83, 1.0])  # of the horizon, at which guesses are looked at
SAME = 1e-9  # of a value, or of 1: what Newton's method leaves of a constant
APART = 1e-10  # of an equation: more than what rounding leaves of a combination of others
BESIDE = 0.3  # of its size: how far from the guess equations are looked at
HOLDS = 1e-9  # by how much a condition on constants may be missed
Constants = dict[int, float]  # by number of the algebraic


def without_constants(built: Built, guess: Mapping[str, Any]) -> Built:
    """The problem with numbers in place of the algebraic variables that never change."""
    problem, symbols, numbers = built.problem, [ca.SX(0, 1)], []
    if not built.system.loops:
        return built
    guesses, phases = first_guesses(built, guess), []
    for phase in problem.phases:
        constants = _constants(problem, phase, guesses)
        rows = _other_rows(problem, phase, guesses, constants) if constants else None
        if rows is not None:
            symbols += [phase.algebraics[k].symbol for k in constants]
            numbers += constants.values()
            phase = _without(phase, constants, rows)
        phases.append(phase)
    if not numbers:
        return built
    old, new = ca.vertcat(*symbols), ca.DM(numbers)
    found = _met(replace(problem, phases=tuple(_inserted(phase, old, new) for phase in phases)))
    if found is None:
        return built
    definitions = zip(old.elements(), ca.SX(new).elements(), strict=True)
    forms = ca.substitute([*built.closed.values()], [old], [ca.SX(new)]) if built.closed else []
    return replace(
        built,
        problem=found,
        system=replace(built.system, definitions=(*definitions, *built.system.definitions)),
        closed=dict(zip(built.closed, forms, strict=True)),
    )


def _constants(problem: ControlProblem, phase: Phase, guesses: Mapping[str, Guess]) -> Constants:
    """Algebraics within their limits that neither the guess nor, to first order, anything they depend on moves."""
    z = np.array([guesses[a.name](SHARES) for a in phase.algebraics]).reshape(-1, SHARES.size)
    values = np.round(z[:, 0] / SAME) * SAME
    still = np.max(np.abs(z - values[:, None]), axis=1, initial=0.0) <= SAME * np.maximum(np.abs(values), 1.0)
    still &= [a.min <= value <= a.max for a, value in zip(phase.algebraics, values, strict=True)]
    if not np.any(still):
        return {}
    time, unknowns, others = arguments = _arguments(problem, phase)
    by = (ca.jacobian(phase.residuals, one) for one in (unknowns, ca.vertcat(time, others)))
    slopes = ca.Function("slopes", [*arguments], [ca.densify(one) for one in by])
    for place in SHARES[1:-1]:
        by_z, by_rest = (np.array(x) for x in slopes(*_at(problem, phase, guesses, np.array([place]))))
        if not np.all(np.isfinite(by_z)) or np.linalg.matrix_rank(by_z) < len(by_z):
            return {}
        moved = np.abs(np.linalg.solve(by_z, np.nan_to_num(by_rest)))
        still &= np.max(moved, axis=1, initial=0.0) <= SAME * np.max(moved, initial=1.0)
    return {int(k): float(values[k]) for k in np.flatnonzero(still)}


def _other_rows(
    problem: ControlProblem, phase: Phase, guesses: Mapping[str, Guess], constants: Constants
) -> list[int] | None:
    """Indices of independent equations, as many as algebraic variables are left; None if their number differs."""
    count = len(phase.algebraics)
    random = np.random.default_rng(1)
    times, z, others = (np.tile(x, (1, count)) for x in _at(problem, phase, guesses, SHARES))
    z, others = (
        part * (1 + BESIDE * random.uniform(-1, 1, part.shape))
        + BESIDE
        * np.max(np.abs(part), axis=1, initial=0.0, keepdims=True)
        * random.uniform(-1, 1, part.shape)
        for part in (z, others)
    )
    z[list(constants)] = np.array([*constants.values()])[:, None]
    function = ca.Function("equations", [*_arguments(problem, phase)], [ca.densify(phase.residuals)])
    rows = np.array(function(times, z, others))
    rows = rows[:, np.all(np.isfinite(rows), axis=0)]
    if rows.shape[1] < 2 * count:
        return None
    rows /= np.maximum(np.max(np.abs(rows), axis=1, keepdims=True), SAME)
    kept: list[int] = []
    space = np.zeros((0, rows.shape[1]))
    for k, row in enumerate(rows):
        size = np.linalg.norm(row)
        for _ in range(2):  # once more for what rounding leaves
            row = row - space.T @ (space @ row)
        if np.linalg.norm(row) > APART * max(size, 1.0):
            kept.append(k)
            space = np.vstack([space, row / np.linalg.norm(row)])
    left = [k for k in range(count) if k not in constants]
    roots_own = all(row == k for row, k in zip(kept, left, strict=False) if phase.algebraics[k].is_root)
    return kept if len(kept) == len(left) and roots_own else None


def _arguments(problem: ControlProblem, phase: Phase) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Time, algebraics, and all else of which equations depend."""
    z = [a.symbol for a in phase.algebraics]
    others = [s.symbol for s in (*phase.states, *phase.inputs, *phase.courses)]
    return problem.time, ca.vertcat(*z), ca.vertcat(ca.SX(0, 1), *others, problem.numbers)


def _at(
    problem: ControlProblem, phase: Phase, guesses: Mapping[str, Guess], shares: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The guess at shares (n,) of the horizon, each (k, n)."""
    start, stop = horizon(problem, phase)
    times = start + (stop - start) * shares
    others = [guesses[s.name](shares) for s in (*phase.states, *phase.inputs)]
    others += [course.value(times) for course in phase.courses]
    others += [np.full(shares.size, number.guess) for number in problem.free]
    z = np.array([guesses[a.name](shares) for a in phase.algebraics])
    return times[None, :], z, np.array(others).reshape(-1, shares.size)


def _without(phase: Phase, constants: Constants, rows: list[int]) -> Phase:
    """The phase with these equations for the algebraics that are left."""
    left = [k for k in range(len(phase.algebraics)) if k not in constants]
    return replace(
        phase,
        algebraics=tuple(phase.algebraics[k] for k in left),
        residuals=phase.residuals[rows],
        residual_names=tuple(phase.residual_names[k] for k in rows),
    )


def _inserted(phase: Phase, old: ca.SX, new: ca.DM) -> Phase:
    """The phase with numbers for symbols."""
    limits, points, sums = phase.path_limits, phase.points, phase.sums
    columns = [phase.ode, phase.residuals, phase.integrand]
    columns += [one.expression for one in (*limits, *points, *sums)]
    ode, residuals, integrand, *found = ca.substitute(columns, [old], [ca.SX(new)])
    rest = iter(found)
    limits, points, sums = (
        tuple(replace(one, expression=next(rest)) for one in part) for part in (limits, points, sums)
    )
    return replace(
        phase, ode=ode, residuals=residuals, integrand=integrand, path_limits=limits, points=points, sums=sums
    )


def _met(problem: ControlProblem) -> ControlProblem | None:
    """The problem without conditions on constants; None where one of them does not hold."""
    fixed = [p for p in problem.points if not ca.symvar(p.expression)]
    symbols = ca.vertcat(ca.SX(0, 1), *(p.symbol for p in fixed))
    values = ca.vertcat(ca.SX(0, 1), *(p.expression for p in fixed))

    def open_ones(limits: tuple[Limit, ...]) -> tuple[Limit, ...] | None:
        found = []
        for limit in limits:
            value = ca.substitute(limit.expression, symbols, values)
            if ca.symvar(value):
                found.append(limit)
            elif not limit.lower - HOLDS <= float(ca.evalf(value)) <= limit.upper + HOLDS:
                return None
        return tuple(found)

    boundary, paths = open_ones(problem.boundary), [open_ones(phase.path_limits) for phase in problem.phases]
    if boundary is None or None in paths:
        return None
    phases = zip(problem.phases, paths, strict=True)
    return replace(
        problem,
        boundary=boundary,
        phases=tuple(replace(phase, path_limits=mine or ()) for phase, mine in phases),
    )
