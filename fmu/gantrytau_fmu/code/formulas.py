"""The formulas of an FMU, taken from a Dae: what the runtime evaluates, in the arrays that it holds.

t time, x states, u what is known from outside (inputs, then sampled variables, then Discretes, then
what is delayed), z unknowns of the blocks
that have no closed form, p parameters, e which conditions of whens have become true, m modes of frictions with exact
stick-slip (1 forward, -1 backward, 0 locked), then of what switches, y all variables with their derivatives, j their
jumps. The force of such a friction is one of the z; its
equation depends on the mode.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca

from gantrytau import Dae
from gantrytau.compiler.blocks.solution import SolvedBlocks
from gantrytau.compiler.system import System
from gantrytau.compiler.translated import carefully
from gantrytau.flattening.flat_checks import refuse_events
from gantrytau.language.piecewise import switched
from gantrytau.language.symbols import split_derivative
from gantrytau_fmu.code.arrays import column
from gantrytau_fmu.code.fmu_starts import Starts, starts_of
from gantrytau_fmu.code.impulse_formulas import ImpulseFormulas, impulses_of, turning_names
from gantrytau_fmu.code.jumps import JumpFormulas, jump_of
from gantrytau_fmu.code.switching import Switching, WithModes, switching, written

HOLD = 0.01  # s, time in which the speed left at the instant of locking dies away


@dataclass(frozen=True, eq=False)
class ImplicitBlock:
    """Equations 0 = residual for some of the z; linear: in them; frictions: the forces of frictions are among them."""

    names: tuple[str, ...]
    unknowns: ca.SX
    residual: ca.SX
    linear: bool
    frictions: bool


@dataclass(frozen=True, eq=False)
class Formulas:
    """Expressions in the symbols of `arrays`, by name of the array.

    careful: the same with other pivots, for where those of closed forms are small; margins: positive elsewhere. outputs:
    expression by name; samples: new values of `held`, clocks: which period each follows; jump: what whens do; impulses: what
    jumps where a switch turns; friction: speed and breakaway force by turns; delays: what is known from the past, past:
    expressions of which it is that, delay_times: in s; roots: name of an unknown -> what comes to zero where its closed form
    ends; switching: what turns at events.
    """

    dae: Dae
    arrays: Mapping[str, ca.SX]
    states: tuple[str, ...]
    rates: ca.SX
    inputs: tuple[str, ...]
    held: tuple[str, ...]
    samples: ca.SX
    clocks: tuple[int, ...]
    periods: ca.SX
    discretes: tuple[str, ...]
    jump: JumpFormulas
    impulses: ImpulseFormulas
    delays: tuple[str, ...]
    past: ca.SX
    delay_times: ca.SX
    blocks: tuple[ImplicitBlock, ...]
    outputs: Mapping[str, ca.SX]
    frictions: tuple[str, ...]
    friction: ca.SX
    roots: Mapping[str, ca.SX]
    starts: Starts
    parameters: tuple[str, ...]
    margins: ca.SX
    switching: Switching
    careful: "Formulas | None" = None

    @property
    def residuals(self) -> ca.SX:
        """Of all blocks, one below the other."""
        return column([b.residual for b in self.blocks])

    @property
    def z_names(self) -> tuple[str, ...]:
        """Names of the unknowns of all blocks."""
        return tuple(n for b in self.blocks for n in b.names)

    @property
    def start_parameters(self) -> frozenset[str]:
        """Parameters on which start values, sampling periods or delays depend: they act during initialisation only."""
        fixed = column([self.periods, self.delay_times])
        return self.starts.parameters | {s.name() for s in ca.symvar(fixed)}


def formulas_of(dae: Dae, outputs: Sequence[str]) -> Formulas:
    """The formulas of a translated model; outputs: scalar names of what can be read of it, states and all."""
    refuse_events(dae.flat, "laws")
    found = written(dae)
    dae = found.dae
    careful = carefully(dae, SolvedBlocks(dae.blocks)).blocks
    pairs = list(zip(dae.blocks, careful, strict=True))
    # what is left implicit is solved with pivots chosen by value anyway
    quick = tuple(block if other.solution is not None else other for block, other in pairs)
    ways = [replace(found, dae=replace(dae, blocks=blocks)) for blocks in (quick, careful)]
    thrown = turning_names(found)
    kept = frozenset(t.mode.name() for way in ways for t in switching(way, way.dae.system(), thrown).turns)
    first = _formulas(ways[0], outputs, kept)
    if first.margins.is_constant():
        return first
    return replace(first, careful=_formulas(ways[1], outputs, kept))


def _formulas(found: WithModes, outputs: Sequence[str], kept: frozenset[str]) -> Formulas:
    """kept: names of the modes that are known."""
    dae, system = found.dae, found.dae.system()
    outputs, flat = _evaluated(dae, outputs), dae.flat
    sampled, frictions = flat.sampled, flat.frictions
    turning = switching(found, system, kept)

    def at_once(expressions: Sequence[ca.SX]) -> list[ca.SX]:
        """In symbols of the system, modes that are not kept by their margins."""
        return turning.outside.inserted(system.to_system(expressions)) if expressions else []

    wanted = at_once([dae.expression(n) for n in outputs])
    updates = at_once([dae.to_reduced(s.expression) for s in sampled])
    slides, rows, friction = _frictions(found, system)
    initial = at_once([dae.to_reduced(e.residual) for e in flat.initial_equations])
    past = at_once(found.past)
    everything = [system.ode, system.residuals, *wanted, *updates, *rows, friction, *initial, *past]
    jump, impulses = jump_of(found, at_once), impulses_of(found, turning.outside, at_once)
    differentiated = _input_derivatives(dae, column([*everything, *jump.everything, *impulses.everything]))
    free = [s for n, s in zip(system.inputs, system.u.elements(), strict=True) if n in set(dae.inputs)]
    instants = (*(s.name for s in sampled), *flat.discretes, *(d.name for d in flat.delays))
    held = [_symbol(system, n) for n in instants]
    blocks = _blocks(system, frictions, [_symbol(system, f.force) for f in frictions], rows)
    arrays = {
        "t": system.time,
        "x": system.x,
        "u": column([*free, *differentiated.values(), *held]),
        "z": column([b.unknowns for b in blocks]),
        "p": system.p,
        "m": column([*slides, turning.modes]),
        "e": jump.rose,
        **impulses.arrays,
    }
    periods, clocks = _clocks(system, sampled)
    return Formulas(
        dae=dae,
        arrays=arrays,
        states=dae.states,
        rates=system.ode,
        inputs=(*dae.inputs, *differentiated),
        held=tuple(s.name for s in sampled),
        samples=column(updates),
        clocks=clocks,
        periods=periods,
        discretes=flat.discretes,
        jump=jump,
        impulses=impulses,
        delays=tuple(d.name for d in flat.delays),
        past=column([ca.densify(e) for e in past]),
        delay_times=column(at_once([dae.to_reduced(d.time) for d in flat.delays])),
        blocks=blocks,
        outputs=dict(zip(outputs, wanted, strict=True)),
        frictions=tuple(f.force for f in frictions),
        friction=friction,
        roots=_roots(system, turning),
        starts=starts_of(dae, at_once, column(initial), column([b.residual for b in blocks]), arrays),
        parameters=system.parameters,
        margins=column(at_once([m for b in dae.blocks if b.solution is not None for m in b.margins])),
        switching=turning,
    )


def _frictions(found: WithModes, system: System) -> tuple[list[ca.SX], list[ca.SX], ca.SX]:
    """Of frictions that stick: their modes, their equations, and speeds and breakaway forces by turns."""
    slides, rows, watched = [], [], []
    for friction, law in zip(found.dae.flat.frictions, found.laws, strict=True):
        mode, force = ca.SX.sym(f"(mode of {friction.force})"), _symbol(system, friction.force)
        moves = [found.dae.expression(name) for name in (friction.speed, f"der({friction.speed})")]
        v, a, coulomb, smooth, breakaway = system.to_system([*moves, *law])
        slides.append(mode)
        rows.append(ca.if_else(mode == 0, a + v / HOLD, force - mode * coulomb - smooth))
        watched += [v, breakaway]
    return slides, rows, column(watched)


def _evaluated(dae: Dae, outputs: Sequence[str]) -> list[str]:
    """What needs an output function: outputs that are no states, and parameters that follow from others."""
    instants = (*(s.name for s in dae.flat.sampled), *dae.flat.discretes)
    direct = {*dae.states, *(f"der({n})" for n in dae.states), *instants}
    dependent = [n for n, e in dae.table.expressions.items() if not e.is_constant()]
    varying = [n for n in outputs if n not in direct and not dae.expression(n).is_constant()]
    return [*dependent, *varying]


def _symbol(system: System, name: str) -> ca.SX:
    return system.u.elements()[system.inputs.index(name)]


def _input_derivatives(dae: Dae, everything: ca.SX) -> dict[str, ca.SX]:
    """Derivatives of inputs that occur: they are inputs, too."""
    known = set(dae.known)
    found = {}
    for leaf in ca.symvar(everything):
        base, order = split_derivative(leaf.name())
        if order and base in known:
            found[leaf.name()] = leaf

    def place(name: str) -> tuple[int, int]:
        base, order = split_derivative(name)
        return order, dae.known.index(base)

    return {name: found[name] for name in sorted(found, key=place)}


def _blocks(
    system: System, frictions: Sequence, forces: list[ca.SX], rows: list[ca.SX]
) -> tuple[ImplicitBlock, ...]:
    """The implicit blocks; those that depend on forces of frictions become one with the equations of these."""
    found: list[ImplicitBlock] = []
    place = 0
    names, unknowns, residuals = [f.force for f in frictions], list(forces), list(rows)
    merged = {f.name() for f in forces}
    for block in (b for b in system.dae.blocks if b.solution is None):
        own = [system.algebraics[place + k] for k in range(len(block.tears))]
        place += len(own)
        residual = column([a.residual for a in own])
        if merged & {leaf.name() for leaf in ca.symvar(residual)}:
            names += [a.name for a in own]
            unknowns += [a.symbol for a in own]
            residuals.append(residual)
            merged |= {a.name for a in own}
        else:
            symbols = column([a.symbol for a in own])
            found.append(_block([a.name for a in own], symbols, residual, False))
    if frictions:
        found.append(_block(names, column(unknowns), column(residuals), True))
    return tuple(found)


def _block(names: Sequence[str], unknowns: ca.SX, residual: ca.SX, frictions: bool) -> ImplicitBlock:
    smooth = not switched([residual], set(names)).switches
    linear = smooth and not ca.depends_on(ca.jacobian(residual, unknowns), unknowns)
    return ImplicitBlock(tuple(names), unknowns, residual, linear, frictions)


def _roots(system: System, turning: Switching) -> dict[str, ca.SX]:
    """Of blocks in closed form: square roots, and determinants of those with several unknowns, relative to nothing."""
    found = {}
    for block in system.dae.blocks:
        if block.root is not None:
            found[block.tears[0].name()] = ca.sqrt(block.root.radicand)
        elif block.kind == "spheres" and block.solution is not None:
            found[block.tears[0].name()] = ca.det(
                ca.jacobian(ca.vertcat(*block.residuals), ca.vertcat(*block.tears))
            )
    values = turning.outside.inserted(system.to_system(list(found.values()))) if found else []
    return dict(zip(found, values, strict=True))


def _clocks(system: System, sampled: Sequence) -> tuple[ca.SX, tuple[int, ...]]:
    """Different periods, and which of them each sampled variable follows."""
    periods: list[ca.SX] = []
    texts: list[str] = []
    clocks = []
    for expression in system.to_system([system.dae.to_reduced(s.period) for s in sampled]):
        if str(expression) not in texts:
            texts.append(str(expression))
            periods.append(expression)
        clocks.append(texts.index(str(expression)))
    return column(periods), tuple(clocks)
