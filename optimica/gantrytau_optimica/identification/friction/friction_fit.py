"""Coulomb and viscous friction for each direction, and the mass that the actuators carry, by linear least squares.

    f = slope m + known + (f_c+ + f_v+ v)    where v > 0
    f = slope m + known - (f_c- - f_v- v)    where v < 0                   Dressler (2012), (6.8), (6.9)

For each actuator c = X^+ (y - slope m), y = f - known, is what friction would be with a mass m. The mass is
    by symmetry     that of the least sum over actuators of (f_c+ - f_c-)^2
    by positions    that of the least residual, which needs weights that differ from run to run
Both are linear in y, so that covariances follow from those of the means of runs.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.identification.friction.constant_runs import ConstantRuns

SEPARATED = 1e-2  # of the weight, that must differ from constant forces of friction to tell the mass


@dataclass(frozen=True, eq=False)
class ActuatorRows:
    """Means of runs in which an actuator moves: columns X (R, k) of the friction in groups, slope and y (R,).

    groups: directions told, 0 forth, 1 back, 2 both by one law; columns are f_c of all groups, then f_v.
    """

    rows: np.ndarray
    groups: tuple[int, ...]
    X: np.ndarray
    slope: np.ndarray
    y: np.ndarray

    @property
    def inverse(self) -> np.ndarray:
        """X^+, (k, R)."""
        return np.linalg.pinv(self.X)

    def beside(self, values: np.ndarray) -> np.ndarray:
        """Residuals of values after the fit of friction."""
        return values - self.X @ (self.inverse @ values)


@dataclass(frozen=True, eq=False)
class FrictionFit:
    """Mass in kg and columns of friction for each actuator, their covariance, with means of runs left over.

    covariance: of the mass, then the columns of all actuators; symmetric: masses of most symmetric Coulomb friction by norm.
    """

    mass: float
    values: tuple[np.ndarray, ...]
    covariance: np.ndarray
    residuals: tuple[np.ndarray, ...]
    symmetric: dict[str, float]


def actuator_rows(runs: ConstantRuns, i: int, asymmetric: bool, name: str) -> ActuatorRows:
    """The rows of actuator i. Raises ModelError where one direction has runs at a single speed."""
    rows = np.flatnonzero(runs.v[:, i])
    v = runs.v[rows, i]
    sides = (v > 0, v < 0) if asymmetric else (v != 0,)
    told = [(k if asymmetric else 2, side) for k, side in enumerate(sides) if np.any(side)]
    for group, side in told:
        speeds = np.abs(v[side])
        if np.ptp(speeds) <= 1e-3 * np.max(speeds) and not (group == 2 and np.ptp(np.sign(v)) > 0):
            raise ModelError(
                f"identify_friction: found runs of {name} at the single speed of {v[side][0]:g}, expected two at least in "
                "each direction: one does not tell Coulomb from viscous friction",
                argument="runs",
            )
    columns = [np.where(side, column, 0.0) for column in (np.sign(v), v) for _, side in told]
    X = np.array(columns).reshape(-1, rows.size).T
    return ActuatorRows(
        rows, tuple(g for g, _ in told), X, runs.slope[rows, i], runs.f[rows, i] - runs.known[rows, i]
    )


def fit_friction(actuators: Sequence[ActuatorRows], mass: float | str, names: Sequence[str]) -> FrictionFit:
    """Mass and friction; mass: "symmetric", "positions", or known in kg. Raises ModelError where runs do not tell it."""
    both = [a.groups == (0, 1) for a in actuators]
    if mass == "symmetric" and 2 not in {g for a in actuators for g in a.groups}:
        if not any(both):
            raise ModelError(
                f"identify_friction: found no actuator of {', '.join(names)} with runs forth and back, expected some as "
                "mass='symmetric' compares them; add runs, or give the mass in kg",
                argument="mass",
            )
        weights = _by_symmetry(actuators)
    elif isinstance(mass, str):
        weights = _by_positions(actuators)
    else:
        weights = [np.zeros(a.y.size) for a in actuators]
    told = (
        float(sum(w @ a.y for w, a in zip(weights, actuators, strict=True)))
        if isinstance(mass, str)
        else float(mass)
    )
    values = tuple(a.inverse @ (a.y - told * a.slope) for a in actuators)
    residuals = tuple(a.y - told * a.slope - a.X @ c for a, c in zip(actuators, values, strict=True))
    masses = _symmetric_masses(actuators, told) if any(both) else {}
    return FrictionFit(told, values, _covariance(actuators, weights, residuals), residuals, masses)


def _by_symmetry(actuators: Sequence[ActuatorRows]) -> list[np.ndarray]:
    """Weights of y in the mass: f_c+ - f_c- is D (y - m slope), and sum (D (y - m slope))^2 is least in m."""
    D = [a.inverse[0] - a.inverse[1] if a.groups == (0, 1) else np.zeros(a.y.size) for a in actuators]
    change = [d @ a.slope for d, a in zip(D, actuators, strict=True)]
    size = sum(b**2 for b in change)
    if not size > SEPARATED**2 * sum(np.mean(a.slope**2) for a in actuators if a.y.size):
        raise ModelError(
            "identify_friction: found no weight in the actuators, expected some as mass='symmetric' tells the mass by it; "
            "give the mass in kg",
            argument="mass",
        )
    return [b * d / size for b, d in zip(change, D, strict=True)]


def _by_positions(actuators: Sequence[ActuatorRows]) -> list[np.ndarray]:
    """Weights of y in the mass of least residual, friction fitted beside it."""
    left = [a.beside(a.slope) for a in actuators]
    size = sum(g @ g for g in left)
    if not size > SEPARATED**2 * sum(a.slope @ a.slope for a in actuators):
        raise ModelError(
            "identify_friction: found weights in the actuators that do not change from run to run, where asymmetric "
            "friction cannot be told from weight; expected runs at several positions of the tool, "
            "mass='symmetric' or a mass in kg",
            argument="mass",
        )
    return [g / size for g in left]


def _symmetric_masses(actuators: Sequence[ActuatorRows], near: float) -> dict[str, float]:
    """Masses of most symmetric Coulomb friction: of least sum (f_c+ - f_c-)^2, and of least sum ln(f_c+ / f_c-)^2."""
    from scipy.optimize import minimize_scalar

    pairs = [a for a in actuators if a.groups == (0, 1)]
    try:
        least = float(sum(w @ a.y for w, a in zip(_by_symmetry(pairs), pairs, strict=True)))
    except ModelError:  # without weight there is none
        return {}
    begin = np.array([(a.inverse @ a.y)[:2] for a in pairs])
    change = np.array([(a.inverse @ a.slope)[:2] for a in pairs])

    def unlike(m: float) -> float:
        coulomb = begin - m * change
        return float(np.sum(np.log(coulomb[:, 0] / coulomb[:, 1]) ** 2)) if np.all(coulomb > 0) else np.inf

    if not np.isfinite(unlike(least)):
        return {"least squares": least}
    span = 0.25 * max(abs(least), abs(near), 1.0)
    while span > 1e-6 and not np.isfinite(unlike(least - span) + unlike(least + span)):
        span *= 0.8
    found = minimize_scalar(
        unlike, bounds=(least - span, least + span), method="bounded", options={"xatol": 1e-9}
    )
    return {"least squares": least, "log ratio": float(found.x)}


def _covariance(
    actuators: Sequence[ActuatorRows], weights: Sequence[np.ndarray], residuals: Sequence[np.ndarray]
) -> np.ndarray:
    """Covariance by that of the means of runs, which scatter alike for one actuator; infinite without runs to spare."""
    blocks = []
    for a, left in zip(actuators, residuals, strict=True):
        spare = a.y.size - a.X.shape[1]
        blocks.append(np.full(a.y.size, left @ left / spare if spare > 0 else np.inf))
    variance = np.concatenate(blocks)
    by_mass = np.concatenate(weights)
    lines, begin = [by_mass], 0
    for a in actuators:
        own = np.zeros((a.X.shape[1], by_mass.size))
        own[:, begin : begin + a.y.size] = a.inverse
        lines += list(own - np.outer(a.inverse @ a.slope, by_mass))
        begin += a.y.size
    P = np.array(lines)
    if not np.all(np.isfinite(variance)):
        return np.full((len(P), len(P)), np.inf)
    return (P * variance) @ P.T
