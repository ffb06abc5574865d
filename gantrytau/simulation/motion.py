"""The equations of motion in all coordinates of a model, made of its translated equations."""

from collections.abc import Collection, Mapping, Sequence

import casadi as ca

from gantrytau.border.refusal import ModelError
from gantrytau.compiler.blocks.pattern import block_pattern
from gantrytau.compiler.blocks.pivots import Guide
from gantrytau.compiler.blocks.solution import SolvedBlocks, solve_anew, solve_blocks
from gantrytau.compiler.index_reduction import Key
from gantrytau.compiler.symbol_spaces import column
from gantrytau.compiler.translated import Translated
from gantrytau.language.symbols import derivative_name, split_derivative, time
from gantrytau.simulation.dependents import definitions_of, dependents
from gantrytau.simulation.events.impulses import turning
from gantrytau.simulation.events.margins import Switches
from gantrytau.simulation.events.modes import in_modes, sorted_out
from gantrytau.simulation.events.rounds import rounds_of
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.memory.hermite import ORDER
from gantrytau.simulation.signals import SampledCourse, Signal
from gantrytau.simulation.singular_poses import Conditioning


def all_coordinates(
    dae: Translated, signals: Mapping[str, Signal], outputs: Sequence[str] = ()
) -> Coordinates:
    """The model in all its coordinates, with inputs as signals say; ModelError for one that is not known well enough."""
    sampled = tuple(n for n in dae.known if isinstance(signals.get(n), SampledCourse))
    held = tuple(s.name for s in dae.flat.sampled)
    width = 2 * len(sampled) + len(held) + len(dae.flat.discretes) + (ORDER + 1) * len(dae.flat.delays)
    w, t0 = ca.SX.sym("w", width), ca.SX.sym("t0")
    chains, given = dae.reduced.chains, dependents(dae)
    states = _states(dae, {name for _, name in given})
    rates = column([chains.rate(n) for n in states])
    highest = {derivative_name(n, top): chains.sx(n, top) for n, top in dae.indexed.orders.items()}
    known = _known_symbols(dae, signals, sampled, w, t0, outputs)
    pieces = in_modes(dae, known)
    last = {(i, c): pieces.residuals[i, c] for i, c in enumerate(dae.indexed.counts)}
    solved = _highest_blocks(dae, states, last, highest, pieces.numbers(dae.start))
    definitions = [(dae.table.symbols[n], ca.SX(dae.table.values[n])) for n in dae.table.independent]
    definitions += [(chains.named(n), e) for n, e in pieces.known.items()]
    substitution = solved.after([*definitions, *definitions_of(dae, given, pieces.residuals)])
    levels, rows = _invariants(dae, {i for i, _ in given}, pieces.residuals)
    moving = [rates, column(solved.residuals), column(pieces.conditions), *levels, *turning(dae, pieces)]
    slopes = ca.densify(ca.jacobian(column(list(last.values())), column(list(highest.values()))))
    renewal = dae.to_reduced(column([s.expression for s in dae.flat.sampled]))
    found = substitution.inserted([*moving, slopes, dae.openings, renewal, *_matrices(solved)])
    turns, outside = sorted_out(pieces.switched.switches, found[: len(moving)], substitution)
    ode, algebraic, conditions, *rest = outside.inserted(found)
    invariants, (pivots, dropped, renewed, *matrices) = rest[: len(levels)], rest[len(moving) - 3 :]
    w = ca.vertcat(w, *(turn.mode for turn in turns))
    arguments = [column([chains.named(n) for n in states]), column(solved.tears), time, t0, w]
    switches = Switches(turns, arguments, ode, algebraic)
    divisors = _divisors(solved, pivots, list(last), list(highest))
    at_events = _at_events(dae, len(sampled), w, len(turns))
    constraints = _constraints(dae, invariants, states)
    return Coordinates(
        dae=dae,
        states=states,
        algebraics=tuple(y.name() for y in solved.tears),
        sampled=sampled,
        held=held,
        x=arguments[0],
        z=arguments[1],
        w=w,
        t0=t0,
        ode=ode,
        algebraic=algebraic,
        invariants=tuple(invariants),
        rows=tuple(rows),
        known=known,
        substitutions=(substitution, outside),
        pivots=pivots,
        pieces=pieces,
        switches=switches,
        rounds=rounds_of(dae, states, conditions, (substitution, outside), switches, arguments),
        dropped=ca.Function("dropped", [arguments[0], *arguments[2:]], [ca.densify(dropped)], {"cse": True}),
        renewal=renewed,
        conditioning=Conditioning(*constraints, divisors, matrices, arguments, at_events),
    )


def _at_events(dae: Translated, sampled: int, w: ca.SX, switches: int) -> list[int]:
    """Which of the inputs w change at events only: Discretes, and modes, which stand last."""
    first = 2 * sampled + len(dae.flat.sampled)
    return [*range(first, first + len(dae.flat.discretes)), *range(w.numel() - switches, w.numel())]


def _states(dae: Translated, follow: Collection[str]) -> tuple[str, ...]:
    """Every derivative below the highest of the variables that do not follow from others."""
    orders = dae.indexed.orders
    return tuple(
        derivative_name(n, k)
        for k in range(max(orders.values(), default=0))
        for n, top in orders.items()
        if k < top and n not in follow
    )


