"""In which unit each variable is shown, in figures, tables and CSV files: a result itself is in SI."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from gantrytau.border.checks import instance
from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.border.units import Scale, known_scale, scale
from gantrytau.results.series import Series, split_element

Display = str | Mapping[str, str] | None  # as callers say it
SI, DECLARED = "SI", "declared"


@dataclass(frozen=True)
class Shown:
    """How one variable is shown: unit, "" if it has none; scale: None for what is shown as it is, in SI."""

    unit: str
    scale: Scale | None = None

    def of(self, values: Any) -> Any:
        """Values in SI as they are shown."""
        return values if self.scale is None else self.scale.written(values)

    def heading(self, name: str) -> str:
        """The name with the unit in brackets, as it stands over a column."""
        return f"{name} [{self.unit}]" if self.unit else name


def shown_units(
    result: Series, names: Iterable[str], display: Display, default: str, verb: str
) -> dict[str, Shown]:
    """How variables of a result are shown, by name.

    display: a unit for all that it measures ("deg"); units by name of a variable, "time" among them, or by the unit that
    it replaces, {"crank.phi": "deg", "m": "mm"}; "declared", those of the declarations; "SI"; None: `default`, one of these.
    What it does not speak of is shown as `default` says. verb: for messages. Raises ModelError for a unit that is none, or
    measures something else, and for unknown names.
    """
    names = list(dict.fromkeys(names))
    around, place = f"{result.title or 'Result'}: {verb}", "display"
    if display is None:
        display = default
    instance(around, "display", display, (str, Mapping), "a unit, or {name: unit}")
    base = display if display in (SI, DECLARED) else default
    chosen = {name: result.display(name) for name in names} if base == DECLARED else {}
    try:
        if isinstance(display, Mapping):
            chosen |= _by_keys(result, names, display, place)
        elif display not in (SI, DECLARED):
            chosen |= _wherever(result, names, display, place)
        return {name: _shown(result, name, chosen.get(name, ""), place) for name in names}
    except ModelError as error:
        raise ModelError(str(error), place=around, argument="display") from None


def _shown(result: Series, name: str, text: str, place: str) -> Shown:
    unit = result.unit(name)
    if text in ("", unit):
        return Shown(unit)
    return Shown(text, known_scale(f"{place} of {name}", text, unit or None))


def _wherever(result: Series, names: list[str], text: str, place: str) -> dict[str, str]:
    """One unit for all variables that it measures; ModelError if there are none."""
    try:
        found = scale(text)
    except ModelError as error:
        raise ModelError(f"{place}: {error}") from None
    chosen = {n: text for n in names if (unit := result.unit(n)) and _coherent(unit) and found.measures(unit)}
    if not chosen:
        there = ", ".join(f"{n} in {result.unit(n) or 'no unit'}" for n in names[:6] if n != "time")
        raise ModelError(
            f"{place}: found '{text}', {found.kind}, expected a unit of what is shown: {there}; display={{name: unit}} says "
            "it for one of them"
        )
    return chosen


def _coherent(unit: str) -> bool:
    """Whether a unit is one of models; results of foreign FMUs may have others."""
    try:
        scale(unit).measures(unit)
    except ModelError:
        return False
    return True


def _by_keys(result: Series, names: list[str], units: Mapping[str, str], place: str) -> dict[str, str]:
    """Units by scalar name: those for an element go before those for its vector, and these before those for a unit."""
    ranks: tuple[dict[str, str], ...] = ({}, {}, {})
    for key, text in units.items():
        if key in result and not _is_unit(result, key, text):
            known_scale(f"{place}: {key}", text, result.unit(key) or None)
            ranks[2 if key == "time" or key not in result.arrays else 1][key] = text
        elif key in {result.unit(name) for name in names} or (key and _coherent(key)):
            known_scale(f"{place}: {key}", text, key)
            ranks[0][key] = text
        else:
            known = ("time", *result.names, *result.arrays, *{u for n in names if (u := result.unit(n))})
            raise ModelError(
                f"{place}: found '{key}', expected the name of a variable, or its unit{did_you_mean(key, known)}"
            )
    chosen = {}
    for name in names:
        element = split_element(name)
        keys = (result.unit(name), element[0] if element and element[0] in result.arrays else name, name)
        said = [rank[key] for rank, key in zip(ranks, keys, strict=True) if key in rank]
        if said:
            chosen[name] = said[-1]
    return chosen


def _is_unit(result: Series, key: str, text: Any) -> bool:
    """Whether a name that a unit has too, as m, means the unit here: the text measures that, and not the variable."""
    unit = result.unit(key)
    try:
        meant = scale(text)
        return meant.measures(key) and not (_coherent(unit) and meant.measures(unit))
    except (ModelError, AttributeError):
        return False
