"""What is left of the forces, looked at again: forces that come late, and fixed values that the motion contradicts."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau.border import Given
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.fitting.linear import linear_least_squares
from gantrytau_optimica.identification.least_squares.parameter_limits import ParameterLimits
from gantrytau_optimica.identification.least_squares.regression import LimitedFit
from gantrytau_optimica.identification.rigid.residual_covariance import LogRows, covariance
from gantrytau_optimica.identification.rigid.rigid_regression import RigidRegression, factors_of, minimum
from gantrytau_optimica.identification.rigid.robot_dynamics import IdentificationError, model_name

LATE = 0.4  # samples, from which a delay is told
EXPLAINED = 0.98  # of what is left, which a delay or freed values must go below to be told
CONTRADICTED = 0.9
SURE = 4.0  # deviations
FALLS = np.geomspace(0.01, 0.3, 8)  # m/s or rad/s, within which friction may rise or fall towards rest
BENT = 0.25  # of what is left of a joint, that such a change must explain to be told
FALLEN = 3.0  # times this speed, where a ten-thousandth of the change is left


def second_looks(
    problem: RigidRegression, found: LimitedFit, rows: Sequence[LogRows], given: Mapping[str, Any]
) -> list[Finding]:
    """Kinds "delay", "law of friction", "fixed"; given: values that were fixed, by name."""
    findings = [*delay_findings(rows, found), *law_findings(problem, found, rows)]
    return [*findings, *contradictions(problem, found, rows, given)] if given else findings


def delay_findings(rows: Sequence[LogRows], found: LimitedFit) -> list[Finding]:
    """A delay of forces against motion, to parts of a sample: b(t - s) = b - s b', so that s is one column more.

    What the parameters can make up for is taken out of b' first, so that a delay is not mistaken for friction.
    """
    free = found.base.independent
    X = np.concatenate([r.A[r.moving][:, free] for r in rows])
    slope = np.concatenate([np.gradient(r.b, r.period, axis=0)[r.moving] for r in rows])
    left = np.concatenate([r.left(found.p)[r.moving] for r in rows])
    own = slope - X @ linear_least_squares(X, slope)
    if not own @ own > 0 or not left @ left > 0:
        return []
    late = -(own @ left) / (own @ own)  # s
    rest = left + late * own
    period = rows[0].period / rows[0].thinned
    if abs(late) < LATE * period or rest @ rest > EXPLAINED * (left @ left):
        return []
    samples, explained = late / period, 1 - (rest @ rest) / (left @ left)
    back = -round(float(samples)) or -int(np.sign(samples))
    message = (
        f"forces are {abs(samples):.1f} samples {'late' if late > 0 else 'early'} ({1e3 * abs(late):.3g} ms): that explains "
        f"{explained:.0%} of what is left; shift the columns of f by {back:+d} rows, or mend the clocks of both"
    )
    return [Finding("delay", np.arange(0), message)]


def law_findings(problem: RigidRegression, found: LimitedFit, rows: Sequence[LogRows]) -> list[Finding]:
    """Friction that rises or falls towards rest, sign(v) exp(-(v / v_s)^2), which the law that was fitted does not know."""
    if problem.friction is None or problem.friction.law == "stribeck":
        return []
    free = found.base.independent
    changes = [
        [
            m.filtered(m.thin((np.sign(m.speed) * np.exp(-((m.v / x) ** 2)))[:, :, None]))[:, :, 0]
            for x in FALLS
        ]
        for m in problem.motions
    ]
    findings = []
    for i, coordinate in enumerate(problem.dynamics.coordinates):
        X = np.concatenate([r.A[r.moving[:, i], i][:, free] for r in rows])
        left = np.concatenate([r.left(found.p)[r.moving[:, i], i] for r in rows])
        basis, _ = np.linalg.qr(X / np.maximum(np.linalg.norm(X, axis=0), np.finfo(float).tiny))
        best = (0.0, 0.0, 0.0)
        for k, fall in enumerate(FALLS):
            column = np.concatenate([c[k][r.moving[:, i], i] for c, r in zip(changes, rows, strict=True)])
            own = column - basis @ (basis.T @ column)
            if own @ own > 1e-6 * (column @ column) and left @ left > 0:
                slope = float(own @ left / (own @ own))
                best = max(best, (slope * float(own @ left / (left @ left)), float(fall), slope))
        explained, fall, size = best
        if explained > BENT:
            message = (
                f"friction of {coordinate} {'rises' if size > 0 else 'falls'} by {abs(size):.3g} towards rest, within about "
                f"{fall:.2g} m/s or rad/s: that is {explained:.0%} of what is left of its force, and bends friction that "
                "was found; take "
            )
            speed = Given("minimum_speed", float(f"{FALLEN * fall:.2g}"))
            laws = (Given("friction", "stribeck"), ", or ", Given("friction", None), ", the model's law")
            findings.append(Finding("law of friction", np.arange(0), (message, speed, ", ", *laws)))
    return findings


def contradictions(
    problem: RigidRegression, found: LimitedFit, rows: Sequence[LogRows], given: Mapping[str, Any]
) -> list[Finding]:
    """Fixed values from which a fit that is free of them goes far away, and explains more."""
    dynamics, friction = problem.dynamics, problem.friction
    own = tuple(n for n in given if friction is None or n not in friction.known)
    held = {model_name(dynamics.dae, n) for n in own}
    others = {n: v for n, v in dynamics.values.items() if n not in held}
    dynamics = replace(dynamics, names=(*dynamics.names, *own), values=others)
    freed = replace(problem, dynamics=dynamics, friction=replace(friction, known={}) if friction else None)
    if freed.nonlinear():
        return []
    try:
        other, others = minimum(freed, ParameterLimits(np.full(len(freed.names), -np.inf)), ())
    except IdentificationError:  # free of them nothing is determined
        return []
    before, after = factors_of(rows).squares(found.p), factors_of(others).squares(other.p)
    if after > CONTRADICTED * before:
        return []
    matrix = covariance(others, other.p, other.base.independent)
    deviations = np.sqrt(np.diag(matrix))
    told = []
    for k, name in enumerate(freed.names):
        if name not in given:
            continue
        low, high = np.min(given[name]), np.max(given[name])  # of both directions
        if 0 < SURE * deviations[k] < max(low - other.p[k], other.p[k] - high):
            value = f"{low:g}" if low == high else f"{low:g} to {high:g}"
            told.append(f"{name} = {value}, which would be {other.p[k]:.4g} +- {deviations[k]:.2g}")
    if not told:
        return []
    message = (
        f"the motion contradicts {'; '.join(told)}: free of them, {1 - after / before:.0%} less is left of the forces, by "
        "squares; identify them too, or look at the units of what was fixed"
    )
    return [Finding("fixed", np.arange(0), message)]
