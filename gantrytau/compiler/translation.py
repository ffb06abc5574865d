"""From a model to the translated record: the whole way, step by step."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import casadi as ca

from gantrytau.border.refusal import InitializationError, ModelError, StructureError
from gantrytau.compiler.aliases import Reduced, eliminate_aliases
from gantrytau.compiler.blocks.cancellation import combined
from gantrytau.compiler.blocks.determinacy import massless, refuse_undetermined
from gantrytau.compiler.blocks.pattern import block_pattern
from gantrytau.compiler.blocks.pivots import Guide
from gantrytau.compiler.blocks.solution import solve_blocks
from gantrytau.compiler.index_reduction import Indexed, reduce_index
from gantrytau.compiler.parameters import ParameterTable, parameter_table
from gantrytau.compiler.redundancy import Settled, without_redundant
from gantrytau.compiler.request import Request
from gantrytau.compiler.start.consistent_start import consistent_start
from gantrytau.compiler.start.start_values import start_values
from gantrytau.compiler.states import choose_states
from gantrytau.compiler.translated import Translated
from gantrytau.flattening.check_units import check_units
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.flattening.flatten import flatten
from gantrytau.language.declarations import StateSelect
from gantrytau.language.model import Model
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau.progress import stage, timed


def translate_model(model: Model) -> Translated:
    """Flatten a model, check the dimensions of all equations, and translate it; see `gantrytau.translate`."""
    with timed("translating"):
        flat = flatten(model)
        check_units(flat)
        return translate_flat(flat, Request())


def translate_flat(
    flat: FlatModel,
    request: Request,
    start: Mapping[str, float] | None = None,
    course: Sequence[Mapping[str, float]] = (),
) -> Translated:
    """A system of index one, sorted into blocks; `start`: numbers of symbols that replace start values.

    course: poses of a motion at whose end constraints that repeat others are chosen, as of `without_redundant`.
    """
    table, known = _given(flat, request.given)
    doubtful = any(e.dual for e in flat.equations)
    with stage("loops"):
        settled = without_redundant(flat, table, frozenset(known), course) if flat.loops else Settled(flat)
    try:
        return _translated(settled, flat, table, known, request, start or {})
    except StructureError as error:
        # rods are rarely redundant, so they are only looked at if something is wrong
        if flat.loops or not doubtful:
            raise
        try:
            settled = without_redundant(flat, table, frozenset(known))
        except InitializationError:
            raise error from None
        if not settled.redundant:
            raise
    return _translated(settled, flat, table, known, request, start or {})


def _given(flat: FlatModel, given: Sequence[str]) -> tuple[ParameterTable, tuple[str, ...]]:
    """The parameters, and which scalars are known as functions of time."""
    scalars = [n for name in given for n in flat.expand(name)]
    parameters = {n for p in flat.parameters for n in p.elements}
    events = flat.event_names
    known = tuple(n for n in scalars if n not in parameters)
    variables = {n for v in flat.variables for n in v.elements}
    for name in known:
        why = "is set at instants (by sampled, when or stick_slip); leave it out, it is known anyway"
        if name not in variables:
            derived = name.startswith("der(")
            why = "is a derivative; name the variable" if derived else "follows from others; name those"
        elif name not in events:
            continue
        raise ModelError(f"{name} {why}, expected variables", place="given", argument="given")
    with stage("parameters"):
        table = parameter_table(flat, keep=frozenset(n for n in scalars if n in parameters))
    return table, (*(known or flat.inputs), *events)


def _translated(
    settled: Settled,
    flat: FlatModel,
    table: ParameterTable,
    known: tuple[str, ...],
    request: Request,
    start: Mapping[str, float],
) -> Translated:
    """From the flat model without redundant constraints to the sorted system."""
    with stage("aliases"):
        reduced = eliminate_aliases(settled.flat, table, frozenset(known))
    wanted = _wanted_derivatives(flat, request.find)
    try:
        return _sorted(settled, flat, reduced, known, request, start)
    except (InitializationError, StructureError) as error:
        reduced, decisive = combined(reduced, flat, wanted, error)
        if decisive & _loose(flat, request):
            raise
        try:
            if decisive:
                return _shaped(settled, flat, decisive, known, request, start)
            return _sorted(settled, flat, reduced, known, request, start)
        except StructureError:
            if isinstance(error, StructureError):
                raise error from None
            raise


def _shaped(
    settled: Settled,
    flat: FlatModel,
    names: frozenset[str],
    known: tuple[str, ...],
    request: Request,
    start: Mapping[str, float],
) -> Translated:
    """The sorted system with the values of the parameters `names` folded in: they decide on the structure."""

    def folded(one: FlatModel) -> FlatModel:
        parameters = (replace(p, fold=p.fold or not names.isdisjoint(p.elements)) for p in one.parameters)
        return replace(one, parameters=tuple(parameters))

    flat, settled = folded(flat), replace(settled, flat=folded(settled.flat))
    return _translated(settled, flat, _given(flat, request.given)[0], known, request, start)


def _loose(flat: FlatModel, request: Request) -> set[str]:
    """Parameters that have to stay symbols."""
    given = {n for name in request.given for n in flat.expand(name)}
    return given | {n for p in flat.parameters if p.free for n in p.elements}


def _sorted(
    settled: Settled,
    flat: FlatModel,
    reduced: Reduced,
    known: tuple[str, ...],
    request: Request,
    start: Mapping[str, float],
) -> Translated:
    """The reduced equations differentiated, started and solved block by block."""
    wanted = _wanted_derivatives(flat, request.find)
    with stage("index"):
        indexed = reduce_index(reduced, flat, wanted)
        _refuse_differentiated(flat, reduced, indexed, wanted)
    asked = start_values(flat, reduced, indexed.symbols(reduced.known))
    better = {n: v for n, v in {**settled.guess, **start}.items() if n in asked.values}
    asked = replace(asked, values={**asked.values, **better}, wished=asked.values)
    try:
        with stage("start"):
            sample = consistent_start(flat, reduced, indexed, asked)
    except InitializationError as error:
        raise massless(indexed, reduced, flat) or error from None
    states = [_state_name(reduced, n) for name in request.states for n in flat.expand(name)]
    with stage("states"):
        choice = choose_states(indexed, reduced, sample, _preferences(flat, reduced), states, flat.name)
    chosen = set(choice.states)
    unknowns = [n for n in indexed.unknown_symbols() if n not in chosen]
    with stage("blocks"):
        pattern = block_pattern(indexed.incidence, unknowns)
        by_name = {n: reduced.chains.named(n) for n in unknowns}
        guide = Guide(sample, reduced.table.values, choice.states)
        blocks = solve_blocks(pattern.blocks, indexed.residuals, by_name, guide).blocks
    with stage("determinacy"):
        refuse_undetermined(blocks, indexed, reduced, asked, sample, flat)
    found = Translated(
        request, flat, reduced, indexed, choice, blocks, known, asked, sample, settled.redundant
    )
    decisive = _refuse_reinits(found)
    return _shaped(settled, flat, decisive, known, request, start) if decisive else found


def _preferences(flat: FlatModel, reduced: Reduced) -> dict[str, int]:
    """StateSelect by variable, a fixed start being as good as any; a root is preferred as much as its aliases."""
    found = {
        n: int(StateSelect.ALWAYS if v.fixed and v.prefer >= StateSelect.DEFAULT else v.prefer)
        for v in flat.variables
        for n in v.elements
    }
    for name, alias in reduced.aliases.items():
        if alias.root is not None and alias.root != name:
            found[alias.root] = max(found[alias.root], found[name])
    for one in flat.whens:
        for name, _ in one.reinits:
            alias = reduced.aliases[name]
            if alias.root is not None:
                found[alias.root] = max(found[alias.root], int(StateSelect.ALWAYS))
    return found


def _refuse_reinits(dae: Translated) -> frozenset[str]:
    """ModelError for a variable that a when gives a new value although it is no state, or is one by another name.

    In an equation of two unknowns such a variable may be a multiple of a state: the parameters in that equation come back.
    """
    owners: dict[str, str] = {}
    for one in dae.flat.whens:
        for name, _ in one.reinits:
            symbol = dae.reduced.aliases[name].symbol
            if symbol not in dae.choice.states:
                keys = next((b.equations for b in dae.blocks if b.unknowns == (symbol,)), ())
                leaves = {s.name() for k in keys for s in ca.symvar(dae.indexed.residuals[k])}
                decisive = leaves.intersection(dae.table.independent)
                if decisive and len(leaves - decisive) == 2 and not decisive & _loose(dae.flat, dae.request):
                    return frozenset(decisive)
                shown = ", ".join(dae.states[:8]) + (", ..." if len(dae.states) > 8 else "")
                raise ModelError(
                    f"found reinit({name}, ...), but {name} is no state, as it follows from others; expected one of the "
                    f"states, {shown or 'of which there is none'}; what jumps with them follows by itself",
                    place=one.label,
                )
            if (other := owners.setdefault(symbol, name)) != name:
                raise ModelError(
                    f"found reinit({name}, ...), but {name} is the same state as {other}, which a when sets as well; "
                    f"expected one name and one chain for it: set {other}, and join the whens by .elsewhen",
                    place=one.label,
                )
    return frozenset()


def retranslate(dae: Translated, flat: FlatModel) -> Translated:
    """The same translation of a flat model with other parameter values."""
    return translate_flat(flat, dae.request)


def _state_name(reduced: Reduced, name: str) -> str:
    alias = reduced.root(name)
    if alias is None or alias.root is None:
        what = "constant" if alias else "no variable"
        raise StructureError(f"{name} is {what} and cannot be a state")
    return alias.symbol


def _wanted_derivatives(flat: FlatModel, find: Sequence[str]) -> tuple[str, ...]:
    """Derivatives that are asked for, or that what is set at instants depends on: they must be known in time."""
    wanted = [n for name in find for n in flat.expand(name) if n.startswith("der(")]
    accelerations = [f"der({f.speed})" for f in flat.frictions]  # zero while a friction sticks
    return tuple(dict.fromkeys((*wanted, *_sampled_derivatives(flat), *accelerations)))


def _sampled_derivatives(flat: FlatModel) -> list[str]:
    """Derivatives of variables that only what is set at instants depends on."""
    if not (flat.sampled or flat.frictions or flat.whens or flat.delays):
        return []
    used = [s.expression for s in (*flat.sampled, *flat.delays)]
    used += [e for w in flat.whens for e in (w.condition, *(v for _, v in (*w.reinits, *w.assignments)))]
    used += [e for f in flat.frictions for e in (f.coulomb, f.smooth, f.breakaway)]
    variables = {n for v in flat.variables for n in v.elements}
    there = {leaf.name() for e in flat.equations for leaf in ca.symvar(e.residual)}
    leaves = [split_derivative(leaf.name()) for leaf in ca.symvar(ca.vertcat(*used))]
    found = [derivative_name(base, order) for base, order in leaves if order and base in variables]
    return [n for n in found if n not in there]


def _refuse_differentiated(
    flat: FlatModel, reduced: Reduced, indexed: Indexed, wanted: Sequence[str]
) -> None:
    """ModelError where the equations differentiate what jumps at instants."""
    events = flat.event_names
    if not events:
        return
    where = [(a.root, a.order, n) for n, a in reduced.aliases.items()]
    where += [(*split_derivative(n), f"wanted {n}") for n in wanted]
    for (i, _), row in indexed.incidence.items():
        where += [(*occurring, reduced.equations[i].name) for occurring in row]
    for name, order, place in where:
        if name in events and order:
            what = "friction that sticks" if any(f.force == name for f in flat.frictions) else "a Discrete"
            what = "delayed" if any(d.name == name for d in flat.delays) else what
            what = "sampled" if any(s.name == name for s in flat.sampled) else what
            raise ModelError(
                f"{name} is {what} and jumps at instants, but {place} has it differentiated; pass it through a filter "
                "(gantrytau.mechanics.filters.LowPass), or let it drive a force instead of a motion"
            )
