"""The equations of motion in all coordinates of a model, made of its translated equations."""

from collections.abc import Mapping, Sequence

import casadi as ca

from gantrytau.blocks import block_pattern
from gantrytau.conditioning import Conditioning
from gantrytau.coordinates import Coordinates
from gantrytau.dae import Dae
from gantrytau.dependents import definitions_of, dependents
from gantrytau.errors import ModelError
from gantrytau.guide import Guide
from gantrytau.signals import Samples, Signal
from gantrytau.solution import solve_blocks
from gantrytau.symbols import derivative_name, split_derivative, time


def all_coordinates(dae: Dae, signals: Mapping[str, Signal], outputs: Sequence[str] = ()) -> Coordinates:
    """The model in all its coordinates, with its inputs as the signals say. Raises ModelError for an input
    without value, or a sampled one that has to be differentiated.
    """
    sampled = tuple(n for n in dae.known if isinstance(signals.get(n), Samples))
    w, t0 = ca.SX.sym("w", 2 * len(sampled)), ca.SX.sym("t0")
    indexed, chains = dae.indexed, dae.reduced.chains
    given = dependents(dae)
    follow = {name for _, name in given}
    states = tuple(
        derivative_name(n, k)
        for k in range(max(indexed.orders.values(), default=0))
        for n, top in indexed.orders.items()
        if k < top and n not in follow
    )
    highest = {derivative_name(n, top): chains.sx(n, top) for n, top in indexed.orders.items()}
    last = {(i, c): indexed.residuals[i, c] for i, c in enumerate(indexed.counts)}
    guide = Guide(dae.start, dae.table.values, states)
    for block in dae.blocks:
        if not highest.keys() & set(block.unknowns):
            block.enter(guide)
    blocks = solve_blocks(block_pattern(last, highest).blocks, last, highest, guide)
    known = _known_symbols(dae, signals, sampled, w, t0, outputs)
    numbers = [(dae.table.symbols[n], ca.SX(dae.table.values[n])) for n in dae.table.independent]
    definitions = [*numbers, *((chains.named(n), e) for n, e in known.items())]
    definitions += definitions_of(dae, given)
    implicit = [b for b in blocks if b.solution is None]
    for block in blocks:
        definitions += block.definitions
    ode = (
        ca.vertcat(*(chains.sx(base, k + 1) for base, k in map(split_derivative, states)))
        if states
        else ca.SX(0, 1)
    )
    algebraic = ca.vertcat(*(r for b in implicit for r in b.residuals)) if implicit else ca.SX(0, 1)
    invariants, rows = _invariants(dae, {i for i, _ in given})
    tops = ca.vertcat(*highest.values()) if highest else ca.SX(0, 1)
    pivots = ca.jacobian(ca.vertcat(*last.values()), tops) if last else ca.SX(0, 0)
    v, e = [s for s, _ in definitions], [d for _, d in definitions]
    matrices = [
        ca.jacobian(ca.vertcat(*b.residuals), ca.vertcat(*b.tears))
        for b in blocks
        if len(b.unknowns) > 1 and b.tears
    ]
    residual = dae.table.reduce(ca.vertcat(*(e.residual for e in dae.redundant)))
    dropped = dae.reduced.written(residual) if dae.redundant else ca.SX(0, 1)
    wanted = [ode, algebraic, ca.densify(pivots), *matrices, *invariants, dropped]
    _, found = ca.substitute_inplace(v, e, wanted, False)
    row_of, column_of = {key: i for i, key in enumerate(last)}, {name: j for j, name in enumerate(highest)}
    divisors = [found[2][row_of[key], column_of[name]] for b in blocks for key, name in b.pairs]
    x = ca.vertcat(*(chains.named(n) for n in states)) if states else ca.SX(0, 1)
    tears = [y for b in implicit for y in b.tears]
    z = ca.vertcat(*tears) if tears else ca.SX(0, 1)
    return Coordinates(
        dae=dae,
        states=states,
        algebraics=tuple(y.name() for y in tears),
        sampled=sampled,
        x=x,
        z=z,
        w=w,
        t0=t0,
        ode=found[0],
        algebraic=found[1],
        invariants=tuple(found[3 + len(matrices) : -1]),
        rows=tuple(rows),
        known=known,
        definitions=tuple(definitions),
        pivots=found[2],
        dropped=ca.Function("dropped", [x, time, t0, w], [ca.densify(found[-1])], {"cse": True}),
        conditioning=Conditioning(
            *_constraints(dae, found[3 + len(matrices) : -1], states),
            divisors,
            found[3 : 3 + len(matrices)],
            [x, z, time, t0, w],
        ),
    )


def _constraints(dae: Dae, invariants: list[ca.SX], states: Sequence[str]) -> tuple[ca.SX, list[int]]:
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


def _invariants(dae: Dae, used: set[int]) -> tuple[list[ca.SX], list[tuple[str, ...]]]:
    """Residuals of the levels below the last, positions, then velocities, and the names of their equations.

    used: equations that give dependent variables, which hold anyway.
    """
    counts, found, names = dae.indexed.counts, [], []
    for stage in range(-max(counts, default=0), 0):
        rows = [(i, stage + c) for i, c in enumerate(counts) if stage + c >= 0 and i not in used]
        found.append(ca.vertcat(*(dae.indexed.residuals[key] for key in rows)) if rows else ca.SX(0, 1))
        names.append(tuple(dae.reduced.equations[i].name for i, _ in rows))
    return found, names


def _known_symbols(
    dae: Dae,
    signals: Mapping[str, Signal],
    sampled: Sequence[str],
    w: ca.SX,
    t0: ca.SX,
    outputs: Sequence[str],
) -> dict[str, ca.SX]:
    """Inputs and those of their derivatives that occur, as expressions of time and samples."""
    occurring = {leaf.name() for r in dae.indexed.residuals.values() for leaf in ca.symvar(r)}
    for asked in (*dae.variables, *(n for name in outputs for n in dae.expand(name))):
        base, order = split_derivative(asked)
        alias = dae.reduced.aliases.get(base)
        if alias is not None and alias.root in dae.known:
            occurring.add(derivative_name(alias.root, alias.order + order))
    starts = {n for v in dae.flat.variables if v.start is not None for n in v.elements}
    known: dict[str, ca.SX] = {}
    for name in dae.known:
        signal = signals.get(name)
        top = max((k for b, k in map(split_derivative, occurring) if b == name), default=0)
        if isinstance(signal, Samples):
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
    return known
