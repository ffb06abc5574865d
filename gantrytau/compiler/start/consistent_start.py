"""Start values of all symbols: what the model gives, made consistent level by level."""

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from itertools import product

import casadi as ca

from gantrytau.border.refusal import InitializationError
from gantrytau.compiler.aliases import Reduced
from gantrytau.compiler.index_reduction import Indexed
from gantrytau.compiler.refusals import nearest_words
from gantrytau.compiler.start.consistency import solve_levels
from gantrytau.compiler.start.level import Level, joined
from gantrytau.compiler.start.start_values import StartValues
from gantrytau.compiler.symbol_spaces import values_at
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.language.scalar_arithmetic import leaf_names

ROUNDS = 200  # in which delayed values are made those of the start
SAME = 1e-13  # relative, between two rounds


def consistent_start(
    flat: FlatModel,
    reduced: Reduced,
    indexed: Indexed,
    guess: StartValues,
    held: frozenset[str] = frozenset(),
    free: tuple[str, ...] = (),
) -> dict[str, float]:
    """Consistent numbers of all symbols; `held` must not move, `free` are inputs that may (last level).

    What is delayed is what it is at the start. InitializationError where that leads to no numbers.
    """
    for _ in range(ROUNDS if flat.delays else 0):
        found = _consistent_start(flat, reduced, indexed, guess, held, free)
        values = {**guess.values, **found}
        delays = reduced.to_reduced(ca.vertcat(*(d.expression for d in flat.delays)))
        now = dict(
            zip((d.name for d in flat.delays), values_at(delays, values).ravel().tolist(), strict=True)
        )
        if all(abs(now[n] - guess.values[n]) <= SAME * max(1e-300, abs(now[n])) for n in now):
            return found
        guess = replace(guess, values={**guess.values, **now})
    if flat.delays:
        names = ", ".join(d.name for d in flat.delays)
        raise InitializationError(
            f"{flat.name}: found no value for {names} that is what is delayed at the start, expected one, as "
            "before the start everything was as it is there; change start values or the equations"
        )
    return _consistent_start(flat, reduced, indexed, guess, held, free)


def _consistent_start(
    flat: FlatModel,
    reduced: Reduced,
    indexed: Indexed,
    guess: StartValues,
    held: frozenset[str],
    free: tuple[str, ...],
) -> dict[str, float]:
    stages = list(indexed.levels)
    if free:
        last = stages[-1]
        stages[-1] = Level(last.residuals, last.names, (*last.unknowns, *free), last.exact)
    title, fixed = flat.name, guess.fixed | held
    started = guess.started | held
    initial = bool(flat.initial_equations) and not held
    if initial and free not in indexed.with_initial:
        indexed.with_initial[free] = _initial_level(flat, reduced, stages)

    def led(
        levels: list[Level], chosen: frozenset[str], thorough: bool = False, anew: bool = False
    ) -> dict[str, float]:
        """Solve the levels, and then all of them with the initial equations."""
        values = solve_levels(
            levels,
            guess.values,
            held=fixed,
            started=started,
            chosen=chosen,
            title=title,
            thorough=thorough,
            anew=anew,
        )
        whole = [indexed.with_initial[free]] if initial else []
        return solve_levels(whole, values, held=fixed, started=guess.started, title=title, anew=anew)

    # an initial equation may belong to the first level: a position that was moved without it leads nowhere afterwards
    placed = _with_initial(flat, reduced, stages) if initial else None
    if placed:
        with contextlib.suppress(InitializationError):
            return led(placed, guess.chosen)
    try:
        return led(stages, guess.chosen, not held)
    except InitializationError as error:
        refuse_outside(flat, reduced, guess.values, error)
        if held or not (guess.fixed or initial):
            raise
        # equations may have no value before the initial ones hold, and a fixed start belong to a later level than the states
        # that follow it
        attempts = [[]] if initial else []
        attempts += [[indexed.whole], *([placed] if placed else [])]
        for anew, levels in product((False, True), attempts):
            with contextlib.suppress(InitializationError):
                return led(levels, frozenset(), anew=anew)
        raise (_with_nearest(error, stages, guess, started, title) if guess.fixed else error) from None


def _with_nearest(
    error: InitializationError, stages: list[Level], guess: StartValues, started: frozenset[str], title: str
) -> InitializationError:
    """The failure with the nearest values of fixed starts that are consistent, where there are some."""
    try:
        near = solve_levels(
            stages, guess.values, held=frozenset(), started=started, title=title, thorough=True
        )
    except InitializationError:
        return error
    words = nearest_words({n: (guess.values[n], near[n]) for n in sorted(guess.fixed) if n in near})
    return InitializationError(f"{error}{words}", residuals=error.residuals)


def refuse_outside(
    flat: FlatModel, reduced: Reduced, values: Mapping[str, float], error: InitializationError
) -> None:
    """InitializationError in place of another if a table that is not defined beyond its ends is left at some values."""
    for one in flat.ranges:
        expression = reduced.to_reduced(one.expression)
        if not all(leaf.name() in values for leaf in ca.symvar(expression)):
            continue
        found = float(values_at(expression, values)[0, 0])
        if not one.low <= found <= one.high:
            words = (
                f"{one.name} starts at {found:g}, expected {one.low:g} to {one.high:g}, where its table is defined: start "
                "within, add points, or let it go on with outside='hold' or 'linear'"
            )
            raise InitializationError(words, place=flat.name, residuals=error.residuals) from None


def _with_initial(flat: FlatModel, reduced: Reduced, stages: list[Level]) -> list[Level] | None:
    """The levels, the first one with the initial equations in which no unknown of another level stands, but for signals.

    A signal follows from known numbers by an equation of its own, as the angle that a source prescribes.
    """
    first, *others = stages
    later = {n for s in others for n in s.unknowns}
    every = later.union(first.unknowns)
    rows = reduced.to_reduced(ca.vertcat(*(e.residual for e in flat.initial_equations))).elements()
    foreign = [later.intersection(leaf_names([row])) for row in rows]
    asked, signals = set().union(*foreign), dict[str, tuple[ca.SX, str]]()
    for level in others if asked else ():
        for residual, name in zip(level.residuals, level.names, strict=True):
            inside = every.intersection(leaf_names([residual]))
            if len(inside) == 1 and inside <= asked:
                signals[inside.pop()] = residual, name
    own = [k for k, names in enumerate(foreign) if names <= signals.keys()]
    if not own:
        return None
    used = {n: signals[n] for k in own for n in sorted(foreign[k])}
    residuals = (*first.residuals, *(r for r, _ in used.values()), *(rows[k] for k in own))
    names = (*first.names, *(n for _, n in used.values()))
    names += tuple(f"initial equation of {flat.initial_equations[k].name}" for k in own)
    return [Level(residuals, names, (*first.unknowns, *used), first.exact), *others]


def _initial_level(flat: FlatModel, reduced: Reduced, stages: list[Level]) -> Level:
    rows = reduced.to_reduced(ca.vertcat(*(e.residual for e in flat.initial_equations))).elements()
    names = tuple(f"initial equation of {e.name}" for e in flat.initial_equations)
    return joined([*stages, Level(tuple(rows), names, ())])
