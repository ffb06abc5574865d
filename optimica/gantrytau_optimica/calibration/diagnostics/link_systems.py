"""Closure errors of all links at a minimum, linear in what may have gone wrong, and what identified numbers leave of them.

    e = J dp + U d,    left = e - Q Q'e,    J = Q T,    columns X of a cause count by X - Q Q'X

U are the derivatives by place and turn of the plate and by actuators. Links of other groups share no numbers, so that each
group has its own J; a cause may move the links of all of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np

from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.fitting.covariance import pose_noise
from gantrytau_optimica.calibration.fitting.rod_fit import Fit
from gantrytau_optimica.fitting.diagnostics import ResidualSeries

# times the variance that a cause leaves, which smooth functions of the pose must leave at the least
SMOOTHER = 2.0


@dataclass(frozen=True, eq=False)
class LinkSystem(Record):
    """m links that share numbers, at N poses.

    errors: closure errors, (N, m) in m; numbers: their derivatives by the combinations of numbers that data hold and by
    those that were given, (N, m, p); place, turn: by T and by a rotation vector of the plate in the world, (N, m, 3);
    actuators: by columns of q, (N, m); certainty: (N, 1), by which the rows of all of these are multiplied.
    """

    errors: np.ndarray
    numbers: np.ndarray
    place: np.ndarray
    turn: np.ndarray
    actuators: Mapping[int, np.ndarray]
    certainty: np.ndarray

    @cached_property
    def known(self) -> np.ndarray:
        """Q, (N m, p)."""
        return np.linalg.qr(self.numbers.reshape(self.errors.size, -1))[0]

    @cached_property
    def left(self) -> np.ndarray:
        """Residuals of the errors after the fit of the parameters, (N, m)."""
        return self.across(self.errors[..., None])[..., 0]

    def across(self, columns: np.ndarray) -> np.ndarray:
        """Residuals of columns (N, m, k) after the fit of the parameters."""
        flat = columns.reshape(self.errors.size, -1)
        return (flat - self.known @ (self.known.T @ flat)).reshape(columns.shape)

    def with_columns(self, columns: np.ndarray) -> "LinkSystem":
        """This system with further columns (N, m, k) as parameters."""
        return replace(self, numbers=np.concatenate([self.numbers, columns], axis=2))


def link_systems(fits: Sequence[Fit], data: Measurements) -> list[LinkSystem]:
    """The links of each fit at the poses of data, whether they were fitted or not."""
    found, sure = [], np.ones((len(data), 1)) if data.certainty is None else data.certainty[:, None]
    for fit in fits:
        here = fit.group.over(data.q, data.r, data.R)
        every = replace(here, free=np.ones_like(here.free))
        numbers = np.stack([every.link_jacobian(fit.x, k) for k in range(len(here.chains))], axis=1)
        if fit.minimum.rank < here.free.sum():  # what data do not hold explains nothing
            held = np.zeros((fit.minimum.rank, len(fit.x)))
            held[:, here.free] = fit.minimum.directions[: fit.minimum.rank] * here.scale[here.free]
            numbers = numbers @ np.vstack([held, np.eye(len(fit.x))[~here.free]]).T
        by_pose = [link.by_pose(here.parameters(k, fit.x)) for k, link in enumerate(here.chains)]
        place, turn = (np.stack(each, axis=1) for each in zip(*by_pose, strict=True))
        slopes = [link.by_actuator(here.parameters(k, fit.x)) for k, link in enumerate(here.chains)]
        # errors of links on straight guideways are squares of lengths: in m where T moves them by as much as itself
        unit = np.median(np.linalg.norm(place, axis=2), axis=0)
        actuators = {
            column: sure * np.column_stack([one.get(column, np.zeros(len(data))) for one in slopes]) / unit
            for column in sorted({column for one in slopes for column in one})
        }
        errors = sure * here.errors(fit.x) / unit
        numbers, place, turn = (sure[..., None] * array / unit[:, None] for array in (numbers, place, turn))
        found.append(LinkSystem(errors, numbers, place, turn, actuators, sure))
    return found


def freedom(systems: Sequence[LinkSystem]) -> int:
    """Errors more than numbers."""
    return sum(one.errors.size - one.known.shape[1] for one in systems)


def variance(systems: Sequence[LinkSystem]) -> float:
    """Variance of the residual closure errors, m2."""
    return sum(float(np.sum(one.left**2)) for one in systems) / max(1, freedom(systems))


def with_smooth(systems: Sequence[LinkSystem], r: np.ndarray) -> list[LinkSystem]:
    """This system with polynomials of the third degree in r (N, 3) for each link, as errors of the model."""
    x = 2 * (r - r.min(axis=0)) / np.maximum(np.ptp(r, axis=0), 1e-300) - 1
    x = np.column_stack([np.ones(len(x)), x])
    smooth = np.column_stack(
        [x[:, i] * x[:, j] * x[:, k] for i, j, k in combinations_with_replacement(range(4), 3)]
    )
    found = []
    for one in systems:
        count = one.errors.shape[1]
        columns = np.kron(np.eye(count), smooth[:, None, :]).reshape(len(r), count, -1)
        found.append(one.with_columns(columns * one.certainty[..., None]))
    return found


def closure_series(fits: Sequence[Fit], data: Measurements, rows: np.ndarray) -> list[ResidualSeries]:
    """Residual series of the links at the fitted poses; links that share numbers are one quantity; rows: of the data."""
    systems = link_systems(fits, data)
    noise = _told(systems, data)
    away = systems[0].certainty[:, 0] * data.distances
    signals = {f"q of q{k + 1}": q - q.mean() for k, q in enumerate(data.q.T)}
    found = []
    for fit, one in zip(fits, systems, strict=True):
        links = [link.name for link in fit.group.chains]
        name = f"the closure of {' to '.join(dict.fromkeys((links[0], links[-1])))}"
        for k, link in enumerate(links):
            told = None if noise is None else noise.pop(0)
            groups = {"link": np.full(len(data), link)} if len(links) > 1 else {}
            found.append(
                ResidualSeries(
                    name, one.errors[:, k], away, told, one.numbers[:, k], signals, groups, rows, link
                )
            )
    return found


def _told(systems: Sequence[LinkSystem], data: Measurements) -> list[np.ndarray] | None:
    """Told deviations of the closure errors of each link, (N,) in m: by the covariance of positions, less the shared part
    that numbers take up, and by the estimated noise of orientations.
    """
    if data.spreads is None or data.deviation is None:
        return None
    links = [(one, k) for one in systems for k in range(one.errors.shape[1])]
    seen = np.stack([np.einsum("nj,njk->nk", one.place[:, k], data.spreads) for one, k in links], axis=1)
    turn = np.stack([one.turn[:, k] for one, k in links], axis=1)
    errors = np.column_stack([one.errors[:, k] for one, k in links])
    freedom = np.array([len(data) - one.known.shape[1] / one.errors.shape[1] for one, _ in links])
    angle = pose_noise(errors, seen, turn, np.maximum(freedom, 1.0))[1]
    squares = data.deviation**2 * np.sum(seen**2, axis=2) + angle**2 * np.sum(turn**2, axis=2)
    if data.shared is not None:
        common = [one.across(np.einsum("nmj,njk->nmk", one.place, data.shared)) for one in systems]
        squares += np.concatenate([np.sum(each**2, axis=2) for each in common], axis=1)
    return list(np.sqrt(squares).T)
