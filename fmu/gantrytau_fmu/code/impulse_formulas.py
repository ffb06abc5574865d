"""What jumps in an FMU where a switch turns, in the symbols of the arrays: equations of simulation/events/impulses.py."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca

from gantrytau.border.refusal import ModelError
from gantrytau.compiler.symbol_spaces import Substitution
from gantrytau.language.symbols import split_derivative
from gantrytau.simulation.events.impulses import Levels, stepping, turning
from gantrytau_fmu.code.switching import WithModes


@dataclass(frozen=True, eq=False)
class ImpulseFormulas:
    """symbols: all variables with their derivatives, of the system; jacobian, by_level: in `y`, which stands for them, and
    in jumps `j`, a column for each level; states: their places in y.
    """

    levels: Levels
    symbols: ca.SX
    y: ca.SX
    j: ca.SX
    jacobian: ca.SX
    by_level: tuple[ca.SX, ...]
    states: list[int]

    @property
    def arrays(self) -> dict[str, ca.SX]:
        """Symbols of its own, by array."""
        return {"y": self.y, "j": self.j}

    @property
    def everything(self) -> tuple[ca.SX, ...]:
        """All expressions."""
        return self.symbols, self.jacobian, *self.by_level


def turning_names(found: WithModes) -> frozenset[str]:
    """Names of the modes whose turns may be impulses."""
    return frozenset(mode.name() for mode in turning(found.dae, found.pieces))


def impulses_of(
    found: WithModes, outside: Substitution, at_once: Callable[[Sequence[ca.SX]], list[ca.SX]]
) -> ImpulseFormulas:
    """outside: modes that are not kept; at_once: leads from reduced symbols to those of the arrays. Where nothing can jump
    there are no formulas.
    """
    dae = found.dae
    if steps := stepping(dae, found.pieces):
        raise ModelError(
            f"{dae.name}: found {steps[0]}, which is set at instants, in an equation that is differentiated, expected one "
            "that is not in an FMU; let it drive a force or a current, or pass it through a filter"
        )
    known = tuple(n for n in dae.symbols if split_derivative(n)[0] in set(dae.known))
    levels = Levels(dae, found.pieces.residuals, known)
    if not turning_names(found):
        nothing = ca.SX(0, 1)
        return ImpulseFormulas(levels, nothing, nothing, nothing, nothing, (), [])
    states = [levels.names.index(n) for n in dae.choice.states]
    most = int(levels.counts.max(initial=0))
    y, j = ca.SX.sym("y", len(levels.names)), ca.SX.sym("j", levels.counts.size * most)
    columns = ca.horzsplit(ca.reshape(j, levels.counts.size, most))
    rows = [ca.vec(ca.densify(levels.jacobian))]
    for k in range(1, most + 1):  # inputs do not say by how much they jump
        rows.append(ca.vertcat(*levels.lacking(k), levels.balance(k, columns, ca.SX(len(known), 1))))
    rows = outside.inserted([ca.densify(e) for e in rows])
    jacobian, *by_level = ca.substitute(rows, [levels.symbols[0]], [y])
    symbols = ca.vertcat(*at_once(levels.symbols[0].elements()))
    return ImpulseFormulas(levels, symbols, y, j, jacobian, tuple(by_level), states)
