"""From a model to the translated record: the whole way, step by step."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import casadi as ca

from gantrytau.compiler.aliases import Reduced, eliminate_aliases
from gantrytau.compiler.blocks.pattern import block_pattern
from gantrytau.compiler.blocks.pivots import Guide
from gantrytau.compiler.blocks.solution import solve_blocks
from gantrytau.compiler.determinacy import massless, refuse_undetermined
from gantrytau.compiler.index_reduction import Indexed, reduce_index
from gantrytau.compiler.parameters import ParameterTable, parameter_table
from gantrytau.compiler.redundancy import Settled, without_redundant
from gantrytau.compiler.start.consistent_start import consistent_start
from gantrytau.compiler.start.start_values import starting_guess
from gantrytau.compiler.states import choose_states
from gantrytau.compiler.translated import Translated
from gantrytau.errors import InitializationError, ModelError, StructureError, did_you_mean
from gantrytau.flattening.flat_model import FlatModel, FlatVariable
from gantrytau.flattening.flatten import flatten
from gantrytau.flattening.instants import refuse_events
from gantrytau.flattening.unit_checking import check_units
from gantrytau.language.declarations import StateSelect
from gantrytau.language.model import Model
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import derivative_name, split_derivative


def translate_model(
    model: Model,
    *,
    given: Sequence[str] = (),
    find: Sequence[str] = (),
    states: Sequence[str] | None = None,
    units: bool = True,
    events: bool = False,
) -> Translated:
    """Flatten a model, check the dimensions of all equations, and translate it; see `gantrytau.translate`."""
    flat = flatten(model)
    if units:
        check_units(flat)
    return translate_flat(flat, given=given, find=find, states=states, events=events)


def translate_flat(
    flat: FlatModel,
    *,
    given: Sequence[str] = (),
    find: Sequence[str] = (),
    states: Sequence[str] | None = None,
    start: Mapping[str, float] | None = None,
    events: bool = False,
) -> Translated:
    """A system of index one, sorted into blocks; `start`: numbers of symbols that replace start values."""
    if not events:
        refuse_events(flat)
    given, find, states = (names(x) for x in (given, find, states or ()))
    settings = dict(given=given, find=find, states=states)
    flat = _with_wanted(flat, find)
    table, known = _given(flat, given)
    doubtful = any(e.dual for e in flat.equations)
    settled = without_redundant(flat, table, frozenset(known)) if flat.loops else Settled(flat)
    try:
        return _translated(settled, flat, table, known, settings, start or {})
    except StructureError as error:
        # rods are rarely redundant, so they are only looked at if something is wrong
        if flat.loops or not doubtful:
            raise
        try:
            settled = without_redundant(flat, table, frozenset(known))
        except (InitializationError, StructureError):
            raise error from None
        if not settled.redundant:
            raise
    return _translated(settled, flat, table, known, settings, start or {})


def _given(flat: FlatModel, given: Sequence[str]) -> tuple[ParameterTable, tuple[str, ...]]:
    """The parameters, and which scalars are known as functions of time."""
    scalars = [n for name in given for n in expand(flat, name)]
    parameters = {n for p in flat.parameters for n in p.elements}
    events = flat.event_names
    known = tuple(n for n in scalars if n not in parameters)
    for name in known:
        if name.startswith("der("):
            raise ModelError(f"given: {name} is a derivative, expected variables; name the variable itself")
        if name in events:
            raise ModelError(
                f"given: {name} is set at instants (by sampled or stick_slip), expected another variable; leave it "
                "out, it is known anyway"
            )
    table = parameter_table(flat, keep=frozenset(n for n in scalars if n in parameters))
    return table, (*(known or flat.inputs), *events)


def _translated(
    settled: Settled,
    flat: FlatModel,
    table: ParameterTable,
    known: tuple[str, ...],
    settings: Mapping[str, Any],
    start: Mapping[str, float],
) -> Translated:
    """From the flat model without redundant constraints to the sorted system."""
    reduced = eliminate_aliases(settled.flat, table, frozenset(known))
    indexed = reduce_index(reduced, flat)
    _refuse_differentiated(flat, reduced, indexed)
    guess = starting_guess(flat, table, reduced, all_symbols(indexed, reduced.known))
    better = {n: v for n, v in {**settled.guess, **start}.items() if n in guess.values}
    guess = replace(guess, values={**guess.values, **better})
    try:
        sample = consistent_start(flat, table, reduced, indexed, guess)
    except InitializationError as error:
        raise massless(indexed, reduced, flat) or error from None
    wanted = [_state_name(reduced.aliases, n) for name in settings["states"] for n in expand(flat, name)]
    choice = choose_states(indexed, reduced, sample, _preferences(flat, reduced), wanted, flat.name)
    unknowns = [n for n in indexed.unknown_symbols() if n not in set(choice.states)]
    pattern = block_pattern(indexed.residuals, unknowns)
    by_name = {n: reduced.chains.named(n) for n in unknowns}
    guide = Guide(sample, table.values, choice.states)
    blocks = tuple(solve_blocks(pattern.blocks, indexed.residuals, by_name, guide))
    refuse_undetermined(blocks, indexed, reduced, sample, flat)
    more = dict(started=guess.started, fixed=guess.fixed)
    return Translated(
        flat, table, reduced, indexed, choice, blocks, known, sample, settled.redundant, {**settings, **more}
    )


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
    return found


def names(found: Sequence[str]) -> tuple[str, ...]:
    """A list of names as a tuple; ModelError for a text, which Python would take for a list of letters."""
    if isinstance(found, str):
        raise ModelError(f"found the text '{found}', expected a list of names; write ['{found}']")
    return tuple(found)


def retranslate(dae: Translated, flat: FlatModel) -> Translated:
    """The same translation of a flat model with other parameter values."""
    chosen = {k: dae.settings[k] for k in ("given", "find", "states")}
    return translate_flat(flat, **chosen, events=True)


def all_symbols(indexed: Indexed, known: frozenset[str]) -> list[str]:
    """Unknowns with their derivatives, and the known variables with the derivatives that occur."""
    names = dict.fromkeys(indexed.unknown_symbols())
    names.update(dict.fromkeys(known))
    for residual in indexed.residuals.values():
        for leaf in ca.symvar(residual):
            if split_derivative(leaf.name())[0] in known:
                names[leaf.name()] = None
    return list(names)


def expand(flat: FlatModel, name: str) -> tuple[str, ...]:
    """Scalar names of a variable, parameter or derivative of a flat model; ModelError if unknown."""
    base, order = split_derivative(name)
    found = flat.find(base)
    if found is not None:
        return tuple(derivative_name(n, order) for n in found.elements)
    known = [n for v in (*flat.variables, *flat.parameters) for n in dict.fromkeys((v.name, *v.elements))]
    if base not in known:
        raise ModelError(f"{flat.name} has no variable or parameter '{name}'{did_you_mean(base, known)}")
    return (name,)


def _state_name(aliases: Mapping[str, Any], name: str) -> str:
    base, order = split_derivative(name)
    alias = aliases[base]
    if alias.root is None:
        raise StructureError(f"{name} is constant and cannot be a state")
    return derivative_name(alias.root, alias.order + order)


def _with_wanted(flat: FlatModel, find: Sequence[str]) -> FlatModel:
    """Derivatives that are asked for become outputs with an equation, so that they are known in time."""
    wanted = [n for name in find for n in expand(flat, name) if n.startswith("der(")]
    wanted = [n for n in wanted if n not in flat.derivatives]
    wanted += _sampled_derivatives(flat)
    if not wanted:
        return flat
    variables, equations, derivatives = list(flat.variables), list(flat.equations), dict(flat.derivatives)
    for name in dict.fromkeys(wanted):
        derivatives.setdefault(name, ca.SX.sym(name))
        helper = f"wanted {name}"
        symbol = ca.SX.sym(helper)
        variables.append(FlatVariable(helper, "output", (), (helper,), symbol, None, ""))
        equations.append(Equation(symbol, derivatives[name], "", "wanted", 1))
    return replace(flat, variables=tuple(variables), equations=tuple(equations), derivatives=derivatives)


def _sampled_derivatives(flat: FlatModel) -> list[str]:
    """Derivatives of variables that only what is set at instants depends on."""
    if not (flat.sampled or flat.frictions):
        return []
    used = [s.expression for s in flat.sampled]
    used += [e for f in flat.frictions for e in (f.coulomb, f.smooth, f.breakaway)]
    variables = {n for v in flat.variables for n in v.elements}
    there = {leaf.name() for e in flat.equations for leaf in ca.symvar(e.residual)}
    leaves = [split_derivative(leaf.name()) for leaf in ca.symvar(ca.vertcat(*used))]
    found = [derivative_name(base, order) for base, order in leaves if order and base in variables]
    return [n for n in found if n not in there]


def _refuse_differentiated(flat: FlatModel, reduced: Reduced, indexed: Indexed) -> None:
    """ModelError where the equations differentiate what jumps at instants."""
    events = flat.event_names
    if not events:
        return
    where = [(a.root, a.order, n) for n, a in reduced.aliases.items()]
    for (i, _), residual in indexed.residuals.items():
        leaves = [split_derivative(leaf.name()) for leaf in ca.symvar(residual)]
        where += [(base, order, reduced.equations[i].name) for base, order in leaves]
    for name, order, place in where:
        if name in events and order:
            what = "sampled" if any(s.name == name for s in flat.sampled) else "friction that sticks"
            raise ModelError(
                f"{name} is {what} and jumps at instants, but {place} has it differentiated; pass it through a filter "
                "(gantrytau.mechanics.filters.LowPass), or let it drive a force instead of a motion"
            )
