"""How sure identified parameters are, from the noise of measured poses.

    e_ik = |y_ik|^2 - L_i^2,    de_ik = 2 y_ik . dT_k + 2 (R_k B_i x y_ik) . dphi_k = u_ik . dT_k + w_ik . dphi_k
    cov(e_ik, e_jk) = s^2 u_ik . u_jk + a^2 w_ik . w_jk
    p = -(J'WWJ)^-1 J'WWe       cov p = (J'WWJ)^-1 J'WW cov(e) WWJ (J'WWJ)^-1

Links share the noise of a pose, so that parameters of different links vary together. The deviations s of a coordinate and a
of a turn about an axis are those with which the products of closure errors agree best. For one link alone this is
4 s^2 L^2 (J'J)^-1, the Cramer-Rao bound of its closure errors. Where positions have a covariance C of their own, C^1/2 u
stands for u, C in units of its median size, and w is worse by as much; W are the weights of the fit.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import block_diag

from gantrytau_optimica.calibration.fitting.rod_fit import Fit
from gantrytau_optimica.fitting.covariance import spread_by
from gantrytau_optimica.fitting.robust import robust_deviations

ALIKE = 4.0  # standard deviations by which estimated noises may differ and count as one
LEAST = 0.1  # of the squares of what is left, that are at the least no errors which poses share


def link_noise(
    fits: Sequence[Fit], loss: str, spreads: np.ndarray | None = None, shared: np.ndarray | None = None
) -> list[np.ndarray]:
    """Standard deviations of a measured coordinate, in m, one for each link of each fit; pooled where they are alike.

    Of a robust fit from the median of the amounts. spreads, shared: `Measurements.spreads` and `.shared` of the fitted
    poses: then of a pose of median size, by what is left beside errors that poses share.
    """
    found, counts = [], []
    for fit in fits:
        distances, known = fit.distances(), 0.0
        if spreads is not None:
            along = [
                link.by_pose(fit.group.parameters(k, fit.x))[0] for k, link in enumerate(fit.group.chains)
            ]
            seen = np.column_stack([_seen(u, spreads) for u in along])
            distances = distances / seen
            known = 0.0 if shared is None else _shared_squares(fit, along, shared, seen)
        share = fit.minimum.rank / distances.shape[1]
        freedom = max(1.0, len(distances) - share)
        if loss == "robust":
            squares = robust_deviations(distances) ** 2
        else:
            squares = np.sum(distances**2, axis=0)
            squares = np.maximum(squares - known, LEAST * squares) / freedom
        found.append(squares)
        counts.append(np.full(len(squares), freedom))
    squares, weights = np.concatenate(found), np.concatenate(counts)
    pooled = float(squares @ weights / weights.sum())
    # a variance from n errors has the relative deviation sqrt(2 / n)
    if np.all(np.abs(squares / pooled - 1) < ALIKE * np.sqrt(2 / weights)):
        found = [np.full(len(one), pooled) for one in found]
    return [np.sqrt(one) for one in found]


def _shared_squares(fit: Fit, along: list[np.ndarray], shared: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """Squares of distances of each link, (links,), by errors that poses share and that parameters cannot follow."""
    unit = [np.linalg.norm(u, axis=1) * f for u, f in zip(along, seen.T, strict=True)]
    X = np.stack([np.einsum("ni,nik->nk", u, shared) / s[:, None] for u, s in zip(along, unit, strict=True)])
    J = np.stack([fit.group.link_jacobian(fit.x, k) / s[:, None] for k, s in enumerate(unit)])
    Q = np.linalg.qr(J.reshape(-1, J.shape[2]) * fit.group.scale[fit.group.free])[0]
    flat = X.reshape(-1, X.shape[2])
    return np.sum((flat - Q @ (Q.T @ flat)).reshape(X.shape) ** 2, axis=(1, 2))


def _seen(u: np.ndarray, spreads: np.ndarray) -> np.ndarray:
    """How much more than a pose of median size each pose moves closure errors whose derivatives are u (N, 3), (N,)."""
    return np.linalg.norm(_through(u, spreads), axis=1) / np.linalg.norm(u, axis=1)


def _through(u: np.ndarray, spreads: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", spreads, u)


def pose_noise(
    errors: np.ndarray, by_place: np.ndarray, by_turn: np.ndarray, freedom: np.ndarray
) -> tuple[float, float, np.ndarray]:
    """Deviations s in m and a in rad of measured poses, and factors (links,) by which links are worse than these say.

    errors: (N, links); by_place, by_turn: u and w, (N, links, 3), w zero where plates do not turn; freedom: of each link,
    N less its share of the parameters. Factors are 1 unless errors of the model make links differ.
    """
    i, j = np.triu_indices(errors.shape[1])
    share = np.sqrt(freedom / len(errors))
    squares = np.sum(errors[:, i] * errors[:, j], axis=0) / (share[i] * share[j])
    design = np.column_stack([np.einsum("nki,nki->k", w[:, i], w[:, j]) for w in (by_place, by_turn)])
    own = np.maximum(squares[i == j], 1e-300)
    weight = 1 / np.sqrt(own[i] * own[j] * np.where(i == j, 2.0, 1.0))
    variances = _not_negative(design * weight[:, None], squares * weight)
    expected = (design @ variances)[i == j]
    ratio = own / np.maximum(expected, 1e-300)
    alike = np.all(np.abs(ratio - 1) < ALIKE * np.sqrt(2 / freedom))
    s, a = np.sqrt(variances)
    return float(s), float(a), np.ones(len(own)) if alike else np.sqrt(ratio)


def _not_negative(design: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Least squares for two parameters of which none is below zero."""
    if design[:, 1].any():
        found = np.linalg.lstsq(design, right, rcond=None)[0]
        if (found >= 0).all():
            return found
    alone = np.maximum(design.T @ right, 0.0) / np.maximum(np.sum(design**2, axis=0), 1e-300)
    left = [np.sum((right - alone[k] * design[:, k]) ** 2) for k in (0, 1)]
    return np.array([alone[0], 0.0]) if left[0] <= left[1] else np.array([0.0, alone[1]])


