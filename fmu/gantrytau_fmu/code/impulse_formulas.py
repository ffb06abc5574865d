"""What jumps in an FMU where a switch turns, in the symbols of the arrays: equations of simulation/events/impulses.py."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.compiler.alphabets import Substitution
from gantrytau.language.symbols import split_derivative
from gantrytau.simulation.events.impulses import Levels, turning
from gantrytau_fmu.code.switching import WithModes


@dataclass(frozen=True, eq=False)
class ImpulseFormulas:
    """symbols: all variables with their derivatives, of the system; jacobian, by_level: in `y`, which stands for them, and
    in jumps `j`, a column for each level; names, orders, counts, ends: of unknowns and equations as in Levels; states:
    places in y.
    """

    symbols: ca.SX
    y: ca.SX
    j: ca.SX
    jacobian: ca.SX
    by_level: tuple[ca.SX, ...]
    names: tuple[str, ...] = ()
    orders: tuple[int, ...] = ()
    counts: tuple[int, ...] = ()
    ends: tuple[int, ...] = ()
    states: tuple[int, ...] = ()

    @property
    def arrays(self) -> dict[str, ca.SX]:
        """Symbols of its own, by array."""
        return {"y": self.y, "j": self.j}

    @property
    def everything(self) -> tuple[ca.SX, ...]:
        """All expressions."""
        return self.symbols, self.jacobian, *self.by_level


NONE = ImpulseFormulas(ca.SX(0, 1), ca.SX(0, 1), ca.SX(0, 1), ca.SX(0, 1), ())


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
    if not turning_names(found):
        return NONE
    known = tuple(n for n in dae.symbols if split_derivative(n)[0] in set(dae.known))
    levels = Levels(dae, found.pieces.residuals, known)
    most = int(levels.counts.max(initial=0))
    y, j = ca.SX.sym("y", len(levels.names)), ca.SX.sym("j", levels.counts.size * most)
    columns = ca.horzsplit(ca.reshape(j, levels.counts.size, most))
    steps = ca.SX(len(known), 1)
    rows = [ca.vec(ca.densify(levels.jacobian))]
    rows += [ca.vertcat(*levels.lacking(k), levels.balance(k, columns, steps)) for k in range(1, most + 1)]
    jacobian, *by_level = ca.substitute(
        outside.inserted([ca.densify(e) for e in rows]), [levels.symbols[0]], [y]
    )
    places = {name: i for i, name in enumerate(levels.names)}
    return ImpulseFormulas(
        symbols=ca.vertcat(*at_once(levels.symbols[0].elements())),
        y=y,
        j=j,
        jacobian=jacobian,
        by_level=tuple(by_level),
        names=tuple(dae.indexed.orders),
        orders=_integers(levels.orders),
        counts=_integers(levels.counts),
        ends=_integers(levels.ends),
        states=tuple(places[n] for n in dae.choice.states),
    )


def _integers(values: np.ndarray) -> tuple[int, ...]:
    return tuple(int(v) for v in values)
