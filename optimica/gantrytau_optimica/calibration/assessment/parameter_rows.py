"""A calibration as values of its robot: modifications of the model, and rows of a table."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gantrytau import ModelError
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.links.error_models import shared_name
from gantrytau_optimica.calibration.links.nominal_rods import modifications_of
from gantrytau_optimica.calibration.named.named_calibration import NamedCalibration
from gantrytau_optimica.calibration.report.report import nominal_values, scalars

GEOMETRY = ("length", "offset", "direction", "plate_offset", "orientation", "start", "r")
HOLDERS = ("arms", "links", "turntables", "tool")


@dataclass(frozen=True)
class ParameterRow(Record):
    """A number of a calibration, in m or rad: value and change from the nominal one, None where there is none.

    deviation: standard deviation, None for a number that was held, NaN for one that data do not hold.
    """

    name: str
    value: float | None
    deviation: float | None
    change: float | None


def parameter_rows(found: Calibration | NamedCalibration) -> list[ParameterRow]:
    """Each number with its deviation, and how far it is from the nominal one."""
    nominal, deviations, values = nominal_values(found), found.deviations, scalars(found.parameters)
    rows = []
    for name, value in values.items():
        change = value - nominal[name] if name in nominal else None
        rows.append(ParameterRow(name, value, deviations.get(shared_name(name, deviations)), change))
    # rotations of a turntable, by which its orientation is free
    free = [name for name in deviations if name not in values and not name.startswith("direction")]
    return [*rows, *(ParameterRow(name, None, deviations[name], None) for name in free)]


def calibrated_geometry(found: Calibration | NamedCalibration) -> dict[str, Any] | None:
    """The calibrated geometry as modifications, `robot.modified(...)`; None of models that no robot can hold."""
    if isinstance(found, NamedCalibration):
        return modifications_of(found.given, dict(found.parameters))
    try:
        robot = found.robot
    except ModelError:
        return None
    return _geometry({k: v for k, v in robot.modifications.items() if k in HOLDERS})


def _geometry(part: Any) -> Any:
    """What of nested modifications is geometry."""
    if isinstance(part, Mapping):
        kept = {
            key: value if key in GEOMETRY and not isinstance(value, Mapping) else _geometry(value)
            for key, value in part.items()
            if key in GEOMETRY or key in HOLDERS
        }
        return {key: value for key, value in kept.items() if not (isinstance(value, Mapping) and not value)}
    if isinstance(part, (list, tuple)) and any(isinstance(one, Mapping) for one in part):
        return [_geometry(one) for one in part]
    return part
