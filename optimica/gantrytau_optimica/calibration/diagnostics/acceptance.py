"""What to make of measurements: refused before a fit, or judged after it."""

from collections.abc import Iterator, Sequence

import numpy as np

from gantrytau.border.refusal import Given
from gantrytau_optimica.calibration.data.findings import CalibrationError
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.data.row_sets import rows_of
from gantrytau_optimica.calibration.diagnostics.causes import over_rows, pulled, scaled
from gantrytau_optimica.calibration.diagnostics.device_frames import frame_of, moved_arms
from gantrytau_optimica.calibration.diagnostics.fitted_numbers import FittedNumbers
from gantrytau_optimica.calibration.diagnostics.fitted_rods import FittedRods
from gantrytau_optimica.calibration.diagnostics.outliers import OUTLIER, Suspicion
from gantrytau_optimica.calibration.diagnostics.plausibility import (
    NEAR,
    Fitting,
    compare,
    explained_rows,
    miss,
    misses_of,
    swapped_carts,
)
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure
from gantrytau_optimica.calibration.links.error_models import ModelLink, links_of_arms, moved
from gantrytau_optimica.calibration.links.nominal_rods import NominalRods
from gantrytau_optimica.fitting.finding import DataRows, Finding, Part, agreeing

HOPELESS = ("too few poses", "line", "plane", "millimetres", "rotations", "guideway")
LEFT_OUT = ("nan", "duplicates", "stuck")
STILL = 1e-4  # m, over which a cart must move to be calibrated
NOISE = ("noise larger", "noise smaller")
MISFIT, REFUSED = 1e-3, 1e-2  # m, of typical closure errors that no parameters explain: told, refused
EXPLAINED = 1e-3  # m, within which links close once a mistake is undone, unless noise is larger


def usable_rows(findings: Sequence[Finding], measurements: Measurements) -> np.ndarray:
    """The rows that take part; CalibrationError for what cannot be used at all."""
    good = np.ones(len(measurements), dtype=bool)
    for finding in findings:
        if finding.kind in HOPELESS:
            raise refusal(finding.kind, finding.rows, *finding.parts, findings=findings)
        if finding.kind in LEFT_OUT:
            good[finding.rows] = False
    return np.flatnonzero(good)


def check_carts(robot: NominalRods, measurements: Measurements, rows: np.ndarray) -> None:
    """CalibrationError for a cart that stands still."""
    for k in range(len(robot.arms)):
        q = measurements.q[rows, k]
        if len(rows) and q.max() - q.min() < STILL:
            raise refusal(
                "constant",
                rows,
                f"found q{k + 1} at {q[0]:.6g} m in ",
                DataRows(rows),
                ", expected a cart that moves; its guideway cannot be identified from these; look at that column, or "
                "measure other poses",
            )


def check_count(parameters: int, rows: np.ndarray, findings: Sequence[Finding]) -> None:
    """CalibrationError for fewer fitted rows than a link has parameters and one more."""
    needed = parameters + 1
    if len(rows) < needed:
        raise refusal(
            "too few poses",
            rows,
            f"found {len(rows)} poses to fit {parameters} parameters of each link, expected {needed} at the least; measure "
            "more poses, or give ",
            Given("holdout", None),
            findings=findings,
        )


def in_frame(
    robot: NominalRods, links: list[ModelLink], data: Measurements, rows: np.ndarray
) -> tuple[list[ModelLink], Fitting | None]:
    """Links whose start fits the frame of the measurements, and that frame if it is another; CalibrationError for another
    robot.
    """
    if miss(misses_of(links), data.q, data.r, data.R) < NEAR:
        return links, None
    fitting = compare(links, data.q, data.r, data.R)
    if fitting.left > NEAR / 10:
        raise refusal(
            "another robot",
            rows,
            "found no links of constant length that fit ",
            DataRows(rows),
            f" (they miss it by {fitting.left * 1e3:.3g} mm in the median); expected q and r of the same pose in each row, "
            "of a robot with linear guideways",
        )
    # points on two levels of an axis do not tell guideways apart; forward kinematics may
    if fitting.off > NEAR:
        by_tool = frame_of(robot.robot, misses_of(links), data)
        fitting = fitting if by_tool is None or by_tool.off > NEAR else by_tool
    if fitting.off > NEAR and (swapped := swapped_carts(links, fitting.off, data.q, data.r, data.R)):
        words, off = swapped
        raise refusal(
            "swapped columns" if "column" in words else "sign",
            rows,
            f"found {words} in ",
            DataRows(rows),
            f" (guideways lie {fitting.off:.3g} m off those of {robot.name} however the frame is placed, {off:.3g} m with "
            "that undone); correct the columns of the measurements",
        )
    if fitting.off > NEAR:
        raise refusal(
            "another robot",
            rows,
            f"found guideways that lie {fitting.off:.3g} m off those of {robot.name} however the frame is placed, in ",
            DataRows(rows),
            f", expected {NEAR:g} m at most; these are measurements of another robot, or its nominal values are wrong: ",
            Given("start", "linear"),
            " needs none",
        )
    return moved(links, fitting.turn, fitting.shift), fitting


