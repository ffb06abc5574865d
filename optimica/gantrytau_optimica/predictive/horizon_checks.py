"""What makes a problem none for a receding horizon, or a doubtful one: no objective, one without bound, slow samples."""

import math
import warnings

import numpy as np

from gantrytau import GantryTauError, ModelError, linearize
from gantrytau.border.refusal import DoubtfulResult
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.predictive.plan import PlannedMotion
from gantrytau_optimica.predictive.stages import HorizonStages

ENDLESS = 1e6  # sizes of an input: nothing that an objective bounds
SURE = 5  # late steps, without one in time, until a deadline is doubted


def check_bounded(stages: HorizonStages) -> None:
    """ModelError where there is no objective, or one that falls ever faster with an input that has no limit."""
    problem = stages.problem
    if problem.objective.is_zero() and stages.phase.integrand.is_zero():
        raise ModelError("there is no objective; write integrand(), as x**2 + u**2", place=problem.name)
    for k, signal in enumerate(stages.phase.inputs):
        curvature = stages.input_curvatures[k] / signal.nominal**2
        if curvature < 0.0 and not (np.isfinite(stages.lower_u[k]) and np.isfinite(stages.upper_u[k])):
            raise _endless(stages, signal.name, f"its second derivative by {signal.name} is {curvature:.3g}")


def check_plan(stages: HorizonStages, plan: PlannedMotion, unbounded: bool) -> None:
    """ModelError for a first plan whose inputs go to infinity."""
    largest = np.abs(plan.u).max(axis=0)
    if unbounded or largest.max() > ENDLESS:
        free = np.isfinite(stages.lower_u) & np.isfinite(stages.upper_u)
        name = stages.phase.inputs[int(np.argmax(largest - np.where(free, math.inf, 0.0)))].name
        raise _endless(stages, name, "every plan has a cheaper one")


def _endless(stages: HorizonStages, name: str, why: str) -> ModelError:
    return ModelError(
        f"the objective is not bounded: {why}; give {name} a min and a max, or a cost, as + 0.01 * {name}**2",
        place=stages.problem.name,
    )


def doubt_samples(built: Built, period: float) -> None:
    """A warning for samples that are slow beside an unstable pole, or an oscillation, of the model at its start."""
    try:
        poles = linearize(built.read.dae).poles
    except GantryTauError:  # the first measurement is the start, that of the model may be none
        return
    lively = [one for one in poles if abs(one) * period > 1.0 and one.real > -abs(one) / 2]
    if lively:
        pole = max(lively, key=abs)
        said = f"{pole.real:.3g}" if pole.imag == 0.0 else f"{pole.real:.3g} +- {abs(pole.imag):.3g}j"
        warnings.warn(
            f"{built.read.name}: found samples every {period:g} s, expected at most {1 / abs(pole):.2g} s for the pole "
            f"{said} 1/s of the model at its start, which else {'runs away' if pole.real > 0 else 'swings'} between them; "
            "take a shorter period",
            DoubtfulResult,
            stacklevel=3,
        )


def doubt_deadline(name: str, deadline: float, steps: list[float], missed: int) -> None:
    """A warning, once, where the first steps after the first plan all missed their deadline."""
    if missed == SURE == len(steps) - 1:
        warnings.warn(
            f"{name}: found a deadline of {deadline:g} s, expected one above {min(steps[1:]):.2g} s, the quickest "
            "step until now: no plan is ever used; take fewer elements, a longer deadline, or none",
            DoubtfulResult,
            stacklevel=3,
        )
