"""What happens in an FMU where conditions become true: Discretes and states get new values, or the run ends."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import casadi as ca

from gantrytau import Dae
from gantrytau.flattening.flat_model import When
from gantrytau.flattening.whens import one_round
from gantrytau_fmu.code.arrays import column
from gantrytau_fmu.code.switching import WithModes


@dataclass(frozen=True, eq=False)
class JumpFormulas:
    """One round of the whens of a model, in the symbols of the arrays.

    conditions: 1 where they hold, in modes; rose: symbols, 1 where a condition has become true; acts: which whens act;
    discretes, values: new values of the Discretes and of the states whose places are `states`; labels: where the whens
    are stated, messages: what they say of the end of the run, "" of those that do not end it; initially: whether they act at
    the start, too, failures: words of the errors that they are instead of acting, "" of those that act; waits: whether
    they act only in rounds in which none of the others does.
    """

    conditions: ca.SX
    rose: ca.SX
    acts: ca.SX
    discretes: ca.SX
    states: tuple[int, ...]
    values: ca.SX
    labels: tuple[str, ...]
    messages: tuple[str, ...]
    initially: tuple[bool, ...]
    failures: tuple[str, ...]
    waits: tuple[bool, ...]

    @property
    def everything(self) -> tuple[ca.SX, ...]:
        """All expressions."""
        return self.conditions, self.discretes, self.values


def with_ends_of_tables(dae: Dae) -> Dae:
    """A model in which leaving a table that is not defined beyond its ends is a when that fails."""
    leaving = [
        When(
            ca.logic_or(one.expression < one.low, one.expression > one.high),
            (), (), "", "", dae.name, 0, words=f"end of the table of {one.name}", initially=True, failure=one.left,
        )
        for one in dae.flat.ranges
    ]  # fmt: skip
    return replace(dae, flat=replace(dae.flat, whens=(*dae.flat.whens, *leaving)))


def jump_of(found: WithModes, to_system: Callable[[Sequence[ca.SX]], list[ca.SX]]) -> JumpFormulas:
    """The round of a model's whens; to_system: leads from reduced symbols to those of the arrays."""
    dae, whens = found.dae, found.dae.flat.whens
    round_ = one_round(dae.flat)
    places, values = [], []
    for name, value in round_.states:
        alias = dae.reduced.aliases[name]  # factor * root + offset
        places.append(dae.choice.states.index(alias.symbol))
        values.append((dae.to_reduced(value) - alias.offset) / alias.factor)
    discretes = [dae.to_reduced(e) for e in round_.discretes.elements()]
    return JumpFormulas(
        conditions=column([ca.densify(e) for e in to_system(found.conditions)]),
        rose=round_.rose,
        acts=round_.acts,
        discretes=column(to_system(discretes)),
        states=tuple(places),
        values=column(to_system(values)),
        labels=tuple(one.label for one in whens),
        messages=tuple(one.message for one in whens),
        initially=tuple(one.initially for one in whens),
        failures=tuple(one.failure for one in whens),
        waits=tuple(one.waits for one in whens),
    )
