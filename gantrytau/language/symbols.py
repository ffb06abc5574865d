"""The symbols of one instantiated model and their time derivatives."""

from collections.abc import Iterable
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca

from gantrytau.border.checks import whole
from gantrytau.border.refusal import ModelError
from gantrytau.language.instructions import refuse_calls

LONG = 60  # of an expression in a message, from where on only its symbols are named
time = ca.SX.sym("time")  # the independent variable of every model, in s


class Derivative(NamedTuple):
    """The order-th time derivative of a variable, 0 for the variable itself: how structural passes know a symbol."""

    root: str
    order: int

    @property
    def name(self) -> str:
        """`der(der(x))` of ("x", 2)."""
        return derivative_name(self.root, self.order)


@dataclass(frozen=True, eq=False)
class Symbol:
    """A scalar symbol: a variable, a parameter, or the `order`-th derivative of variable `base`.

    kind: real, input, output, discrete, flow, parameter, propagated; pre: a value just before an instant.
    """

    name: str
    sx: ca.SX
    kind: str
    base: str
    order: int


@dataclass(frozen=True, eq=False)
class Range:
    """Numbers between which a scalar expression has to stay, in its unit, lest something is not defined."""

    expression: ca.SX
    low: float
    high: float

    @property
    def left(self) -> str:
        """What is said where it does not stay there."""
        return (
            f"{self.name} leaves its table, which ends at {self.low:g} and {self.high:g}, and is not defined beyond; add "
            "points, or let it go on with outside='hold' or 'linear'"
        )

    @property
    def name(self) -> str:
        """What has to stay there, as it is written."""
        text = str(self.expression)
        return (
            text
            if len(text) < LONG
            else f"an expression of {', '.join(map(str, ca.symvar(self.expression)))}"
        )


@dataclass(frozen=True, eq=False)
class Delayed:
    """A scalar expression as it was some time ago: its symbol, and that time, s."""

    symbol: ca.SX
    expression: ca.SX
    time: ca.SX

    @property
    def name(self) -> str:
        """`delay(x, T)`."""
        return self.symbol.name()


class Symbols:
    """All scalar symbols of one model, found by name or by the CasADi node that stands for them; ranges: noted so far."""

    def __init__(self) -> None:
        self.by_name: dict[str, Symbol] = {}
        self.ranges: list[Range] = []
        self.delays: dict[str, Delayed] = {}
        self._by_node: dict[int, Symbol] = {}

    def add(self, name: str, kind: str, base: str | None = None, order: int = 0) -> Symbol:
        """A new symbol of that name."""
        symbol = Symbol(name, ca.SX.sym(name), kind, base or name, order)
        self.by_name[name] = symbol
        self._by_node[symbol.sx.element_hash()] = symbol
        return symbol

    def find(self, node: ca.SX) -> Symbol | None:
        """The symbol that the scalar expression `node` is, or None."""
        return self._by_node.get(node.element_hash())

    def derivative(self, symbol: Symbol) -> Symbol:
        """The time derivative of a variable, made when it is first asked for."""
        name = derivative_name(symbol.base, symbol.order + 1)
        return self.by_name.get(name) or self.add(name, symbol.kind, symbol.base, symbol.order + 1)

    def before(self, symbol: Symbol) -> Symbol:
        """The value of a variable just before an instant, made when it is first asked for."""
        name = f"pre({symbol.name})"
        return self.by_name.get(name) or self.add(name, "pre", symbol.name)

    def total_derivative(self, expression: ca.SX) -> ca.SX:
        """d/dt of a scalar expression by the chain rule; parameters are constant."""
        found = self.find(expression)
        if found is not None:
            _refuse_jump(found)
            return ca.SX(0) if found.kind == "parameter" else self.derivative(found).sx
        refuse_calls("der()", expression)
        inside, rates = [time], [ca.SX(1)]
        for leaf in ca.symvar(expression):
            symbol = self.find(leaf)
            if symbol is not None and symbol.kind != "parameter":
                _refuse_jump(symbol)
                inside.append(leaf)
                rates.append(self.derivative(symbol).sx)
        return ca.jtimes(expression, ca.vertcat(*inside), ca.vertcat(*rates))


def _refuse_jump(symbol: Symbol) -> None:
    """ModelError for what jumps at instants and has no derivative there."""
    if symbol.kind == "delayed":
        raise ModelError(
            f"der(): found {symbol.name}, whose derivative is none of its own, expected a variable; delay the derivative "
            "instead: delay(der(x), T)"
        )
    if symbol.kind in ("discrete", "pre"):
        raise ModelError(
            f"der(): found {symbol.name}, which jumps at instants and is constant between them, expected what has a "
            "derivative; pass it through a filter (gantrytau.mechanics.filters.LowPass), or differentiate the rest alone"
        )


