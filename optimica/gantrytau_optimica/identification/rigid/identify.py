"""Masses and friction of a robot from its motion and its forces: `identify`."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from gantrytau import Model, translate
from gantrytau.border.checks import check_words, number
from gantrytau.dae import Dae
from gantrytau.progress import shows_progress
from gantrytau_optimica.fitting.diagnostics import diagnose
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.least_squares.parameter_limits import ParameterLimits
from gantrytau_optimica.identification.least_squares.regression import LimitedFit, fit
from gantrytau_optimica.identification.logs.motion_log import MotionLog
from gantrytau_optimica.identification.residuals.force_diagnostics import force_diagnostics
from gantrytau_optimica.identification.residuals.position_noise import unbiased
from gantrytau_optimica.identification.rigid.chosen_parameters import (
    asked_parameters,
    check_logs,
    fixed_values,
    is_friction,
)
from gantrytau_optimica.identification.rigid.data_findings import second_looks
from gantrytau_optimica.identification.rigid.fit_findings import (
    beside_robot,
    fit_findings,
    half_against_half,
    usable_parts,
)
from gantrytau_optimica.identification.rigid.friction_columns import FrictionColumns, Law
from gantrytau_optimica.identification.rigid.identification import Identification
from gantrytau_optimica.identification.rigid.parallel_filter import filtered_motion
from gantrytau_optimica.identification.rigid.residual_covariance import LogRows, covariance
from gantrytau_optimica.identification.rigid.rigid_regression import RigidRegression, factors_of, minimum
from gantrytau_optimica.identification.rigid.robot_dynamics import (
    RobotDynamics,
    drives,
    frictions,
    model_name,
)

FALLS = (0.01, 1.0)  # m/s between which a Stribeck speed is looked for
CAUSES = ("delay", "law of friction", "fixed", "noise of positions")  # of what else is left
SIGNS = ("not white", "outliers")  # told where no cause is
INFLATED = 10.0  # times the deviation of a parameter alone: errors of the model weigh as much more


@shows_progress
def identify(
    robot: Model | Dae,
    log: MotionLog | Sequence[MotionLog],
    *,
    parameters: Sequence[str] | str | None = None,
    fixed: Mapping[str, Any] | None = None,
    friction: Law | None = "symmetric",
    physical: bool = True,
    cutoff: float = 10.0,
    minimum_speed: float = 0.005,
    holdout: Literal["second half"] | None = "second half",
) -> Identification:
    """Masses and friction of a robot of rigid bodies, by least squares of its forces along measured motion.

    robot: any model, or what `translate` made of it, of any loops, whose inputs are the forces or torques of its drives,
    with `s` or `phi` beside them; log: one or several, q and f in the order of these inputs. parameters: names or
    families, `plate_mass`, `link_masses[0]` or the model's own, by default masses and inertias that move the forces, and
    the friction of the model (f_c, f_v, f_s) where it is kept.
    The name of a body, `tool`, stands for its ten: mass, `tool.moment[i]` in kg.m, `tool.inertia[i,j]` in kg.m2 about the
    origin of its frame. fixed: values by name or family, numbers, or pairs at positive and negative speed; link_masses=0
    leaves links out. friction: the law that is identified in place of the model's, None keeps that law; the speed of
    "stribeck" is one for all joints, looked for between 0.01 and 1. physical: no mass and no friction below the limits
    that the model declares, no body without a density (pseudo-inertia). cutoff: Hz, of the zero-phase filter of both
    sides; minimum_speed: m/s or rad/s, below which a joint's rows do not count; twice Stribeck's keeps that out of the
    other laws. holdout: the part that judges a fit of the rest. Gautier (1991); Dressler (2012), section 6.1.
    Raises ModelError for unknown names, IdentificationError for data that determine nothing.
    """
    _check_policy(friction, holdout, cutoff, minimum_speed)
    dae = robot if isinstance(robot, Dae) else translate(robot)
    logs = [log] if isinstance(log, MotionLog) else list(log)
    coordinates, forces = drives(dae)
    check_logs(dae, logs, coordinates)
    parts, findings = usable_parts(logs, cutoff)
    findings += beside_robot(dae, coordinates, logs, findings)
    given = fixed_values(dae, fixed or {}, len(coordinates), friction)
    known = {n: v for n, v in given.items() if is_friction(n)}
    fixed_in_model = {model_name(dae, n): float(v) for n, v in given.items() if n not in known}
    rigid = fixed_in_model | (dict.fromkeys(frictions(dae), 0.0) if friction else {})
    names = asked_parameters(dae, parameters, given, friction)
    columns = FrictionColumns(len(coordinates), friction, known) if friction else None
    motions = [replace(filtered_motion(part, cutoff), origin=origin) for origin, part in parts]
    problem = RigidRegression(
        RobotDynamics(dae, coordinates, forces, names, rigid), columns, motions, minimum_speed
    )
    problem = problem if parameters else problem.without_silent()
    nonlinear = problem.nonlinear()
    limits = problem.limits if physical else ParameterLimits(np.full(len(problem.names), -np.inf))
    if friction == "stribeck":
        problem = _with_fall(problem, limits, nonlinear)
    found, rows = minimum(problem, limits, nonlinear)
    clean = unbiased(problem, found, rows, [part for _, part in parts])
    found = clean.fit
    judged, held_findings = _judged(rows, problem, limits) if holdout else (np.nan, [])
    answer = _identified(problem, found, rows, robot, clean.errors)
    left = force_diagnostics(problem, found, rows, logs)
    doubts = [*clean.findings, *held_findings, *fit_findings(problem.names, found, answer.weak, nonlinear)]
    doubts += second_looks(problem, found, rows, given)
    answer = replace(answer, fixed=given, nonlinear=nonlinear, held_out=judged, diagnostics=left)
    answer = replace(answer, findings=_noticed(findings, doubts, left.findings))
    return replace(answer, model_values=fixed_in_model | dict(answer.model_values))


def _check_policy(friction: Any, holdout: Any, cutoff: float, minimum_speed: float) -> None:
    check_words(identify, dict(friction=friction, holdout=holdout))
    cutoff = number("identify", "cutoff", cutoff, above=0.0)
    minimum_speed = number("identify", "minimum_speed", minimum_speed, least=0.0)


def _noticed(
    of_logs: Sequence[Finding], of_fit: Sequence[Finding], of_residuals: Sequence[Finding]
) -> tuple[Finding, ...]:
    """What is told: of a fit what the logs do not tell already, signs in what is left where no cause is known."""
    explained = any(f.kind in CAUSES for f in of_fit)
    more = (*of_fit, *(f for f in of_residuals if not (explained and f.kind in SIGNS)))
    return (*of_logs, *(f for f in more if f.kind not in {one.kind for one in of_logs}))


def _with_fall(
    problem: RigidRegression, limits: ParameterLimits, nonlinear: tuple[str, ...]
) -> RigidRegression:
    """The regression with the Stribeck speed that leaves the least; everything else is minimised at each."""
    from scipy.optimize import minimize_scalar

    def at(logarithm: float) -> RigidRegression:
        assert problem.friction is not None
        return replace(problem, friction=replace(problem.friction, fall=float(np.exp(logarithm))))

    def left(logarithm: float) -> float:
        found, rows = minimum(at(logarithm), limits, nonlinear)
        return factors_of(rows).squares(found.p)

    # several minima are possible: the best of a coarse row of speeds is where to look
    coarse = np.linspace(np.log(FALLS[0]), np.log(FALLS[1]), 8)
    best = int(np.argmin([left(x) for x in coarse]))
    around = (coarse[max(best - 1, 0)], coarse[min(best + 1, len(coarse) - 1)])
    found = minimize_scalar(left, bounds=around, method="bounded", options=dict(xatol=1e-3))
    return at(float(found.x))


def _judged(
    rows: list[LogRows], problem: RigidRegression, limits: ParameterLimits
) -> tuple[float, list[Finding]]:
    """What a fit of the first half of each log leaves of the second."""
    halves = [[r.half(k) for r in rows] for k in (0, 1)]
    if not all(any(np.any(r.moving) for r in half) for half in halves):
        return np.nan, []
    first, second = map(factors_of, halves)
    return half_against_half((first, second), fit(first, problem.nominal, limits).p)


def _identified(
    problem: RigidRegression, found: LimitedFit, rows: list[LogRows], robot: Model | Dae, errors: np.ndarray
) -> Identification:
    """The record of a fit; errors: factor (k, k) of its errors beside those of least squares."""
    names, p = problem.names, found.p
    free = found.base.independent[~found.active[found.base.independent]]
    matrix = errors @ covariance(rows, p, free) @ errors.T
    matrix[found.base.dependent, found.base.dependent] = np.nan
    deviations = np.sqrt(np.diag(matrix))
    told = (found.inflation <= INFLATED) & (2 * deviations <= np.abs(p))
    left = [np.where(r.moving, r.left(p), np.nan) for r in rows]
    own = problem.dynamics.names
    values = {n: float(x) for n, x in problem.dynamics.in_model(p[: len(own)].tolist()).items()}
    parameters = dict(zip(names, p.tolist(), strict=True))
    friction = problem.friction
    if friction and friction.law == "symmetric":
        laws = {
            f"{place}.{short}": f"{word}[{i}]"
            for i, place in enumerate(problem.dynamics.laws)
            if place
            for short, word in (("f_c", "coulomb"), ("f_v", "viscous"))
        }
        numbers = {n: v for n, v in friction.known.items() if isinstance(v, float)} | parameters
        values |= {model: numbers[name] for model, name in laws.items() if name in numbers}
    return Identification(
        robot_name=problem.dynamics.dae.name,
        parameters=parameters,
        fixed={},
        matrix=matrix,
        residuals=np.concatenate(left),
        squares=np.sum(
            [r.thinned * np.nansum(e**2, axis=0) for r, e in zip(rows, left, strict=True)], axis=0
        ),
        condition=found.condition,
        weak=tuple(np.array(names, dtype=object)[~told & ~found.active]),
        active=tuple(np.array(names, dtype=object)[found.active]),
        base=found.base.words(names),
        nonlinear=(),
        stribeck_speed=friction.fall if friction and friction.law == "stribeck" else None,
        model_values=values,
        held_out=np.nan,
        findings=(),
        diagnostics=diagnose(()),
        nominal=robot if isinstance(robot, Model) else None,
    )
