"""What happens when a condition becomes true: statements read into records, refusals, and what one round of them makes.

At an instant values change in rounds. In a round all whens whose conditions became true act at once, from the values before
it: first the Discretes get new values, each after those it needs, then the states. Rounds follow each other until no
condition becomes true any more.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from graphlib import CycleError, TopologicalSorter
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.flattening.flat_model import FlatModel, When
from gantrytau.flattening.instants import declared, sized
from gantrytau.language.events import Happening, Reinit, Terminate, WhenChain, refuse_change
from gantrytau.language.functions import plain_condition
from gantrytau.language.statements import equality, place_of
from gantrytau.language.symbols import Symbols, scalars

RELATIONS = (ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE)
Where = tuple[str, str, int, str]  # path, class, number, and the place in words


def read_whens(
    stated: Sequence[tuple[str, str, int, WhenChain]], symbols: Symbols, held: Collection[str]
) -> tuple[When, ...]:
    """The records of chains (path, class, number, chain). ModelError for what cannot be one; held: what is sampled."""
    found: list[When] = []
    for path, model, number, chain in stated:
        after = -1
        for branch in chain.branches:
            own = branch.where or (path, model, number)
            found.append(_read(branch, symbols, held, (*own, place_of(*own)), after))
            after = len(found) - 1
    _refuse_set_twice(found)
    return tuple(found)


def _read(branch: Happening, symbols: Symbols, held: Collection[str], where: Where, after: int) -> When:
    path, model, number, place = where
    condition = condition_of(branch.condition, symbols, held, place)
    plain = _without_pre(condition, symbols, held, place, discrete=True)
    reinits: list[tuple[str, ca.SX]] = []
    assignments: list[tuple[str, ca.SX]] = []
    words: list[str] = []
    if not branch.actions and not branch.failure:
        raise ModelError(
            f"{place}: found no action in when, expected reinit(...), discrete == ..., or terminate(...)"
        )
    for action in branch.actions:
        if isinstance(action, Reinit):
            reinits += _reinits(action, symbols, place)
        elif isinstance(action, Terminate):
            words.append(action.words)
        else:
            assignments += _assignments(action, symbols, (path, model, number, place))
    named = [n for n, _ in (*reinits, *assignments)]
    twice = next((n for n in named if named.count(n) > 1), None)
    if twice:
        raise ModelError(
            f"{place}: found two actions that set {twice} in one when, expected one; leave one out"
        )

    def settled(pairs: list[tuple[str, ca.SX]]) -> tuple[tuple[str, ca.SX], ...]:
        return tuple((n, _without_pre(e, symbols, held, place)) for n, e in pairs)

    found = When(plain, settled(reinits), settled(assignments), "; ".join(words), path, model, number, after)
    found = replace(found, words=branch.words, initially=branch.initially, failure=branch.failure)
    return replace(found, waits=branch.waits)


def condition_of(value: Any, symbols: Symbols, held: Collection[str], place: str) -> ca.SX:
    """A condition as one scalar expression; ModelError for what is none, or never changes."""
    value = plain_condition(value)
    if isinstance(value, (bool, np.bool_, int, float, np.number, ca.DM)):
        raise ModelError(
            f"{place}: found {value} as the condition of when, which never changes, expected a comparison of variables or "
            "the time, as self.h <= 0; what is done at the start is a start value"
        )
    if not isinstance(value, ca.SX):
        raise ModelError(
            f"{place}: found {type(value).__name__} as the condition of when, expected a comparison, as self.h <= 0"
        )
    if value.numel() != 1:
        raise ModelError(
            f"{place}: the condition of when has shape {value.shape}, expected one number; write one when for each element, "
            "or logic_or(...) of the elements"
        )
    (condition,) = scalars(value)
    kinds = {leaf.name(): _kind(leaf, symbols, held) for leaf in ca.symvar(condition)}
    if all(kind == "parameter" for kind in kinds.values()):
        raise ModelError(
            f"{place}: found `{str(condition)[:80]}` as the condition of when, which never changes, expected one on "
            "variables or the time; what is done at the start is a start value"
        )
    _refuse_no_condition(condition, kinds, place)
    refuse_change(condition, place)
    return condition


def _kind(leaf: ca.SX, symbols: Symbols, held: Collection[str]) -> str:
    """parameter, discrete (a Discrete, or sampled), or moving."""
    symbol = symbols.find(leaf)
    if symbol is None:
        return "moving"
    own = symbols.by_name[symbol.base] if symbol.kind == "pre" else symbol
    return own.kind if own.kind in ("parameter", "discrete") else "discrete" if own.name in held else "moving"


def _refuse_no_condition(part: ca.SX, kinds: Mapping[str, str], place: str) -> None:
    if part.is_constant():
        return
    if part.is_op(ca.OP_AND) or part.is_op(ca.OP_OR) or part.is_op(ca.OP_NOT):
        for k in range(part.n_dep()):
            _refuse_no_condition(part.dep(k), kinds, place)
        return
    moving = [leaf.name() for leaf in ca.symvar(part) if kinds[leaf.name()] == "moving"]
    if part.is_op(ca.OP_EQ) or part.is_op(ca.OP_NE):
        if moving:
            raise ModelError(
                f"{place}: found the equation `{str(part)[:80]}` as a condition of when, which {moving[0]} meets at single "
                "instants only, expected a comparison by <, <=, > or >=, which becomes true and stays so"
            )
        return
    if part.is_symbolic() and not moving and kinds[part.name()] == "discrete":
        return  # 0 or 1
    if not any(part.is_op(relation) for relation in RELATIONS):
        raise ModelError(
            f"{place}: found `{str(part)[:80]}` as a condition of when, a number, expected a comparison, as x > 0; join "
            "several by logic_and, logic_or, logic_not"
        )


def _reinits(action: Reinit, symbols: Symbols, place: str) -> list[tuple[str, ca.SX]]:
    elements = scalars(action.variable) if isinstance(action.variable, ca.SX) else []
    for element in elements:
        symbol = symbols.find(element)
        if symbol is not None and symbol.kind == "discrete":
            raise ModelError(
                f"{place}: found reinit({symbol.name}, ...), a Discrete, expected a state; write {symbol.name} == ..."
            )
        if symbol is not None and symbol.order:
            raise ModelError(
                f"{place}: found reinit({symbol.name}, ...), a derivative, expected a variable; declare one that equals it, "
                f"v == {symbol.name}, and set that"
            )
    found = declared(action.variable, symbols, place, "reinit", ("real", "output", "flow"))
    values = sized(action.value, action.variable.shape, place, "the value of reinit")
    return [(symbol.name, value) for symbol, value in zip(found, values, strict=True)]


def _assignments(action: Any, symbols: Symbols, where: Where) -> list[tuple[str, ca.SX]]:
    path, model, number, place = where
    if isinstance(action, (WhenChain, str)):
        raise ModelError(
            f"{place}: found {type(action).__name__} as an action of when, expected reinit(...), discrete == ..., or "
            "terminate(...); conditions that must hold together are joined by logic_and"
        )
    found: list[tuple[str, ca.SX]] = []
    for equation in equality(action, path, model, number):
        symbol = symbols.find(equation.left)
        if symbol is None or symbol.kind != "discrete":
            what = symbol.name if symbol else f"`{str(equation.left)[:80]}`"
            raise ModelError(
                f"{place}: found `{equation.text[:80]}` as an action of when, with {what} on its left, expected a Discrete "
                "there; a state gets another value by reinit(state, value), what else follows from an equation outside of "
                "when, with if_else on a Discrete"
            )
        found.append((symbol.name, equation.right))
    return found


def _without_pre(
    expression: ca.SX, symbols: Symbols, held: Collection[str], place: str, *, discrete: bool = False
) -> ca.SX:
    """An expression in which only Discretes have values before beside new ones; discrete: not even these."""
    before = [
        s for leaf in ca.symvar(expression) if (s := symbols.find(leaf)) is not None and s.kind == "pre"
    ]
    for symbol in before:
        if symbol.base in held:
            raise ModelError(
                f"{place}: found {symbol.name} of a sampled variable, which has its new value at its instants before any "
                f"when acts, expected {symbol.base} itself; keep older values in a variable that is sampled, too"
            )
    own = [(s, symbols.by_name[s.base]) for s in before]
    old = [s.sx for s, variable in own if discrete or variable.kind != "discrete"]
    new = [variable.sx for _, variable in own if discrete or variable.kind != "discrete"]
    return ca.substitute(expression, ca.vertcat(*old), ca.vertcat(*new)) if old else expression


def _refuse_set_twice(whens: Sequence[When]) -> None:
    """ModelError for a variable that two chains set, which might act at one instant."""
    owners: dict[str, tuple[int, When]] = {}
    chain = 0
    for k, one in enumerate(whens):
        chain = k if one.after < 0 else chain
        for name, _ in (*one.assignments, *one.reinits):
            first, owner = owners.setdefault(name, (chain, one))
            if first != chain:
                raise ModelError(
                    f"{one.label}: found {name}, which {owner.label} sets as well, expected one when for it, as both could "
                    "act at one instant; join them, when(first, ...).elsewhen(second, ...)"
                )


def refuse_unassigned(discretes: Sequence[str], whens: Sequence[When]) -> None:
    """ModelError for a Discrete that nothing sets, and for Discretes that need each other's new values in a circle."""
    assigned = {n for one in whens for n, _ in one.assignments}
    for name in discretes:
        if name not in assigned:
            raise ModelError(
                f"{name}: found a Discrete that no when sets, expected an action {name} == ... in one; what stays "
                "constant is a Parameter"
            )
    _sorted(whens)


