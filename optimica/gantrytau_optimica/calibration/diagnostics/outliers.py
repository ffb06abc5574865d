"""Rows that close worse than noise explains, seen by a fit without them.

    e_k = e + J_k dp      var e_k = s^2 (1 - h_k) of poses that were fitted, s^2 (1 + h_k) of others, h_k = J_k C J_k'

C is the covariance of the numbers in units of s^2; what data do not hold is known by tape measure. Without h a pose that
was not fitted, far from those that were, would look like an outlier. Few poses hardly show what noise is: the limit
widens as Student's distribution does.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.data.measurements import Measurements, thinned
from gantrytau_optimica.calibration.diagnostics.link_systems import freedom, link_systems
from gantrytau_optimica.calibration.diagnostics.masked_outliers import AGREEING, masked_rows
from gantrytau_optimica.calibration.diagnostics.plausibility import BETTER, NEAR, Misses
from gantrytau_optimica.calibration.fitting.named_parameters import calibrated_arms, rod_links
from gantrytau_optimica.calibration.fitting.rod_fit import Fit, fit_group
from gantrytau_optimica.calibration.links.forward import BLOCK, RodLink
from gantrytau_optimica.fitting.robust import OUTLIER, limit, robust_deviations

CLEANINGS = 5  # rounds of leaving suspicious poses out to see the others clearly
MANY = 2000  # poses, from which on h is negligible
LOOKED_AT = 100  # poses fitted, and as many held out, among which masked ones are looked for
LEAST = 0.05  # of 1 - h, of poses that the fit follows whatever they say


@dataclass(frozen=True)
class Suspicion(Record):
    """rows: those that close too badly; misses: how links identified without them close; typical: robust standard
    deviation of the closure errors of the others, of the worst link, m; fits: without them, by weights 0.
    """

    rows: np.ndarray
    misses: Misses
    typical: float
    fits: tuple[Fit, ...] = ()


def standardised(errors: np.ndarray, spread: np.ndarray | float) -> tuple[np.ndarray, float]:
    """The largest of the errors (links, N) of each pose in robust deviations of its link, (N,), and the worst deviation.

    spread: what the deviations are to be multiplied with, (links, N).
    """
    sizes = np.abs(errors) / spread
    # of many rows some thousand tell their median well enough
    scales = robust_deviations(sizes[:, :: max(1, sizes.shape[1] // 5000)], axis=1)
    return (sizes / np.maximum(scales, 1e-12)[:, None]).max(axis=0), float(scales.max())


def suspicion(
    fits: Sequence[Fit],
    measurements: Measurements,
    fitted: np.ndarray,
    held_out: np.ndarray,
    nominal: Misses | None,
) -> Suspicion:
    """Of fits to the rows `fitted`: rows fitted and held out; nominal: how nominal values miss them, if they are known."""
    mask = np.zeros(len(measurements), dtype=bool)
    mask[fitted] = mask[held_out] = True
    used = np.flatnonzero(mask)
    fits, bad = list(fits), used[:0]
    sure = measurements.select(fitted).certainty
    sure = 1.0 if sure is None else sure
    sizes, typical = relative_distances(fits, measurements, used, fitted)
    # among many poses a mistake in a few is seen without nominal values
    if (len(used) < MANY or (sizes > OUTLIER).any()) and (
        coarse := far_rows(nominal, measurements, used)
    ).size:
        fits = [fit_group(fit.group, sure * (1.0 - np.isin(fitted, coarse))) for fit in fits]
        sizes, typical = relative_distances(fits, measurements, used, fitted)
    degrees = min((fit.count - fit.minimum.rank) / len(fit.group.chains) for fit in fits)
    if (agreeing := agreeing_rows(fits, measurements, fitted, held_out)) is not None:
        fits = [fit_group(fit.group, sure * np.isin(fitted, agreeing)) for fit in fits]
        sizes, typical = relative_distances(fits, measurements, used, fitted)
    for _ in range(CLEANINGS):
        fresh = used[sizes > limit(degrees)]
        if np.array_equal(fresh, bad):
            break
        bad = fresh
        weights = 1.0 - np.isin(fitted, bad)
        if weights.sum() < AGREEING * len(weights):
            break
        fits = [fit_group(fit.group, sure * weights, begin=fit.x) for fit in fits]
        sizes, typical = relative_distances(fits, measurements, used, fitted)
    distances = _distances_of(fits)

    def misses(q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
        return np.abs(distances(q, r, R)).max(axis=0)

    return Suspicion(bad, misses, typical, tuple(fits))


def agreeing_rows(
    fits: Sequence[Fit], measurements: Measurements, fitted: np.ndarray, held_out: np.ndarray
) -> np.ndarray | None:
    """Some rows that agree with each other where so many do not that a fit follows these too, None where there are none."""
    rows = np.union1d(*(each[thinned(len(each), LOOKED_AT)] for each in (fitted, held_out)))
    data = measurements.select(rows)
    # of turntables much is held hardly: wrong rows lead such fits astray, where nothing is linear any more
    astray = any(fit.group.noise is not None or not fit.minimum.success for fit in fits)
    begins = [fits, [started(fit) for fit in fits]] if astray else [fits]
    for begin in begins:
        systems = link_systems(begin, data)
        links = sum(one.errors.shape[1] for one in systems)
        bad = masked_rows(systems, data.r, limit(freedom(systems) / links))
        if bad.any():
            return rows[~bad]
    return None


def started(fit: Fit) -> Fit:
    """The fit before its first step."""
    return replace(fit, minimum=replace(fit.minimum, x=fit.group.x))


def far_rows(nominal: Misses | None, measurements: Measurements, used: np.ndarray) -> np.ndarray:
    """Rows that nominal values miss by far more than the others; none where they miss most, or nothing is known."""
    if nominal is None:
        return used[:0]
    data = measurements.select(used)
    missed = nominal(data.q, data.r, data.R)
    usual = float(np.median(missed))
    far = used[missed > max(NEAR, BETTER * usual)]
    return far if usual < NEAR and len(far) < (1 - AGREEING) * len(used) else used[:0]


def relative_distances(
    fits: Sequence[Fit], measurements: Measurements, rows: np.ndarray, fitted: np.ndarray
) -> tuple[np.ndarray, float]:
    """The largest closure error of each of some rows in robust standard deviations of its link, (rows,), and the worst."""
    distances, whole = _distances_of(fits), measurements.select(rows)
    parts = []
    for first in range(0, len(rows), BLOCK):
        part = slice(first, first + BLOCK)
        parts.append(distances(whole.q[part], whole.r[part], None if whole.R is None else whole.R[part]))
    sure = 1.0 if whole.certainty is None else whole.certainty
    spread = _spread(fits, whole, np.isin(rows, fitted)) if len(rows) < MANY else 1.0
    return standardised(sure * np.concatenate(parts, axis=1), spread)


def _distances_of(
    fits: Sequence[Fit],
) -> Callable[[np.ndarray, np.ndarray, np.ndarray | None], np.ndarray]:
    """How far links are from their lengths, (links, rows) in m, of q (rows, n), r (rows, 3), R (rows, 3, 3)."""
    if arms := calibrated_arms(fits):
        return lambda q, r, R: np.hstack([arm.errors(q, r, R) for arm in arms]).T
    links = rod_links(fits)
    return lambda q, r, R: _distances(links, q, r, R)


def _distances(links: Sequence[RodLink], q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> np.ndarray:
    q, r = np.ascontiguousarray(q.T), np.ascontiguousarray(r.T)
    found = np.empty((len(links), r.shape[1]))
    for k, link in enumerate(links):
        y = r - link.guideway.across(q[link.arm])
        if R is not None and link.on_plate.any():
            y += (R @ link.on_plate).T
        found[k] = np.sqrt(y[0] ** 2 + y[1] ** 2 + y[2] ** 2) - link.length
    return found


def _spread(fits: Sequence[Fit], data: Measurements, fitted: np.ndarray) -> np.ndarray:
    """sqrt(1 -+ h) of the links, in their order, (links, N)."""
    found, sure = [], None if data.certainty is None else data.certainty[:, None]
    for fit in fits:
        minimum, held = fit.minimum, fit.minimum.root
        here = fit.group if fitted.all() else fit.group.over(data.q, data.r, data.R)
        used = fitted.copy()
        if fit.weights is not None:
            used[fitted] = fit.weights > 0
        lost = (
            minimum.directions[minimum.rank :] / fit.smallest * minimum.scale
            if minimum.cost > 0
            else held[:0]
        )
        for k, link in enumerate(here.chains):
            J = here.link_jacobian(fit.x, k)
            J = J if sure is None else J * sure
            own, other = (J @ held.T) ** 2, (J @ lost.T) ** 2
            h = own.sum(axis=1)
            spread = np.where(used, np.maximum(1.0 - h, LEAST), 1.0 + h + other.sum(axis=1))
            found.append((link.cart, link.name, np.sqrt(spread)))
    return np.array([spread for _, _, spread in sorted(found, key=lambda one: one[:2])])