def frame_seen(links: list[ModelLink], data: Measurements) -> Fitting | None:
    """The frame of the measurements if it is another than that of nominal values, None where these tell nothing."""
    if miss(misses_of(links), data.q, data.r, data.R) < NEAR:
        return None
    fitting = compare(links, data.q, data.r, data.R)
    return fitting if fitting.off <= NEAR else None


def arms_in_frame(
    robot: NominalRods, arms: tuple[ArmClosure, ...], data: Measurements, rows: np.ndarray
) -> tuple[tuple[ArmClosure, ...], Fitting | None]:
    """Arms on turntables in the frame of the measurements, as `in_frame` says of links."""
    misses = misses_of(links_of_arms(arms, data))
    missed = miss(misses, data.q, data.r, data.R)
    if missed < NEAR:
        return arms, None
    fitting = frame_of(robot.robot, misses, data)
    if fitting is not None:
        there = moved_arms(arms, fitting.turn, fitting.shift)
        left = miss(misses_of(links_of_arms(there, data)), data.q, data.r, data.R)
        if left < NEAR:
            return there, fitting
        missed = min(missed, left)
    raise refusal(
        "another robot",
        rows,
        "found ",
        DataRows(rows),
        f" in which links miss their nominal lengths by {missed:.3g} m in the median however the frame is placed, expected "
        f"{NEAR:g} m at most; these are measurements of another robot, or its nominal values are wrong",
    )


def refusal(kind: str, rows: np.ndarray, *parts: Part, findings: Sequence[Finding] = ()) -> CalibrationError:
    """The error for measurements that cannot be used."""
    return CalibrationError(*parts, kind=kind, rows=rows, findings=findings, place="Measurements")


def other_frame(fitting: Fitting, rows: np.ndarray) -> Finding:
    """The finding that the frame is another."""
    words = (
        f" is another than that of the nominal values ({_described(fitting)}); identified in the frame measured, from "
        "nominal values moved there"
    )
    return Finding("frame", rows, ("the frame of ", DataRows(rows), words))


def _described(fitting: Fitting) -> str:
    angle = np.degrees(np.arccos(np.clip((np.trace(fitting.turn) - 1) / 2, -1.0, 1.0)))
    x, y, z = fitting.shift
    return (
        f"turned by {angle:.3g} degrees, its origin is at {x:.4g}, {y:.4g}, {z:.4g} m, links miss their lengths by "
        f"{fitting.miss:.3g} m"
    )


def not_in_base(robot: NominalRods, fitting: Fitting, rows: np.ndarray) -> CalibrationError:
    """The refusal of measurements in another frame than the base in which they are said to be."""
    return refusal(
        "frame",
        rows,
        "found ",
        DataRows(rows),
        f" in another frame than the base of {robot.name} ({_described(fitting)}), expected poses where the robot is "
        "commanded; move them there, or take ",
        Given("frame", "fitted"),
    )


def judged(found: FittedRods) -> list[Finding]:
    """Findings after a fit: rows with mistakes, outliers, slips, and undetermined parameters.

    CalibrationError for rows whose columns are swapped or in mm, unless a robust loss left them without weight, and for
    measurements that no parameters explain.
    """
    seen = found.suspicion
    findings = _mistaken(found, seen)
    others = rows_of(seen.rows, without=rows_of(*(f.rows for f in findings)))
    findings += outliers(found, others, f"close worse than {OUTLIER:g} standard deviations")
    others = found.without_strays()
    findings += over_rows(others)
    return [
        *findings,
        *_misfit(found, seen, findings),
        *pulled(found),
        *scaled(found),
        *_far(others),
        *_in_doubt(found),
        *not_converged(found),
        *_undetermined(others),
        *_other_noise(found),
    ]


def _other_noise(found: FittedNumbers) -> Iterator[Finding]:
    """The findings on residuals of another size than covariances tell; without these nothing is worked out."""
    if found.measurements.covariance is not None:
        yield from (f for f in found.diagnostics.findings if f.kind in NOISE)


