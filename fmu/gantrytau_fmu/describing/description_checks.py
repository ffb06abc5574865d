"""What a description must obey before it is written, told in the words of the model.

FMI 2.0.4, sections 2.2.7 and 2.2.8; FMI 3.0.2, sections 2.4.7 and 2.4.8: names, the combinations of causality,
variability and initial, start values, and the lists of the model structure. The schemas do not see most of it.
"""

import re
from collections.abc import Collection, Iterable
from dataclasses import astuple
from math import isfinite

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.description import C_NAME, FmuDescription, FmuVariable, Unknown, Value

LETTERS = r"(?:[A-Za-z_]\w*|'(?:[\w!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['\"?\\abfnrtv])+')"
IDENTIFIER = rf"{LETTERS}(?:\[\d+(?:,\d+)*\])?(?:\.{LETTERS}(?:\[\d+(?:,\d+)*\])?)*"
STRUCTURED = re.compile(rf"(?:{IDENTIFIER}|der\({IDENTIFIER}(?:,\d+)?\))", re.ASCII)
INT32 = range(-(2**31), 2**31)

EXACT, FOUND, ANY = ("exact",), ("calculated", "approx"), ("calculated", "exact", "approx")
# what `initial` may be, the default first
INITIALS: dict[tuple[str, str], tuple[str | None, ...]] = {
    ("parameter", "fixed"): EXACT,
    ("parameter", "tunable"): EXACT,
    ("input", "discrete"): EXACT,
    ("input", "continuous"): EXACT,
    ("output", "constant"): EXACT,
    ("output", "discrete"): ANY,
    ("output", "continuous"): ANY,
    ("local", "constant"): EXACT,
    ("local", "fixed"): FOUND,
    ("local", "tunable"): FOUND,
    ("local", "discrete"): ANY,
    ("local", "continuous"): ANY,
    ("independent", "continuous"): (None,),
}


def initial_of(variable: FmuVariable) -> str | None:
    """How a variable gets its first value, with the standards' default where the record is silent."""
    return variable.initial or INITIALS[variable.causality, variable.variability][0]


def check_description(fmu: FmuDescription) -> None:
    """Raises ModelError for what no valid FMU can show; the message names the variable."""
    if fmu.fmi not in ("2.0", "3.0"):
        raise ModelError(f"fmi: found {fmu.fmi!r}, expected '2.0' or '3.0'")
    kinds = [each.kind for each in fmu.interfaces]
    if not kinds or {*kinds} - {"model-exchange", "co-simulation"}:
        raise ModelError(
            f"{fmu.name}: interfaces are {kinds}; expected 'model-exchange', 'co-simulation' or both"
        )
    if not C_NAME.fullmatch(fmu.identifier):
        raise ModelError(
            f"{fmu.name}: the model identifier {fmu.identifier!r} is no C name; use letters, digits and '_'"
        )
    _check_names(fmu)
    for place, variable in enumerate(fmu.variables):
        try:
            _check_variable(variable, place)
        except ModelError as error:
            raise ModelError(f"{fmu.name}: variable '{variable.name}': {error}") from None
    times = [v.name for v in fmu.variables if v.causality == "independent"]
    if len(times) > 1 or (fmu.fmi == "3.0" and not times):
        raise ModelError(f"{fmu.name}: found {len(times)} independent variables {times}, expected one, time")
    _check_experiment(fmu)
    _check_structure(fmu)


def _check_names(fmu: FmuDescription) -> None:
    seen: dict[str, int] = {}
    for place, variable in enumerate(fmu.variables):
        name = variable.name
        if not STRUCTURED.fullmatch(name):
            raise ModelError(
                f"{fmu.name}: variable {name!r} is no structured name; expected parts of ASCII letters, digits "
                "and '_' as in 'carts[0].s' or 'der(x,2)', other characters in apostrophes; rename it in the model"
            )
        if name in seen:
            raise ModelError(
                f"{fmu.name}: variable '{name}' is there twice, as references {seen[name]} and {place}; "
                "names are unique in an FMU"
            )
        seen[name] = place