def _sorted(whens: Sequence[When]) -> list[str]:
    """The Discretes that are set, each after those whose new values it needs."""
    set_by = {n: one for one in whens for n, _ in one.assignments}
    needs: dict[str, list[str]] = {n: [] for n in set_by}
    for one in whens:
        for name, value in one.assignments:
            needs[name] += [leaf.name() for leaf in ca.symvar(value) if leaf.name() in needs]
    try:
        return list(TopologicalSorter(needs).static_order())
    except CycleError as error:
        circle = list(dict.fromkeys(error.args[1]))
        words = f"{circle[0]} needs its own new value" if len(circle) == 1 else (
            f"{', '.join(circle)} need each other's new values in a circle"
        )  # fmt: skip
        raise ModelError(
            f"{set_by[circle[0]].label}: {words}, expected values that follow one after another; write pre({circle[0]}) "
            "for the value before the instant"
        ) from None


@dataclass(frozen=True, eq=False)
class Jump:
    """What one round makes of values: expressions of the flat model's symbols, which are the values before it.

    rose: symbols (whens,), 1 where a condition became true since the round before, else 0; acts: which whens act, 0 or 1;
    discretes: the new value of each of `FlatModel.discretes`; states: those that are set anew, and their values.
    """

    rose: ca.SX
    acts: ca.SX
    discretes: ca.SX
    states: tuple[tuple[str, ca.SX], ...]