def derivative_name(base: str, order: int) -> str:
    """`der(der(x))` for ("x", 2)."""
    return "der(" * order + base + ")" * order


@lru_cache(maxsize=100_000)  # the same few names, again and again
def split_derivative(name: str) -> Derivative:
    """("x", 2) for `der(der(x))`."""
    order = 0
    while name.startswith("der(") and name.endswith(")"):
        name, order = name[4:-1], order + 1
    return Derivative(name, order)


def derivatives_in(expression: ca.SX) -> tuple[Derivative, ...]:
    """The symbols of an expression as variables and orders: a row of the structural incidence."""
    return tuple(split_derivative(leaf.name()) for leaf in ca.symvar(expression))


def element_names(name: str, shape: tuple[int, ...], first: int = 0) -> list[str]:
    """Names of the elements of a quantity, column after column as CasADi orders them; first: the lowest index."""
    if shape == ():
        return [name]
    rows, *columns = (range(first, first + size) for size in shape)
    if not columns:
        return [f"{name}[{i}]" for i in rows]
    return [f"{name}[{i},{j}]" for j in columns[0] for i in rows]


_current: ContextVar[Symbols | None] = ContextVar("symbols of the model being written out", default=None)


@contextmanager
def writing(symbols: Symbols):
    """While it lasts, `der` refers to these symbols."""
    token = _current.set(symbols)
    try:
        yield
    finally:
        _current.reset(token)


def note_range(expression: ca.SX, low: float, high: float) -> None:
    """Note where a scalar expression of the model that is being written out has to stay."""
    symbols = _current.get()
    if symbols is not None and not expression.is_constant():
        symbols.ranges.append(Range(expression, low, high))


def of_parameters(expression: ca.SX) -> bool:
    """Whether an expression of the model that is written out holds parameters only."""
    symbols = _current.get()
    found = [None if symbols is None else symbols.find(leaf) for leaf in ca.symvar(expression)]
    return all(one is not None and one.kind == "parameter" for one in found)


def delayed(expressions: Iterable[ca.SX], time: ca.SX) -> list[ca.SX]:
    """The symbols of scalar expressions as they were some time ago; ModelError outside of the equations of a model."""
    symbols = _current.get()
    if symbols is None:
        raise ModelError("delay() was called outside of equations(self), where there are no symbols yet")
    found = []
    for one in expressions:
        text = str(one)
        name = f"delay({text if len(text) < LONG else f'expression {len(symbols.delays) + 1}'}, {time})"
        if name not in symbols.delays:
            symbols.delays[name] = Delayed(symbols.add(name, "delayed").sx, one, time)
        found.append(symbols.delays[name].symbol)
    return found


def der(expression: Any, order: int = 1) -> ca.SX:
    """Time derivative of a variable or expression, of the same shape; for use in equations(self).

    order: how often it is differentiated. Raises ModelError outside of the equations of a model.
    """
    whole("der", "order", order, least=1)
    symbols = _current.get()
    if symbols is None:
        raise ModelError(
            "der() was called outside of equations(self), where there are no symbols yet; "
            "a result is asked for a derivative by name: result['der(x)']"
        )
    expression = ca.densify(ca.SX(expression))
    elements = expression.elements()
    for _ in range(order):
        elements = [symbols.total_derivative(element) for element in elements]
    return ca.reshape(ca.vertcat(*elements), *expression.shape)


def pre(expression: Any) -> ca.SX:
    """The value of a variable or expression just before an instant, of the same shape; for use in `when`.

    Raises ModelError outside of the equations of a model.
    """
    symbols = _current.get()
    if symbols is None:
        raise ModelError(
            "pre() was called outside of equations(self), where there are no symbols yet; "
            "a result has both sides of a jump, at two equal times"
        )
    expression = ca.densify(ca.SX(expression))
    leaves = [(leaf, symbols.find(leaf)) for leaf in ca.symvar(expression)]
    moving = [(leaf, s) for leaf, s in leaves if s is not None and s.kind != "parameter"]
    for _, symbol in moving:
        if symbol.kind == "pre":
            raise ModelError(
                f"pre(): found {symbol.name}, a value just before, expected a variable; keep older values in a Discrete"
            )
    if not moving:
        return expression
    before = [symbols.before(symbol).sx for _, symbol in moving]
    return ca.substitute(expression, ca.vertcat(*(leaf for leaf, _ in moving)), ca.vertcat(*before))


def scalars(expression: Iterable[Any] | Any) -> list[ca.SX]:
    """The elements of an SX (or of numbers), column after column."""
    found: Any = expression if isinstance(expression, ca.SX) else ca.SX(expression)
    return (found if found.is_dense() else ca.densify(found)).elements()
