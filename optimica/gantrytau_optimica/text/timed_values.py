"""Expressions of Optimica as values: those of Modelica, and variables at times, `x(finalTime)`."""

from typing import Any

from gantrytau import ModelError
from gantrytau.modelica import tree
from gantrytau.modelica.elaboration import values
from gantrytau.modelica.elaboration.interpreter import Interpreter
from gantrytau.modelica.elaboration.scopes import TextError
from gantrytau_optimica.problem.optimization import at, final, initial

ENDS = {"startTime": initial, "finalTime": final}


class TimedInterpreter(Interpreter):
    """Evaluates expressions of an optimization, in which a variable may be called with a time."""

    def results(self, expression: Any) -> Any:
        if not isinstance(expression, tree.Call) or not self._is_variable(expression.function):
            return super().results(expression)
        try:
            return self._at_time(expression)
        except TextError:
            raise
        except ModelError as error:
            self.scope.refuse(expression.at, str(error))

    def _is_variable(self, function: tree.ComponentReference) -> bool:
        name = function.parts[0][0]
        return name in self.local or self.members.has(name)

    def _at_time(self, call: tree.Call) -> Any:
        if len(call.arguments) != 1 or call.named or call.iterators:
            name = ".".join(part for part, _ in call.function.parts)
            raise ModelError(f"found the variable '{name}' called, expected one time, as {name}(finalTime)")
        (when,) = call.arguments
        signal = self.value(call.function)
        if hasattr(signal, "member") or isinstance(signal, (list, str)):
            raise ModelError("found a component called with a time, expected a variable of it")
        if values.is_number(signal):
            return signal
        if isinstance(when, tree.ComponentReference) and len(when.parts) == 1 and when.parts[0][0] in ENDS:
            return _each(ENDS[when.parts[0][0]], signal)
        instant = self.value(when)
        return _each(lambda one: at(instant, one), signal)


def _each(sampled: Any, signal: Any) -> Any:
    shape = values.boxed(signal).shape
    return values.from_casadi(sampled(values.to_casadi(signal)), shape)