def joint_covariance(
    fits: Sequence[Fit], loss: str, spreads: np.ndarray | None = None, shared: np.ndarray | None = None
) -> np.ndarray:
    """Covariance of the free parameters of all fits one after another, (n, n); zero in directions that data do not hold.

    spreads: as of `link_noise`; shared: `Measurements.shared` of the fitted poses, F (N, 3, k), which moves all of them at
    once by u F.
    """
    parts = [(f, k) for f, fit in enumerate(fits) for k in range(len(fit.group.chains))]
    starts = np.cumsum([0, *(int(fit.group.free.sum()) for fit in fits)])
    moved = _moved(fits, parts, loss, spreads, shared)
    middle = np.zeros((starts[-1], *moved[0].shape))
    together = np.zeros((starts[-1], 0 if shared is None else shared.shape[2]))
    for (f, k), by_pose in zip(parts, moved, strict=True):
        fit, part = fits[f], slice(starts[f], starts[f + 1])
        J = fit.group.link_jacobian(fit.x, k) * (1.0 if fit.weights is None else (fit.weights**2)[:, None])
        middle[part] += np.einsum("np,na->pna", J, by_pose)
        if shared is not None:
            u = fit.group.chains[k].by_pose(fit.group.parameters(k, fit.x))[0]
            together[part] += J.T @ np.einsum("ni,nik->nk", u, shared)
    priors = np.asarray(block_diag(*[_of_prior(fit) for fit in fits]))
    inverses = [as_told(fit) @ fit.minimum.inverse for fit in fits]
    inverse = np.asarray(block_diag(*inverses))
    return spread_by(inverse, middle.reshape(starts[-1], -1), together, priors)


def _moved(
    fits: Sequence[Fit],
    parts: list[tuple[int, int]],
    loss: str,
    spreads: np.ndarray | None,
    shared: np.ndarray | None,
) -> list[np.ndarray]:
    """(s u, a w) of each link, (N, 6): what noise of a pose, one deviation along each axis, adds to its closure errors."""
    turned = [fits[f].group.chains[k].by_pose(fits[f].group.parameters(k, fits[f].x)) for f, k in parts]
    worse = np.ones(1)
    if spreads is not None:
        worse = np.sqrt(np.trace(spreads @ spreads, axis1=1, axis2=2) / 3)[:, None]
        turned = [(_through(u, spreads), worse * w) for u, w in turned]
    if loss == "robust" or not any(w.any() for _, w in turned):
        noises = np.concatenate(link_noise(fits, loss, spreads, shared))
        return [s * np.hstack([u, 0 * w]) for s, (u, w) in zip(noises, turned, strict=True)]
    errors = np.column_stack(
        [fits[f].group.chains[k].error(fits[f].x[fits[f].group.places[k]]) for f, k in parts]
    )
    freedom = np.array([len(errors) - fits[f].minimum.rank / len(fits[f].group.chains) for f, _ in parts])
    sure = 1 / worse[..., None]
    by_place, by_turn = (np.stack(each, axis=1) * sure for each in zip(*turned, strict=True))
    s, a, factors = pose_noise(errors * sure[..., 0], by_place, by_turn, np.maximum(freedom, 1.0))
    return [c * np.hstack([s * u, a * w]) for c, (u, w) in zip(factors, turned, strict=True)]


def _of_prior(fit: Fit) -> np.ndarray:
    """Contributions of the rows of the prior, the last of the Jacobian, to J'e, in columns."""
    count = len(fit.group.prior)
    rows = fit.minimum.jacobian[len(fit.minimum.jacobian) - count :] / fit.minimum.scale
    return rows.T * fit.minimum.noise(fit.count)


def as_told(fit: Fit) -> np.ndarray:
    """Derivatives of the parameters that are reported by those that were moved, (n, n)."""
    whole = np.eye(len(fit.x))
    for link, places in zip(fit.group.chains, fit.group.places, strict=True):
        told = link.told(fit.x[places])
        if told is not None:
            whole[np.ix_(places, places)] = told
    return whole[np.ix_(fit.group.free, fit.group.free)]