def _highest_blocks(
    dae: Translated,
    states: Sequence[str],
    last: Mapping[Key, ca.SX],
    highest: Mapping[str, ca.SX],
    modes: Mapping[str, float],
) -> SolvedBlocks:
    """The blocks that give the highest derivatives; pivots are those of the same equations at lower ones, or by value."""
    incidence = {key: dae.indexed.incidence[key] for key in last}
    pattern = block_pattern(incidence, highest).blocks

    def guide(careful: bool) -> Guide:
        found = Guide({**dae.start, **modes}, dae.table.values, states, modes=modes, careful=careful)
        for block in dae.blocks:
            if not highest.keys() & set(block.unknowns):
                block.enter(found)
        return found

    quick = solve_blocks(pattern, last, highest, guide(False))
    careful = solve_anew(quick, last, highest, guide(True)) if quick.margins else quick
    # more unknowns of the integrator are no gain: they need consistent starts
    return quick if len(careful.tears) > len(quick.tears) else careful


def _divisors(
    solved: SolvedBlocks, pivots: ca.SX, equations: Sequence[Key], unknowns: Sequence[str]
) -> list[ca.SX]:
    """Divisors of the equations solved for one unknown."""
    rows, columns = ({key: k for k, key in enumerate(keys)} for keys in (equations, unknowns))
    return [pivots[rows[key], columns[name]] for b in solved.blocks for key, name in b.pairs]


def _matrices(solved: SolvedBlocks) -> list[ca.SX]:
    """Jacobians of the blocks of several unknowns; each must be regular for its unknowns to be determined."""
    several = [b for b in solved.blocks if len(b.unknowns) > 1 and b.tears]
    return [ca.jacobian(ca.vertcat(*b.residuals), ca.vertcat(*b.tears)) for b in several]


def _constraints(dae: Translated, invariants: list[ca.SX], states: Sequence[str]) -> tuple[ca.SX, list[int]]:
    """Jacobian of the constraints of speeds, and which of its columns belong to dependent coordinates."""
    if not invariants:
        return ca.SX(0, 0), []
    level = [derivative_name(n, top - 1) for n, top in dae.indexed.orders.items() if top]
    names = [n for n in level if n in set(states)]
    speeds = ca.vertcat(*(dae.reduced.chains.named(n) for n in names))
    jacobian = ca.jacobian(invariants[-1], speeds)
    used = [j for j in range(len(names)) if jacobian[:, j].nnz()]
    chosen = set(dae.choice.states)
    return jacobian[:, used], [k for k, j in enumerate(used) if names[j] not in chosen]


def _invariants(
    dae: Translated, used: set[int], residuals: Mapping[Key, ca.SX]
) -> tuple[list[ca.SX], list[tuple[str, ...]]]:
    """Residuals of the levels below the last, positions, then velocities, and the names of their equations.

    used: equations that give dependent variables, which hold anyway.
    """
    counts, found, names = dae.indexed.counts, [], []
    for stage in range(-max(counts, default=0), 0):
        rows = [(i, stage + c) for i, c in enumerate(counts) if stage + c >= 0 and i not in used]
        found.append(ca.vertcat(*(residuals[key] for key in rows)) if rows else ca.SX(0, 1))
        names.append(tuple(dae.reduced.equations[i].name for i, _ in rows))
    return found, names


def _known_symbols(
    dae: Translated,
    signals: Mapping[str, Signal],
    sampled: Sequence[str],
    w: ca.SX,
    t0: ca.SX,
    outputs: Sequence[str],
) -> dict[str, ca.SX]:
    """Inputs and those of their derivatives that occur, as expressions of time and samples, and what is held."""
    sampled_at = dae.to_reduced(column([s.expression for s in dae.flat.sampled]))
    occurring = {leaf.name() for leaf in ca.symvar(sampled_at)}
    occurring |= {x.name for row in dae.indexed.incidence.values() for x in row}
    for asked in (*dae.variables, *(n for name in outputs for n in dae.expand(name))):
        alias = dae.root(asked)
        if alias is not None and alias.root in dae.known:
            occurring.add(alias.symbol)
    starts = {n for v in dae.flat.variables if v.start is not None for n in v.elements}
    known: dict[str, ca.SX] = {}
    for name in dae.inputs:
        signal = signals.get(name)
        top = max((k for b, k in map(split_derivative, occurring) if b == name), default=0)
        if isinstance(signal, SampledCourse):
            if top > 0:
                raise ModelError(
                    f"input {name} is differentiated {top} times by the model, which samples do not allow; give "
                    "a function of time that accepts symbols, or pass the samples through a filter component"
                )
            k = sampled.index(name)
            known[name] = w[k] + w[len(sampled) + k] * (time - t0)
            continue
        if signal is None:
            if name not in starts:
                raise ModelError(
                    f"input {name} has no value; give inputs={{'{name}': ...}}, or a start value"
                )
            signal = ca.SX(dae.start[name])
        for order in range(top + 1):
            known[derivative_name(name, order)] = signal
            signal = ca.densify(ca.jacobian(signal, time))
    held = (*(s.name for s in dae.flat.sampled), *dae.flat.discretes)
    own, *past = ca.vertsplit(
        w[2 * len(sampled) :], [0, *range(len(held), w.numel() - 2 * len(sampled) + 1, ORDER + 1)]
    )
    known.update(zip(held, own.elements(), strict=True))
    for one, coefficients in zip(dae.flat.delays, past, strict=True):
        known[one.name] = ca.polyval(coefficients[::-1], time - t0)
    return known
