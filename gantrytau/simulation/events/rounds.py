"""What whens make of a place where their conditions become true: functions of states, algebraics, time and what is held."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.compiler.symbol_spaces import Substitution, column
from gantrytau.compiler.translated import Translated
from gantrytau.flattening.flat_model import When
from gantrytau.flattening.whens import one_round
from gantrytau.simulation.events.at_places import AtPlaces
from gantrytau.simulation.events.margins import Switches
from gantrytau.simulation.singular_poses import Point

MOST = 100  # rounds at one instant


@dataclass(frozen=True)
class Made:
    """What one round makes: which whens act, (whens,); new values of the Discretes, and of the states at `Rounds.places`."""

    acts: np.ndarray
    discretes: np.ndarray
    states: np.ndarray


@dataclass(frozen=True, eq=False)
class Rounds:
    """The whens of a model. places: of the states that they set, in x; of: of the switches in each condition.

    left: which of its ranges are left; past: what is delayed, in the arguments of the functions.
    """

    whens: tuple[When, ...]
    places: np.ndarray
    of: tuple[tuple[int, ...], ...]
    conditions: AtPlaces
    left: ca.Function
    past: ca.SX
    jump: AtPlaces

    def holding(self, point: Point) -> np.ndarray:
        """Whether each condition holds at a point."""
        return self._at(self.conditions, point)[0] != 0

    def rising(self, now: np.ndarray, holding: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which conditions became true, and which hold from now on; those that wait for others count as not yet true.

        now, holding: which conditions hold, and which did when they were looked at last.
        """
        rose = now & ~holding
        waits = rose & [one.waits for one in self.whens]
        waits = waits if (rose & ~waits).any() else waits & False
        return rose & ~waits, now & ~waits

    def made(self, point: Point, rose: np.ndarray) -> Made:
        """A round at a point where some conditions became true."""
        return Made(*self._at(self.jump, point, rose.astype(float)))

    def not_finite(self, made: Made, discretes: Sequence[str], states: Sequence[str]) -> str:
        """The name of a new value that is not finite; "" without one."""
        names = [*discretes, *(states[i] for i in self.places.tolist())]
        values = np.concatenate([made.discretes, made.states])
        return next((n for n, value in zip(names, values, strict=True) if not np.isfinite(value)), "")

    def labels(self, chosen: np.ndarray) -> list[str]:
        """Where some whens are stated, and on what condition."""
        return [one.label for one, some in zip(self.whens, chosen, strict=True) if some]

    @staticmethod
    def _at(function: AtPlaces, point: Point, *more: np.ndarray) -> list[np.ndarray]:
        x, z, t, w = point
        return [f[0] for f in function(x[None], z[None], t, t, w[None], *(a[None] for a in more))]


def rounds_of(
    dae: Translated,
    states: Sequence[str],
    conditions: ca.SX,
    substitutions: Sequence[Substitution],
    switches: Switches,
    arguments: Sequence[ca.SX],
) -> Rounds:
    """The whens in the symbols of a simulation.

    conditions: of whens, then of ranges that are left, then what is delayed, with modes; substitutions: one
    after another, from reduced symbols to the arguments, x, z, time, t0, w.
    """
    jump = one_round(dae.flat)
    roots = [dae.reduced.aliases[name] for name, _ in jump.states]
    values = [dae.to_reduced(a.root_value(value)) for a, (_, value) in zip(roots, jump.states, strict=True)]
    found = [dae.to_reduced(jump.acts), dae.to_reduced(jump.discretes), column(values)]
    for substitution in substitutions:
        found = substitution.inserted(found)
    acts, discretes, new = found
    rose = [jump.rose] if dae.flat.whens else [ca.SX.sym("rose", 0)]
    made = [ca.densify(e) for e in (acts, discretes, new)]
    first = len(dae.flat.whens)
    parts = [0, first, first + len(dae.flat.ranges), conditions.numel()]
    conditions, left, past = ca.vertsplit(conditions, parts)
    return Rounds(
        dae.flat.whens,
        np.array([states.index(a.symbol) for a in roots], dtype=int),
        _switches_of(conditions, switches),
        AtPlaces(ca.Function("conditions", list(arguments), [ca.densify(conditions)], {"cse": True})),
        ca.Function("left", list(arguments), [ca.densify(left)], {"cse": True}),
        past,
        AtPlaces(ca.Function("jump", [*arguments, *rose], made, {"cse": True})),
    )


def _switches_of(conditions: ca.SX, switches: Switches) -> tuple[tuple[int, ...], ...]:
    """The switches in each condition, and in the margins of these."""
    places = {turn.mode.name(): k for k, turn in enumerate(switches.turns)}
    found = []
    for condition in conditions.elements():
        own: set[int] = set()
        left = [condition]
        while left:
            new = {places[n] for leaf in ca.symvar(left.pop()) if (n := leaf.name()) in places} - own
            own |= new
            left += [switches.turns[k].margin for k in new]
        found.append(tuple(sorted(own)))
    return tuple(found)
