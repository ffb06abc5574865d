"""Functions of an instant: from values just before it to those behind it, where the whens act whose conditions hold.

The new value of each x that is given as pre(x) is an unknown `after(x)` of an equation beside those of the model; what is
asked for follows from the new values as from any others.
"""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from gantrytau.answers.causality import function
from gantrytau.border.refusal import ModelError
from gantrytau.compiler.request import names
from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import retranslate
from gantrytau.flattening.flat_checks import refuse_events
from gantrytau.flattening.flat_model import FlatModel, FlatVariable
from gantrytau.flattening.whens import one_round
from gantrytau.language.statements import Equation


def is_before(name: str) -> bool:
    """Whether a name asks for a value just before an instant: `pre(x)`."""
    return name.startswith("pre(") and name.endswith(")")


def instant_function(dae: Translated, given: Sequence[str], find: Sequence[str]) -> ca.Function:
    """The function from values just before an instant, some of them named `pre(x)`, to those behind it; see Dae.function."""
    given, find = names(given), names(find)
    plain = [name[4:-1] if is_before(name) else name for name in given]
    _refuse(dae, given)
    new = _new_values(dae.flat)
    by_symbol = {dae.reduced.aliases[n].symbol: n for n in new}
    scalars = [[_set_by(dae, n, by_symbol) for n in dae.expand(name)] for name in plain]
    wanted = list(dict.fromkeys(n for column in scalars for n in column if n))
    behind = function(dae, plain, find)
    x = [ca.MX.sym(n, *behind.size_in(n)) for n in behind.name_in()]
    after: dict[str, ca.MX] = {}
    if wanted:
        found = retranslate(dae, _with_unknowns(dae.flat, {n: new[n] for n in wanted}))
        made = function(found, plain, [f"after({n})" for n in wanted]).call(x)
        after = dict(zip(wanted, made, strict=True))
    moved = [
        ca.vertcat(
            *(x[k][i] if n is None else _as(dae, own, n, after[n]) for i, (own, n) in enumerate(pairs))
        )
        for k, pairs in enumerate(
            list(zip(dae.expand(name), column, strict=True))
            for name, column in zip(plain, scalars, strict=True)
        )
    ]
    return ca.Function("f", x, behind.call(moved), behind.name_in(), behind.name_out())


def sample_function(dae: Translated, given: Sequence[str], find: Sequence[str]) -> ca.Function:
    """One step of a sampled controller: (given, held before) -> (find, held behind), vectors of scalars.

    held: the sampled variables in the order of `dae.flat.sampled`; `find` is evaluated behind the instant. Raises
    ModelError for a model with states, whens, delays, friction or laws, or without sampled variables.
    """
    flat = dae.flat
    if not flat.sampled:
        raise ModelError(
            f"{dae.name}: found nothing sampled, expected sampled(y, ..., period=...) of what the controller sets"
        )
    if dae.states or flat.whens or flat.delays or flat.frictions:
        what = "states" if dae.states else "whens, delays or friction"
        raise ModelError(
            f"{dae.name}: found {what}, expected a model of sampled variables alone; leave the plant out"
        )
    refuse_events(flat, "laws")
    held = [s.name for s in flat.sampled]
    renewed = retranslate(dae, _with_unknowns(flat, {s.name: s.expression for s in flat.sampled}))
    before = function(renewed, [*given, *held], [f"after({n})" for n in held])
    behind = function(dae, [*given, *held], find)
    u = [ca.MX.sym(n, *before.size_in(k)) for k, n in enumerate(given)]
    x = ca.MX.sym("held", len(held))
    new = before.call([*u, *ca.vertsplit(x)])
    found = behind.call([*u, *new])
    return ca.Function("sample", [*u, x], [ca.vertcat(*found), ca.vertcat(*new)])


def _refuse(dae: Translated, given: Sequence[str]) -> None:
    """ModelError for what is set at instants and is given without saying that it is the value before."""
    if not dae.flat.whens:
        raise ModelError(
            f"{dae.name}: found {next(n for n in given if is_before(n))} among the given, but there is no when in the "
            "model, expected the names of variables; leave pre(...) out"
        )
    set_anew = {dae.reduced.aliases[n].symbol for n in _new_values(dae.flat)}
    for name in given:
        own = [a for n in (() if is_before(name) else dae.expand(name)) if (a := dae.root(n)) is not None]
        if any(alias.symbol in set_anew for alias in own):
            raise ModelError(
                f"{dae.name}: found {name} among the given of an instant, which whens set, expected pre({name}), its value "
                "just before; its value after the instant belongs to the names to find"
            )


def _new_values(flat: FlatModel) -> dict[str, ca.SX]:
    """By name what one round makes of Discretes and states where the whens act whose conditions hold."""
    jump = one_round(flat)
    conditions = ca.vertcat(*(one.condition for one in flat.whens))
    found = [*zip(flat.discretes, jump.discretes.elements(), strict=True), *jump.states]
    return {n: ca.substitute(e, jump.rose, conditions) for n, e in found}


def _set_by(dae: Translated, name: str, by_symbol: dict[str, str]) -> str | None:
    """The variable that whens set and that a given one is an alias of, None if there is none."""
    alias = dae.root(name)
    return None if alias is None else by_symbol.get(alias.symbol)


def _as(dae: Translated, name: str, source: str, value: ca.MX) -> ca.MX:
    """The value of a variable that is the same but for sign, factor and offset as another one of this value."""
    own, other = dae.reduced.aliases[name], dae.reduced.aliases[source]
    root = (value - dae.number(other.offset)) / other.factor
    return own.factor * root + dae.number(own.offset)


def _with_unknowns(flat: FlatModel, values: dict[str, ca.SX]) -> FlatModel:
    """A model with one more unknown, `after(x)`, for each of these values."""
    names = [f"after({n})" for n in values]
    symbols = [ca.SX.sym(n) for n in names]
    variables = [FlatVariable(n, "real", (), (n,), s, None, "") for n, s in zip(names, symbols, strict=True)]
    rows = zip(symbols, values.values(), names, strict=True)
    equations = [Equation(s, e, "", flat.name, 0, label=n) for s, e, n in rows]
    return replace(flat, variables=(*flat.variables, *variables), equations=(*flat.equations, *equations))
