"""Checks that the two sides of every equation, and the terms of every sum, have one dimension.

A number has no unit of its own: in a product it counts as one, in a sum it takes the unit of its neighbours. Quantities
declared without a unit fit anywhere. Formulas of parameters, starts and limits are checked as equations are. The time times
a number is taken as an angle, and its sine as a number: `0.5 * sin(3 * time)` is what everybody writes.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from typing import NamedTuple

import casadi as ca

from gantrytau.border.dimensions import ONE, Dimension, dimension, unit_text, whole
from gantrytau.border.refusal import ModelError
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.flattening.instants import sides
from gantrytau.language.instructions import computed
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import split_derivative
from gantrytau.progress import stage

NUMBER = "number"
ANY = "any"
CLOCK = {ca.OP_MUL, ca.OP_DIV, ca.OP_ADD, ca.OP_SUB}  # with a number, what makes another time of the time
Unit = Dimension | str

SAME = {
    ca.OP_ADD, ca.OP_SUB, ca.OP_FMIN, ca.OP_FMAX, ca.OP_HYPOT, ca.OP_FMOD, ca.OP_REMAINDER, ca.OP_COPYSIGN,
}  # fmt: skip
RELATIONS = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE}
KEEP = {ca.OP_ASSIGN, ca.OP_NEG, ca.OP_TWICE, ca.OP_FABS, ca.OP_FLOOR, ca.OP_CEIL}
OF_NUMBERS = "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log log1p expm1 erf"
ANGLES = {getattr(ca, f"OP_{name.upper()}"): name for name in OF_NUMBERS.split()}
POWERS: dict[int, int | Fraction] = {ca.OP_SQ: 2, ca.OP_SQRT: Fraction(1, 2), ca.OP_INV: -1}

SIGNS = {ca.OP_ADD: " + ", ca.OP_SUB: " - ", ca.OP_MUL: "*", ca.OP_DIV: "/"}


class Dimensioned(NamedTuple):
    """An expression as it is written, its unit, what is wrong with it, and whether it is the time but for numbers.

    condition: whether it is true or false; piece: whether it is a difference of conditions, which chooses in a table.
    """

    unit: Unit
    text: str
    fault: str = ""
    clock: bool = False
    condition: bool = False
    piece: bool = False


def check_units(flat: FlatModel) -> None:
    """ModelError naming equation, the two terms and their units, for the first that disagree."""
    with stage("units"):
        check_equations(flat, flat.equations, flat.initial_equations, _events(flat), _attributes(flat))


def check_equations(flat: FlatModel, *groups: Sequence[Equation]) -> None:
    """The same for other equations in the symbols of a model, group after group."""
    units = symbol_units(flat)
    quantities = (*flat.variables, *flat.parameters, *flat.propagated)
    symbols = [flat.time, *ca.vertcat(ca.SX(0, 1), *(ca.vec(v.symbol) for v in quantities)).elements()]
    symbols = [s for s in symbols if s.is_symbolic()]
    symbols += [*flat.derivatives.values(), *flat.before.values()]
    clock, *_ = names = [s.name() for s in symbols]  # the time stands first
    known = [Dimensioned(units[name], name, clock=name == clock) for name in names]
    for equations in groups:
        terms = _terms(symbols, known, [side for e in equations for side in (e.left, e.right)])
        for equation, *pair in zip(equations, terms[::2], terms[1::2], strict=True):
            fault = next((term.fault for term in pair if term.fault), "")
            left, right = (term.unit for term in pair)
            if not fault and not _agree(left, right):
                fault = (
                    f"units disagree in `{equation.text[:160]}`: the left side is in "
                    f"{_text(left)}, the right side in {_text(right)}; correct the equation or a declaration"
                )
            if fault and not {"", equation.path, equation.path.rpartition(".")[0]} & flat.unchecked:
                raise ModelError(f"{equation.name}: {fault}")


def _events(flat: FlatModel) -> list[Equation]:
    """Equations whose units agree if those of statements on instants do; a condition agrees with itself."""
    found = sides((*flat.sampled, *flat.frictions, *flat.whens, *flat.delays))
    if not found:
        return []
    symbols = {n: s for v in flat.variables for n, s in zip(v.elements, v.symbol.elements(), strict=True)}
    symbols[flat.time.name()] = flat.time
    return [replace(e, left=symbols.get(e.left.name(), e.right)) for e in found]


def _attributes(flat: FlatModel) -> list[Equation]:
    """Formulas of parameters, starts, limits and requirements as equations."""
    found: list[Equation] = []
    for one in (*flat.variables, *flat.parameters):
        for key in ("value", "start", "min", "max", "nominal"):
            formulas = getattr(one, key, None) or ()
            for k, formula in enumerate(formulas):
                if not formula.is_constant():
                    label, symbol = f"{one.elements[k]}: {key}", one.symbol.elements()[k]
                    found.append(Equation(symbol, formula, one.owner, "", 0, label=label))
    for one in flat.requirements:
        condition, label = ca.SX(one.condition), f"{one.path or 'the model'}: require"
        found.append(Equation(condition, condition, one.path, one.model, 0, label=label))
    return found


def symbol_units(flat: FlatModel) -> Mapping[str, Unit]:
    """Dimension of every scalar symbol, derivatives included, by name."""
    units: dict[str, Unit] = {flat.time.name(): dimension("s")}
    for variable in (*flat.variables, *flat.parameters, *flat.propagated):
        unit: Unit = ANY if variable.unit is None else _read(variable.unit, variable.name)
        units.update(dict.fromkeys(variable.elements, unit))
    for name in flat.derivatives:
        base, order = split_derivative(name)
        unit = units.get(base, ANY)
        units[name] = unit if isinstance(unit, str) else _times(unit, dimension("s"), -order)
    units.update((symbol.name(), units[name]) for name, symbol in flat.before.items())
    return units


def _read(unit: str, path: str) -> Dimension:
    try:
        return dimension(unit)
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from None


def _terms(
    symbols: Sequence[ca.SX], known: Sequence[Dimensioned], expressions: Sequence[ca.SX]
) -> list[Dimensioned]:
    """Scalar expressions with their units, in symbols of which they are known."""
    arguments, results = ([ca.densify(ca.vertcat(ca.SX(0, 1), *of))] for of in (symbols, expressions))
    function = ca.Function("units", arguments, results, {"cse": False, "allow_free": False})
    (found,) = computed(
        function, lambda _, k: known[k], lambda x: Dimensioned(NUMBER if x else ANY, f"{x:g}"), _operation
    )
    return found


def _operation(operator: int, operands: Sequence[Dimensioned]) -> Dimensioned:
    """The term that an operation makes; what is wrong with an operand goes on."""
    units, words = [term.unit for term in operands], [term.text for term in operands]
    constant = None
    if operator in (ca.OP_POW, ca.OP_CONSTPOW) and units[1] == NUMBER:
        with suppress(ValueError):  # of a function of time, which is a number as well
            constant = Fraction(words[1]).limit_denominator(1000)
    unit, fault = _unit(operator, units, words, constant)
    if fault and operator in ANGLES and operands[0].clock:
        unit, fault = NUMBER, None
    carried = next((term.fault for term in operands if term.fault), "")
    plain = [term for term in operands if term.unit != NUMBER]
    condition, piece = operator in RELATIONS, False
    if operator == ca.OP_SUB:  # the numbers of a table take the unit that is asked for
        piece = bool(plain) and all(term.condition or term.piece for term in plain)
    elif operator == ca.OP_AND:  # as `smoothly` writes it
        piece = any(term.piece for term in operands)
    if operator == ca.OP_IF_ELSE_ZERO and operands[0].piece:
        unit = ANY
    clock = (
        bool(plain) and all(term.clock and term.unit == unit for term in plain) and operator in CLOCK | KEEP
    )
    return Dimensioned(unit, _words(operator, words), carried or fault or "", clock, condition, piece)


def _unit(
    operation: int, units: list[Unit], words: list[str], power: int | Fraction | None
) -> tuple[Unit, str | None]:
    """Unit of one operation, and a message if its operands do not fit."""
    first, second = units[0], units[-1]
    if operation in SAME or operation in RELATIONS:
        fault = None
        if not _agree(first, second):
            fault = (
                f"units disagree: `{words[0][:60]}` is in {_text(first)}, `{words[1][:60]}` in {_text(second)}; both must "
                "be the same to be added or compared"
            )
        merged = next((u for u in units if not isinstance(u, str)), ANY if ANY in units else NUMBER)
        return (ONE if operation in RELATIONS else merged), fault
    if operation in KEEP:
        return first, None
    if operation == ca.OP_MUL:
        return _product(first, second, 1), None
    if operation == ca.OP_DIV:
        return _product(first, second, -1), None
    if operation in POWERS:
        return _power(first, POWERS[operation]), None
    if operation in (ca.OP_POW, ca.OP_CONSTPOW):
        return (_power(first, power) if power is not None else ANY), None
    if operation == ca.OP_ATAN2:
        return ONE, None if _agree(first, second) else f"atan2({words[0]}, {words[1]}) of different units"
    if operation in ANGLES:
        if isinstance(first, str) or first == ONE:
            return ONE, None
        name = ANGLES[operation]
        return ONE, (
            f"the argument of {name}, `{words[0][:60]}`, is in {_text(first)}, expected 1 or rad; a number has no unit, so "
            f"make its factor a Parameter(..., unit='{unit_text(_times(ONE, first, -1))}')"
        )
    if operation == ca.OP_IF_ELSE_ZERO:
        return second, None
    return (ONE if operation in (ca.OP_NOT, ca.OP_AND, ca.OP_OR, ca.OP_SIGN) else ANY), None


def _product(first: Unit, second: Unit, sign: int) -> Unit:
    if ANY in (first, second):
        return ANY
    if first == NUMBER and second == NUMBER:
        return NUMBER
    a = ONE if isinstance(first, str) else first
    b = ONE if isinstance(second, str) else second
    return _times(a, b, sign)


def _times(first: Dimension, second: Dimension, power: int) -> Dimension:
    if second == ONE:
        return first
    return tuple(a + power * b for a, b in zip(first, second, strict=True))


def _power(unit: Unit, power: int | Fraction) -> Unit:
    return unit if isinstance(unit, str) else tuple(whole(power * exponent) for exponent in unit)


def _agree(first: Unit, second: Unit) -> bool:
    return isinstance(first, str) or isinstance(second, str) or first == second


def _text(unit: Unit) -> str:
    return unit if isinstance(unit, str) else f"'{unit_text(unit)}'"


def _words(operation: int, words: list[str]) -> str:
    if operation in SIGNS:
        inside = SIGNS[operation].join(words)
        return f"({inside})"[:200]
    if operation == ca.OP_SQ:
        return f"{words[0]}^2"
    if operation == ca.OP_NEG:
        return f"-{words[0]}"
    return f"{ANGLES.get(operation, 'f')}({', '.join(words)})"[:200]
