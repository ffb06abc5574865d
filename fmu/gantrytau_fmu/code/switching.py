"""What switches in the equations of an FMU: modes, which are known between two events, and margins, whose zeros turn them.

Only what motions depend on gets a mode that is kept; what outputs alone look at follows from its margin wherever it is
asked for. Both ways of solving the blocks share the modes.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import casadi as ca

from gantrytau import Dae
from gantrytau.compiler.blocks.pattern import SparsityPattern
from gantrytau.compiler.symbol_spaces import Substitution
from gantrytau.compiler.system import System
from gantrytau.compiler.translated import solved
from gantrytau.language.piecewise import Turn
from gantrytau.simulation.events.margins import ROUNDING
from gantrytau.simulation.events.modes import InModes, in_modes, sorted_out
from gantrytau.simulation.events.phases import phases
from gantrytau.simulation.state_sizes import nominal_sizes
from gantrytau_fmu.code.arrays import column


@dataclass(frozen=True, eq=False)
class WithModes:
    """A model whose equations hold modes; laws: those of its frictions, (coulomb, smooth, breakaway) each; conditions: of
    its whens; past: what its delays look back at.
    """

    dae: Dae
    pieces: InModes
    laws: tuple[tuple[ca.SX, ca.SX, ca.SX], ...]
    conditions: tuple[ca.SX, ...]
    past: tuple[ca.SX, ...]


@dataclass(frozen=True, eq=False)
class Switching:
    """Turns of which each margin holds modes before it only, in the symbols of a system.

    noise: what rounding makes of a margin that is zero, without that of the time; timed: whether a margin is linear in
    time and holds nothing else that moves; conditions: what they ask for, in the model's words; outside: the other modes,
    as what they are; phases: arguments of sines, cosines and tangents, by which margins come and go.
    """

    turns: tuple[Turn, ...]
    noise: ca.SX
    timed: tuple[bool, ...]
    conditions: tuple[str, ...]
    outside: Substitution
    phases: ca.SX

    @property
    def modes(self) -> ca.SX:
        """Symbols of the modes."""
        return column([turn.mode for turn in self.turns])

    @property
    def margins(self) -> ca.SX:
        """They pass zero, or a whole number where a mode counts."""
        return column([ca.densify(turn.margin) for turn in self.turns])


def written(dae: Dae) -> WithModes:
    """The equations of a model with modes, its blocks solved anew; as they are where nothing switches."""
    frictions, whens = dae.flat.frictions, dae.flat.whens
    asked = [e for f in frictions for e in (f.coulomb, f.smooth, f.breakaway)] + [
        one.condition for one in whens
    ]
    pieces = in_modes(dae, {f"({k})": dae.to_reduced(e) for k, e in enumerate(asked)})
    found = list(pieces.known.values())
    count = 3 * len(frictions)
    laws = tuple((found[k], found[k + 1], found[k + 2]) for k in range(0, count, 3))
    modes = {turn.mode.name() for turn in pieces.switched.switches}
    if modes:
        point = {dae.flat.time.name(): 0.0, **dae.table.values, **dae.start}
        dae = replace(dae, start={**dae.start, **pieces.numbers(point)})
    if modes & {leaf.name() for leaf in ca.symvar(column(list(pieces.residuals.values())))}:
        dae = replace(dae, indexed=replace(dae.indexed, residuals=pieces.residuals))
        pattern = SparsityPattern(tuple((b.equations, b.unknowns) for b in dae.blocks), (), ())
        dae = replace(dae, blocks=solved(dae, pattern).blocks)
    past = pieces.conditions[len(pieces.conditions) - len(dae.flat.delays) :]
    return WithModes(dae, pieces, laws, tuple(found[count:]), past)


def moving(found: WithModes, system: System) -> ca.SX:
    """What motions depend on, and what is done when."""
    frictions = system.dae.flat.frictions
    speeds = [system.dae.expression(name) for f in frictions for name in (f.speed, f"der({f.speed})")]
    instants = [*speeds, *(e for law in found.laws for e in law), *found.conditions, *found.past]
    return column([system.ode, system.residuals, *(system.to_system(instants) if instants else [])])


def switching(found: WithModes, system: System, also: frozenset[str] = frozenset()) -> Switching:
    """The turns that the motions of a system depend on; also: names of modes that are kept beside."""
    way = Substitution(system.definitions)
    needed = [
        moving(found, system),
        *(t.mode for t in found.pieces.switched.switches if t.mode.name() in also),
    ]
    turns, outside = sorted_out(found.pieces.switched.switches, needed, way)
    margins = column([ca.densify(turn.margin) for turn in turns])
    seen = [margins, system.residuals] if ca.depends_on(margins, system.z) else [margins]
    return Switching(
        turns=tuple(turns),
        noise=_noise(system, margins),
        timed=tuple(_is_timed(system, turn.margin) for turn in turns),
        conditions=tuple(found.pieces.asked(turn.mode.name(), found.dae) for turn in turns),
        outside=outside,
        phases=phases(column(seen), ca.vertcat(system.time, system.x, system.z)),
    )


def _noise(system: System, margins: ca.SX) -> ca.SX:
    if not margins.numel():
        return margins
    nominal: Mapping[str, float] = nominal_sizes(system.dae)
    sizes = ca.SX(ca.DM([nominal.get(name, 1.0) for name in system.dae.choice.states]))
    terms = ca.fabs(ca.jacobian(margins, system.time) * system.time)
    if system.x.numel():
        terms += ca.fabs(ca.jacobian(margins, system.x)) @ ca.fmax(ca.fabs(system.x), sizes)
    if system.z.numel():
        terms += ca.fabs(ca.jacobian(margins, system.z)) @ ca.fabs(system.z)
    return ROUNDING * ca.densify(terms)


def _is_timed(system: System, margin: ca.SX) -> bool:
    rate = ca.jacobian(margin, system.time)
    return not (
        ca.depends_on(margin, ca.vertcat(system.x, system.z, system.u)) or ca.depends_on(rate, system.time)
    )
