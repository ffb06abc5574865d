"""Whether a calibration is good enough: decided by poses that were not fitted, and by how sure the tool is everywhere."""

from typing import Any

from gantrytau import GantryTauError
from gantrytau.commands.calibrate.cross_validation import Validation
from gantrytau.commands.calibrate.measured_plan import Planned

MATTERS = 0.1  # of the error that is wanted, by which a number that is not held may move the tool
SHOWN = 3  # combinations that are named


def verdict(found: Any, validation: Validation | None, expected: Any, planned: Planned) -> dict[str, Any]:
    """As a record. expected: the error of the tool at all planned poses, by covariance."""
    wanted = planned.cell.wanted
    sure = expected.error <= wanted
    good = bool(found.success and validation is not None and validation.error <= wanted and sure)
    words = (
        f"{_validated(validation)}, {_um(expected.error)} of the tool are expected over all planned poses by what was "
        f"measured, {_um(wanted)} were wanted"
    )
    if not good:
        words += "; look at the findings, measure the poses that are missing, or plan again with more of them"
    record: dict[str, Any] = {
        "good": good,
        "validation_error_m": None if validation is None else validation.error,
        "expected_error_m": expected.error,
        "wanted_m": wanted,
        "verdict": words,
    }
    return record if good else {**record, "error": words}


def _validated(validation: Validation | None) -> str:
    if validation is None:
        return "no poses that were not fitted validate this"
    count = len(validation.left_out)
    without = f", {_number(count)} left out" if count else ""
    return f"{_um(validation.error)} in the mean of poses that were not fitted{without}"


def _number(count: int) -> str:
    words = ("no", "one", "two", "three", "four", "five", "six")
    return f"{words[count] if count < len(words) else count} outlier{'' if count == 1 else 's'}"


def _um(length: float) -> str:
    return f"{length * 1e6:.4g} um"


def with_what_moves_the_tool(found: Any, expected: Any, matters: float, tape: float) -> Any:
    """The calibration, whose finding "undetermined" says what of it moves the tool, if that is known.

    expected: ToolError or None; matters: m, less is nothing; tape: deviation of nominal values, m.
    """
    if expected is None:
        return found
    moving = [one for one in expected.loose if one.moves > matters]
    if not found.undetermined and not moving:
        return found
    others = [f for f in found.findings if f.kind != "undetermined"]
    if not expected.loose:
        return found.with_findings(others)
    from gantrytau_optimica.calibration.data.findings import Finding

    words = _loose(moving, len(expected.loose) - len(moving), tape)
    return found.with_findings([*others, Finding("undetermined", found.rows, words)])


def _loose(moving: list[Any], quiet: int, tape: float) -> str:
    harmless = f"{quiet} combinations of numbers are known by nominal values alone, but do not move the tool"
    if not moving:
        return f"{harmless}: this is harmless"
    shown = "; ".join(f"{', '.join(one.names)} by {_length(one.moves)}" for one in moving[:SHOWN])
    more = f"; and {len(moving) - SHOWN} more" if len(moving) > SHOWN else ""
    found = (
        f"data do not hold all that moves the tool; where nominal values are {_length(tape)} off, together {shown}{more}; "
        "measure more poses, spread over the workspace"
    )
    return f"{found}. {harmless}" if quiet else found


def _length(length: float) -> str:
    return f"{length * 1e6:.3g} um" if length < 1e-3 else f"{length * 1e3:.3g} mm"


def of_measured_poses(found: Any) -> Any:
    """The error of the tool at the poses that were fitted, by nominal values of a usual tape measure; None if unknown."""
    from gantrytau_optimica.calibration.design.identifiability import Poses
    from gantrytau_optimica.calibration.fitting.arm_fit import TAPE
    from gantrytau_optimica.calibration.judging.tool_error import tool_error

    data = found.measurements.select(found.rows)
    try:
        poses = Poses(data.q, data.r, data.R if found.plate_turns else None)
        return tool_error(found.robot, poses, poses, noise=found.noise, tape=TAPE)
    except GantryTauError:
        return None


def with_expectation(found: Any, planned: Planned | None, expected: Any) -> Any:
    """See `with_what_moves_the_tool`; expected: of a plan, else it is worked out for the measured poses."""
    if planned is not None:
        return with_what_moves_the_tool(found, expected, MATTERS * planned.cell.wanted, planned.cell.tape)
    if not found.undetermined:
        return found
    from gantrytau_optimica.calibration.fitting.arm_fit import TAPE

    return with_what_moves_the_tool(found, of_measured_poses(found), found.noise, TAPE)
