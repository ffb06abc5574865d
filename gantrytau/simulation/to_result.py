"""From states over time to a Result with every variable of the model."""

from collections.abc import Sequence
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.dimensions import per_second
from gantrytau.compiler.translated import Translated
from gantrytau.language.symbols import derivative_name, split_derivative, time
from gantrytau.results.result import Result
from gantrytau.simulation.between.passed_limits import limited
from gantrytau.simulation.events.at_places import AtPlaces
from gantrytau.simulation.full_coordinates import Coordinates

HUGE = 1e100  # no quantity is that large
SHOWN = 4  # names in a warning


def result_of(
    coordinates: Coordinates,
    times: np.ndarray,
    x: np.ndarray,
    z: np.ndarray,
    w: np.ndarray,
    outputs: Sequence[str] | None,
    ended: str = "stop",
    instants: tuple[np.ndarray, np.ndarray] | None = None,
) -> Result:
    """Every variable and derivative (or only `outputs`) at the given times; w: what is sampled, held and switched there;
    ended: why there are no more of them; instants: all times at which something is sampled, and w there, where these are
    more.
    """
    dae = coordinates.dae
    names, steps, function = coordinates.kept(
        ("variables", None if outputs is None else tuple(outputs)), lambda: _variables(coordinates, outputs)
    )
    (rows,) = function(times[:, None], x, z, w)
    table = dict(zip(names, np.ascontiguousarray(rows.T), strict=True))
    for parameter in dae.flat.parameters if outputs is None else ():
        table.update((n, np.full(times.size, dae.table.values[n])) for n in parameter.elements)
    units, words = labels(dae)
    modes = {n: own for n, own in dae.flat.modes.items() if n in table}
    own: dict[str, Any] = dict(title=dae.name, held=steps, ended=ended, modes=modes, shapes=dae.flat.shapes)
    own |= dict(displays=displays(dae), limits=limits(dae))
    if instants is not None and steps:
        own["instants"] = _held_at(coordinates, steps, *instants)
    return Result(times, table, units=units, descriptions=words, **own)


def _variables(
    coordinates: Coordinates, outputs: Sequence[str] | None
) -> tuple[list[str], list[str], AtPlaces]:
    """Names of all variables and derivatives (or only `outputs`), of those that hold their values from one time to the next,
    and (t, x, z, w) -> the values of all.
    """
    dae = coordinates.dae
    names = _names(dae, outputs)
    expressions = ca.vertcat(*(dae.expression(n) for n in names)) if names else ca.SX(0, 1)
    (found,) = coordinates.inserted([expressions])
    found = ca.densify(ca.substitute(found, coordinates.t0, time))
    events = {*coordinates.held, *coordinates.discretes}
    steps = [n for n in names if (a := dae.root(n)) is not None and a.symbol in events]
    arguments = [time, coordinates.x, coordinates.z, coordinates.w]
    return names, steps, AtPlaces(ca.Function("variables", arguments, [found]))


def _held_at(coordinates: Coordinates, names: Sequence[str], times: np.ndarray, w: np.ndarray) -> Result:
    """What is held, which follows from w alone, at times."""
    names, _, function = coordinates.kept(("variables", tuple(names)), lambda: _variables(coordinates, names))
    nothing = np.zeros((1, len(coordinates.states))), np.zeros((1, len(coordinates.algebraics)))
    (rows,) = function(times, *nothing, w)
    return Result(times, dict(zip(names, rows.T, strict=True)), held=names)


def doubts(result: Result) -> str:
    """Warning of values that are not finite or huge, "" without any."""
    found = []
    for name in result.names:
        values = result[name]
        if values.size and not -HUGE < values.min() <= values.max() < HUGE:  # NaN is nowhere between
            k = int(np.flatnonzero(~(np.abs(values) < HUGE))[0])
            what = "not finite" if not np.isfinite(values[k]) else f"beyond {HUGE:g}"
            found.append(f"{name} is {what} from t = {result.time[k]:.6g} s on")
    if not found:
        return ""
    rest = f", and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    return (
        f"{'; '.join(found[:SHOWN])}{rest}: look in what gives it for a root or a logarithm of a number that becomes "
        "negative, or a division by zero"
    )


def _names(dae: Translated, outputs: Sequence[str] | None) -> list[str]:
    if outputs is not None:
        return [n for name in outputs for n in dae.expand(name)]
    names = list(dae.variables)
    orders = dae.indexed.orders
    for name in dae.variables:
        alias = dae.reduced.aliases.get(name)
        if alias is not None and alias.root is not None and alias.root in orders:
            names += [derivative_name(name, k) for k in range(1, orders[alias.root] - alias.order + 1)]
    return names


def labels(dae: Translated) -> tuple[dict[str, str], dict[str, str]]:
    """Units and descriptions by name, derivatives included."""
    if "labels" not in dae.made:
        dae.made["labels"] = _labels(dae)
    units, words = dae.made["labels"]
    return dict(units), dict(words)


def _labels(dae: Translated) -> tuple[dict[str, str], dict[str, str]]:
    units: dict[str, str] = {}
    words: dict[str, str] = {}
    for variable in (*dae.flat.variables, *dae.flat.parameters):
        for name in (variable.name, *variable.elements):
            if variable.unit is not None:
                units[name] = variable.unit
            words[name] = variable.description
    for name in _names(dae, None):
        base, order = split_derivative(name)
        if order and base in units:
            units[name] = per_second(units[base], order)
            words[name] = f"derivative of {base}"
    return units, words


def limits(dae: Translated) -> dict[str, tuple[float, float]]:
    """Declared min and max of variables, element by element, infinite where there is none."""
    found: dict[str, dict[str, float]] = {}
    for name, side, _, limit in limited(dae.flat):
        found.setdefault(name, {"min": -np.inf, "max": np.inf})[side] = dae.number(limit)
    return {name: (ends["min"], ends["max"]) for name, ends in found.items()}


def displays(dae: Translated) -> dict[str, str]:
    """The units in which variables and their derivatives are shown, by name, where a declaration says one."""
    if "displays" not in dae.made:
        dae.made["displays"] = _displays(dae)
    return dict(dae.made["displays"])


def _displays(dae: Translated) -> dict[str, str]:
    declared = [v for v in (*dae.flat.variables, *dae.flat.parameters) if v.display]
    found = {name: v.display for v in declared for name in (v.name, *v.elements)}
    for name in _names(dae, None) if found else ():
        base, order = split_derivative(name)
        if order and base in found:
            found[name] = per_second(found[base], order)
    return found
