"""What runs show that the law of Coulomb and viscous friction does not have, and what is missing among them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gantrytau_optimica.fitting.diagnostics import COMPUTED
from gantrytau_optimica.fitting.facts import Fact
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.friction.constant_runs import ConstantRuns
from gantrytau_optimica.identification.friction.friction_fit import SEPARATED, ActuatorRows, FrictionFit

SURE = 4.0  # deviations of what is told as seen
FALLEN = 3.0  # Stribeck speeds, from which a ten-thousandth of the rise is left
SIDES = ("forth", "back")
FALLS = 20  # Stribeck speeds that are tried


def friction_signs(
    actuators: Sequence[ActuatorRows],
    runs: ConstantRuns,
    fit: FrictionFit,
    names: Sequence[str],
    mass: float | str,
) -> tuple[Finding, ...]:
    """Findings on runs and actuators: rows are numbers of runs."""
    found = []
    for a, left, name in zip(actuators, fit.residuals, names, strict=True):
        found += [*_missing(a, runs, name), *_stribeck(a, runs, left, name), *_load(a, fit, left, name)]
    told = (*_known_mass(actuators, fit, mass), *_negative(actuators, fit, names, runs))
    return (*told, *found, *_one_position(actuators, runs, mass), *_lifted(fit, mass))


def _missing(a: ActuatorRows, runs: ConstantRuns, name: str) -> list[Finding]:
    if not a.y.size:
        words = f"{name} moves in no run: its friction is not known (NaN); add runs in which it moves"
        return [Finding("direction missing", np.zeros(0, dtype=int), words)]
    alike = a.groups == (2,)
    there = (
        (bool(np.any(a.X[:, 0] > 0)), not np.all(a.X[:, 0] > 0)) if alike else (0 in a.groups, 1 in a.groups)
    )
    told = "is taken as that of the other" if alike else "is not known (NaN)"
    words = [
        f"{name} has no run {side}: friction in this direction {told}; add runs {side}"
        for side, known in zip(SIDES, there, strict=True)
        if not known
    ]
    return [Finding("direction missing", runs.runs[a.rows], each) for each in words]


def _stribeck(a: ActuatorRows, runs: ConstantRuns, left: np.ndarray, name: str) -> list[Finding]:
    """A rise or fall of friction towards rest, sign(v) exp(-(v / v_s)^2), of the speed v_s that fits best."""
    spare = a.y.size - a.X.shape[1] - 2
    if spare < 1:
        return []
    speeds = np.abs(_speeds(a))
    best = (0.0, 0.0, 0.0)
    for fall in np.geomspace(max(np.min(speeds), 1e-3 * np.max(speeds)), np.max(speeds) / FALLEN, FALLS):
        size, deviation = _share(a, np.sign(_speeds(a)) * np.exp(-((speeds / fall) ** 2)), left, spare)
        if deviation > 0 and abs(size) / deviation > best[0]:
            best = (abs(size) / deviation, size, fall)
    slow = speeds < FALLEN * best[2]
    if best[0] < SURE or not np.any(slow):
        return []
    words = (
        f"friction of {name} {'rises' if best[1] > 0 else 'falls'} by {abs(best[1]):.3g} towards rest, with a "
        f"{'Stribeck' if best[1] > 0 else 'smoothing'} speed of {best[2]:.2g}: {np.sum(slow)} of "
        f"{a.y.size} runs are slower than three of it and bend Coulomb and viscous friction; leave out runs below "
        f"{FALLEN * best[2]:.2g}"
    )
    return [Finding("Stribeck" if best[1] > 0 else "smoothed", runs.runs[a.rows[slow]], words)]


def _load(a: ActuatorRows, fit: FrictionFit, left: np.ndarray, name: str) -> list[Finding]:
    """Friction that grows with the weight in the actuator, which differs from position to position."""
    spare = a.y.size - a.X.shape[1] - 1
    load = np.sign(_speeds(a)) * np.abs(a.slope * fit.mass)
    if spare < 1 or np.linalg.norm(a.beside(load)) < 1e-2 * np.linalg.norm(load):
        return []
    size, deviation = _share(a, load, left, spare)
    if not size > SURE * deviation:
        return []
    words = (
        f"friction of {name} grows with its load, by {size:.3g} N per N of weight: Coulomb friction holds for the mean of "
        "these positions only; identify it where the robot works"
    )
    return [Finding("load", np.zeros(0, dtype=int), words)]


def _one_position(actuators: Sequence[ActuatorRows], runs: ConstantRuns, mass: float | str) -> list[Finding]:
    alike = all(np.linalg.norm(a.beside(a.slope)) < 1e-2 * np.linalg.norm(a.slope) for a in actuators)
    if mass != "symmetric" or not alike or not any(a.groups == (0, 1) for a in actuators):
        return []
    words = (
        "all runs bear the same weight, so that asymmetric friction cannot be told from weight: the mass rests on Coulomb "
        "friction that is as symmetric as possible, by least squares; add runs at other positions of the tool and take "
        "mass='positions'"
    )
    return [Finding("one position", runs.runs, words)]


def _known_mass(actuators: Sequence[ActuatorRows], fit: FrictionFit, mass: float | str) -> list[Finding]:
    """A mass that was told and that runs at several positions contradict."""
    own = [a.beside(a.slope) for a in actuators]
    size = sum(float(x @ x) for x in own)
    seen = SEPARATED**2 * sum(float(a.slope @ a.slope) for a in actuators)
    spare = sum(a.y.size - a.X.shape[1] for a in actuators) - 1
    if isinstance(mass, str) or not size > seen or spare < 1:
        return []
    change = sum(float(x @ left) for x, left in zip(own, fit.residuals, strict=True)) / size
    rest = [left - change * x for x, left in zip(own, fit.residuals, strict=True)]
    deviation = float(np.sqrt(sum(float(e @ e) for e in rest) / spare / size))
    if not abs(change) > max(SURE * deviation, COMPUTED * abs(fit.mass)):
        return []
    fact = Fact("fixed", "mass", held=fit.mass, wanted=fit.mass + change, deviations=abs(change) / deviation)
    remedy = "friction takes what is wrong with it: take mass='positions', or weigh what the actuators carry"
    return [replace(fact, remedy=remedy).finding]


def _negative(
    actuators: Sequence[ActuatorRows], fit: FrictionFit, names: Sequence[str], runs: ConstantRuns
) -> list[Finding]:
    """Friction that drives: a weight, an offset or a sign that is wrong."""
    found, begin = [], 1
    for a, values, name in zip(actuators, fit.values, names, strict=True):
        deviations = np.sqrt(np.diag(fit.covariance)[begin : begin + values.size])
        begin += values.size
        low = values < -np.maximum(SURE * deviations, COMPUTED * np.max(np.abs(values), initial=0.0))
        if np.any(low):
            words = (
                f"friction of {name} is below zero, {', '.join(f'{x:.3g}' for x in values[low])}: it would drive; look at "
                "the mass, the sign of the forces and their offset"
            )
            found.append(Finding("friction below zero", runs.runs[a.rows], words))
    return found


def _lifted(fit: FrictionFit, mass: float | str) -> list[Finding]:
    if fit.mass > 0 or not isinstance(mass, str):
        return []
    words = (
        f"the mass is {fit.mass:.3g} kg, as if it fell upwards: forces have the opposite sign, columns of q and f another "
        "order, or the robot hangs the other way round; look at a run at rest"
    )
    return [Finding("mass below zero", np.zeros(0, dtype=int), words)]


def _speeds(a: ActuatorRows) -> np.ndarray:
    return a.X[:, a.X.shape[1] // 2 :].sum(axis=1)


def _share(a: ActuatorRows, column: np.ndarray, left: np.ndarray, spare: int) -> tuple[float, float]:
    """The share of one more column in what is left, and its deviation."""
    own = a.beside(column)
    size = own @ own
    if size <= 1e-12 * (column @ column):
        return 0.0, 0.0
    share = own @ left / size
    rest = left - share * own
    return float(share), float(np.sqrt(rest @ rest / spare / size))
