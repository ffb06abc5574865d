"""Identified parameters by the names of the robot, and as links that kinematics understands."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.refusal import did_you_mean
from gantrytau.kinematics.rotations import told_vector
from gantrytau_optimica.calibration.fitting.rod_fit import Fit
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure
from gantrytau_optimica.calibration.links.arm_links import ArmLink
from gantrytau_optimica.calibration.links.closure import ALONG, OFFSET, PLATE, Chain
from gantrytau_optimica.calibration.links.error_models import COMMON
from gantrytau_optimica.calibration.links.forward import Guideway, RodLink
from gantrytau_optimica.calibration.links.nominal_rods import NominalRods


class Named(Mapping[str, Any]):
    """Values by name; of a vector `v` also the elements `v[0]`, `v[1]` and so on, which are not listed, nor are others."""

    def __init__(self, values: Mapping[str, Any], others: Mapping[str, Any] | None = None):
        self._values, self._others = dict(values), dict(others or {})
        self._elements = self._others | {
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

    def _ipython_key_completions_(self) -> list[str]:
        return list(self._values)

    def __len__(self) -> int:
        return len(self._values)

    def __repr__(self) -> str:
        return "\n".join(f"{name} = {value}" for name, value in (self._values | self._others).items())


def named_parameters(robot: NominalRods, fits: Sequence[Fit]) -> dict[str, Any]:
    """Values of all parameters, vectors whole, by name; of turntables the quaternion, scalar first."""
    found: dict[str, Any] = {}
    for fit in fits:
        if arms := calibrated_arms([fit]):
            for arm in arms:
                for name in arm.free:
                    value = arm.values[name]
                    found[name] = float(value) if np.ndim(value) == 0 else np.array(value)
            continue
        for link, places in zip(fit.group.chains, fit.group.places, strict=True):
            assert isinstance(link, Chain)
            p, arm = fit.x[places], robot.arms[link.cart]
            names = [fit.group.names[k] for k in places]
            base = robot.base(arm) if link.R is not None else 0.0
            direction = names[4].rsplit("[", 1)[0]
            found[names[0]] = float(p[0])
            found[names[1].rsplit("[", 1)[0]] = p[OFFSET] - base
            # one direction of all arms is that of each
            name = arm.direction if direction == COMMON else direction
            found[name] = p[ALONG].copy() if link.points is None else told_vector(link.frame(p))
            if link.R is not None:
                found[names[7].rsplit("[", 1)[0]] = p[PLATE].copy()
    return found if any(fit.group.arms for fit in fits) else dict(sorted(found.items()))


def calibrated_arms(fits: Sequence[Fit]) -> list[ArmClosure]:
    """Arms on turntables with their identified parameters."""
    found: dict[int, ArmClosure] = {}
    for fit in fits:
        for link, places in zip(fit.group.chains, fit.group.places, strict=True):
            if isinstance(link, ArmLink) and id(link.poses) not in found:
                found[id(link.poses)] = link.poses.moved(fit.x[places])
    return list(found.values())


def rod_links(fits: Sequence[Fit]) -> list[RodLink]:
    """The links with their identified parameters, in the order of the arms."""
    found = []
    for fit in fits:
        for link, places in zip(fit.group.chains, fit.group.places, strict=True):
            assert isinstance(link, Chain)
            p = fit.x[places]
            along = p[ALONG] if link.points is None else link.frame(p)
            on_plate = np.zeros(3) if link.R is None else p[PLATE]
            guideway = Guideway(p[OFFSET], along, link.rail)
            found.append((link.cart, link.name, RodLink(link.cart, float(p[0]), guideway, on_plate)))
    return [link for _, _, link in sorted(found, key=lambda one: one[:2])]
