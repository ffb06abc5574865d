"""What `equations(self)` yields: equations, connections, and the branches of orientation trees."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.language.functions import Between
from gantrytau.language.model import Connector, Declared
from gantrytau.language.scalar_arithmetic import minus
from gantrytau.language.symbols import scalars


@dataclass(frozen=True, eq=False)
class Equation:
    """A scalar equation `left == right` and where it stands.

    dual: name of the force that enforces it, if it is a constraint that may turn out to repeat others;
    label: its name, where component and number do not say what it is; rate: time derivative of its
    residual where it holds, if that is shorter than the derivative of the residual.
    """

    left: ca.SX
    right: ca.SX
    path: str
    model: str
    number: int
    element: int | None = None
    dual: str = ""
    label: str = ""
    rate: ca.SX | None = None

    @cached_property
    def residual(self) -> ca.SX:
        """Left - right."""
        return minus(self.left, self.right)

    @property
    def name(self) -> str:
        """Where the equation stands: 'carts[0] (Cart), equation 2, row 1'."""
        if self.label:
            return self.label
        row = "" if self.element is None else f", row {self.element}"
        return place_of(self.path, self.model, self.number) + row

    @property
    def text(self) -> str:
        """The equation as written."""
        return f"{self.left} == {self.right}"


def place_of(path: str, model: str, number: int | None = None) -> str:
    """Where a statement stands: its component, and its number there."""
    return f"{path or 'the model'} ({model})" + ("" if number is None else f", equation {number}")


@dataclass(frozen=True, eq=False)
class Connection:
    """`connect(a, b)`."""

    a: Any
    b: Any


@dataclass(frozen=True, eq=False)
class Constraint:
    """An equation, and the force or torque that enforces it."""

    equation: Any
    dual: Any


@dataclass(frozen=True, eq=False)
class Requirement:
    """What parameters must satisfy: an expression that is true or not, and the message if it is not."""

    condition: Any
    message: str
    path: str = ""
    model: str = ""


@dataclass(frozen=True, eq=False)
class Branch:
    """A rigid or jointed way along which propagated quantities go from connector a to b and back."""

    a: Any
    b: Any
    forward: dict[str, Any]
    backward: dict[str, Any]
    coordinates: Any = None
    equations: tuple[Any, ...] = ()
    otherwise: tuple[Any, ...] = ()


@dataclass(frozen=True, eq=False)
class Root:
    """A connector whose propagated quantities are given."""

    connector: Any
    values: dict[str, Any]
    coordinates: Any = None
    equations: tuple[Any, ...] = ()
    priority: float | None = None

    @property
    def optional(self) -> bool:
        """Whether it is a root only where no other way leads to the connector; those of low priority come first."""
        return self.coordinates is not None or self.priority is not None


@dataclass(frozen=True, eq=False)
class OfTheTree:
    """Statements that depend on the spanning tree, as a function of an answer.

    The question: whether `connector` is a root, or, unless `only_root`, nearer to the root than the other end of its branch.
    """

    connector: Any
    only_root: bool
    statements: Callable[[bool], Iterable[Any]]


def connect(a: Any, b: Any) -> Connection:
    """Join two connectors: equal potentials, flows that sum to zero. Or two signals: equality.

    Raises ModelError if the two are not of the same kind.
    """
    if not all(isinstance(end, Connector) for end in (a, b)) and any(isinstance(x, Declared) for x in (a, b)):
        raise ModelError(
            f"connect({type(a).__name__}, {type(b).__name__}): expected two connectors; name those of the components, such "
            "as connect(mass.flange, spring.flange_a)"
        )
    return Connection(a, b)


def constraint(equation: Any, *, dual: Any) -> Constraint:
    """State an equation between positions that a force or torque enforces.

    dual: that force, a variable of the same shape, whose power is dual * d/dt(left - right) up to a factor.
    Where the equation repeats others, as in planar loops, it is dropped and its dual is zero.
    """
    return Constraint(equation, dual)


def require(condition: Any, message: str) -> Requirement:
    """State what the parameters of a component must satisfy; ModelError with the message where they do not.

    condition: a relation of parameters, `self.L > 0`; message: what was expected and what to do.
    """
    return Requirement(condition, message)


def branch(
    a: Connector,
    b: Connector,
    *,
    forward: dict[str, Any],
    backward: dict[str, Any],
    coordinates: Any = None,
    equations: Iterable[Any] = (),
    otherwise: Iterable[Any] = (),
) -> Branch:
    """State how propagated quantities of `b` follow from those of `a` (forward), and the reverse.

    coordinates: a variable that describes the way, if loops should rather be opened here: it exists only
    while the way is needed to reach b or a, with `equations`; else `otherwise` holds.
    """
    return Branch(a, b, forward, backward, coordinates, tuple(equations), tuple(otherwise))


def root(
    connector: Connector, *, coordinates: Any = None, equations: Iterable[Any] = (), **values: Any
) -> Root:
    """State the propagated quantities of a connector outright, as the world frame does.

    coordinates: a variable that describes them, if this should only be a root where no other way leads to
    the connector, as for a free body: it exists only then, with `equations`.
    """
    return Root(connector, values, coordinates, tuple(equations))


def equality(statement: Any, path: str, model: str, number: int) -> list[Equation]:
    """The scalar equations of one yielded `a == b`; ModelError if it is no equation or the shapes differ."""
    if isinstance(statement, Constraint):
        found = equality(statement.equation, path, model, number)
        duals = [dual.name() for dual in scalars(statement.dual)]
        return [replace(e, dual=duals[e.element or 0]) for e in found]
    place = place_of(path, model, number)
    if isinstance(statement, (bool, np.bool_)):
        raise ModelError(
            f"{place}: found {statement!r}, expected an equation `a == b` of symbols; Python compared the "
            "two sides itself. Join symbols with casadi.vertcat(...) instead of a list"
        )
    if isinstance(statement, Between) or not isinstance(statement, (ca.SX, ca.DM)):
        raise ModelError(
            f"{place}: found {type(statement).__name__}, expected an equation `a == b` or connect(a, b)"
        )
    found: list[Equation] = []
    elements = scalars(statement)
    for row, element in enumerate(elements):
        if element.is_constant():
            if float(element) == 0.0:
                raise ModelError(f"{place}: both sides are constants that differ, so it can never hold")
            continue
        if not element.is_op(ca.OP_EQ):
            raise ModelError(f"{place}: found '{str(element)[:80]}', expected an equation; write `a == b`")
        found.append(
            Equation(element.dep(0), element.dep(1), path, model, number, row if len(elements) > 1 else None)
        )
    if not found:
        raise ModelError(f"{place}: both sides are the same, so it says nothing; remove it or correct it")
    # CasADi repeats a scalar to fit a vector; a number may stand for a vector of numbers, a symbol may not
    for nodes in ([e.left for e in found], [e.right for e in found]):
        once = len(nodes) > 1 and len({node.element_hash() for node in nodes}) == 1
        if once and not nodes[0].is_constant():
            raise ModelError(
                f"{place}: found shapes ({len(found)},) and () in '{found[0].text}' and the rows below, expected the same "
                "shape on both sides; index the vector, or repeat the scalar in separate equations"
            )
    return found
