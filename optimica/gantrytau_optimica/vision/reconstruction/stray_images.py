"""Images that do not belong to their pose, and offsets that all corners of an image share: what poses leave beside others.

    e = A d + X s + noise       d: unknowns of the pose; s: shifts of its images, X: 1 for their corners
    G = (X'e)'(X'X)^-1(X'e)     X beside A: what shifts explain of the squares; W = |e|^2 - G: of the shapes

Cameras, lenses and the common orientation are those of the other poses. Noise of corners leaves as much along a shift as
within an image; cameras that look at different moments leave more in all poses, a wrong image in its own.
"""

from dataclasses import dataclass, replace

import numpy as np

from gantrytau.kinematics.rotations import mean_rotation
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.fitting.robust import OUTLIER, robust_deviation
from gantrytau_optimica.vision.reconstruction.adjustment import LEAST_SIGMA
from gantrytau_optimica.vision.reconstruction.bundle import Bundle, State
from gantrytau_optimica.vision.reconstruction.relative_orientation import extents, plates

Array = np.ndarray
MOST = 0.3  # of the poses, that may be wrong: more are no strays
SETTLED = 8  # steps of Gauss-Newton of a pose
CLEAR = 25.0  # variances, by which one camera explains a pose better than the next: five deviations
SHAPE = 2.0  # times the scatter of other images, from which on a shape is wrong
STRONG = 0.5  # of its corners: shifts that motion of the pose hardly explains
SURE = 5.0  # deviations, from which on offsets are no chance
ALIKE = 2.0  # times, from which on they are told
CHI_2 = 1.177  # median of the root of a chi-square of two


@dataclass(frozen=True, eq=False)
class PoseFit:
    """What the images of N poses leave.

    shifts, shapes: amounts of shifts in deviations, and sizes of shapes beside others, (N,); sigma: of a corner in pixels,
    without what all corners of an image share; shared: offsets of images beside those of corners that err alone, a ratio;
    unsure: its deviation; left: residuals by their own deviations, that of a corner being 1, (C, N, P, 2) in pixels, NaN
    where not seen; along: residuals along a shift of each image, across and down (2 C, N); reach: slope of these by the
    shift; slopes: by the shared unknowns, (2 C, N, S).
    """

    shifts: Array
    shapes: Array
    sigma: float
    shared: float
    unsure: float
    left: Array
    along: Array
    reach: Array
    slopes: Array

    def beyond(self, sigma: float) -> float:
        """By how much the covariance of poses is larger than that of corners of deviation `sigma` that err alone."""
        if self.shared < 1.0 + SURE * self.unsure:
            return 1.0
        return max(1.0, self.shared * self.sigma / sigma) ** 2


def left_by_poses(bundle: Bundle, state: State) -> PoseFit:
    """What the images of each pose leave."""
    view, state = _settled(*_as_plates(bundle, state))
    rows = view.rows(state)
    count, cameras = len(rows.error), len(view.given)
    A, e = rows.by_own, rows.error
    own = np.linalg.pinv(A)
    left = e - np.einsum("nij,nj->ni", A @ own, e)
    mask = np.repeat(view.weights.transpose(1, 2, 0)[..., None], 2, axis=-1)  # (N, P, C, 2)
    X = (mask[..., None] * np.eye(2 * cameras).reshape(cameras, 2, -1)).reshape(*e.shape, -1)
    apart = X - A @ (own @ X)
    squares, along = np.swapaxes(apart, 1, 2) @ X, np.einsum("nik,ni->nk", apart, left)
    values, axes = np.linalg.eigh(squares)
    parts = np.einsum("nik,ni->nk", axes, along) ** 2 / np.maximum(values, 1e-300)
    corners = mask[..., 0].sum(axis=(1, 2)) / np.maximum((mask[..., 0].sum(axis=1) > 0).sum(axis=1), 1)
    told = values > 1e-9 * corners[:, None]
    within = np.sum(left**2, axis=1) - np.sum(parts * told, axis=1)
    freedom = mask.sum(axis=(1, 2, 3)) - A.shape[2] - told.sum(axis=1)
    shapes = np.sqrt(np.maximum(within, 0.0) / np.maximum(freedom, 1.0))
    sigma = max(float(np.median(shapes)), LEAST_SIGMA)
    gains = np.zeros((count, cameras))
    for c in range(cameras):
        each = slice(2 * c, 2 * c + 2)
        inverse = np.linalg.pinv(squares[:, each, each], rcond=1e-6, hermitian=True)
        gains[:, c] = np.einsum("nk,nkl,nl->n", along[:, each], inverse, along[:, each])
    shifts = np.sqrt(gains.max(axis=1)) / sigma
    strong = values > STRONG * corners[:, None]
    offsets = np.sqrt(np.sum(parts * strong, axis=1) / np.maximum(strong.sum(axis=1), 1)) / sigma
    number = max(int(strong.sum()), 1)
    shared = float(np.sqrt(np.sum(parts * strong) / number)) / sigma if offsets.any() else 1.0
    reach = np.sqrt(np.maximum(np.einsum("nkk->nk", squares), 1e-300))
    slopes = np.swapaxes(apart, 1, 2) @ rows.by_shared / reach[..., None]
    alone = 1.0 - np.einsum("nij,nji->ni", A, own)
    each = np.where(
        (mask.reshape(e.shape) > 0) & (alone > 1e-9), left / np.sqrt(np.maximum(alone, 1e-9)), np.nan
    )
    return PoseFit(
        shifts,
        shapes / sigma,
        sigma,
        shared,
        float(np.sqrt(0.5 / number)),
        each.reshape(mask.shape).transpose(2, 0, 1, 3),
        (along / reach).T,
        reach.T,
        np.moveaxis(slopes, 1, 0),
    )


