"""What to make of measurements: refused before a fit, or judged after it."""

from collections.abc import Sequence

import numpy as np

from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.findings import CalibrationError, Finding, rows_in_words
from gantrytau_optimica.calibration.geometry import Geometry
from gantrytau_optimica.calibration.measurements import Measurements
from gantrytau_optimica.calibration.models import Link, started_linear
from gantrytau_optimica.calibration.plausibility import NEAR, Misses, compare, explained_rows, miss, misses_of

HOPELESS = ("too few poses", "line", "plane", "millimetres", "rotations", "guideway")
LEFT_OUT = ("nan", "duplicates")
OUTLIER = 7.0  # robust standard deviations; of 100,000 normal errors the largest has 4.5


def usable_rows(findings: Sequence[Finding], measurements: Measurements) -> np.ndarray:
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


def check_count(parameters: int, rows: np.ndarray, findings: Sequence[Finding]) -> None:
    """CalibrationError for fewer fitted rows than a link has parameters and one more."""
    needed = parameters + 1
    if len(rows) < needed:
        raise CalibrationError(
            f"Measurements: found {len(rows)} poses to fit {parameters} parameters of each link, expected {needed} at the "
            "least; measure more poses, or give holdout=None",
            kind="too few poses",
            rows=rows,
            findings=findings,
        )


def in_frame(geometry: Geometry, links: list[Link], data: Measurements, rows: np.ndarray):
    """Links whose start fits the frame of the measurements; CalibrationError for another robot."""
    if miss(misses_of(links), data.q, data.r, data.R) < NEAR:
        return links, []
    fitting = compare(links, data.q, data.r, data.R)
    if fitting.left > NEAR / 10:
        raise CalibrationError(
            f"Measurements: found no links of constant length that fit {rows_in_words(rows)} (they miss it by "
            f"{fitting.left * 1e3:.3g} mm in the median); expected q and r of the same pose in each row, of a robot with "
            "linear guideways",
            kind="another robot",
            rows=rows,
        )
    if fitting.shift > NEAR:
        raise CalibrationError(
            f"Measurements: found guideways that lie {fitting.shift:.3g} m off those of {geometry.name} however the "
            f"frame is placed, in {rows_in_words(rows)}, expected {NEAR:g} m at most; these are measurements of another "
            "robot, or its nominal values are wrong: start='linear' needs none",
            kind="another robot",
            rows=rows,
        )
    angle = np.degrees(np.linalg.norm(fitting.turn))
    message = (
        f"the frame of {rows_in_words(rows)} is another than that of the nominal values (turned by {angle:.3g} degrees, "
        f"links miss their lengths by {fitting.miss:.3g} m); identified without nominal values, in the frame measured"
    )
    return started_linear(links), [Finding("frame", rows, message)]


def judged(found: Calibration, misses: Misses) -> list[Finding]:
    """Rows with mistakes and outliers among all poses used, and numbers that data do not hold.

    CalibrationError for rows whose columns are swapped or in mm, unless a robust loss left them without weight.
    """
    suspicious = found.suspicious_rows(OUTLIER)
    findings = _mistaken(found, misses, suspicious) if suspicious.size else []
    others = np.setdiff1d(suspicious, np.concatenate([suspicious[:0], *(f.rows for f in findings)]))
    if others.size:
        advice = "they had little weight" if found.loss == "robust" else "look at them, or take loss='robust'"
        words = f"{rows_in_words(others)} close worse than {OUTLIER:g} standard deviations; {advice}"
        findings.append(Finding("outliers", others, words))
    if found.undetermined:
        turns = any(fit.group.chains[0].R is not None for fit in found.fits)
        advice = (
            "turn the plate more between poses" if turns else "measure more poses, spread over the workspace"
        )
        names = ", ".join(found.undetermined)
        words = f"data do not hold {names}; they stay near their start values; {advice}, or give a prior"
        findings.append(Finding("undetermined", found.rows, words))
    return findings


def _mistaken(found: Calibration, misses: Misses, rows: np.ndarray) -> list[Finding]:
    data = found.measurements
    R = None if data.R is None else data.R[rows]
    findings = [
        Finding(
            mistake.kind,
            rows[places],
            f"{mistake.words} in {rows_in_words(rows[places])}; correct these rows",
        )
        for mistake, places in explained_rows(misses, data.q[rows], data.r[rows], R)
    ]
    if findings and found.loss != "robust":
        words = "; ".join(f.message for f in findings)
        bad = np.sort(np.concatenate([f.rows for f in findings]))
        raise CalibrationError(
            f"Measurements: found {words}, or take loss='robust'",
            kind=findings[0].kind,
            rows=bad,
            findings=findings,
        )
    return findings
