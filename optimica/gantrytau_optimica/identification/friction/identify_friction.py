"""From runs at constant speed to friction and to the mass that the actuators carry."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from gantrytau import Model, ModelError
from gantrytau_optimica.fitting.diagnostics import Diagnostics, ResidualSeries, diagnose, repeated
from gantrytau_optimica.identification.friction.carried_mass import carried_mass
from gantrytau_optimica.identification.friction.constant_runs import ConstantRuns, constant_runs
from gantrytau_optimica.identification.friction.friction_fit import (
    ActuatorRows,
    FrictionFit,
    actuator_rows,
    fit_friction,
)
from gantrytau_optimica.identification.friction.friction_result import Friction
from gantrytau_optimica.identification.friction.friction_signs import friction_signs
from gantrytau_optimica.identification.logs.motion_log import MotionLog

SIGNS = ("not white", "outliers", "trend")  # told where no cause is


def identify_friction(
    robot: Model,
    runs: Sequence[MotionLog],
    *,
    mass: Literal["symmetric", "positions"] | float = "symmetric",
    asymmetric: bool = True,
) -> Friction:
    """Coulomb and viscous friction of each actuator and direction, weight set apart by the robot's own model.

    robot: whose geometry and masses of carts hold; its plate, links and friction are not looked at. runs: one MotionLog for
    each run at constant speed; actuators that rest in a run do not count in it. mass: "symmetric", in kg that of
    Coulomb friction as symmetric as possible, of the least sum of (f_c+ - f_c-)^2 over the actuators; "positions",
    that of the least residual over runs at several positions of the tool (three, better five), whatever friction is; or
    known in kg. asymmetric=False: one friction for both directions, which tells the mass by least residual at any position.
    Raises ModelError for runs that are not of this robot, and for what they do not tell. Dressler (2012), section 6.2.
    """
    known = not isinstance(mass, (str, bool)) and np.ndim(mass) == 0 and np.isfinite(mass)
    if mass not in ("symmetric", "positions") if isinstance(mass, str) else not known:
        raise ModelError(
            f"identify_friction: found mass={mass!r}, expected 'symmetric', 'positions' or a number in kg",
            argument="mass",
        )
    load = carried_mass(robot)
    means, unsteady = constant_runs(runs, load)
    actuators = [actuator_rows(means, i, asymmetric, name) for i, name in enumerate(load.actuators)]
    fit = fit_friction(actuators, mass, load.actuators)
    coulomb, viscous, names = _by_direction(actuators, fit.values)
    signs = friction_signs(actuators, means, fit, load.actuators, mass)
    left = _diagnostics(actuators, fit, means, load.actuators, runs)
    causes = {f.kind for f in signs} - {"one position", "direction missing"}
    noticed = (*unsteady, *signs, *(f for f in left.findings if not (causes and f.kind in SIGNS)))
    return Friction(
        fit.mass, coulomb, viscous, fit.symmetric, noticed, means, load, names, fit.covariance, left
    )


def _diagnostics(
    actuators: Sequence[ActuatorRows],
    fit: FrictionFit,
    means: ConstantRuns,
    names: Sequence[str],
    runs: Sequence[MotionLog],
) -> Diagnostics:
    """What is left of the means of runs, in their order, with their positions as known signals."""
    series = [
        ResidualSeries(
            f"the force at {name}",
            left,
            measured=a.y,
            jacobian=np.column_stack([a.X, a.slope]),
            signals={f"q of {name}": means.q[a.rows, i], "order of runs": means.runs[a.rows].astype(float)},
            rows=means.runs[a.rows],
        )
        for i, (a, left, name) in enumerate(zip(actuators, fit.residuals, names, strict=True))
    ]
    return diagnose(series, known=repeated({f"run {k}": np.hstack([r.q, r.f]) for k, r in enumerate(runs)}))


def _by_direction(
    actuators: Sequence[ActuatorRows], values: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Coulomb and viscous friction (n, 2), and names in the order of the covariance."""
    found, names = {word: np.full((len(actuators), 2), np.nan) for word in ("coulomb", "viscous")}, ["mass"]
    for i, (a, c) in enumerate(zip(actuators, values, strict=True)):
        for (word, target), part in zip(found.items(), np.split(c, 2), strict=True):
            for group, value in zip(a.groups, part, strict=True):
                target[i, slice(None) if group == 2 else group] = value
                names.append(f"{word}[{i}]" if group == 2 else f"{word}[{i}][{group}]")
    return found["coulomb"], found["viscous"], tuple(names)
