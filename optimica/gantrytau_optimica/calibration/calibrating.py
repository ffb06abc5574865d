"""`calibrate`: the parameters of a robot from measured poses."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from gantrytau import Model, ModelError
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.findings import CalibrationError, Finding, rows_in_words
from gantrytau_optimica.calibration.fitting import (
    Fit,
    best_of,
    fit_group,
    fit_robust,
    with_prior,
)
from gantrytau_optimica.calibration.geometry import Geometry, read_geometry
from gantrytau_optimica.calibration.groups import Group
from gantrytau_optimica.calibration.measurements import Measurements
from gantrytau_optimica.calibration.models import (
    Link,
    check_model,
    grouped,
    needs_rails,
    nominal_links,
    on_rail,
    own_directions,
    parallel,
    six_links,
    started_linear,
)
from gantrytau_optimica.calibration.plausibility import NEAR, check_robot, compare

HOPELESS = ("too few poses", "line", "plane", "millimetres", "rotations", "guideway")
LEFT_OUT = ("nan", "duplicates")
OUTLIER = 7.0  # robust standard deviations; of 100,000 normal errors the largest has 4.5
ANOTHER_FRAME = (
    0.005  # rad, between nominal guideways and identified ones, from which on the frame is another
)


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
) -> Calibration:
    """Identify the kinematic parameters of a robot from measured poses by the closure of its links.

    model: None takes the robot as it is, with a direction for each guideway; "parallel" holds their directions, equal,
    at the nominal value; 1 to 5 are the error models of Table 5.2 (see `models.py`). method: "ipopt" solves the same
    least squares by CasADi and Ipopt, as a check. start: "linear" needs no nominal values, only the structure of the
    robot. orientation: of the turntables of an F1. prior: deviations about nominal values by name, in m, such as
    {"plate_offset": 0.001}, or pairs (value, deviation). loss: "robust" leaves gross errors without weight. holdout:
    "second" validates with every second usable pose, None with the poses of the fit, else rows or a mask.
    Raises ModelError for what the model lacks; CalibrationError, with `.rows` and `.kind`, for hopeless measurements.
    """
    _check_words(method=method, start=start, orientation=orientation, loss=loss)
    geometry = read_geometry(robot)
    if geometry.kind == "turning":
        raise ModelError(f"calibrate: found {geometry.name}, expected a robot without turntables")
    _check_columns(geometry, measurements)
    check_model(model, geometry, measurements)
    findings = list(measurements.findings)
    rows = _usable(findings, measurements)
    fitted, held_out = _split(rows, holdout, measurements)
    data = measurements.select(fitted)
    links = nominal_links(geometry, data, six_links(model, geometry))
    _check_count(links, fitted, findings)
    check_robot(links, data.q, data.r, data.R, fitted)
    if start == "linear":
        links = started_linear(links)
    else:
        links, more = _in_frame(geometry, links, data, fitted)
        findings += more
    fits = _fit(model, links, data, start, prior, loss)
    if method == "ipopt":
        from gantrytau_optimica.calibration.by_ipopt import solve

        fits = [solve(fit) for fit in fits]
    found = Calibration(geometry, measurements, model, fits, fitted, held_out, method, loss)
    return replace(found, findings=(*findings, *_afterwards(found, data, held_out)))


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
                f"calibrate: found {name}={word!r}, expected {' or '.join(map(repr, known[name]))}"
            )


def _check_columns(geometry: Geometry, measurements: Measurements) -> None:
    if not isinstance(measurements, Measurements):
        raise ModelError(
            f"calibrate: found {type(measurements).__name__} as measurements, expected Measurements(q, r, ...)"
        )
    if measurements.q.shape[1] != len(geometry.arms):
        raise ModelError(
            f"calibrate: found measurements of {measurements.q.shape[1]} actuators for {geometry.name}, expected "
            f"{len(geometry.arms)}, one for each guideway; check the columns q1, q2, ..."
        )


def _usable(findings: Sequence[Finding], measurements: Measurements) -> np.ndarray:
    """The rows that take part; CalibrationError for what cannot be used at all."""
    good = np.ones(len(measurements), dtype=bool)
    for finding in findings:
        if finding.kind in HOPELESS:
            raise CalibrationError(
                f"Measurements: {finding.message}", kind=finding.kind, rows=finding.rows, findings=findings
            )
        if finding.kind in LEFT_OUT:
            good[finding.rows] = False
    return np.flatnonzero(good)


def _split(rows: np.ndarray, holdout: Any, measurements: Measurements) -> tuple[np.ndarray, np.ndarray]:
    if holdout is None:
        return rows, rows
    if isinstance(holdout, str):
        if holdout != "second":
            raise ModelError(f"calibrate: found holdout={holdout!r}, expected 'second', None, or rows")
        return rows[::2], rows[1::2]
    mask = np.zeros(len(measurements), dtype=bool)
    try:
        mask[np.asarray(holdout)] = True
    except (IndexError, ValueError):
        raise ModelError(
            f"calibrate: found holdout={holdout!r}, expected rows from 0 to {len(measurements) - 1} or a mask of "
            f"{len(measurements)}"
        ) from None
    return rows[~mask[rows]], rows[mask[rows]]


def _check_count(links: Sequence[Link], rows: np.ndarray, findings: Sequence[Finding]) -> None:
    needed = max(len(link.start) for link in links) + 1
    if len(rows) < needed:
        raise CalibrationError(
            f"Measurements: found {len(rows)} poses to fit {needed - 1} parameters of each link, expected {needed} at the "
            "least; measure more poses, or give holdout=None",
            kind="too few poses",
            rows=rows,
            findings=findings,
        )


def _in_frame(geometry: Geometry, links: list[Link], data: Measurements, rows: np.ndarray):
    """Links whose start fits the frame of the measurements; CalibrationError for another robot."""
    fitting = compare(links, data.q, data.r, data.R)
    if fitting.shift > NEAR:
        raise CalibrationError(
            f"Measurements: found guideways that lie {fitting.shift:.3g} m off those of {geometry.name} however the "
            f"frame is placed, in {rows_in_words(rows)}, expected {NEAR:g} m at most; these are measurements of another "
            "robot, or its nominal values are wrong: start='linear' needs none",
            kind="another robot",
            rows=rows,
        )
    if fitting.miss < NEAR:
        return links, []
    angle = np.degrees(np.linalg.norm(fitting.turn))
    message = (
        f"the frame of {rows_in_words(rows)} is another than that of the nominal values (turned by {angle:.3g} degrees, "
        f"links miss their lengths by {fitting.miss:.3g} m); identified without nominal values, in the frame measured"
    )
    return started_linear(links), [Finding("frame", rows, message)]


def _fit(
    model: object,
    links: list[Link],
    data: Measurements,
    start: str,
    prior: Mapping[str, Any] | None,
    loss: str,
) -> list[Fit]:
    if needs_rails(model):
        return _fit_rails(model, links, data, prior, loss)
    if model == 3:
        links = [own_directions(link) for link in links]
    if model == "parallel":
        return _fit_parallel(links, start, prior, loss)
    return _fit_groups(with_prior(grouped(links), prior), loss)


def _fit_groups(groups: Sequence[Group], loss: str) -> list[Fit]:
    return fit_robust(groups) if loss == "robust" else [fit_group(group) for group in groups]


def _fit_parallel(links: list[Link], start: str, prior: Mapping[str, Any] | None, loss: str) -> list[Fit]:
    """One direction for all guideways: the nominal one, unless it is unknown or that of another frame."""
    common = _fit_groups(with_prior(grouped(parallel(links, True)), prior), loss)
    found = common[0].values
    identified = np.array([found[f"direction[{k}]"] for k in range(3)])
    nominal = np.mean([link.start[4:7] for link in links], axis=0)
    cosine = identified @ nominal / np.linalg.norm(identified) / np.linalg.norm(nominal)
    if start == "linear" or np.arccos(np.clip(cosine, -1, 1)) > ANOTHER_FRAME:
        return common
    return _fit_groups(with_prior(grouped(parallel(links, False)), prior), loss)


def _fit_rails(
    model: object, links: list[Link], data: Measurements, prior: Mapping[str, Any] | None, loss: str
) -> list[Fit]:
    """Models 2, 4 and 5: first where straight guideways lie, then how the measured ones do."""
    assert data.rails is not None
    single = [link for link in links if link.chain.R is None]
    if not single:  # models 4 and 5 turn guideways as model 2 finds them
        single = started_linear([_without_plate(arm, links) for arm in range(len(data.rails))])
    single = [_at(link, fit) for link, fit in zip(single, map(fit_group, grouped(single)), strict=True)]
    placed = [best_of([grouped([trial])[0] for trial in on_rail(k, data.rails[k.arm])]) for k in single]
    if model == 2:
        return _fit_groups(with_prior([_restarted(fit) for fit in placed], prior), loss)
    whole: list[Link] = []
    for link in links:
        own = own_directions(link)
        if model == 4 or link.arm == 1:
            fit = placed[link.arm]
            turned = fit.group.chains[0].frame(fit.x[fit.group.places[0]])
            started = _at(own, fit_group(grouped([own])[0]))
            whole += on_rail(started, data.rails[link.arm], turned)
        else:
            whole.append(own)
    return _fit_groups(with_prior(grouped(whole), prior), loss)


def _without_plate(arm: int, links: Sequence[Link]) -> Link:
    link = next(link for link in links if link.arm == arm)
    names = (f"arms[{arm}].length", *(f"arms[{arm}].offset[{k}]" for k in range(3)), *link.names[4:7])
    return Link(arm, replace(link.chain, name=f"arms[{arm}]", R=None), names, link.start[:7], link.free[:7])


def _at(link: Link, fit: Fit) -> Link:
    return replace(link, start=np.array([fit.values[name] for name in link.names]))


def _restarted(fit: Fit) -> Group:
    """The group at its minimum, its rotation folded into the start so that it counts from there."""
    return fit.group.started(fit.x)


def _afterwards(found: Calibration, data: Measurements, held_out: np.ndarray) -> list[Finding]:
    """Outliers among all poses used, and numbers that data do not hold."""
    findings = []
    suspicious = found.suspicious_rows(OUTLIER)
    if suspicious.size:
        findings.append(
            Finding(
                "outliers",
                suspicious,
                f"{rows_in_words(suspicious)} close worse than {OUTLIER:g} standard deviations; "
                + (
                    "they had little weight"
                    if found.loss == "robust"
                    else "look at them, or take loss='robust'"
                ),
            )
        )
    if found.undetermined:
        findings.append(
            Finding(
                "undetermined",
                found.rows,
                f"data do not hold {', '.join(found.undetermined)}; they stay near their start values; turn the plate "
                "more between poses, or give a prior",
            )
        )
    return findings
