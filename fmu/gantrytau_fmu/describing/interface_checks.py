"""What an interface must obey before it is written, told in the words of the model.

FMI 2.0.4, sections 2.2.7 and 2.2.8; FMI 3.0.2, sections 2.4.7 and 2.4.8: names, the combinations of causality,
variability and initial, start values, and the lists of the model structure. The schemas do not see most of it.
"""

import re
from collections.abc import Iterable
from math import isfinite

from gantrytau.errors import ModelError
from gantrytau_fmu.description import Interface, Unknown, Variable

LETTERS = r"(?:[A-Za-z_]\w*|'(?:[\w!#$%&()*+,\-./:;<>=?@\[\]^{}|~ ]|\\['\"?\\abfnrtv])+')"
IDENTIFIER = rf"{LETTERS}(?:\[\d+(?:,\d+)*\])?(?:\.{LETTERS}(?:\[\d+(?:,\d+)*\])?)*"
STRUCTURED = re.compile(rf"(?:{IDENTIFIER}|der\({IDENTIFIER}(?:,\d+)?\))", re.ASCII)
C_NAME = re.compile(r"[A-Za-z_]\w*", re.ASCII)
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


def initial_of(variable: Variable) -> str | None:
    """How a variable gets its first value, with the standards' default where the record is silent."""
    return variable.initial or INITIALS[variable.causality, variable.variability][0]


def check_interface(interface: Interface, fmi: str) -> None:
    """Raises ModelError for what no valid FMU can show; the message names the variable."""
    if fmi not in ("2.0", "3.0"):
        raise ModelError(f"fmi: found {fmi!r}, expected '2.0' or '3.0'")
    known = ("model-exchange", "co-simulation")
    if not interface.interfaces or any(kind not in known for kind in interface.interfaces):
        raise ModelError(
            f"{interface.name}: interfaces are {list(interface.interfaces)}; "
            "expected 'model-exchange', 'co-simulation' or both"
        )
    if not C_NAME.fullmatch(interface.identifier):
        raise ModelError(
            f"{interface.name}: the model identifier {interface.identifier!r} is no C name; use letters, digits and '_'"
        )
    _check_names(interface)
    for place, variable in enumerate(interface.variables):
        try:
            _check_variable(variable, place)
        except ModelError as error:
            raise ModelError(f"{interface.name}: variable '{variable.name}': {error}") from None
    times = [v.name for v in interface.variables if v.causality == "independent"]
    if len(times) > 1 or (fmi == "3.0" and not times):
        raise ModelError(
            f"{interface.name}: found {len(times)} independent variables {times}, expected one, time"
        )
    _check_experiment(interface)
    _check_structure(interface)


def _check_names(interface: Interface) -> None:
    seen: dict[str, int] = {}
    for place, variable in enumerate(interface.variables):
        name = variable.name
        if not STRUCTURED.fullmatch(name):
            raise ModelError(
                f"{interface.name}: variable {name!r} is no structured name; expected parts of ASCII letters, digits "
                "and '_' as in 'carts[0].s' or 'der(x,2)', other characters in apostrophes; rename it in the model"
            )
        if name in seen:
            raise ModelError(
                f"{interface.name}: variable '{name}' is there twice, as references {seen[name]} and {place}; "
                "names are unique in an FMU"
            )
        seen[name] = place


def _check_variable(variable: Variable, place: int) -> None:
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
    if variable.type == "integer" and variable.variability == "continuous":
        raise ModelError("an integer cannot be continuous; expected discrete, fixed, tunable or constant")
    if initial in ("exact", "approx"):
        _check_start(variable)
    low, high = limit(variable.min), limit(variable.max)
    if low is not None and high is not None and low > high:
        raise ModelError(f"min {low} is above max {high}")
    if variable.nominal is not None and variable.nominal <= 0:
        raise ModelError(f"nominal is {variable.nominal}, expected a size above zero")


