"""From measured steps to the servos of a robot."""

from collections.abc import Sequence

import numpy as np

from gantrytau_optimica.fitting.diagnostics import Diagnostics, ResidualSeries, diagnose, repeated
from gantrytau_optimica.identification.rigid.robot_dynamics import IdentificationError
from gantrytau_optimica.identification.servos.servo_findings import explained, servo_findings
from gantrytau_optimica.identification.servos.servo_fit import ServoFit, ServoRows, fit_servo
from gantrytau_optimica.identification.servos.servo_model import ServoModel
from gantrytau_optimica.identification.servos.step_response import StepResponse, check_steps

TOLD = ("duplicates", "outliers", "group")  # what friction and limits colour is told by themselves
FOLLOWS = 30.0  # % of the motion, below which positions do not follow references


def identify_servo(steps: StepResponse | Sequence[StepResponse]) -> ServoModel:
    """Delay, pole and gain of each servo, q_m = q^-d b / (1 - a q^-1) q_r, from steps of references.

    steps: one StepResponse or several, best of several sizes; an actuator is fitted to those in which its reference
    changes. From rest wherever friction holds it: the law is that of differences. The delay is a whole number of samples,
    that of the least sum of squares of the simulated response. `.findings` tell of friction and saturation.
    Raises ModelError for steps that tell nothing, and IdentificationError for positions that do not follow their
    references. Dressler (2012), (6.10) and (6.11).
    """
    steps = check_steps(steps)
    period = steps[0].period
    n = steps[0].position.shape[1]
    rows = [_rows(steps, i) for i in range(n)]
    fits = [fit_servo(one, period) for one in rows]
    share = np.array([explained(one, fit) for one, fit in zip(rows, fits, strict=True)])
    rest, matrix = np.full((len(steps), n), np.nan), np.zeros((2 * n, 2 * n))
    noticed = []
    for i, (one, fit) in enumerate(zip(rows, fits, strict=True)):
        _check_follows(i, share[i], fit)
        rest[[r.step for r in one], i] = fit.rest
        matrix[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = fit.covariance
        noticed += servo_findings(i, one, fit, period)
    left = _diagnostics(steps, rows, fits)
    return ServoModel(
        np.array([fit.delay for fit in fits]),
        np.array([fit.pole for fit in fits]),
        np.array([fit.gain for fit in fits]),
        share,
        period,
        rest,
        steps,
        (*noticed, *(f for f in left.findings if f.kind in TOLD)),
        matrix,
        left,
    )


def _diagnostics(
    steps: Sequence[StepResponse], rows: Sequence[list[ServoRows]], fits: Sequence[ServoFit]
) -> Diagnostics:
    """What the laws leave of the motion of each actuator, step by step."""
    series = [
        ResidualSeries(
            f"actuator {i}",
            left,
            measured=r.y - rest,
            groups={f"actuator {i}, step": np.full(len(left), r.step)},
            run=f"step {r.step}",
        )
        for i, (own, fit) in enumerate(zip(rows, fits, strict=True))
        for r, left, rest in zip(own, fit.residuals, fit.rest, strict=True)
    ]
    courses = {f"step {k}": np.hstack([step.reference, step.position]) for k, step in enumerate(steps)}
    return diagnose(series, known=repeated(courses))


def _rows(steps: Sequence[StepResponse], i: int) -> list[ServoRows]:
    return [
        ServoRows(k, step.reference[:, i] - step.reference[0, i], step.position[:, i])
        for k, step in enumerate(steps)
        if step.start[i] < len(step)
    ]


def _check_follows(i: int, share: float, fit: ServoFit) -> None:
    if not share > FOLLOWS:
        raise IdentificationError(
            f"identify_servo: found that the reference explains {max(share, 0.0):.3g} % of the motion of actuator {i}, "
            f"expected more than {FOLLOWS:.0f} %; look at the order of columns and at the clocks of both (the best delay is "
            f"{fit.delay} samples)"
        )
    if fit.pole >= 1 - 1e-8:
        raise IdentificationError(
            f"identify_servo: found that actuator {i} does not come to an end of its motion, expected a pole below 1; log "
            "until it rests, and look whether the reference is a position, not a speed"
        )
