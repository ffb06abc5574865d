"""What is said of signals over time: how long, why they end, and each by name, unit, first and last value, range."""

import numpy as np

from gantrytau.describing.described import Description, Listing
from gantrytau.describing.short_values import array_words, number
from gantrytau.language.symbols import split_derivative
from gantrytau.results.display_units import DECLARED, Shown, shown_units
from gantrytau.results.series import Series

SPOKEN = 3  # elements of a vector that is spoken
ROUNDING = 1e-12  # of the largest value: what is smaller is rounding


def series_described(series: Series, name: str = "") -> Description:
    """What is said of a result, or of one variable of it; ModelError for a name that is not there.

    Vectors are one row: their values where they are short, else none.
    """
    time = series.time
    span = f"{time.size} times from {number(time[0])} to {number(time[-1])} s"
    if name:
        values = series[name]
        unit = shown_units(series, [name], None, DECLARED, "describe")[name].unit
        facts = (("unit", unit or "1"), ("shape", str(values.shape)), *_extremes(series, name))
        aliases = [n for n, to in series.aliases.items() if to.removeprefix("-") == name]
        told = (*facts, ("equal or opposite", ", ".join(aliases))) if aliases else facts
        return Description(name, f"variable of {series.title or 'a result'}", series.description(name), told)
    elements = {str(element) for names in series.arrays.values() for element in names.flat}
    places = _first_places(series)
    names = (*series.arrays, *(n for n in series.names if n not in elements))
    shown = sorted(names, key=lambda n: (n.count("."), places[n]))  # what is deep in components comes last
    told = [n for n in shown if not split_derivative(n)[1]]
    units = shown_units(series, told, None, DECLARED, "describe")
    rows = [_row(series, n, units[n]) for n in told]
    facts = (("time", span), ("ended", series.ended))
    columns = ("name", "at the start", "at the end", "unit", "description")
    kind = type(series).__name__
    return Description(series.title or kind, kind, "", facts, (Listing.of("Variables", columns, rows),))


def _first_places(series: Series) -> dict[str, int]:
    """Where each name first stands in the order of the scalars."""
    places = {name: k for k, name in enumerate(series.names)}
    return places | {name: places[str(names.flat[0])] for name, names in series.arrays.items()}


def _row(series: Series, name: str, unit: Shown) -> tuple[str, ...]:
    shape = series.arrays[name].shape if name in series.arrays else ()
    told = f"{name}[{', '.join(map(str, shape))}]" if shape else name
    return told, *_ends(series, name, unit), _plain(unit.unit), series.description(name)


def _ends(series: Series, name: str, unit: Shown) -> tuple[str, str]:
    values = series[name]
    if name in series.modes:
        words = series.mode(name)
        return str(words[0]), str(words[-1])
    if values[0].size > SPOKEN:
        return "", ""
    small = ROUNDING * np.nanmax(np.abs(values), initial=0.0)
    first, last = (np.where(np.abs(value) < small, 0.0, value) for value in (values[0], values[-1]))
    return array_words(np.asarray(unit.of(first))), array_words(np.asarray(unit.of(last)))


def _plain(unit: str) -> str:
    return "" if unit == "1" else unit


def _extremes(series: Series, name: str) -> tuple[tuple[str, str], ...]:
    """Least and greatest value with their times, of a scalar; how many are missing."""
    if series[name].ndim > 1:
        return ()
    shown = shown_units(series, [name], None, DECLARED, "describe")[name]
    values, unit = np.asarray(shown.of(series[name])), _plain(shown.unit)
    missing = np.count_nonzero(~np.isfinite(values))
    lost = (("not finite", f"at {missing} of {values.size} times"),) if missing else ()
    if missing == values.size:
        return lost
    low, high = np.nanargmin(values), np.nanargmax(values)

    def at(k: np.intp) -> str:
        return f"{values[k]:.6g} {unit}".rstrip() + f" at {number(series.time[k])} s"

    return ("least", at(low)), ("greatest", at(high)), *lost
