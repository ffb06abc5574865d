"""A problem made ready for a receding horizon: in states, algebraics and inputs, with the functions of its stages."""

from collections.abc import Sequence
from typing import Any

from gantrytau import ModelError
from gantrytau_optimica.predictive.stages import HorizonStages
from gantrytau_optimica.predictive.unknowns import as_courses, with_unknowns


def staged(
    problem: Any, period: float, disturbance: Sequence[str] = (), parameters: Sequence[str] = ()
) -> tuple[Any, HorizonStages, dict[str, float]]:
    """The problem in states, algebraics and inputs, its stages, and estimates by name; ModelError for what no receding
    horizon can have.
    """
    disturbance, parameters = ((one,) if isinstance(one, str) else one for one in (disturbance, parameters))
    built, estimates = as_courses(with_unknowns(problem, parameters, disturbance, "Mpc"), parameters)
    read, found = built.read, built.problem
    if found.free:
        names = ", ".join(n.name for n in found.free)
        raise ModelError(
            f"{names} is free, expected a number: a receding horizon has a fixed length and a fixed model; give it a value, "
            "as in final_time = 1.0",
            place=read.name,
        )
    if not any(phase.inputs for phase in found.phases):
        raise ModelError("there is no input to choose; declare one as Input", place=read.name)
    return built, HorizonStages(found, period), estimates
