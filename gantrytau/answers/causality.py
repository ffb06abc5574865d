"""Functions from any given names to any wanted names: the blocks sliced to what is asked for."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import casadi as ca

from gantrytau.answers.function_through import Question, function_through
from gantrytau.answers.implicit_blocks import one_where
from gantrytau.border.refusal import ModelError, StructureError
from gantrytau.compiler.blocks.pattern import SparsityPattern, block_pattern
from gantrytau.compiler.blocks.solution import SolvedBlocks
from gantrytau.compiler.request import Request, names
from gantrytau.compiler.translated import Translated, carefully, solved
from gantrytau.compiler.translation import translate_flat
from gantrytau.language.symbols import derivative_name, split_derivative

Answer = TypeVar("Answer")
DROPPED = "constraints that were left out"
OPEN = 1e-6  # of the size of a loop, by which they may be violated


def function(dae: Translated, given: Sequence[str], find: Sequence[str]) -> ca.Function:
    """See Dae.function."""
    return composed(dae, given, find, function_through, _closed)


def composed(
    dae: Translated,
    given: Sequence[str],
    find: Sequence[str],
    through: Callable[..., Answer],
    closed: Callable[[Answer], Answer],
) -> Answer:
    """What `through` makes of the question and of blocks that lead from the given to the wanted; see `function_through`.

    closed: takes away the last result, which must be zero, and makes the others NaN where it is not.
    """
    given, find = names(given), names(find)
    dae = _with_parameters(dae, given)
    columns = [[ca.SX.sym(n) for n in dae.expand(name)] for name in given]
    inputs: list[str] | None = None
    known, targets = {}, []
    for translated in _translations(dae, given, find):
        dae = translated
        known = _known(dae, given, columns)
        targets = [ca.vertcat(*(dae.expression(n) for n in dae.expand(name))) for name in find]
        dropped = _dropped(dae, given)
        pattern = _pattern(dae, known, [*targets, dropped]) if dropped.numel() else None
        if pattern is not None:
            question, quick = _asked(
                dae, pattern, known, [*targets, dropped], given, [*find, DROPPED], columns
            )
            return closed(_answered(dae, question, quick, through))
        pattern = _pattern(dae, known, targets)
        if pattern is not None:
            return _answered(dae, *_asked(dae, pattern, known, targets, given, find, columns), through)
        inputs = _sufficient_inputs(dae, known, targets) if inputs is None else inputs
    raise StructureError(_undetermined(dae, known, targets, inputs or [], given, find))


def _dropped(dae: Translated, given: Sequence[str]) -> ca.SX:
    """Constraints left out as redundant, which must stay zero where given parameters could open a loop."""
    parameters = any(n in dae.table.symbols for name in given for n in dae.expand(name))
    if not parameters or not dae.redundant:
        return ca.SX(0, 1)
    return dae.openings


def _closed(function: ca.Function) -> ca.Function:
    """A function whose last result must be zero: without it, and NaN where it is not."""
    names = function.name_in()
    x = [ca.MX.sym(n, *function.size_in(n)) for n in names]
    *results, gap = function.call(x)
    holds = one_where(ca.sumsqr(gap) <= OPEN**2)
    return ca.Function("f", x, [holds * r for r in results], names, function.name_out()[:-1])


def _translations(dae: Translated, given: Sequence[str], find: Sequence[str]) -> Iterator[Translated]:
    """The model as it is translated, then with the wanted derivatives, then with other inputs."""
    yield dae
    orders = dae.indexed.orders
    leaves = [leaf.name() for name in find for n in dae.expand(name) for leaf in ca.symvar(dae.expression(n))]
    if any(split_derivative(n)[1] > orders.get(split_derivative(n)[0], 99) for n in leaves):
        parameters = [n for name in given for n in dae.expand(name) if n in dae.table.symbols]
        request = Request((*dae.inputs, *parameters), tuple(find), dae.request.states)
        yield translate_flat(dae.flat, request, dae.start)
    if dae.inputs or not any(
        split_derivative(n)[0] in dae.reduced.aliases for name in given for n in dae.expand(name)
    ):
        yield _flipped(dae, given, find)  # where nothing can be chosen, nothing more can be given


def _with_parameters(dae: Translated, given: Sequence[str]) -> Translated:
    """Parameters that are given stay symbols, even those that shape the equations."""
    scalars = [n for name in given for n in dae.expand(name)]
    symbols = [n for n in scalars if n in dae.table.symbols and n not in dae.table.independent]
    if not symbols:
        return dae
    parameters = [n for n in scalars if n in dae.table.symbols]
    return translate_flat(dae.flat, replace(dae.request, given=(*dae.inputs, *parameters)))


def _known(dae: Translated, given: Sequence[str], columns: list[list[ca.SX]]) -> dict[str, ca.SX]:
    """Expression of each known symbol in the arguments of the function."""
    known: dict[str, ca.SX] = {}
    for name, symbols in zip(given, columns, strict=True):
        for scalar, argument in zip(dae.expand(name), symbols, strict=True):
            base, alias = split_derivative(scalar)[0], dae.root(scalar)
            if base in dae.table.symbols or base == dae.flat.time.name():
                symbol, value = base, argument
            elif alias is None:
                raise ModelError(f"{scalar} follows from other variables and cannot be given; name those")
            else:
                if alias.root is None:
                    raise ModelError(f"{scalar} is constant in {dae.name} and cannot be given")
                symbol, value = alias.symbol, alias.root_value(argument)
            if symbol in known:
                raise StructureError(f"{scalar} is given twice, directly or by an alias; leave one out")
            known[symbol] = value
    return known


def _pattern(dae: Translated, known: dict[str, ca.SX], targets: list[ca.SX]) -> SparsityPattern | None:
    """Blocks that lead from the known symbols to the targets, or None where they do not determine them."""
    unknowns = [n for n in dae.symbols if n not in known]
    wanted = [leaf.name() for leaf in ca.symvar(ca.vertcat(*targets)) if leaf.name() not in known]
    wanted = [n for n in wanted if n not in dae.table.symbols and n != dae.flat.time.name()]
    missing = [n for n in wanted if n not in set(unknowns)]
    pattern = block_pattern(dae.indexed.incidence, unknowns, wanted)
    if pattern.surplus:
        names = "; ".join(dae.equation_name(k) for k in pattern.surplus[:3])
        raise StructureError(
            f"{dae.name}: the given names determine more than there is to choose; contradicted: {names}. "
            "Leave out one of the given names"
        )
    return None if missing or pattern.undetermined else pattern


def _flipped(dae: Translated, given: Sequence[str], find: Sequence[str]) -> Translated:
    """The model translated anew with the given variables as known functions of time."""
    scalars = [n for name in given for n in dae.expand(name) if not n.startswith("der(") and n != "time"]
    variables = [n for n in scalars if n not in dae.table.symbols]
    parameters = [n for n in scalars if n in dae.table.symbols]
    roots: dict[str, str] = {}
    for name in variables:
        alias = dae.reduced.aliases[name]
        if alias.root is not None and alias.order == 0:
            roots.setdefault(alias.root, name)
    for name in dae.flat.event_names:  # known anyway
        roots.pop(name, None)
    return translate_flat(dae.flat, Request((*roots.values(), *parameters), tuple(find)), dae.start)


def _undetermined(dae: Translated, known: dict[str, ca.SX], targets: list[ca.SX], inputs, given, find) -> str:
    """Names to give in addition: the lowest derivatives that suffice, or the inputs of the model."""
    unknowns = [n for n in dae.symbols if n not in known]
    driving = [n for n in unknowns if split_derivative(n)[0] in dae.reduced.known]
    text = f"{dae.name}: {', '.join(given) or 'nothing'} does not determine {', '.join(find)}."
    ways: list[str] = []
    for highest in sorted({split_derivative(n)[1] for n in driving}):
        more = [n for n in driving if split_derivative(n)[1] <= highest]
        if _suffices(dae, known, targets, more):
            ways.append(", ".join(_whole(dae, more)))
            break
    ways += [", ".join(_whole(dae, inputs))] if inputs else []
    states = [n for n in dae.choice.states if n in unknowns]
    if not ways and _suffices(dae, known, targets, states):
        ways = [", ".join(_whole(dae, [dae.spoken(n) for n in states]))]
    return f"{text} Give also {', or '.join(dict.fromkeys(ways)) or 'states, inputs or derivatives'}."


def _sufficient_inputs(dae: Translated, known: dict[str, ca.SX], targets: list[ca.SX]) -> list[str]:
    """The inputs that are missing if these alone are, else nothing."""
    missing = [n for n in dae.known if n not in known]
    return missing if missing and _suffices(dae, known, targets, missing) else []


def _suffices(dae: Translated, known: Collection[str], targets: list[ca.SX], more: list[str]) -> bool:
    """Whether the targets follow from the known symbols and some more."""
    unknowns = [n for n in dae.symbols if n not in known and n not in more]
    wanted = [leaf.name() for leaf in ca.symvar(ca.vertcat(*targets)) if leaf.name() in unknowns]
    return not block_pattern(dae.indexed.incidence, unknowns, wanted).undetermined


def _whole(dae: Translated, scalars: Sequence[str]) -> list[str]:
    """The names with complete vectors under one name."""
    left = dict.fromkeys(scalars)
    for vector in dae.vectors.values():
        for order in {split_derivative(n)[1] for n in scalars}:
            elements = [derivative_name(n, order) for n in vector.elements]
            if len(elements) > 1 and all(n in left for n in elements):
                left = dict.fromkeys(
                    derivative_name(vector.name, order) if n in elements else n for n in left
                )
    return list(left)


def _answered(
    dae: Translated, question: Question, quick: SolvedBlocks, through: Callable[..., Answer]
) -> Answer:
    return through("f", question, quick, lambda: carefully(dae, quick), dae.start)


def _asked(
    dae, pattern: SparsityPattern, known, targets, given, find, columns
) -> tuple[Question, SolvedBlocks]:
    """What is asked of the blocks of a pattern, and these blocks."""
    numbers = {n: dae.table.values[n] for n in dae.table.independent if n not in known}
    definitions: list[tuple[ca.SX, ca.SX]] = [(dae.table.symbols[n], ca.SX(v)) for n, v in numbers.items()]
    definitions += [
        (
            dae.table.symbols[n]
            if n in dae.table.symbols
            else dae.flat.time
            if n == "time"
            else dae.reduced.chains.named(n),
            e,
        )
        for n, e in known.items()
    ]
    names_in = _legal(given, "i")
    question = Question(
        arguments=tuple(ca.vertcat(*column) for column in columns),
        start=lambda: ca.DM(_start_of(dae, [n for name in given for n in dae.expand(name)])),
        known=tuple(definitions),
        targets=tuple(targets),
        names=(names_in, _legal(find, "o", names_in)),
    )
    quick = solved(dae, pattern)
    _refuse_time(question.inserted(quick), dae)
    return question, quick


def _start_of(dae: Translated, scalars: Sequence[str]) -> list[float]:
    """Numbers of arguments where the model starts; derivatives that do not occur there are zero."""
    found = []
    for name in scalars:
        try:
            found.append(float(dae.numbers([name], dae.start)[0]))
        except KeyError:
            found.append(dae.table.values.get(name, 0.0))
    return found


def _refuse_time(expression: ca.SX, dae: Translated) -> None:
    if any(ca.is_equal(leaf, dae.flat.time) for leaf in ca.symvar(expression)):
        raise StructureError(f"{dae.name} depends on time explicitly; name 'time' among the given")


def _legal(names: Sequence[str], prefix: str, taken: Sequence[str] = ()) -> list[str]:
    """Names as CasADi accepts them: letters, digits and single underscores, all different."""
    found: list[str] = []
    for name in names:
        text = "".join(c if c.isalnum() else "_" for c in name).strip("_")
        while "__" in text:
            text = text.replace("__", "_")
        if not text or not text[0].isalpha():
            text = f"{prefix}_{text}".rstrip("_")
        while text in found or text in taken:
            text += "x"
        found.append(text)
    return found
