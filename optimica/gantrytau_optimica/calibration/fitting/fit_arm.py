"""The parameters of one arm from measured poses, as `calibrate` finds those of all arms."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from gantrytau.border.checks import check_words, number
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.fitting.covariance import joint_covariance
from gantrytau_optimica.calibration.fitting.priors import with_prior
from gantrytau_optimica.calibration.fitting.rod_fit import fit_groups
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure
from gantrytau_optimica.calibration.links.arm_factors import checked_poses
from gantrytau_optimica.calibration.links.error_models import grouped, links_of_arm
from gantrytau_optimica.calibration.links.groups import TAPE


@dataclass(frozen=True, eq=False)
class ArmFit(Record):
    """The arm as it was fitted.

    arm: with its new values; iterations: steps taken; success: whether they converged; residuals: closure errors
    (N, m) in m; rank: how many directions the data hold; deviation: of one closure error, in m;
    covariance: (p, p) of the unknowns in the directions that are held, zero in others; links of one pose share the error
    of its measurement, so it uses the covariance of their residuals and not their deviation alone.
    """

    arm: ArmClosure
    iterations: int
    success: bool
    residuals: np.ndarray
    rank: int
    deviation: float
    covariance: np.ndarray


def fit_arm(
    arm: ArmClosure,
    q: np.ndarray,
    r: np.ndarray,
    R: np.ndarray | None,
    *,
    noise: float | None = None,
    tape: float = TAPE,
    prior: Mapping[str, Any] | None = None,
    loss: Literal["linear", "robust"] = "linear",
) -> ArmFit:
    """Fit the unknowns of an arm to measured poses.

    q: (N, n); r: (N, 3) in m; R: (N, 3, 3) or None; noise: standard deviation of a measured closure error in m, by default
    found from the data, or with turntables that of a laser tracker; tape: that of nominal values, in m: what data hold worse
    stays near them; prior, loss: as of `calibrate`.
    Raises ModelError for other words, unknown names, arrays whose shapes do not fit or numbers that are not finite.
    """
    check_words(fit_arm, locals())
    noise = None if noise is None else number("fit_arm", "noise", noise, above=0.0)
    tape = number("fit_arm", "tape", tape, above=0.0)
    data = checked_poses(arm, q, r, R)
    (group,) = with_prior(grouped(links_of_arm(arm, *data)), prior, {})
    if noise is not None:
        group = replace(group, noise=noise if group.arms else noise * 2 * float(np.mean(arm.lengths)))
    (fit,) = fit_groups([replace(group, tape=tape)], loss)
    order = [group.names.index(name) for name in arm.names]
    found = arm.moved((fit.x - group.x)[order])
    residuals = found.closure(*data)[0]
    # links have their shares of the unknowns
    degrees = max(1.0, len(residuals) - arm.count / len(arm.lengths))
    return ArmFit(
        arm=found,
        iterations=fit.minimum.iterations,
        success=fit.minimum.success,
        residuals=residuals,
        rank=fit.minimum.rank,
        deviation=float(np.sqrt((residuals**2).sum() / degrees / len(arm.lengths))),
        covariance=joint_covariance([fit], loss)[np.ix_(order, order)],
    )
