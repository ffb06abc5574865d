"""What the arguments of a controller may be."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.board import STATES, State
from gantrytau_fmu.controller.channels import Channel
from gantrytau_fmu.controller.external_kinematics import ExternalKinematics
from gantrytau_fmu.controller.reference_path import AxisLimits


def check_kinds(tables: Mapping[str, Any], kinematics: Any, clients: Any) -> None:
    """ModelError for arguments that are of another kind."""
    kinds: dict[str, tuple[type, type, str]] = {
        "limits": (str, AxisLimits, "{input: AxisLimits(...)}"),
        "references": (str, object, "{name: value}"),
        "parameters": (Channel, object, "{Channel(name, unit): value}"),
    }
    for name, table in tables.items():
        key, value, expected = kinds[name]
        found = {} if table is None else table
        if not isinstance(found, Mapping) or not all(
            isinstance(own, key) and isinstance(one, value) for own, one in found.items()
        ):
            raise ModelError(f"{name}: found {table!r}, expected {expected}", argument=name)
    if not isinstance(kinematics, ExternalKinematics | None):
        raise ModelError(
            f"kinematics: found {kinematics!r}, expected ExternalKinematics(function, poses, axes)"
        )
    if not isinstance(clients, Sequence):
        raise ModelError(f"clients: found {clients!r}, expected clients in a list")


def state_of(state: Any) -> State:
    """A state; ModelError for what is none."""
    if state not in STATES:
        raise ModelError(f"controller: found state={state!r}, expected {', '.join(STATES)}", argument="state")
    return state


def above_zero(name: str, value: Any) -> float:
    """A number above zero; ModelError for any other value of an argument."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.number)) or not 0 < value < np.inf:
        raise ModelError(
            f"controller: found {name}={value!r}, expected a number above zero, in s", argument=name
        )
    return float(value)
