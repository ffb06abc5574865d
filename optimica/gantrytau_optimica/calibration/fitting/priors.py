"""Prior of parameters, as `calibrate(..., prior=...)` takes it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import instance, number
from gantrytau.border.refusal import did_you_mean
from gantrytau_optimica.calibration.links.groups import Group


def with_prior(
    groups: Sequence[Group], prior: Mapping[str, Any] | None, nominal: Mapping[str, float]
) -> list[Group]:
    """The groups with standard deviations of parameters about what is expected of them.

    prior: by name of a parameter, of a vector, or of the last part of these for all links: a deviation about the nominal
    value, or (value, deviation). ModelError for names that are not identified and deviations that are not above 0.
    """
    free = {n: float(x) for g in groups for n, x, each in zip(g.names, g.x, g.free, strict=True) if each}
    found = read_prior(prior, free | {n: x for n, x in nominal.items() if n in free})
    return [
        replace(g, prior=dict(g.prior) | {i: found[n] for i, n in enumerate(g.names) if n in found})
        for g in groups
    ]


def read_prior(prior: Mapping[str, Any] | None, start: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Value and deviation by name of a parameter; start: of all that are free, where a prior holds those without a value."""
    expected = "a dict as {'arms[1].links[0].plate_offset': 0.001}, deviations in m by name"
    instance("calibrate", "prior", prior, (Mapping, type(None)), expected)
    found: dict[str, tuple[float, float]] = {}
    for name, given in (prior or {}).items():
        matches = [n for n in start if name in (n, _vector(n), _vector(n).rsplit(".", 1)[-1])]
        if not matches:
            raise ModelError(
                f"prior for '{name}', which is not identified{did_you_mean(name, sorted(start))}",
                place="calibrate",
                argument="prior",
            )
        value, deviation = given if isinstance(given, tuple) else (None, given)
        for n in matches:
            k = [m for m in matches if _vector(m) == _vector(n)].index(n)
            size = number(f"calibrate: deviation for '{name}'", "prior", _element(deviation, k), above=0.0)
            at = (
                start[n]
                if value is None
                else number(f"calibrate: value for '{name}'", "prior", _element(value, k))
            )
            found[n] = at, size
    return found


def _vector(element: str) -> str:
    return element.rsplit("[", 1)[0] if element.endswith("]") else element


def _element(value: Any, k: int) -> Any:
    if isinstance(value, str):
        return value  # which is refused
    array = np.atleast_1d(np.asarray(value, dtype=float))
    return float(array[k] if array.size > 1 else array[0])
