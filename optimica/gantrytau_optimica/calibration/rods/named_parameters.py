"""Identified numbers under the names of the robot's parameters, and as links that kinematics understands."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.errors import did_you_mean
from gantrytau.kinematics.rotations import told_vector
from gantrytau_optimica.calibration.fitting.truncated_fit import Fit
from gantrytau_optimica.calibration.rods.closure import ALONG, OFFSET, PLATE
from gantrytau_optimica.calibration.rods.forward import Guideway, RodLink
from gantrytau_optimica.calibration.rods.nominal_geometry import Geometry


class Named(Mapping[str, Any]):
    """Values by name; of a vector `v` also the elements `v[0]`, `v[1]` and so on, which are not listed."""

    def __init__(self, values: Mapping[str, Any]):
        self._values = dict(values)
        self._elements = {
            f"{name}[{k}]": float(x)
            for name, value in self._values.items()
            if np.ndim(value)
            for k, x in enumerate(value)
        }

    def __getitem__(self, name: str) -> Any:
        if name in self._values:
            return self._values[name]
        if name in self._elements:
            return self._elements[name]
        raise ModelError(f"parameters: there is no '{name}'{did_you_mean(name, self._values)}")

    def __contains__(self, name: object) -> bool:
        return name in self._values or name in self._elements

    def __iter__(self) -> Iterator[str]:
        return iter(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return "\n".join(f"{name} = {value}" for name, value in self._values.items())


def arm_of(name: str) -> int:
    """The number in "arms[1].links[0]"."""
    return int(name[name.index("[") + 1 : name.index("]")])


def named_parameters(geometry: Geometry, fits: Sequence[Fit]) -> dict[str, Any]:
    """Values of all parameters, vectors whole, in the order of the arms."""
    found: dict[str, Any] = {}
    for fit in fits:
        for chain, places in zip(fit.group.chains, fit.group.places, strict=True):
            p = fit.x[places]
            names = [fit.group.names[k] for k in places]
            offset = p[OFFSET] - (geometry.arms[arm_of(chain.name)].base if chain.R is not None else 0.0)
            along = p[ALONG] if chain.points is None else told_vector(chain.frame(p))
            direction = names[4].rsplit("[", 1)[0]
            if direction == "direction":
                direction = f"arms[{arm_of(chain.name)}].direction"
            found[names[0]] = float(p[0])
            found[names[1].rsplit("[", 1)[0]] = offset
            found[direction] = along.copy()
            if chain.R is not None:
                found[names[7].rsplit("[", 1)[0]] = p[PLATE].copy()
    return dict(sorted(found.items()))


def rod_links(fits: Sequence[Fit], rails: Sequence[np.ndarray] | None) -> list[RodLink]:
    """The links with their identified numbers, in the order of the arms."""
    found = []
    for fit in fits:
        for chain, places in zip(fit.group.chains, fit.group.places, strict=True):
            p, arm = fit.x[places], arm_of(chain.name)
            if chain.points is None:
                guideway = Guideway(p[OFFSET], p[ALONG])
            else:
                assert rails is not None
                guideway = Guideway(p[OFFSET], chain.frame(p), rails[arm])
            on_plate = np.zeros(3) if chain.R is None else p[PLATE]
            found.append((chain.name, RodLink(arm, float(p[0]), guideway, on_plate)))
    return [link for _, link in sorted(found, key=lambda pair: pair[0])]