def _check_variable(variable: FmuVariable, place: int) -> None:
    if variable.reference != place:
        raise ModelError(f"its value reference is {variable.reference}, expected its place, {place}")
    allowed = INITIALS.get((variable.causality, variable.variability))
    if allowed is None:
        raise ModelError(f"a {variable.variability} {variable.causality} does not exist in FMI")
    initial = initial_of(variable)
    if initial not in allowed:
        raise ModelError(
            f"initial is {initial!r}, a {variable.variability} {variable.causality} has {allowed}"
        )
    if not (variable.real or variable.integer):
        raise ModelError(f"its type is {variable.type}, expected Float64 or Int32, in FMI 2 Real or Integer")
    if variable.integer and variable.variability == "continuous":
        raise ModelError("an integer cannot be continuous; expected discrete, fixed, tunable or constant")
    if initial in ("exact", "approx"):
        _check_start(variable)
    low, high = limit(variable.min), limit(variable.max)
    if low is not None and high is not None and low > high:
        raise ModelError(f"min {low} is above max {high}")
    if variable.nominal is not None and variable.nominal <= 0:
        raise ModelError(f"nominal is {variable.nominal}, expected a size above zero")


def _check_start(variable: FmuVariable) -> None:
    start = variable.start
    if not isinstance(start, (int, float)) or not isfinite(start):
        raise ModelError(f"start is {start}, expected a finite number; give it a start value")
    if variable.integer and (start != int(start) or int(start) not in INT32):
        raise ModelError(f"start is {start}, expected a whole number of 32 bits")
    low, high = limit(variable.min), limit(variable.max)
    if (low is not None and start < low) or (high is not None and start > high):
        raise ModelError(f"start {start} is outside min {low} and max {high}; change the start or the limits")


def limit(value: Value | None) -> float | None:
    """A finite bound, nominal or start, or None: infinite ones say nothing and are not written."""
    return value if isinstance(value, (int, float)) and isfinite(value) else None


def _check_experiment(fmu: FmuDescription) -> None:
    told = fmu.experiment
    start, stop, tolerance, step = times = astuple(told)
    if None in times or not all(map(isfinite, times)):
        raise ModelError(f"{fmu.name}: the default experiment is {told}, expected finite numbers")
    if stop <= start or tolerance <= 0 or step <= 0:
        raise ModelError(
            f"{fmu.name}: the default experiment is {told}; expected a stop after the start, "
            "tolerance and step above zero"
        )


def _check_structure(fmu: FmuDescription) -> None:
    known, lists = fmu.by_name, fmu.structure
    where = f"{fmu.name}: model structure"
    for unknown in (*lists.outputs, *lists.derivatives, *lists.initial_unknowns):
        _check_unknown(unknown, known, where)
    outputs = {v.name for v in fmu.variables if v.causality == "output"}
    if wrong := _listed(outputs.symmetric_difference(fmu.outputs)) or _listed(_repeated(fmu.outputs)):
        raise ModelError(
            f"{where}: {wrong}: expected each output once in the list of outputs, and nothing else"
        )
    rates = [unknown.name for unknown in lists.derivatives]
    if wrong := _listed(_repeated(rates)):
        raise ModelError(f"{where}: {wrong} stands twice in the list of derivatives")
    for variable in fmu.variables:
        state = variable.derivative
        if state is not None and (state not in known or not _continuous(known[state])):
            raise ModelError(
                f"{where}: '{variable.name}' is the derivative of '{state}', expected a continuous variable"
            )
    for name in rates:
        if known[name].derivative is None:
            raise ModelError(f"{where}: '{name}' is listed as a derivative, but of no state")
    if wrong := _listed(_repeated(fmu.states)):
        raise ModelError(f"{where}: state {wrong} has two derivatives")
    for name in lists.indicators if fmu.fmi == "3.0" else ():
        if name not in known or not _continuous(known[name]):
            raise ModelError(f"{where}: event indicator '{name}' is no continuous real variable; make it one")
    for terminal in fmu.terminals:
        if wrong := [
            f"{terminal.name}.{member}" for member, name in terminal.members.items() if name not in known
        ]:
            raise ModelError(f"{fmu.name}: terminal members {wrong} refer to no variable")


def _check_unknown(unknown: Unknown, known: Collection[str], where: str) -> None:
    needed = unknown.dependencies or ()
    if wrong := [name for name in (unknown.name, *needed) if name not in known]:
        raise ModelError(f"{where}: unknown '{unknown.name}': {_listed(wrong)}: expected names of variables")
    if (unknown.kinds is not None and len(unknown.kinds) != len(needed)) or _repeated(needed):
        raise ModelError(
            f"{where}: unknown '{unknown.name}' has {len(needed)} dependencies {needed} "
            f"and {len(unknown.kinds or ())} kinds; expected one kind for each, and each once"
        )


def _continuous(variable: FmuVariable) -> bool:
    return variable.real and variable.variability == "continuous"


def _repeated(names: Iterable[str]) -> set[str]:
    seen: set[str] = set()
    return {name for name in names if name in seen or seen.add(name)}


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"'{name}'" for name in sorted(names))
