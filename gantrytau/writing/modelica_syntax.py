"""Expressions, names and strings in Modelica (Language Specification 3.6, sections 2.3 and 3.7)."""

from collections.abc import Mapping

from gantrytau.border.refusal import ModelError
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau.writing.instants_written import without_pre
from gantrytau.writing.syntax import AND, CHOICE, OR, POWER, PRODUCT, SUM, Arguments, Written
from gantrytau.writing.text import WORDS, PlainSyntax

OPERATORS = WORDS.keys() - {"==", "!="}
FUNCTIONS = {
    "abs": "abs", "sign": "sign", "sqrt": "sqrt", "exp": "exp", "log": "log",
    "sin": "sin", "cos": "cos", "tan": "tan", "asin": "asin", "acos": "acos", "atan": "atan", "atan2": "atan2",
    "sinh": "sinh", "cosh": "cosh", "tanh": "tanh", "floor": "floor", "ceil": "ceil",
    "min": "min", "max": "max", "fmod": "rem",
}  # fmt: skip


def quoted(name: str) -> str:
    """A name as a quoted identifier; letters beyond ASCII, which may not stand there, as their code."""
    escaped = name.replace("\\", "\\\\").replace("'", "\\'")
    return "'" + "".join(c if c.isascii() else f"U+{ord(c):04X}" for c in escaped) + "'"


def string(text: str) -> str:
    """A text as a Modelica string, on one line."""
    escaped = " ".join(text.split()).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


class ModelicaSyntax(PlainSyntax):
    """Modelica; spoken: texts of names that are no variables there."""

    name = "Modelica"

    def __init__(self, spoken: Mapping[str, Written] | None = None):
        self._spoken = {} if spoken is None else spoken

    def number(self, value: float) -> Written:
        """A number; ModelError for an infinite one."""
        if abs(value) == float("inf"):
            raise ModelError("found an infinite number, which Modelica cannot write; expected a finite one")
        return super().number(value)

    def symbol(self, name: str) -> Written:
        """A quoted name, the derivative of one, its value just before an instant, or `time`."""
        base, order = split_derivative(name)
        if order:
            return Written(f"der({self.variable(derivative_name(base, order - 1))})")
        if name in self._spoken or name == "time":
            return self._spoken.get(name, Written("time"))
        own = without_pre(name)
        return Written(quoted(name) if own == name else f"pre({quoted(own)})")

    def variable(self, name: str) -> str:
        """The name of a variable; '=der(x)' of one that is the derivative of another."""
        return quoted(f"={name}" if split_derivative(name).order else name)

    def shared(self, number: int) -> Written:
        """'=1', which is no name that Python could have."""
        return Written(quoted(f"={number}"))

    def apply(self, operation: str, arguments: Arguments) -> Written | None:
        """Operators, `if`, the built-in functions, and what can be said with them."""
        if operation in OPERATORS or operation == "select":
            return super().apply(operation, arguments)
        if operation in FUNCTIONS:
            return super().apply(FUNCTIONS[operation], arguments)
        return _paraphrase(operation, arguments)


def _paraphrase(operation: str, arguments: Arguments) -> Written | None:
    """What Modelica has no word for, in other words; None for what stays unsaid (erf and the like)."""
    a, b = arguments.bare(0), arguments.bare(len(arguments) - 1)
    sum_a, sum_b = arguments.held(0, SUM), arguments.held(len(arguments) - 1, SUM)
    base_a, base_b = arguments.held(0, 8), arguments.held(len(arguments) - 1, 8)
    forms = {
        # equality of reals is not allowed outside of functions (section 3.5)
        "==": Written(f"{sum_a} <= {sum_b} and {sum_a} >= {sum_b}", AND),
        "!=": Written(f"{sum_a} < {sum_b} or {sum_a} > {sum_b}", OR),
        "asinh": Written(f"sign({a})*log(abs({a}) + sqrt({base_a}^2 + 1))", PRODUCT),
        "acosh": Written(f"log({sum_a} + sqrt({base_a}^2 - 1))", POWER),
        "atanh": Written(f"log((1 + {sum_a})/(1 - {arguments.held(0, PRODUCT)}))/2", PRODUCT),
        "hypot": Written(f"sqrt({base_a}^2 + {base_b}^2)", POWER),
        "log1p": Written(f"log(1 + {sum_a})", POWER),
        "expm1": Written(f"exp({a}) - 1", SUM),
        "copysign": Written(f"if {b} >= 0 then abs({a}) else -abs({a})", CHOICE),
    }
    return forms.get(operation)
