"""Named parameters of any robot from measured poses: fitted, and judged by what is left."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from gantrytau import Model, ModelError
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.diagnostics.acceptance import (
    check_count,
    not_converged,
    outliers,
    usable_rows,
)
from gantrytau_optimica.calibration.fitting.pose_residuals import fitted, started
from gantrytau_optimica.calibration.fitting.priors import read_prior
from gantrytau_optimica.calibration.fitting.tool_function import ToolFunction, tool_function
from gantrytau_optimica.calibration.named.named_calibration import NamedCalibration
from gantrytau_optimica.fitting.finding import DataRows, Finding, agreeing

FAR = 0.02  # m, of typical places, that named parameters leave: more are other mistakes
WORSE = 1.1  # times what held-out poses were off before a fit


@dataclass(frozen=True, eq=False)
class Usable(Record):
    """Tool function of the robot, rows of the measurements that take part, and findings on these."""

    tool: ToolFunction
    rows: np.ndarray
    findings: list[Finding]


def usable(
    robot: Model,
    measurements: Measurements,
    parameters: Sequence[str],
    joints: Sequence[str] | None,
    component: str,
) -> Usable:
    """Tool function and usable rows of a robot; joints: columns of q, None for the driven ones; component: name
    of what was measured.
    """
    tool = tool_function(robot, parameters, joints, measurements.R is not None, component)
    if measurements.q.shape[1] != len(tool.joints):
        raise ModelError(
            f"calibrate: found measurements of {measurements.q.shape[1]} joints for {tool.dae.name}, expected "
            f"{len(tool.joints)}: {', '.join(tool.joints)}; check the columns q1, q2, ..., or name joints="
        )
    # SCARA and five bars work in a plane
    findings = [f for f in measurements.findings if f.kind not in ("plane", "line")]
    rows = usable_rows(findings, measurements)
    there = np.isfinite(tool(measurements.q[rows], tool.nominal)[0]).all(axis=1)
    if not there.all():
        lost = rows[~there]
        left = f"; {agreeing(lost, 'they are')} left out"
        findings.append(
            Finding("no pose", lost, ("the nominal robot has no pose at q of ", DataRows(lost), left))
        )
    return Usable(tool, rows[there], findings)


def calibrate_by_names(
    robot: Model,
    measurements: Measurements,
    known: Usable,
    split: tuple[np.ndarray, np.ndarray],
    *,
    prior: Mapping[str, Any] | None,
    loss: str,
    frame: str,
) -> NamedCalibration:
    """The calibration; split: rows that are fitted and held out; prior, loss, frame: as of `calibrate`."""
    tool, (rows, held_out) = known.tool, split
    free = len(tool.names) + 6 * (frame == "fitted")
    check_count(free // (6 if tool.turning else 3) + 1, rows, known.findings)
    residuals, x = started(tool, measurements.select(rows), frame == "fitted")
    told = read_prior(prior, dict(zip(residuals.names, x.tolist(), strict=True)))
    held = {k: told[name] for k, name in enumerate(residuals.names) if name in told}
    residuals, minimum, noise = fitted(replace(residuals, prior=held), x, loss == "robust")
    found = NamedCalibration(
        given=robot,
        measurements=measurements,
        residuals=residuals,
        minimum=minimum,
        noise=noise,
        rows=rows,
        held_out=held_out,
        loss=loss,
        frame=frame,
    )
    findings = [*known.findings, *_judged(found), *_no_better(found, x)]
    return replace(found, noise=_noise(found)).with_findings(findings)


def _no_better(found: NamedCalibration, start: np.ndarray) -> Iterator[Finding]:
    """A finding where the fit predicts the held-out poses worse than the parameters before the fit."""
    if not len(found.held_out):
        return
    data = replace(found.residuals, data=found.measurements.select(found.held_out), lever=1.0)
    before, after = (
        float(np.linalg.norm(data.poses(x)[:, :3], axis=1).mean()) for x in (start, found.minimum.x)
    )
    if after > WORSE * before:
        yield Finding(
            "no better",
            found.held_out,
            f"the held-out poses are {after * 1e6:.3g} um from the fit in the mean, and were {before * 1e6:.3g} um from "
            "where it began; look at what is free, at numbers that are given, and at joints=",
        )


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
    """Findings on a fit: outliers, convergence, undetermined numbers, size and structure of the residuals."""
    findings = [*outliers(found, found.stray_rows, "lie off by more than noise"), *not_converged(found)]
    if found.undetermined:
        told = "; ".join(found.base.messages(found.names))
        words = f"rank {found.rank} of {len(found.names)}: {told}; "
        words += f"they stay near their start values; {found.advice}"
        findings.append(Finding("undetermined", found.rows, words))
    typical = float(np.median(np.linalg.norm(found.residuals.poses(found.minimum.x)[:, :3], axis=1)))
    if typical > FAR:
        words = (
            f"the tool is {typical * 1e3:.3g} mm from where it was measured, with the best parameters; look at order, units "
            "and signs of the columns of q and r, and whether more parameters differ from nominal values"
        )
        findings.append(Finding("misfit", found.rows, words))
    return [*findings, *found.diagnostics.findings]
