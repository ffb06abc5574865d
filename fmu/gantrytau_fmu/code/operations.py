"""The operations of CasADi's scalar expressions, as they are written in C."""

INFIX = {"ADD": "+", "SUB": "-", "MUL": "*", "DIV": "/", "LT": "<", "LE": "<=", "EQ": "==", "NE": "!="}
INFIX |= {"AND": "&&", "OR": "||"}
CALLS = dict(EXP="exp", LOG="log", POW="pow", CONSTPOW="pow", SQRT="sqrt", SIN="sin", COS="cos", TAN="tan")
CALLS |= dict(ASIN="asin", ACOS="acos", ATAN="atan", SINH="sinh", COSH="cosh", TANH="gt_tanh", ASINH="asinh")
CALLS |= dict(ACOSH="acosh", ATANH="atanh", ATAN2="atan2", FLOOR="floor", CEIL="ceil", FMOD="fmod", ERF="erf")
CALLS |= dict(
    FABS="fabs", COPYSIGN="copysign", FMIN="fmin", FMAX="fmax", HYPOT="hypot", LOG1P="log1p", EXPM1="expm1"
)
CALLS |= dict(REMAINDER="remainder")
OTHERS = {
    "NEG": "-{0}",
    "SQ": "{0} * {0}",
    "TWICE": "2. * {0}",
    "INV": "1. / {0}",
    "NOT": "!{0}",
    "SIGN": "(double)(({0} > 0.) - ({0} < 0.))",
    "IF_ELSE_ZERO": "{0} != 0. ? {1} : 0.",
}
OPERATIONS = {name: f"{{0}} {sign} {{1}}" for name, sign in INFIX.items()}
OPERATIONS |= {name: f"{call}({{0}})" for name, call in CALLS.items()}
TWO = ("POW", "CONSTPOW", "ATAN2", "FMOD", "COPYSIGN", "FMIN", "FMAX", "HYPOT", "REMAINDER")
OPERATIONS |= {name: f"{CALLS[name]}({{0}}, {{1}})" for name in TWO}
OPERATIONS |= OTHERS


def number_text(value: float) -> str:
    """A C literal that reads back exactly."""
    if value != value:
        return "NAN"
    if value in (float("inf"), float("-inf")):
        return "INFINITY" if value > 0 else "(-INFINITY)"
    text = repr(float(value))
    text = text if any(c in text for c in ".e") else f"{text}."
    return f"({text})" if value < 0 else text
