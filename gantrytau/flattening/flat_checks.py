"""What cannot be in a model that is written out: numbers that are none, coordinates that do not exist, what jumps."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence

import casadi as ca

from gantrytau.border.refusal import ModelError
from gantrytau.flattening.flat_model import FlatModel, FlatVariable
from gantrytau.flattening.instantiation import Instance
from gantrytau.language.instructions import refuse_calls
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import split_derivative


def refuse_nan(equations: Iterable[Equation]) -> None:
    """Functions of the module math turn a symbol into nan without a word."""
    equations = tuple(equations)
    if equations and re.search(r"\bnan\b", str(ca.vertcat(*(e.residual for e in equations)))):
        for equation in equations:
            if re.search(r"\bnan\b", equation.text):
                raise ModelError(
                    f"{equation.name}: found nan in `{equation.text[:100]}`, expected symbols and finite numbers; functions "
                    "of the module math do not work on symbols, use those of gantrytau or casadi"
                )


def refuse_tables(equations: Iterable[Equation]) -> None:
    """ModelError with the name of an equation that calls what is no expression, as a table."""
    equations = tuple(equations)
    try:
        refuse_calls("", *(e.residual for e in equations))
    except ModelError:
        for equation in equations:
            refuse_calls(equation.name, equation.residual)


def first_with(
    equations: Sequence[Equation], names: Iterable[str], wrong: Callable[[str], bool]
) -> tuple[Equation, str] | None:
    """The first equation with a symbol of a wrong name, and that name; names: of all symbols in these equations or more."""
    if not any(map(wrong, names)):
        return None
    leaves = ((equation, leaf.name()) for equation in equations for leaf in ca.symvar(equation.residual))
    return next(((equation, name) for equation, name in leaves if wrong(name)), None)


def refuse_absent(equations: Sequence[Equation], names: Iterable[str], absent: Mapping[str, str]) -> None:
    """ModelError for an equation with a coordinate that does not exist; names: of all symbols in the equations."""
    if absent and (found := first_with(equations, names, lambda n: split_derivative(n)[0] in absent)):
        name = split_derivative(found[1])[0]
        raise ModelError(
            f"{found[0].name}: found {name}, which does not exist: {absent[name]}; use the orientation R "
            "or angular velocity w of a frame instead"
        )


def refuse_starts(instance: Instance, absent: Mapping[str, str]) -> None:
    """Start values of coordinates that do not exist would be lost silently."""
    for placed in instance.quantities:
        start = placed.attributes.get("start")
        changed = start is not None and start.value is not placed.declaration.start
        if placed.elements[0] in absent and changed:
            raise ModelError(
                f"{placed.name}: found a start value, but it does not exist: {absent[placed.elements[0]]}; give start "
                "values to the coordinates of those joints"
            )


def refuse_before(equations: Sequence[Equation], names: Iterable[str]) -> None:
    """ModelError for a value just before an instant where there is none; names: of all symbols in the equations or more."""
    if found := first_with(equations, names, lambda n: n.startswith("pre(")):
        raise ModelError(
            f"{found[0].name}: found {found[1]}, expected it in when(...) only: an equation holds at all times, "
            "and sampled(...) sees the values before anyway; keep the value in a Discrete that a when sets"
        )


def refuse_bound(discretes: Iterable[FlatVariable], equations: Iterable[Equation]) -> None:
    """ModelError for a Discrete that a modification sets by an equation."""
    names = {v.name for v in discretes}
    for equation in equations:
        if equation.model == "binding" and equation.path in names:
            own = equation.path.rpartition(".")[2]
            raise ModelError(
                f"{equation.path}: found the modification {own}={equation.right}, an equation, but only actions of when set "
                f"a Discrete; its start value is {own}=Start({equation.right})"
            )


REFUSED = {  # statements on instants -> why they cannot be
    "frictions": "found friction that sticks, whose equations change at instants, expected equations that stay. simulate "
    "and FMUs let it stick; optimisation, linearisation and extraction cannot: take a smooth friction there, TanhFriction. "
    "translate(..., events=True) takes its force as known",
    "whens": "found a condition at which variables jump, expected continuous equations. simulate and FMUs act upon it; "
    "optimisation, linearisation and extraction cannot: leave it out there, or write it as a continuous equation",
    "delays": "found a value of the past, expected equations of one time. simulate and FMUs remember it; functions, linear "
    "systems and optimisation cannot: leave it out there, or write a chain of first-order lags, T / n * der(y) == x - y, "
    "n times; translate(..., events=True) takes it as known",
    "laws": "found a function of Python that is called at instants, expected formulas. simulate calls it; optimisation, "
    "linearisation, extraction, C code, FMUs and Modelica cannot: leave it out there",
    "sampled": "found a value that jumps at instants, expected continuous equations. simulate, linearize and FMUs sample "
    "it; optimisation and extraction cannot: leave it out there, or write it as a continuous equation. "
    "translate(..., events=True) takes it as known",
}


def refuse_events(flat: FlatModel, *kinds: str) -> None:
    """ModelError naming the first statement on instants, of some kinds of REFUSED or of all.

    A when that only ends the run with an error, an `assert`, sets nothing: the equations stay.
    """
    for kind in kinds or REFUSED:
        for one in getattr(flat, kind):
            if not getattr(one, "failure", ""):
                raise ModelError(REFUSED[kind], place=one.label)
