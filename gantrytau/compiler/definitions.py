"""Propagated quantities in the symbols of the reduced equations: what they are, and their time derivatives.

Equations keep the symbols of orientations and angular velocities until they have been differentiated: by
the chain rule through the symbols, with d/dt R = w x R, the derivatives stay short. Then the expressions
are inserted, in one go, so that what they have in common is written once.
"""

from collections.abc import Callable, Mapping

import casadi as ca

from gantrytau.language.symbols import derivative_name, split_derivative

Shift = Callable[[str, int], ca.SX | None]  # (variable, order) -> what that derivative is; None: no variable


class Definitions:
    """Expressions of scalars by name, in an order in which each comes after those it needs.

    Derivatives of them become definitions too when they are asked for.
    """

    def __init__(
        self,
        symbols: Mapping[str, ca.SX],
        expressions: Mapping[str, ca.SX],
        rates: Mapping[str, ca.SX],
        variable: Shift,
    ):
        self._symbols = dict(symbols)
        self._expressions = dict(expressions)
        self._rates = rates
        self._variable = variable
        self._reduced: dict[str, ca.SX] = {}

    def __contains__(self, name: str) -> bool:
        return split_derivative(name)[0] in self._expressions

    def symbol(self, name: str) -> ca.SX:
        """The symbol that stands for a definition, or a derivative of one, in unresolved equations."""
        if name not in self._symbols:
            self._symbols[name] = ca.SX.sym(name)
        return self._symbols[name]

    def rate(self, leaf: ca.SX) -> ca.SX:
        """The time derivative of a leaf of an unresolved expression."""
        name = leaf.name()
        if name == "time":
            return ca.SX(1)
        base, order = split_derivative(name)
        if name in self:
            return self._define(derivative_name(base, order + 1))
        found = self._variable(base, order + 1)
        return ca.SX(0) if found is None else found

    def _define(self, name: str) -> ca.SX:
        if name not in self._expressions:
            base, order = split_derivative(name)
            below = derivative_name(base, order - 1)
            found = self._rates.get(below)
            self._expressions[name] = self.differentiated(self.expression(below)) if found is None else found
        return self.symbol(name)

    def expression(self, name: str) -> ca.SX:
        """The expression that a definition, or a derivative of one, stands for; not resolved."""
        if name not in self._expressions:
            self._define(name)
        return self._expressions[name]

    def differentiated(self, expression: ca.SX) -> ca.SX:
        """The time derivative of an unresolved expression, unresolved, of the same shape."""
        leaves = ca.symvar(expression)
        if not leaves:
            return ca.SX.zeros(*expression.shape)
        rates = ca.vertcat(*(self.rate(leaf) for leaf in leaves))
        return ca.densify(ca.jtimes(expression, ca.vertcat(*leaves), rates))

    def reduced(self, name: str) -> ca.SX:
        """A definition, or a derivative of one, in variables alone."""
        if not self._reduced:
            names = list(self._expressions)
            found = self.to_reduced(ca.vertcat(*(self.symbol(n) for n in names))).elements()
            self._reduced.update(zip(names, found, strict=True))
        if name not in self._reduced:
            self._reduced[name] = self.to_reduced(self.expression(name))
        return self._reduced[name]

    def to_reduced(self, expression: ca.SX) -> ca.SX:
        """The expression in variables alone."""
        order: dict[str, None] = {}
        stack = [(leaf.name(), False) for leaf in ca.symvar(expression) if leaf.name() in self]
        while stack:
            name, done = stack.pop()
            if done:
                order[name] = None
            elif name not in order:
                stack.append((name, True))
                inside = ca.symvar(self.expression(name))
                stack += [
                    (leaf.name(), False)
                    for leaf in inside
                    if leaf.name() in self and leaf.name() not in order
                ]
        if not order:
            return expression
        symbols = [self.symbol(name) for name in order]
        values = [self._expressions[name] for name in order]
        _, (found,) = ca.substitute_inplace(symbols, values, [expression], False)
        return found