def one_round(flat: FlatModel) -> Jump:
    """The round of a model's whens, in which a Discrete's new value comes after those it needs."""
    rose = ca.SX.sym("rose", len(flat.whens))
    acts: list[ca.SX] = []
    blocked: list[ca.SX] = []  # whether a when, or one before it in its chain, acts
    for k, one in enumerate(flat.whens):
        before = blocked[one.after] if one.after >= 0 else ca.SX(0)
        acts.append(rose[k] * (1 - before))
        blocked.append(acts[k] + before)
    old = {n: s for v in flat.variables for n, s in zip(v.elements, v.symbol.elements(), strict=True)}
    new = {n: old[n] for n in flat.discretes}
    states: dict[str, ca.SX] = {}

    def in_old(value: ca.SX) -> ca.SX:
        leaves = [leaf.name() for leaf in ca.symvar(value)]
        inside = [(flat.before[n], old[n]) for n in new if f"pre({n})" in leaves]
        inside += [(old[n], new[n]) for n in new if n in leaves]
        if not inside:
            return value
        return ca.substitute(value, ca.vertcat(*(a for a, _ in inside)), ca.vertcat(*(b for _, b in inside)))

    values = {
        n: [(acts[k], e) for k, one in enumerate(flat.whens) for m, e in one.assignments if m == n]
        for n in new
    }
    for name in _sorted(flat.whens):
        value = old[name]
        for act, expression in values[name]:
            value = ca.if_else(act, in_old(expression), value)
        new[name] = value
    for k, one in enumerate(flat.whens):
        for name, expression in one.reinits:
            states[name] = ca.if_else(acts[k], in_old(expression), states.get(name, old[name]))
    return Jump(rose, _column(acts), _column([new[n] for n in flat.discretes]), tuple(states.items()))


def _column(elements: Sequence[ca.SX]) -> ca.SX:
    return ca.vertcat(*elements) if elements else ca.SX(0, 1)
