"""Start values of all symbols: what the model gives, made consistent level by level."""

from collections.abc import Mapping

import casadi as ca

from gantrytau.compiler.aliases import Reduced
from gantrytau.compiler.alphabets import values_at
from gantrytau.compiler.index_reduction import Indexed
from gantrytau.compiler.start.consistency import Level, solve_levels
from gantrytau.compiler.start.start_values import StartValues
from gantrytau.errors import InitializationError
from gantrytau.flattening.flat_model import FlatModel


def consistent_start(
    flat: FlatModel,
    reduced: Reduced,
    indexed: Indexed,
    guess: StartValues,
    held: frozenset[str] = frozenset(),
    free: tuple[str, ...] = (),
) -> dict[str, float]:
    """Consistent numbers of all symbols; `held` must not move, `free` are inputs that may (last level)."""
    stages = list(indexed.levels)
    if free:
        last = stages[-1]
        stages[-1] = Level(last.residuals, last.names, (*last.unknowns, *free))
    title, fixed = flat.name, guess.fixed | held
    started, thorough = guess.started | held, not held
    try:
        values = solve_levels(
            stages,
            guess.values,
            held=fixed,
            started=started,
            chosen=guess.chosen,
            title=title,
            thorough=thorough,
        )
    except InitializationError as error:
        refuse_outside(flat, reduced, guess.values, error)
        if held or not guess.fixed:
            raise
        # a fixed start may belong to a later level than the states that have to follow it
        try:
            values = solve_levels([indexed.whole], guess.values, held=fixed, started=started, title=title)
        except InitializationError:
            raise error from None
    if flat.initial_equations and not held:
        extra = _initial_level(flat, reduced, stages)
        values = solve_levels([extra], values, held=fixed, started=guess.started, title=title)
    return values


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
            raise InitializationError(
                f"{flat.name}: {one.name} starts at {found:g}, expected {one.low:g} to {one.high:g}, where its table is "
                "defined: start within, add points, or let it go on with outside='hold' or 'linear'",
                residuals=error.residuals,
            ) from None


def _initial_level(flat: FlatModel, reduced: Reduced, stages: list[Level]) -> Level:
    rows = reduced.to_reduced(ca.vertcat(*(e.residual for e in flat.initial_equations))).elements()
    return Level(
        tuple(r for s in stages for r in s.residuals) + tuple(rows),
        tuple(n for s in stages for n in s.names)
        + tuple(f"initial equation of {e.name}" for e in flat.initial_equations),
        tuple(n for s in stages for n in s.unknowns),
    )
