"""The robot's own way of references, which nobody can overwrite: kinematics, then limits of positions and speeds.

    wanted -> axes by kinematics -> not finite or out of reach: as before -> within [minimum, maximum]
           -> |axes - before| <= speed period

The limits come last and hold whatever came before, so that a jump becomes a ramp and no client can move an axis faster.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.describing.record import Record
from gantrytau_fmu.controller.channels import Declaration, Values
from gantrytau_fmu.controller.external_kinematics import ExternalKinematics
from gantrytau_fmu.controller.stepped_part import SteppedPart


@dataclass(frozen=True)
class AxisLimits(Record):
    """Limits of the references of an input: numbers, or one for each of its axes.

    minimum, maximum: in the unit of the input, None for those that the plant declares; speed: of change, in this unit per
    second, None for none.
    """

    minimum: ArrayLike | None = None
    maximum: ArrayLike | None = None
    speed: ArrayLike | None = None


class ReferencePath:
    """From references to the inputs of a plant. declaration: of the references, with poses in place of axes.

    limited, refused, unreachable: samples in which a limit acted, values were not finite, a pose was out of reach.
    Raises ModelError for limits and kinematics of inputs that the plant does not have.
    """

    def __init__(
        self,
        plant: SteppedPart,
        limits: Mapping[str, AxisLimits],
        kinematics: ExternalKinematics | None,
        period: float,
    ):
        self.inputs, self.kinematics = plant.inputs, kinematics
        self.least, self.most, step = (
            plant.minimum.copy(),
            plant.maximum.copy(),
            np.full(plant.inputs.size, np.inf),
        )
        for name, limit in limits.items():
            if name not in plant.inputs:
                raise ModelError(
                    f"limits: the plant has no input '{name}'{did_you_mean(str(name), plant.inputs.names)}"
                )
            place = plant.inputs.slices[name]
            self.least[place] = np.maximum(
                self.least[place], _numbers(name, plant.inputs, limit.minimum, -np.inf)
            )
            self.most[place] = np.minimum(
                self.most[place], _numbers(name, plant.inputs, limit.maximum, np.inf)
            )
            speed = _numbers(name, plant.inputs, limit.speed, np.inf)
            if not np.all(speed > 0):
                raise ModelError(f"limits {name}: found speed={limit.speed!r}, expected numbers above zero")
            step[place] = speed * period
            if np.any(self.least[place] > self.most[place]):
                raise ModelError(
                    f"limits {name}: found minimum above maximum, expected it below, also with those of the plant"
                )
        self.step = step
        driven = () if kinematics is None else kinematics.axes
        for name in driven:
            if name not in plant.inputs:
                raise ModelError(
                    f"kinematics: the plant has no input '{name}'{did_you_mean(str(name), plant.inputs.names)}"
                )
        self.rest = [channel for channel in plant.inputs if channel.name not in driven]
        poses = () if kinematics is None else kinematics.declaration.channels
        self.declaration = Declaration([*poses, *self.rest])
        pairs = [plant.inputs.slices[name] for name in (*driven, *(channel.name for channel in self.rest))]
        self.order = np.array([k for place in pairs for k in range(place.start, place.stop)], dtype=int)
        self.pose_size = sum(channel.size for channel in poses)
        self.axis_count = sum(plant.inputs[name].size for name in driven)
        self.applied = plant.first_inputs
        self.limited = self.refused = self.unreachable = 0
        self.status = ""

    def begin(self, references: Values) -> Values:
        """Start at references (m,): nothing limits the first speed. ModelError where they are beyond limits or reach."""
        wanted, status = self._axes(references)
        if status or not np.isfinite(wanted).all():
            raise ModelError(
                f"references: found {references.tolist()} at the start, {status or 'not finite'}, expected a reachable start"
            )
        bad = (wanted < self.least) | (wanted > self.most)
        if bad.any():
            k = int(np.argmax(bad))
            raise ModelError(
                f"references: found {self.inputs.elements[k]} = {wanted[k]:g} at the start, expected a number in "
                f"[{self.least[k]:g}, {self.most[k]:g}]; start within the limits"
            )
        self.applied, self.status = wanted, ""
        self.limited = self.refused = self.unreachable = 0
        return self.applied

    def follow(self, references: Values) -> Values:
        """The inputs of the plant (n,) for references (m,)."""
        self.status = ""
        if not np.isfinite(references).all():
            self.refused, self.status = self.refused + 1, "not finite"
            return self.applied
        wanted, self.status = self._axes(references)
        if self.status:
            self.unreachable += 1
            return self.applied
        allowed = np.clip(
            np.clip(wanted, self.least, self.most), self.applied - self.step, self.applied + self.step
        )
        self.limited += bool((allowed != wanted).any())
        self.applied = allowed
        return allowed

    def replace(self, kinematics: ExternalKinematics) -> None:
        """Other kinematics of the same poses and axes. ModelError for others."""
        old = self.kinematics
        if old is None or (old.declaration, tuple(old.axes)) != (
            kinematics.declaration,
            tuple(kinematics.axes),
        ):
            raise ModelError(
                "kinematics: found other poses or axes, expected those that the controller was made with"
            )
        self.kinematics = kinematics

    def _axes(self, references: Values) -> tuple[Values, str]:
        wanted, status = np.empty(self.inputs.size), ""
        found = references
        if self.kinematics is not None:
            axes, status = self.kinematics.axes_of(references[: self.pose_size].copy(), self.axis_count)
            found = np.concatenate([axes, references[self.pose_size :]])
        wanted[self.order] = found
        return wanted, status


def _numbers(name: str, inputs: Declaration, value: Any, none: float) -> Values:
    """One number for each axis."""
    size = inputs[name].size
    try:
        numbers = np.asarray(none if value is None else value, dtype=float)
    except (TypeError, ValueError):
        numbers = np.full(1, np.nan)
    if numbers.shape not in ((), (1,), (size,)) or np.isnan(numbers).any():
        raise ModelError(f"limits {name}: found {value!r}, expected a number, or {size} of them")
    return np.broadcast_to(numbers, (size,))
