"""What is noticed of logs and of a fit: findings in words, with rows and remedy."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gantrytau.dae import Dae
from gantrytau.kinematics.kinematics import driven_joints
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.fitting.rank import not_told_apart
from gantrytau_optimica.identification.least_squares.factors import Factors
from gantrytau_optimica.identification.least_squares.regression import LimitedFit
from gantrytau_optimica.identification.logs.motion_log import MotionLog
from gantrytau_optimica.identification.logs.robot_checks import check_motion
from gantrytau_optimica.identification.rigid.robot_dynamics import IdentificationError

LEFT_OUT = ("nan", "time", "gaps")  # kinds of findings of a log, whose rows are told together
PERIODS = 10  # of the cutoff, which a stretch must last to be filtered
WORSE = 1.5  # times what a fit leaves where it was made, above which held-out rows contradict it


def usable_parts(
    logs: Sequence[MotionLog], cutoff: float
) -> tuple[list[tuple[tuple[int, np.ndarray], MotionLog]], list[Finding]]:
    """Stretches without gaps that a filter can pass, with number of log and rows there, and what was left out.

    Raises IdentificationError where nothing is left.
    """
    kept: list[tuple[tuple[int, np.ndarray], MotionLog]] = []
    findings: list[Finding] = []
    for number, log in enumerate(logs):
        mended, rows = log.without_lost_rows()
        parts = mended.parts()
        long = [p for p in parts if len(p) > 1 and (p.t[-1] - p.t[0]) * cutoff >= PERIODS]
        firsts = [int(np.flatnonzero(mended.t == part.t[0])[0]) for part in long]
        kept += [((number, rows[k : k + len(part)]), part) for k, part in zip(firsts, long, strict=True)]
        lost = len(mended) - sum(map(len, long))
        if lost:
            bad = np.flatnonzero(~log.finite)
            why = (
                f"{len(bad)} of them are not finite, first row {bad[0]}"
                if len(bad)
                else "times have gaps or do not rise"
            )
            words = (
                f"{lost} of {len(mended)} rows of log {number} do not count: {why}; what is left are {len(long)} stretches "
                f"of at least {PERIODS / cutoff:g} s"
            )
            findings.append(Finding("gaps", bad, words))
        told = [f for f in log.findings if f.kind not in LEFT_OUT or (f.kind == "time" and not lost)]
        where = f"log {number}: " if len(logs) > 1 else ""
        ends = "; here they are put in again" if mended is not log else ""
        findings += [
            replace(f, sentence=f"{where}{f.message}{ends if f.kind == 'lost rows' else ''}") for f in told
        ]
    if not kept:
        raise IdentificationError(
            f"no log lasts {PERIODS} periods of the cutoff of {cutoff:g} Hz, {PERIODS / cutoff:g} s, without gap; "
            f"log longer, or raise the cutoff. {' '.join(f.message for f in findings)}",
            place="identify",
        )
    return kept, findings


def beside_robot(
    dae: Dae, coordinates: Sequence[str], logs: Sequence[MotionLog], known: Sequence[Finding]
) -> list[Finding]:
    """Disagreements of logs with the robot and its nominal values, of kinds not in `known`."""
    if not all(name.endswith((".f", ".tau")) for name in dae.inputs) or driven_joints(dae) != tuple(
        coordinates
    ):
        return []
    kinds = {one.kind for one in known}
    return [
        replace(f, sentence=f"log {number}: {f.message}" if len(logs) > 1 else f.message)
        for number, log in enumerate(logs)
        for f in check_motion(dae, log)
        if f.kind not in kinds
    ]


def half_against_half(halves: tuple[Factors, Factors], p: np.ndarray) -> tuple[float, list[Finding]]:
    """Rms residual, N, of the second half by a fit of the first, and its message. p: the fit of the first half."""
    first, second = (np.sqrt(h.squares(p) / max(h.rows, 1)) for h in halves)
    findings = []
    if second > WORSE * first:
        words = (
            f"a fit of the first half leaves {first:.4g} N rms there and {second:.4g} N in the second: friction, load or "
            "geometry changed, or one half moves what the other does not; log again, or fit the halves apart"
        )
        findings.append(Finding("held out", np.arange(0), words))
    return float(second), findings


def fit_findings(
    names: Sequence[str], found: LimitedFit, weak: Sequence[str], nonlinear: Sequence[str]
) -> list[Finding]:
    """Findings: undetermined parameters, impossible values, and values found by iteration."""
    findings = []
    if nonlinear:
        words = f"forces are not linear in {', '.join(nonlinear)}; found by Gauss-Newton from the robot's own values"
        findings.append(Finding("not linear", np.arange(0), words))
    silent = found.base.silent(names)
    if silent:
        words = (
            f"{not_told_apart(silent, ())}, which stay as in the robot, or as close as a body can; move them"
        )
        findings.append(Finding("silent", np.arange(0), words))
    together = found.base.messages(names)[bool(silent) :]
    if together:
        words = f"{'; '.join(together)}; what follows the first in each sum keeps its nominal value"
        findings.append(Finding("base parameters", np.arange(0), words))
    hardly = [n for n in weak if n not in silent]
    if hardly:
        words = (
            f"the motion hardly tells {', '.join(hardly)} from others, or from zero: small errors of the model move them "
            "far; excite them more, or fix them"
        )
        findings.append(Finding("weak", np.arange(0), words))
    for path in found.tight:
        of_body = ", ".join(n for n in weak if n.startswith(f"{path}."))
        words = (
            f"least squares alone give {path} inertial parameters that no body has; those of the nearest that has a density "
            f"leave {found.cost:.6g} times the sum of squares. "
            f"The motion hardly tells {of_body or 'them'}: turn it further and faster"
        )
        findings.append(Finding("no such body", np.arange(0), words))
    carts = [k for k, n in enumerate(names) if n.startswith("cart_masses[")]
    if carts and all(found.p[k] < 0 or found.active[k] for k in carts):
        words = "no cart has a mass above zero: forces have the opposite sign, or another unit; give them along q, in N"
        findings.append(Finding("sign of force", np.arange(0), words))
    return findings
