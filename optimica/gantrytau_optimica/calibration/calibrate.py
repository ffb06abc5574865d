"""`calibrate`: the parameters of a robot from measured poses."""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from gantrytau import Model, ModelError
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.fitting.model_fits import fit_model
from gantrytau_optimica.calibration.judging.plausibility import check_robot, misses_of
from gantrytau_optimica.calibration.judging.verdicts import (
    check_carts,
    check_count,
    in_frame,
    judged,
    usable_rows,
)
from gantrytau_optimica.calibration.rods.error_models import (
    check_model,
    nominal_links,
    six_links,
    started_linear,
)
from gantrytau_optimica.calibration.rods.nominal_geometry import Geometry, read_geometry


def calibrate(
    robot: Model,
    measurements: Measurements,
    *,
    model: Literal["parallel", 1, 2, 3, 4, 5] | None = None,
    method: Literal["gauss-newton", "ipopt"] = "gauss-newton",
    start: Literal["nominal", "linear"] = "nominal",
    orientation: Literal["local", "unit", "free"] = "local",
    prior: Mapping[str, Any] | None = None,
    loss: Literal["linear", "robust"] = "linear",
    holdout: Any = "second",
    constraints: Mapping[str, Any] | None = None,
) -> Calibration:
    """Identify the kinematic parameters of a robot from measured poses by the closure of its links.

    model: None takes the robot as it is, with a direction for each guideway; "parallel" holds their directions, equal,
    at the nominal value; 1 to 5 are the error models of Table 5.2 (see `models.py`). method: "ipopt" solves the same
    least squares by CasADi and Ipopt, as a check. start: "linear" needs no nominal values, only the structure of the
    robot. orientation: how quaternions of turntables of an F1 are free: "free" with any length, "unit", or "local", three
    rotations each. prior: deviations about nominal values by name, in m, such as {"plate_offset": 0.001}, or pairs
    (value, deviation). loss: "robust" leaves gross errors without weight. holdout:
    "second" validates with every second usable pose, None with the poses of the fit, else rows or a mask.
    constraints: equations and limits that numbers keep, by Ipopt, such as {"|arms[0].direction|": 1.0,
    "arms[0].length": (2.0, 2.1), "arms[1].links[0].length": "arms[1].links[1].length"} (see `constraints.py`).
    Raises ModelError for what the model lacks; CalibrationError, with `.rows` and `.kind`, for hopeless measurements.
    """
    _check_words(method=method, start=start, orientation=orientation, loss=loss)
    if constraints and method != "ipopt":
        raise ModelError(
            "calibrate: found constraints= with method='gauss-newton', which keeps none; take method='ipopt'",
            argument="constraints",
        )
    geometry = read_geometry(robot)
    _check_columns(geometry, measurements)
    check_model(model, geometry, measurements)
    findings = list(measurements.findings)
    rows = usable_rows(findings, measurements)
    check_carts(geometry, measurements, rows)
    fitted, held_out = _split(rows, holdout, measurements)
    if geometry.kind == "turning":
        from gantrytau_optimica.calibration.turning_calibration import calibrate_turning

        policy: Any = dict(method=method, start=start, orientation=orientation, prior=prior, loss=loss)
        policy["constraints"] = constraints
        return calibrate_turning(geometry, measurements, rows, (fitted, held_out), **policy)
    data = measurements.select(fitted)
    links = nominal_links(geometry, data, six_links(model, geometry))
    check_count(max(len(link.start) for link in links), fitted, findings)
    check_robot(geometry, misses_of(links), data.q, data.r, data.R, rows)
    nominal = links
    if start == "nominal" or _needs_values(prior):
        nominal, more = in_frame(geometry, links, data, rows)
        findings += more
    known = "linear" if findings and findings[-1].kind == "frame" else start  # of directions
    links = started_linear(links) if start == "linear" else nominal
    values = {n: float(x) for link in nominal for n, x in zip(link.names, link.start, strict=True)}
    known_misses = misses_of(nominal) if start == "nominal" else None
    fits = fit_model(model, links, data, known, prior, loss, values)
    if method == "ipopt":
        from gantrytau_optimica.calibration.fitting.by_ipopt import solve, solve_constrained

        fits = solve_constrained(fits, constraints) if constraints else [solve(fit) for fit in fits]
    found = Calibration(
        geometry, measurements, model, fits, fitted, held_out, method, loss, nominal=known_misses
    )
    return found.with_findings([*findings, *judged(found)])


def _needs_values(prior: Mapping[str, Any] | None) -> bool:
    """Whether a prior speaks of nominal values."""
    return isinstance(prior, Mapping) and any(not isinstance(given, tuple) for given in prior.values())


def _check_words(**words: str) -> None:
    known = dict(
        method=("gauss-newton", "ipopt"),
        start=("nominal", "linear"),
        orientation=("local", "unit", "free"),
        loss=("linear", "robust"),
    )
    for name, word in words.items():
        if word not in known[name]:
            raise ModelError(
                f"calibrate: found {name}={word!r}, expected {' or '.join(map(repr, known[name]))}",
                argument=name,
            )


def _check_columns(geometry: Geometry, measurements: Measurements) -> None:
    if not isinstance(measurements, Measurements):
        raise ModelError(
            f"calibrate: found {type(measurements).__name__} as measurements, expected Measurements(q, r, ...)"
        )
    expected = len(geometry.arms) + geometry.turntables
    if measurements.q.shape[1] != expected:
        raise ModelError(
            f"calibrate: found measurements of {measurements.q.shape[1]} actuators for {geometry.name}, expected "
            f"{expected}, one for each guideway and turntable; check the columns q1, q2, ..."
        )


def _split(rows: np.ndarray, holdout: Any, measurements: Measurements) -> tuple[np.ndarray, np.ndarray]:
    if holdout is None:
        return rows, rows
    if isinstance(holdout, str):
        if holdout != "second":
            raise ModelError(
                f"calibrate: found holdout={holdout!r}, expected 'second', None, or rows", argument="holdout"
            )
        return rows[::2], rows[1::2]
    mask = np.zeros(len(measurements), dtype=bool)
    try:
        mask[np.asarray(holdout)] = True
    except (IndexError, ValueError):
        raise ModelError(
            f"calibrate: found holdout={holdout!r}, expected rows from 0 to {len(measurements) - 1} or a mask of "
            f"{len(measurements)}",
            argument="holdout",
        ) from None
    return rows[~mask[rows]], rows[mask[rows]]