def stray_images(bundle: Bundle, state: State) -> list[tuple[int, tuple[int, ...]]]:
    """Poses with an image that does not belong to them, and which cameras took it, as far as that can be told."""
    found = left_by_poses(bundle, state)
    usual = max(1.0, float(np.median(found.shifts)) / CHI_2)
    spread = robust_deviation(found.shapes - 1.0)
    wrong = (found.shifts > OUTLIER * usual) | (found.shapes > max(SHAPE, 1.0 + OUTLIER * spread))
    poses = np.flatnonzero(wrong).tolist()
    if len(poses) > MOST * len(wrong):
        return []
    return [(k, _taken_by(bundle, state, k, found.sigma * usual)) for k in poses]


def _taken_by(bundle: Bundle, state: State, pose: int, sigma: float) -> tuple[int, ...]:
    """The camera whose image does not belong to a pose, or all where none is clearly the one.

    By what the others leave with the pose that they see, and the shape of the image left out; of images whose shape is wrong
    by the others alone.
    """
    view, state = _as_plates(bundle, state)
    one = view.of(np.array([pose]))
    cameras = [c for c in range(len(view.given)) if one.seen[c].any()]
    if len(cameras) < 2:
        return tuple(cameras)
    shifted, alone = {}, {}
    for c in cameras:
        weights = one.weights.copy()
        weights[c] = 0.0
        _, there = _settled(replace(one, weights=weights), state.of(np.array([pose])))
        left = one.residuals(there)[:, 0] / sigma
        alone[c] = float(np.nansum(left[np.arange(len(left)) != c] ** 2))
        own = left[c] - np.nanmedian(left[c], axis=0)
        shifted[c] = alone[c] + float(np.nansum(own**2))
    freedom = 2.0 * one.seen.sum()
    costs = shifted if min(shifted.values()) < SHAPE**2 * freedom else alone
    first, second = sorted(costs, key=lambda c: costs[c])[:2]
    clear = costs[second] - costs[first] > CLEAR * max(1.0, costs[first] / freedom)
    return (first,) if clear else tuple(cameras)


def in_words(strays: list[tuple[int, tuple[int, ...]]], rows: Array) -> list[Finding]:
    """A finding for each wrong image; rows: of the poses that were fitted."""
    found = []
    for pose, cameras in strays:
        row = int(rows[pose])
        which = " or ".join(str(c + 1) for c in cameras)
        words = (
            f"row {row}: the image of camera {which} does not belong to this pose; it is left out: look whether it is of "
            "another pose, blurred, or numbers its corners otherwise"
        )
        found.append(Finding("stray image", np.array([row]), words))
    return found


def other_moments(found: PoseFit, rows: Array) -> list[Finding]:
    """The finding that corners of an image err alike, in all poses: cameras do not look at the same moment."""
    if found.shared < max(ALIKE, 1.0 + SURE * found.unsure):
        return []
    words = (
        f"all corners of an image are off alike, by {found.shared:.3g} times as much as corners that err alone ("
        f"{found.sigma:.2g} pixel each) would be: cameras look at different moments while the plate moves, or one of "
        "them was moved; trigger them together, or let the plate stand; covariances count it"
    )
    return [Finding("moments", rows, words)]


def _as_plates(bundle: Bundle, state: State) -> tuple[Bundle, State]:
    """The bundle where only poses of the plate are unknown, all corners of equal weight, but for single ones far from the
    others of their image.
    """
    told = replace(bundle.told, lenses=False, plate=True, sized=False, spacing=None)
    view = replace(bundle, told=told, weights=np.ones_like(bundle.weights))
    state = replace(state, middles=np.zeros((0, 3)), offsets=np.zeros(0))
    if not bundle.told.plate:
        twice = np.isfinite(bundle.pixels[..., 0]).sum(axis=0) > 1
        r, R = plates(np.where(twice[..., None], state.corners, np.nan), bundle.points)
        R = np.broadcast_to(mean_rotation(R), R.shape).copy() if told.alike else R
        size = float(np.median(extents(state.corners)) / extents(bundle.points[None])[0])
        state = replace(state, r=r, R=R, size=size)
    seen = np.asarray(view.seen.any(axis=2))[..., None, None]
    left = np.where(seen, view.residuals(state), 0.0)
    beside = np.asarray(np.linalg.norm(left - np.nanmedian(left, axis=2, keepdims=True), axis=-1))
    far = beside > OUTLIER * max(float(np.nanmedian(beside[view.seen > 0])), LEAST_SIGMA)
    far &= far.sum(axis=2, keepdims=True) < 0.25 * view.seen.sum(axis=2, keepdims=True)
    return replace(view, weights=view.seen * ~far), state


def _settled(view: Bundle, state: State) -> tuple[Bundle, State]:
    """The poses at least squares of their own images."""
    for _ in range(SETTLED):
        rows = view.rows(state)
        step = -np.einsum("nij,nj->ni", np.linalg.pinv(rows.by_own), rows.error)
        state = view.moved(state, np.zeros(view.shared), step)
    return view, state
