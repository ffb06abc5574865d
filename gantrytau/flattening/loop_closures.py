"""A connection that closes a loop: residuals that must vanish, each with the force or torque that enforces it."""

from collections.abc import Sequence

import casadi as ca

from gantrytau.border.refusal import ModelError
from gantrytau.flattening.flat_model import FlatVariable, Loop
from gantrytau.flattening.instantiation import Instance
from gantrytau.flattening.propagation import propagated
from gantrytau.language.model import Connector
from gantrytau.language.statements import Connection, Equation
from gantrytau.language.symbols import element_names, scalars

AXES = "xyz"


class Closure:
    """The equations and multipliers of one closing connection.

    The multipliers are the flows that pass from the first connector to the second; those of residuals
    that repeat others can be zero. Without residuals it is a connection as any other.
    """

    def __init__(self, instance: Instance, number: int, stated: tuple[str, Connection], loop: Loop):
        self.connection = stated[1]
        a, b = self.connection.a, self.connection.b
        self.equations: list[Equation] = []
        self.variables: list[FlatVariable] = []
        self._flows: dict[str, list[ca.SX]] = {}
        for words, flow, basis, residual, rate in a.closing(b):
            name = f"loops[{number}].{flow}"
            self._add(instance, name, (loop.a, loop.b, words), scalars(residual), scalars(rate))
            self._flows[flow] = scalars(basis @ self.variables[-1].symbol)
        if not self.equations and type(a).closing is Connector.closing:
            raise ModelError(
                f"connect({loop.a}, {loop.b}) closes a loop of {', '.join(propagated(a))}, and "
                f"{type(a).__name__} does not say what that means; give it a method `closing`"
            )

    def _add(
        self,
        instance: Instance,
        name: str,
        where: tuple[str, str, str],
        elements: list[ca.SX],
        rates: Sequence[ca.SX],
    ) -> None:
        a, b, words = where
        flow = name.rpartition(".")[2]
        declaration = type(self.connection.a).members()[flow]
        names = element_names(name, (len(elements),))
        symbols = [instance.symbols.add(n, "real").sx for n in names]
        self.variables.append(
            FlatVariable(
                name,
                "real",
                (len(elements),),
                tuple(names),
                ca.vertcat(*symbols),
                declaration.unit,
                f"cut from {a} to {b}, resolved in {a}",
                owner=name.partition(".")[0],
            )
        )
        for k, (element, rate, dual) in enumerate(zip(elements, rates, names, strict=True)):
            label = f"{a} - {b}, {words} {AXES[k]}" if len(elements) == 3 else f"{a} - {b}, {words} {k}"
            self.equations.append(
                Equation(element, ca.SX(0), a, "loop", 1, k, dual=dual, label=label, rate=rate)
            )

    def flow(self, name: str, row: int) -> ca.SX:
        """What passes from the first connector to the second."""
        return self._flows[name][row] if name in self._flows else ca.SX(0)