def outliers(found: FittedNumbers, rows: np.ndarray, said: str) -> Iterator[Finding]:
    """The finding on outliers; said: how they are off, the verb first."""
    if not rows.size:
        return
    one, (verb, *words) = len(rows) == 1, said.split()
    advice: tuple[Part, ...] = (f"look at {'it' if one else 'them'}, or take ", Given("loss", "robust"))
    if found.loss == "robust":
        advice = (
            f"{'it' if one else 'they'} had little weight and {'is' if one else 'are'} left out of the error",
        )
    where = DataRows(rows, len(found.measurements))
    yield Finding("outliers", rows, (where, f" {agreeing(rows, verb)} {' '.join(words)}; ", *advice))


def not_converged(found: FittedNumbers) -> Iterator[Finding]:
    """The finding on a fit without convergence."""
    if not found.success:
        words = (
            "the fit did not converge; its numbers are those of the last step; measure more poses, or give ",
            Given("prior"),
        )
        yield Finding("not converged", found.rows, words)


def _far(found: FittedRods) -> Iterator[Finding]:
    """Lengths and joints on the plate that data hold, and that are not where they nominally are."""
    if found.nominal is None:
        return
    far = []
    values = found.nominal_rods.values
    for rod in (rod for arm in found.nominal_rods.arms for rod in arm.rods):
        for name in (rod.length, rod.plate_offset):
            if name is not None and name in found.parameters and not found.undetermined_part(name):
                off = float(np.linalg.norm(found.parameters[name] - values[name]))
                far += [f"{name} by {off:.3g} m"] if off > NEAR else []
    if far:
        words = (
            f"identified numbers are off their nominal values, {', '.join(far)}; expected {NEAR:g} m at most; look at units "
            "and columns of the measurements, and at those values"
        )
        yield Finding("far", found.rows, words)


def _misfit(found: FittedRods, seen: Suspicion, findings: list[Finding]) -> Iterator[Finding]:
    if seen.typical < MISFIT:
        return
    rows = rows_of(found.rows, found.held_out)
    said: tuple[Part, ...] = (
        f"links miss their lengths by {seen.typical * 1e3:.3g} mm in ",
        DataRows(rows, len(found.measurements)),
        " with the best parameters",
    )
    remedy: tuple[Part, ...] = (
        " expected q, r and R of the same pose in each row; look at order, units and signs of columns, or take ",
        Given("loss", "robust"),
        " where many rows are wrong, or a device that errs by less",
    )
    if seen.typical > REFUSED:
        raise refusal("misfit", rows, "found that ", *said, ",", *remedy, findings=findings)
    yield Finding("misfit", rows, (*said, ";", *remedy))


def _in_doubt(found: FittedRods) -> Iterator[Finding]:
    lost = found.held_out[~np.isfinite(found.errors)]
    if lost.size:
        left = f"{agreeing(lost, 'they are')} left out of the error"
        words = ("links of the calibrated robot do not meet at q of ", DataRows(lost), f"; {left}")
        yield Finding("no pose", lost, words)


def _undetermined(found: FittedRods) -> Iterator[Finding]:
    if found.undetermined:
        advice = (
            "turn the plate more" if found.plate_turns else "measure more poses, spread over the workspace"
        )
        names = ", ".join(_whole_vectors(found.undetermined))
        words = (
            f"data do not hold {names} (rank {found.rank} of {len(found.names)}); they stay near their start values; "
            f"{advice}, or give ",
            Given("prior"),
        )
        yield Finding("undetermined", found.rows, words)


def _whole_vectors(names: Sequence[str]) -> list[str]:
    """Names of numbers, the three of a vector by its name."""
    found = []
    for name in names:
        vector = name.rpartition("[")[0]
        whole = name.endswith("]") and all(f"{vector}[{k}]" in names for k in range(3))
        found.append(vector if whole else name)
    return list(dict.fromkeys(found))


def _mistaken(found: FittedRods, seen: Suspicion) -> list[Finding]:
    data, rows = found.measurements, seen.rows
    if not rows.size or seen.typical > EXPLAINED:
        return []
    R = None if data.R is None else data.R[rows]
    limit = max(EXPLAINED, OUTLIER * seen.typical)
    findings = []
    for mistake, indices in explained_rows(
        found.nominal_rods, seen.misses, limit, data.q[rows], data.r[rows], R
    ):
        advice = f"; correct {'this row' if len(indices) == 1 else 'these rows'}"
        findings.append(
            Finding(mistake.kind, rows[indices], (f"{mistake.words} in ", DataRows(rows[indices]), advice))
        )
    if findings and found.loss != "robust":
        words = [part for finding in findings for part in ("; ", *finding.parts)][1:]
        bad = np.sort(np.concatenate([finding.rows for finding in findings]))
        last = (", or take ", Given("loss", "robust"))
        raise refusal(findings[0].kind, bad, "found ", *words, *last, findings=findings)
    return findings
