"""Named parameters of any robot from measured poses: fitted, and judged by what is left."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.describing.record import Record
from gantrytau.errors import did_you_mean
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.fitting.pose_residuals import PoseResiduals, fitted, started
from gantrytau_optimica.calibration.fitting.tool_function import ToolFunction, tool_function
from gantrytau_optimica.calibration.judging.verdicts import check_count, usable_rows
from gantrytau_optimica.calibration.named.named_calibration import NamedCalibration
from gantrytau_optimica.fitting.finding import Finding, agreeing, rows_in_words

FAR = 0.02  # m, of typical places, that named parameters leave: more are other mistakes


@dataclass(frozen=True)
class AskedByName(Record):
    """What is asked for: names of parameters; joints: columns of q, None for those that are driven; prior, loss, frame: as
    of `calibrate`.
    """

    parameters: Sequence[str]
    joints: Sequence[str] | None
    prior: Mapping[str, Any] | None
    loss: str
    frame: str


def usable(
    robot: Model, measurements: Measurements, asked: AskedByName
) -> tuple[ToolFunction, np.ndarray, list[Finding]]:
    """The function of the robot, rows that it can be fitted to, and what was noticed of the measurements."""
    tool = tool_function(robot, asked.parameters, asked.joints, measurements.R is not None)
    if measurements.q.shape[1] != len(tool.joints):
        raise ModelError(
            f"calibrate: found measurements of {measurements.q.shape[1]} joints for {tool.dae.name}, expected "
            f"{len(tool.joints)}: {', '.join(tool.joints)}; check the columns q1, q2, ..., or name joints="
        )
    findings = [
        f for f in measurements.findings if f.kind not in ("plane", "line")
    ]  # SCARA and five bars work in a plane
    rows = usable_rows(findings, measurements)
    there = np.isfinite(tool(measurements.q[rows], tool.nominal)[0]).all(axis=1)
    if not there.all():
        lost = rows[~there]
        words = f"the nominal robot has no pose at q of {rows_in_words(lost)}; {agreeing(lost, 'they are')} left out"
        findings.append(Finding("no pose", lost, words))
    return tool, rows[there], findings


def calibrate_by_names(
    robot: Model,
    measurements: Measurements,
    asked: AskedByName,
    parted: tuple[np.ndarray, np.ndarray],
    known: tuple[ToolFunction, list[Finding]],
) -> NamedCalibration:
    """The calibration; parted: rows that are fitted and held out; known: as of `usable`."""
    (tool, findings), (rows, held_out) = known, parted
    data = measurements.select(rows)
    check_count(
        (len(tool.names) + 6 * (asked.frame == "fitted")) // (6 if tool.turning else 3) + 1, rows, findings
    )
    residuals, x = started(tool, data, asked.frame == "fitted")
    residuals = replace(residuals, prior=_prior(residuals, asked.prior, x))
    residuals, minimum, noise = fitted(residuals, x, asked.loss == "robust")
    found = NamedCalibration(
        given=robot,
        measurements=measurements,
        residuals=residuals,
        minimum=minimum,
        noise=noise,
        rows=rows,
        held_out=held_out,
        loss=asked.loss,
        frame=asked.frame,
    )
    return replace(found, noise=_noise(found)).with_findings([*findings, *_judged(found)])


def _prior(
    residuals: PoseResiduals, given: Mapping[str, Any] | None, x: np.ndarray
) -> dict[int, tuple[float, float]]:
    found: dict[int, tuple[float, float]] = {}
    for name, told in (given or {}).items():
        those = [k for k, n in enumerate(residuals.names) if name in (n, n.rpartition("[")[0])]
        if not those:
            raise ModelError(
                f"calibrate: prior for '{name}', which is not identified{did_you_mean(name, residuals.names)}",
                argument="prior",
            )
        values, deviation = told if isinstance(told, tuple) else (x[those], told)
        if not np.all(np.asarray(deviation, dtype=float) > 0):
            raise ModelError(
                f"calibrate: found the deviation {deviation!r} for '{name}' in prior, expected one above 0",
                argument="prior",
            )
        for k, value, size in zip(
            those, *np.broadcast_arrays(np.atleast_1d(values), deviation), strict=False
        ):
            found[k] = float(value), float(size)
    return found


def _noise(found: NamedCalibration) -> float:
    """Deviation of a coordinate of a pose of median certainty: of all that is left, but of a robust fit by its median."""
    if found.loss == "robust":
        return found.noise
    left = found.residuals.poses(found.minimum.x)
    spreads = found.residuals.data.spreads
    if spreads is not None:
        R = found.residuals.frame(found.minimum.x)[0]
        worse = np.sqrt(np.sum(spreads**2, axis=(1, 2)) / 3)[:, None]
        left = np.hstack(
            [np.einsum("nij,nj->ni", np.linalg.inv(spreads), left[:, :3] @ R), left[:, 3:] / worse]
        )
    return float(np.sqrt(np.sum(left**2) / max(1, left.size + len(found.residuals.prior) - found.rank)))


def _judged(found: NamedCalibration) -> list[Finding]:
    """What is doubtful after a fit: stray poses, numbers that data do not hold, and what else is left."""
    findings, x, rows = [], found.minimum.x, found.rows
    off = found.stray_rows
    if off.size:
        advice = (
            "had little weight, left out of the error"
            if found.loss == "robust"
            else "look there, or take loss='robust'"
        )
        words = f"{rows_in_words(off, len(found.measurements))} {agreeing(off, 'lie')} off by more than noise; {advice}"
        findings.append(Finding("outliers", off, words))
    if not found.success:
        words = "the fit did not converge; its numbers are those of the last step; start nearer, or name fewer parameters"
        findings.append(Finding("not converged", rows, words))
    if found.undetermined:
        told = [
            f"{name} follows from {', '.join(others)}"
            if others
            else f"nothing that was measured depends on {name}"
            for name, others in found.dependent.items()
        ]
        words = f"data do not tell all numbers apart (rank {found.rank} of {len(found.names)}): {'; '.join(told)}; "
        findings.append(
            Finding("undetermined", rows, f"{words}they stay near their start values; {found.advice}")
        )
    typical = float(np.median(np.linalg.norm(found.residuals.poses(x)[:, :3], axis=1)))
    if typical > FAR:
        words = (
            f"the tool is {typical * 1e3:.3g} mm from where it was measured, with the best parameters; look at order, units "
            "and signs of the columns of q and r, and whether more parameters differ from nominal values"
        )
        findings.append(Finding("misfit", rows, words))
    return [*findings, *found.diagnostics.findings]
