"""Priors and constraints that hold numbers where data do not want them.

    d = -H^-1 J'e,  H = J'J + (s / tape)^2     the step to where data alone want the numbers, C = s^2 H^-1
    D = m - G (x + d),  V = G C G' + diag(deviations^2)
    z_i = (V^-1 D)_i / sqrt (V^-1)_ii          of each row, beside data and all other rows

Rows G x = m are priors, with their deviations, and constraints that are kept exactly; z of these are multipliers in
deviations of their own.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau_optimica.calibration.fitting.constraints import AT_LIMIT, ParameterConstraint
from gantrytau_optimica.calibration.fitting.rod_fit import Fit

LEAST = 1e-9  # m2 or m, of the noise: rounding of closure errors is far below it
PULLED = 5.0  # deviations, from which on a prior or an equation contradicts data


@dataclass(frozen=True)
class Pull:
    """name: of the number; kind: "prior", "equation", or "limit" that has another side; held: where it is held; wanted:
    where data alone want it; deviation: of a prior, 0 of constraints; deviations: how many these are off each other.
    """

    name: str
    kind: str
    held: float
    wanted: float
    deviation: float
    deviations: float


def pulls(fit: Fit, constraints: Sequence[ParameterConstraint] = ()) -> list[Pull]:
    """Priors and constraints against the data, the strongest first; reached limits in any case."""
    names, free = fit.free_names, np.flatnonzero(fit.group.free)
    if not fit.group.prior and not constraints:
        return []
    step, covariance = _by_data_alone(fit)
    x, rows = fit.x[free], []
    for place, (value, deviation) in fit.group.prior.items():
        k = int(np.flatnonzero(free == place)[0])
        rows.append((names[k], "prior", np.eye(len(x))[k], value, fit.x[place] + step[k], deviation))
    for constraint in constraints:
        rows += _held(constraint, names, x, step)
    if not rows:
        return []
    G, D = np.array([row[2] for row in rows]), np.array([row[3] - row[4] for row in rows])
    V = G @ covariance @ G.T + np.diag([row[5] ** 2 for row in rows])
    size = np.sqrt(np.maximum(np.diag(V), 1e-300))
    inverse = np.linalg.pinv(V / np.outer(size, size), rcond=1e-12, hermitian=True)
    z = inverse @ (D / size) / np.sqrt(np.maximum(np.diag(inverse), 1e-300))
    found = [
        Pull(name, kind, held, wanted, deviation, float(abs(pull)))
        for (name, kind, _, held, wanted, deviation), pull in zip(rows, z, strict=True)
        if kind == "limit" or abs(pull) > PULLED
    ]
    return sorted(found, key=lambda pull: -pull.deviations)


def _by_data_alone(fit: Fit) -> tuple[np.ndarray, np.ndarray]:
    """The step of the free numbers to where data want them, (n,), by tape where they want nothing, and its covariance."""
    group, free = fit.group, fit.group.free
    data = group.condensed(fit.weights)
    e, J = data.residuals(fit.x), (data.jacobian(fit.x) * group.scale)[:, free]
    rest = e - J @ np.linalg.lstsq(J, e, rcond=1e-10)[0]
    s = max(float(np.sqrt(rest @ rest / max(1, fit.count - fit.minimum.rank))), LEAST)
    away = (fit.x - group.x)[free] / group.scale[free]
    H = J.T @ J + (s / group.tape) ** 2 * np.eye(J.shape[1])
    scale = group.scale[free]
    inverse = np.linalg.inv(H)
    step = -inverse @ (J.T @ e + (s / group.tape) ** 2 * away) * scale
    return step, s**2 * inverse * np.outer(scale, scale)


def _held(
    constraint: ParameterConstraint, names: Sequence[str], x: np.ndarray, step: np.ndarray
) -> list[tuple]:
    """Active rows of a constraint: name, kind, gradient (n,), active bound, value of the unconstrained step, 0."""
    if constraint.squared:
        places = list(constraint.places)
        length = float(np.linalg.norm(x[places]))
        low, high = np.sqrt(constraint.low), np.sqrt(constraint.high)
        slopes = np.zeros((1, len(x)))
        slopes[0, places] = x[places] / length
        value, wanted = np.array([length]), np.array([np.linalg.norm((x + step)[places])])
        told = [f"|{names[places[0]].rpartition('[')[0]}|"]
    else:
        slopes = np.eye(len(x))[list(constraint.places)]
        told = [names[k] for k in constraint.places]
        if constraint.others:
            slopes = slopes - np.eye(len(x))[list(constraint.others)]
            told = [f"{a} less {names[k]}" for a, k in zip(told, constraint.others, strict=True)]
        low, high = constraint.low, constraint.high
        value, wanted = slopes @ x, slopes @ (x + step)
    found = []
    for name, row, here, there, least, most in zip(told, slopes, value, wanted, low, high, strict=True):
        if min(here - least, most - here) < AT_LIMIT:
            kind = "equation" if most - least < AT_LIMIT else "limit"
            found.append((name, kind, row, float(here), float(there), 0.0))
    return found
