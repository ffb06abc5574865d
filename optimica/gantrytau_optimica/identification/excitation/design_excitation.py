"""From limits to the motion that tells the parameters of a robot best."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from gantrytau import Model, ModelError, SolveError, translate
from gantrytau.border.checks import check_words, number, whole
from gantrytau_optimica.identification.excitation.excitation_limits import ExcitationLimits, excitation_limits
from gantrytau_optimica.identification.excitation.excitation_program import Criterion, ExcitationProgram
from gantrytau_optimica.identification.excitation.excitation_result import Excitation, deviations
from gantrytau_optimica.identification.excitation.fourier_series import FourierSeries, at_rest
from gantrytau_optimica.identification.excitation.motion_regressor import MotionRegressor, motion_regressor
from gantrytau_optimica.identification.logs.motion_log import MotionLog

TOOL = ("tool.r[0]", "tool.r[1]", "tool.r[2]")
PERIOD = 0.004  # s between rows
SMOOTH = 0.02  # of the limit of the speed, within which the sign of friction turns in a design
SHARP = 1e-9  # m/s, the same in what is foretold
TYPICAL = 1.0  # SI unit of a parameter whose value in the model is zero
FASTEST = 2.5  # Hz of the highest harmonic, a quarter of where `identify` cuts off
BEGIN = 0.3  # of the box that a start moves in
SPARE = 1e-3  # of a limit, drawn in besides
ROUNDS = 4  # of limits drawn in, as motions swing out between points


def design_excitation(
    robot: Model,
    *,
    duration: float,
    limits: Mapping[str, Any],
    parameters: Sequence[str] | None = None,
    harmonics: int = 5,
    period: float | None = None,
    criterion: Criterion = "a",
    seed: int = 0,
    starts: int = 3,
) -> Excitation:
    """A periodic motion of the tool that begins at rest, keeps limits, and tells parameters with least deviations.

    duration, period: s; by default whole periods in which the highest harmonic can use speed and acceleration alike, of
    2.5 Hz at most; limits: dict(speed=, acceleration=, force=, box=(low, high)) of the actuators, in m/s, m/s2 and N, a
    number or one for each, and of the tool, in m. parameters: names such as `plate_mass`, `cart_masses[0]`,
    `coulomb[1]`; None for all. criterion: "a", the sum of squares of relative deviations; "d", the volume of the
    confidence ellipsoid; "condition", a smooth bound of the condition number. The best of `starts` random starts.
    Raises ModelError for what does not fit, SolveError where no motion keeps the limits. Swevers et al. (1997).
    """
    check_words(design_excitation, locals())
    _check_numbers(duration, period, harmonics=harmonics, starts=starts, seed=seed)
    dae = translate(robot)
    if TOOL[0] not in dae.variables:
        raise ModelError(
            f"design_excitation: {dae.name} has no tool.r, expected a robot with the position of its tool",
            argument="robot",
        )
    held = excitation_limits(limits, len(dae.inputs), len(TOOL))
    soft = motion_regressor(dae, TOOL, parameters, SMOOTH * float(np.min(held.speed)))
    sharp = motion_regressor(dae, TOOL, parameters, SHARP)
    scale = (
        np.where(soft.nominal > 0, soft.nominal, TYPICAL) if criterion == "a" else np.ones(len(soft.names))
    )
    period = whole_periods(duration, harmonics, held) if period is None else period
    program = ExcitationProgram(soft, held, harmonics, period, criterion, scale)
    rows = np.arange(round(duration / PERIOD) + 1) * PERIOD
    found = [_within(program, sharp, begin, rows) for begin in _begins(held, harmonics, seed, starts)]
    series, used = _best(found)
    motion = series.motion(rows)
    q, v, _, f, Y = sharp.rows(motion)
    Y = Y.reshape(-1, len(soft.names))
    log = MotionLog(rows, q, f, v=v, r=motion[:, :3])
    predicted = dict(zip(soft.names, deviations(Y).tolist(), strict=True))
    start: dict[str, float] = dict(zip(TOOL, motion[0, :3].tolist(), strict=True))
    by_actuators = motion_regressor(dae, sharp.coordinates, soft.names, SHARP)
    return Excitation(
        dae.name,
        log,
        series,
        soft.names,
        float(np.linalg.cond(Y)),
        predicted,
        used,
        soft.actuators,
        start,
        by_actuators,
    )


def whole_periods(duration: float, harmonics: int, limits: ExcitationLimits) -> float:
    """The period in s of which duration holds whole ones, and whose highest harmonic has w = acceleration / speed."""
    natural = harmonics * max(2 * np.pi * float(np.max(limits.speed / limits.acceleration)), 1 / FASTEST)
    return duration / max(1, round(duration / natural))


def _best(
    found: Sequence[tuple[float, FourierSeries, dict[str, float]] | None],
) -> tuple[FourierSeries, dict[str, float]]:
    """The motion of least criterion, and the shares of limits that it uses."""
    kept = [each for each in found if each is not None]
    if not kept:
        raise SolveError(
            f"design_excitation: found no motion within the limits from {len(found)} starts, expected one; look whether "
            "forces hold the robot at rest in the whole box, and whether it is within reach"
        )
    return min(kept, key=lambda each: each[0])[1:]


def _check_numbers(duration: float, period: float | None, **counts: int) -> None:
    duration = number("design_excitation", "duration", duration, above=PERIOD)
    if period is not None:
        period = number("design_excitation", "period", period, above=PERIOD)
    least = dict(harmonics=2, starts=1, seed=0)
    for name, value in counts.items():
        whole("design_excitation", name, value, least=least[name])


def _begins(limits: ExcitationLimits, harmonics: int, seed: int, starts: int) -> list[np.ndarray]:
    """Random series about the centre of the box, higher harmonics smaller."""
    generator, basis = np.random.default_rng(seed), at_rest(harmonics)
    found = []
    for _ in range(starts):
        order = np.concatenate([[np.inf], *[np.arange(1.0, harmonics + 1)] * 2])
        wanted = generator.standard_normal((order.size, len(limits.low))) / order[:, None]
        wanted = basis @ (basis.T @ wanted)
        wanted *= BEGIN * (limits.high - limits.low) / np.sum(np.abs(wanted), axis=0)
        wanted[0] = (limits.high + limits.low) / 2
        found.append(basis.T @ wanted)
    return found


def _within(
    program: ExcitationProgram, sharp: MotionRegressor, begin: np.ndarray, rows: np.ndarray
) -> tuple[float, FourierSeries, dict[str, float]] | None:
    """A motion that keeps the limits at all rows, and what is least there; None where there is none."""
    for _ in range(ROUNDS):
        series, least, _ = program.solve(begin)
        motion = series.motion(rows)
        _, v, a, f, _ = sharp.rows(motion)
        used = program.limits.worst(motion[:, : motion.shape[1] // 3], v, a, f)
        worst = max(used.values())
        if not np.isfinite(worst) or not np.isfinite(least):
            return None
        if worst <= 1.0:
            return least, series, used
        program = replace(program, margin=program.margin / (worst + SPARE))
        begin = at_rest(program.harmonics).T @ series.coefficients.T
    return None
