"""What the arguments of a controller may be."""

from collections.abc import Mapping, Sequence
from typing import Any

from gantrytau.border.checks import instance
from gantrytau.border.refusal import Given, ModelError, did_you_mean
from gantrytau_fmu.controller.channels import Channel, Declaration
from gantrytau_fmu.controller.external_kinematics import ExternalKinematics
from gantrytau_fmu.controller.reference_path import AxisLimits
from gantrytau_fmu.systems.component import Component

TABLES: Mapping[str, tuple[type, type, str]] = {
    "limits": (str, AxisLimits, "{input: AxisLimits(...)}"),
    "references": (str, object, "{name: value}"),
    "parameters": (Channel, object, "{Channel(name, unit): value}"),
}


def check_kinds(tables: Mapping[str, Any], kinematics: Any, clients: Any) -> None:
    """ModelError for arguments that are of another kind."""
    for name, table in tables.items():
        key, value, expected = TABLES[name]
        found = {} if table is None else table
        if not isinstance(found, Mapping) or not all(
            isinstance(own, key) and isinstance(one, value) for own, one in found.items()
        ):
            raise ModelError(f"expected {expected}", place="controller", found=Given(name, table))
    if kinematics is not None:
        expected = "ExternalKinematics(function, poses, axes)"
        instance("controller", "kinematics", kinematics, ExternalKinematics, expected)
    instance("controller", "clients", clients, Sequence, "clients in a list")


def check_references(
    declared: Declaration, references: Mapping[str, Any], kinematics: ExternalKinematics | None
) -> None:
    """ModelError for references that are none, and for a pose without one."""
    for name in references:
        if name not in declared:
            raise ModelError(
                f"references: there is no '{name}'{did_you_mean(str(name), declared.names)}",
                argument="references",
            )
    for name in () if kinematics is None else kinematics.declaration.names:
        if name not in references:
            raise ModelError(
                f"references: found no '{name}', expected the pose to begin with", argument="references"
            )


def check_step(plant: Component, period: float) -> None:
    """ModelError if the period is no multiple of the step of an FMU whose step is fixed."""
    step = None if plant.variable_step else plant.step
    if step and (period < step / 2 or abs(period - round(period / step) * step) > 1e-6 * step):
        words = f"found a period of {period:g} s and steps of {step:g} s, which alone {plant.file} takes"
        raise ModelError(f"controller: {words}; expected a multiple of these, as period={step:g}")
