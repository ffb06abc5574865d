"""`calibrate`: the parameters of a robot from measured poses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, overload

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.border.checks import check_words, instance
from gantrytau.border.refusal import Given
from gantrytau.progress import shows_progress
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.diagnostics.acceptance import (
    arms_in_frame,
    check_carts,
    check_count,
    frame_seen,
    in_frame,
    judged,
    not_in_base,
    other_frame,
    usable_rows,
)
from gantrytau_optimica.calibration.diagnostics.device_frames import Motion
from gantrytau_optimica.calibration.diagnostics.plausibility import Fitting, Misses, check_robot, misses_of
from gantrytau_optimica.calibration.fitting.constraints import read_constraints
from gantrytau_optimica.calibration.fitting.model_fits import fit_model
from gantrytau_optimica.calibration.fitting.rod_fit import Fit
from gantrytau_optimica.calibration.links.arm_closure import Orientation, arms_of
from gantrytau_optimica.calibration.links.error_models import (
    check_model,
    links_of_arms,
    nominal_links,
    six_links,
    started_linear,
)
from gantrytau_optimica.calibration.links.nominal_rods import NominalRods, read_nominal
from gantrytau_optimica.calibration.named.calibrate_by_names import calibrate_by_names, usable
from gantrytau_optimica.calibration.named.named_calibration import NamedCalibration
from gantrytau_optimica.fitting.finding import Finding

ErrorModel = Literal["parallel", 1, 2, 3, 4, 5]
Method = Literal["gauss-newton", "ipopt"]
Start = Literal["nominal", "linear"]
Loss = Literal["linear", "robust"]
Frame = Literal["fitted", "base"]
ON_RODS = dict(
    model=None, method="gauss-newton", start="nominal", orientation="local"
)  # else robots on rods are meant
BY_NAMES = dict(joints=None, tool="tool")  # else robots by names of parameters are meant


@overload
def calibrate(
    robot: Model,
    measurements: Measurements,
    *,
    model: ErrorModel | None = ...,
    method: Method = ...,
    start: Start = ...,
    orientation: Orientation = ...,
    prior: Mapping[str, Any] | None = ...,
    loss: Loss = ...,
    holdout: Any = ...,
    constraints: Mapping[str, Any] | None = ...,
    frame: Frame = ...,
) -> Calibration: ...


@overload
def calibrate(
    robot: Model,
    measurements: Measurements,
    *,
    parameters: Sequence[str],
    joints: Sequence[str] | None = ...,
    tool: str = ...,
    prior: Mapping[str, Any] | None = ...,
    loss: Loss = ...,
    holdout: Any = ...,
    frame: Frame = ...,
) -> NamedCalibration: ...


@shows_progress
def calibrate(
    robot: Model,
    measurements: Measurements,
    *,
    model: ErrorModel | None = None,
    method: Method = "gauss-newton",
    start: Start = "nominal",
    orientation: Orientation = "local",
    prior: Mapping[str, Any] | None = None,
    loss: Loss = "linear",
    holdout: Any = "second",
    constraints: Mapping[str, Any] | None = None,
    frame: Frame = "fitted",
    parameters: Sequence[str] | None = None,
    joints: Sequence[str] | None = None,
    tool: str = "tool",
) -> Calibration | NamedCalibration:
    """Identify the kinematic parameters of a robot from measured poses: on rods by the closure of its links, of any robot
    with a tool and driven joints by the names of its parameters.

    model: None takes the robot as it is, with a direction for each guideway; "parallel" holds their directions, equal,
    at the nominal value; 1 to 5 are the error models of Table 5.2 (see `models.py`). method: "ipopt" solves the same
    least squares by CasADi and Ipopt, as a check. start: "linear" needs no nominal values, only the structure of the
    robot. orientation: how quaternions of turntables of an F1 are free: "free" with any length, "unit", or "local", three
    rotations each. prior: deviations about nominal values by name, in m, such as {"plate_offset": 0.001}, or pairs
    (value, deviation). loss: "robust" leaves gross errors without weight. holdout:
    "second" validates with every second usable pose, None with the poses of the fit, else rows or a mask.
    constraints: equations and limits that numbers keep, by Ipopt, such as {"|arms[0].direction|": 1.0,
    "arms[0].length": (2.0, 2.1), "arms[1].links[0].length": "arms[1].links[1].length"} (see `constraints.py`).
    frame: "base" says that poses were measured in the base of the robot, where it is commanded; "fitted" takes them in any
    frame: numbers are identified there, and nominal values say where the base is, `.parameters["frame.R"]`, `["frame.t"]`.
    parameters: names in the model of any robot, as ["upper.r", "h"]; prior, loss, holdout and frame speak of them, and the
    frame is fitted beside them. joints: columns of q, by default those that are driven. tool: name of the
    component that was measured, its `.r` and `.R`, as "wrist".
    Raises ModelError for what the model lacks; CalibrationError, with `.rows` and `.kind`, for hopeless measurements.
    """
    asked = locals()
    check_words(calibrate, asked)
    instance("calibrate", "measurements", measurements, Measurements, "Measurements(q, r, ...)")
    _check_rods(asked)
    if parameters is not None:
        known = usable(robot, measurements, parameters, joints, tool)
        split = _split(known.rows, holdout, measurements)
        return calibrate_by_names(robot, measurements, known, split, prior=prior, loss=loss, frame=frame)
    fit = _Asked(model, start, prior, loss, orientation, frame)
    return _on_rods(read_nominal(robot), measurements, fit, method, holdout, constraints)


def _on_rods(
    nominal_rods: NominalRods,
    measurements: Measurements,
    asked: "_Asked",
    method: str,
    holdout: Any,
    constraints: Mapping[str, Any] | None,
) -> Calibration:
    _check_columns(nominal_rods, measurements, asked.start)
    check_model(asked.model, nominal_rods, measurements)
    findings = list(measurements.findings)
    rows = usable_rows(findings, measurements)
    check_carts(nominal_rods, measurements, rows)
    fitted, held_out = _split(rows, holdout, measurements)
    fits, known, there = _fitted(nominal_rods, measurements.select(fitted), asked, (rows, fitted, findings))
    if method == "ipopt":
        from gantrytau_optimica.calibration.fitting.ipopt_fit import solve

        fits = solve(fits, constraints)
    found = Calibration(
        nominal_rods=nominal_rods,
        measurements=measurements,
        model=asked.model,
        fits=tuple(fits),
        rows=fitted,
        held_out=held_out,
        method=method,
        loss=asked.loss,
        orientation=asked.orientation,
        nominal=known,
        frame=asked.frame,
        motion=None if there is None else Motion.of(there),
    )
    if constraints:
        found = replace(found, constraints=tuple(read_constraints(constraints, found.names)))
    told = [] if there is None or asked.start == "linear" else [other_frame(there, rows)]
    return found.with_findings([*findings, *told, *judged(found)])


@dataclass(frozen=True)
class _Asked:
    """What was asked of a fit, as `calibrate` says."""

    model: Any
    start: str
    prior: Mapping[str, Any] | None
    loss: str
    orientation: Any
    frame: str


def _fitted(
    robot: NominalRods,
    data: Measurements,
    asked: _Asked,
    where: tuple[np.ndarray, np.ndarray, list[Finding]],
) -> tuple[list[Fit], Misses | None, Fitting | None]:
    """The fits, how nominal values miss the measurements if they were used, and their frame if it is another.

    where: rows of the measurements that are usable and those that are fitted, and what is known of them.
    """
    rows, fitted, findings = where
    if robot.turntables:
        arms = arms_of(robot, asked.orientation)
        check_count(max(arm.count for arm in arms) // 3, fitted, findings)
        links = links_of_arms(arms, data)
        check_robot(robot, misses_of(links), data.q, data.r, data.R, rows)
        moved, there = arms_in_frame(robot, arms, data, rows)
        nominal = links = links if moved is arms else links_of_arms(moved, data)
    else:
        links = nominal_links(robot, data, six_links(asked.model, robot))
        check_count(max(len(link.start) for link in links), fitted, findings)
        check_robot(robot, misses_of(links), data.q, data.r, data.R, rows)
        if asked.start == "nominal" or _needs_values(asked.prior):
            nominal, there = in_frame(robot, links, data, rows)
        else:
            nominal, there = links, frame_seen(links, data)
        links = started_linear(links) if asked.start == "linear" else nominal
    if asked.frame == "base" and there is not None:
        raise not_in_base(robot, there, rows)
    directions = asked.start if there is None else "linear"
    values = {n: float(x) for link in nominal for n, x in zip(link.names, link.start, strict=True)}
    fits = fit_model(
        asked.model, links, data, start=directions, prior=asked.prior, nominal=values, loss=asked.loss
    )
    return fits, misses_of(nominal) if asked.start == "nominal" else None, there


def _needs_values(prior: Mapping[str, Any] | None) -> bool:
    """Whether a prior speaks of nominal values."""
    return isinstance(prior, Mapping) and any(not isinstance(given, tuple) for given in prior.values())


def _check_rods(asked: Mapping[str, Any]) -> None:
    """ModelError for arguments that speak of robots on rods beside parameters=, or of names without, and constraints that
    are not kept.
    """
    for name, usual in ON_RODS.items() if asked["parameters"] is not None else ():
        if asked[name] != usual:
            raise ModelError(
                f"expected {usual!r} with ",
                Given("parameters"),
                ": it speaks of robots on rods",
                place="calibrate",
                found=Given(name, asked[name]),
            )
    for name in BY_NAMES if asked["parameters"] is None else ():
        if asked[name] != BY_NAMES[name]:
            raise ModelError(
                "expected it with ",
                Given("parameters"),
                " alone",
                place="calibrate",
                found=Given(name, asked[name]),
            )
    if asked["constraints"] and asked["method"] != "ipopt":
        raise ModelError(
            Given("constraints"),
            " with ",
            Given("method", asked["method"]),
            ", expected ",
            Given("method", "ipopt"),
            ", which alone keeps them",
            place="calibrate",
            argument="constraints",
        )


def _check_columns(robot: NominalRods, measurements: Measurements, start: str) -> None:
    expected = len(robot.rods.joints)
    if measurements.q.shape[1] != expected:
        raise ModelError(
            f"calibrate: found measurements of {measurements.q.shape[1]} actuators for {robot.name}, expected "
            f"{expected}, one for each guideway and turntable; check the columns q1, q2, ..."
        )
    if (robot.turntables or len(robot.arms) > 3) and start == "linear":
        raise ModelError(
            f"expected 'nominal' for {robot.name}; links of a plate that is turned are found from a start nearby only",
            place="calibrate",
            found=Given("start", start),
        )


def _split(rows: np.ndarray, holdout: Any, measurements: Measurements) -> tuple[np.ndarray, np.ndarray]:
    if holdout is None:
        return rows, rows
    if isinstance(holdout, str) and holdout == "second":
        return rows[::2], rows[1::2]
    mask = np.zeros(len(measurements), dtype=bool)
    try:
        mask[np.asarray(holdout)] = True
    except (IndexError, ValueError):
        raise ModelError(
            f"expected 'second', None, rows from 0 to {len(measurements) - 1} or a mask of {len(measurements)}",
            place="calibrate",
            found=Given("holdout", holdout),
        ) from None
    return rows[~mask[rows]], rows[mask[rows]]
