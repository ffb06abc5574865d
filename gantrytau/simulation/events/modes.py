"""Equations of motion written with modes: between two events they are smooth, whatever they switch on.

Modes are known like inputs, so that a block that switches on its own unknowns has the closed form of its piece. What only
results look at needs no events: such modes follow from their margins wherever they are asked for.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau.compiler.index_reduction import Key
from gantrytau.compiler.symbol_spaces import Substitution, column, values_at
from gantrytau.compiler.translated import Translated
from gantrytau.language.piecewise import Switched, Turn, switched, with_modes
from gantrytau.simulation.events.poles import without_poles


@dataclass(frozen=True, eq=False)
class InModes:
    """Residuals by (equation, times differentiated), expressions of known symbols by name, conditions of whens,
    then of ranges that are left, then what is delayed, and what switches in them.
    """

    residuals: Mapping[Key, ca.SX]
    known: Mapping[str, ca.SX]
    conditions: tuple[ca.SX, ...]
    switched: Switched

    def numbers(self, point: Mapping[str, float]) -> dict[str, float]:
        """The modes, by name, where all symbols have these values."""
        modes = [turn.mode for turn in self.switched.switches]
        if not modes:
            return {}
        found = values_at(ca.vertcat(*with_modes(self.switched, modes)), point).ravel().tolist()
        return {mode.name(): value for mode, value in zip(modes, found, strict=True)}

    def asked(self, mode: str, dae: Translated) -> str:
        """Condition of a switch, in the model's names."""
        modes = {turn.mode.name(): turn for turn in self.switched.switches}
        leaves = {leaf.name() for leaf in ca.symvar(modes[mode].margin)}
        inner = [self.asked(name, dae) for name in sorted(leaves & modes.keys())]
        names = sorted(dae.spoken(name) for name in leaves - modes.keys() - set(dae.table.independent))
        return f"the condition on {', '.join(names)}" if names else inner[0]


def in_modes(dae: Translated, known: Mapping[str, ca.SX]) -> InModes:
    """The equations of a model, its known symbols (their expressions in time) and its conditions with modes."""
    residuals = dae.indexed.residuals
    left = [(r.expression < r.low) + (r.expression > r.high) for r in dae.flat.ranges]
    whens, past = [one.condition for one in dae.flat.whens], [one.expression for one in dae.flat.delays]
    conditions = dae.to_reduced(column([*whens, *left, *past])).elements()
    rows = [*residuals.values(), *known.values(), *conditions]
    steady = set(dae.table.independent)
    names = {leaf.name() for leaf in ca.symvar(ca.vertcat(*rows))} - steady if rows else set()
    found = switched(rows, names, smooth=False)
    written = iter(found.expressions)
    first = {key: next(written) for key in residuals}
    return InModes(first, {name: next(written) for name in known}, tuple(written), found)


def sorted_out(
    turns: Sequence[Turn], moving: Sequence[ca.SX], substitution: Substitution
) -> tuple[list[Turn], Substitution]:
    """The turns that motions depend on, and the modes of the others as what they are.

    moving: expressions of the motions; margins come out in their symbols, as those of `substitution` lead to them.
    """
    # poles as they are written: solutions of equations that divide are exact as they are, and would not be without
    margins = [turn.margin if turn.counts else without_poles(turn.margin) for turn in turns]
    margins = substitution.inserted(margins)
    turns = [Turn(turn.mode, m, turn.closed, turn.counts) for turn, m in zip(turns, margins, strict=True)]
    own = {turn.mode.name() for turn in turns}
    turns = _in_order(turns, own)
    needed = _modes_in(ca.vertcat(*(ca.vec(e) for e in moving)), own) if turns else set()
    settled: set[str] = set()
    for turn in turns:  # a mode that hangs on itself, or on one behind it, cannot follow from its margin
        within = _modes_in(turn.margin, own)
        if not within <= settled:
            needed.add(turn.mode.name())
        settled.add(turn.mode.name())
    found: set[str] = set()
    while needed != found:
        found = set(needed)
        for turn in reversed(turns):
            if turn.mode.name() in needed:
                needed |= _modes_in(turn.margin, own)
    live = [turn for turn in turns if turn.mode.name() in needed]
    rest = tuple((turn.mode, turn.value) for turn in turns if turn.mode.name() not in needed)
    return live, Substitution(rest)


def _in_order(turns: Sequence[Turn], own: set[str]) -> list[Turn]:
    """The turns with those before each that its margin hangs on, wherever they do not hang on each other.

    Equations come in the order in which they are written, which need not be that in which one follows from another.
    """
    left = {turn.mode.name(): turn for turn in turns}
    within = {name: _modes_in(turn.margin, own) - {name} for name, turn in left.items()}
    ordered: list[Turn] = []
    while left:
        free = [name for name in left if not within[name] & left.keys()]
        ordered += [left.pop(name) for name in free or [next(iter(left))]]
    return ordered


def _modes_in(expression: ca.SX, modes: set[str]) -> set[str]:
    return {leaf.name() for leaf in ca.symvar(expression)} & modes