def _check_start(variable: Variable) -> None:
    start = variable.start
    if start is None or not isfinite(start):
        raise ModelError(f"start is {start}, expected a finite number; give it a start value")
    if variable.type == "integer" and (start != int(start) or int(start) not in INT32):
        raise ModelError(f"start is {start}, expected a whole number of 32 bits")
    low, high = limit(variable.min), limit(variable.max)
    if (low is not None and start < low) or (high is not None and start > high):
        raise ModelError(f"start {start} is outside min {low} and max {high}; change the start or the limits")


def limit(value: float | None) -> float | None:
    """A finite bound or nominal, or None: infinite ones say nothing and are not written."""
    return value if value is not None and isfinite(value) else None


def _check_experiment(interface: Interface) -> None:
    told = interface.experiment
    if not all(isfinite(v) for v in (told.start, told.stop, told.tolerance, told.step)):
        raise ModelError(f"{interface.name}: the default experiment is {told}, expected finite numbers")
    if told.stop <= told.start or told.tolerance <= 0 or told.step <= 0:
        raise ModelError(
            f"{interface.name}: the default experiment is {told}; expected a stop after the start, "
            "tolerance and step above zero"
        )


def _check_structure(interface: Interface) -> None:
    variables = interface.variables
    where = f"{interface.name}: model structure"
    for unknown in (*interface.outputs, *interface.derivatives, *interface.initial_unknowns):
        _check_unknown(unknown, len(variables), where)
    listed = [unknown.reference for unknown in interface.outputs]
    outputs = {v.reference for v in variables if v.causality == "output"}
    if wrong := _names(interface, outputs.symmetric_difference(listed)) or _names(
        interface, _repeated(listed)
    ):
        raise ModelError(
            f"{where}: {wrong}: expected each output once in the list of outputs, and nothing else"
        )
    rates = [unknown.reference for unknown in interface.derivatives]
    if wrong := _names(interface, _repeated(rates)):
        raise ModelError(f"{where}: {wrong} stands twice in the list of derivatives")
    for variable in variables:
        state = variable.derivative
        if state is not None and (state not in range(len(variables)) or not _continuous(variables[state])):
            raise ModelError(
                f"{where}: '{variable.name}' is the derivative of {state}, expected a continuous variable"
            )
    for place in rates:
        if variables[place].derivative is None:
            raise ModelError(f"{where}: '{variables[place].name}' is listed as a derivative, but of no state")
    if wrong := _names(interface, _repeated([variables[place].derivative or 0 for place in rates])):
        raise ModelError(f"{where}: state {wrong} has two derivatives")
    for place in interface.indicators:
        if place not in range(len(variables)) or not _continuous(variables[place]):
            raise ModelError(f"{where}: event indicator {place} is no continuous real variable; make it one")
    for name, members in interface.terminals.items():
        if wrong := [
            f"{name}.{member}" for member, place in members.items() if place not in range(len(variables))
        ]:
            raise ModelError(f"{interface.name}: terminal members {wrong} refer to no variable")


def _check_unknown(unknown: Unknown, count: int, where: str) -> None:
    places = (unknown.reference, *unknown.dependencies)
    if wrong := [place for place in places if place not in range(count)]:
        raise ModelError(
            f"{where}: references {wrong} of unknown {unknown.reference}, expected 0 to {count - 1}"
        )
    if len(unknown.kinds) != len(unknown.dependencies) or _repeated(unknown.dependencies):
        raise ModelError(
            f"{where}: unknown {unknown.reference} has {len(unknown.dependencies)} dependencies {unknown.dependencies} "
            f"and {len(unknown.kinds)} kinds; expected one kind for each, and each once"
        )


def _continuous(variable: Variable) -> bool:
    return variable.type == "real" and variable.variability == "continuous"


def _repeated(places: Iterable[int]) -> set[int]:
    seen: set[int] = set()
    return {place for place in places if place in seen or seen.add(place)}


def _names(interface: Interface, places: Iterable[int]) -> str:
    return ", ".join(f"'{interface.variables[place].name}'" for place in sorted(places))
