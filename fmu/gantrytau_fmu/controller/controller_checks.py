"""What the arguments of a controller may be."""

from collections.abc import Mapping, Sequence
from typing import Any

from gantrytau.border.checks import instance
from gantrytau.border.refusal import Given, ModelError
from gantrytau_fmu.controller.channels import Channel
from gantrytau_fmu.controller.external_kinematics import ExternalKinematics
from gantrytau_fmu.controller.reference_path import AxisLimits

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
