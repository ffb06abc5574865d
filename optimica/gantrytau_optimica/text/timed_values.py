"""Expressions of Optimica as values: those of Modelica, and variables at times, `x(finalTime)`."""

from dataclasses import dataclass, replace
from typing import Any, Literal

from gantrytau import ModelError
from gantrytau.modelica import tree
from gantrytau.modelica.elaboration import values
from gantrytau.modelica.elaboration.interpreter import Interpreter
from gantrytau.modelica.elaboration.scopes import TextError
from gantrytau.modelica.printer import expression_written
from gantrytau_optimica.problem.optimization import at, final, initial

ENDS = {"startTime": initial, "finalTime": final}


@dataclass(frozen=True, eq=False)
class TimedInterpreter(Interpreter):
    """Evaluates expressions of an optimization, in which a variable may be called with a time.

    instants: whether variables stand with their times only, as in an objective, or never with a time, as in an integrand.
    """

    instants: Literal["only", "may", "never"] = "may"

    def results(self, expression: Any) -> Any:
        try:
            if isinstance(expression, tree.Call) and self._is_variable(expression.function):
                return self._at_time(expression)
            if self.instants == "only" and isinstance(expression, tree.ComponentReference):
                self._refuse_bare(expression)
        except TextError:
            raise
        except ModelError as error:
            self.scope.refuse(expression.at, str(error))
        return super().results(expression)

    def _is_variable(self, function: tree.ComponentReference) -> bool:
        name = function.parts[0][0]
        return name in self.local or self.members.has(name)

    def _refuse_bare(self, reference: tree.ComponentReference) -> None:
        if reference.parts[0][0] not in self.local and not self.members.structure.is_fixed(reference):
            name = expression_written(reference)
            end = "finalTime" if name == "time" else f"{name}(finalTime)"
            raise ModelError(
                f"found '{name}', which changes over time, expected a value at a time, as {end}, or the objectiveIntegrand"
            )

    def _at_time(self, call: tree.Call) -> Any:
        name = expression_written(call.function)
        if self.instants == "never":
            raise ModelError(
                f"found '{name}' at a time in an integrand, expected variables over time, as {name}"
            )
        if len(call.arguments) != 1 or call.named or call.iterators:
            raise ModelError(f"found the variable '{name}' called, expected one time, as {name}(finalTime)")
        (when,) = call.arguments
        signal = replace(self, instants="may").value(call.function)
        if isinstance(signal, str) or not values.is_plain(signal):
            raise ModelError(f"found the component '{name}' called with a time, expected a variable of it")
        if values.is_number(signal):
            return signal
        if isinstance(when, tree.ComponentReference) and len(when.parts) == 1 and when.parts[0][0] in ENDS:
            return _each(ENDS[when.parts[0][0]], signal)
        if not self.members.structure.is_fixed(when):
            words = f"found {name}({expression_written(when)}), expected a time of numbers and parameters"
            raise ModelError(f"{words}, as {name}(finalTime)")
        instant = self.value(when)
        return _each(lambda one: at(instant, one), signal)


def _each(sampled: Any, signal: Any) -> Any:
    shape = values.boxed(signal).shape
    return values.from_casadi(sampled(values.to_casadi(signal)), shape)
