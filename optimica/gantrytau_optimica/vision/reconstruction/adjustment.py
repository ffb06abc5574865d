"""A bundle from its start to its least squares, with corners that miss by far counting less, and what covariance is left."""

from dataclasses import dataclass, replace

import numpy as np

from gantrytau.kinematics.rotations import mean_rotation
from gantrytau_optimica.fitting.blocks import BlockRows, minimised, reduced
from gantrytau_optimica.fitting.robust import huber_weights
from gantrytau_optimica.vision.opencv import VisionError
from gantrytau_optimica.vision.reconstruction.bundle import LENS, Bundle, State
from gantrytau_optimica.vision.reconstruction.free_network import free_covariance
from gantrytau_optimica.vision.reconstruction.relative_orientation import (
    cameras_from_plates,
    cameras_from_points,
    extents,
    plates,
    plates_of_one,
    triangulated,
)
from gantrytau_optimica.vision.reconstruction.spacing import Spacing

Array = np.ndarray
HUBER = 3.0  # times the median miss, from which on a corner counts less
ROUNDS = 3  # of weights
SIGMA = 0.1  # pixel, of a corner, before it is found from what is left
LEAST_SIGMA = 1e-3  # pixel; images do not tell more


def started(bundle: Bundle, by_plates: bool = False) -> State:
    """A state near to the truth: cameras by five points, corners by their rays, the pattern where it fits these.

    by_plates: cameras by the poses of the plate before each instead, where five points tell nothing.
    """
    directions = np.stack([c.directions(p) for c, p in zip(bundle.given, bundle.pixels, strict=True)])
    placed = cameras_from_plates if by_plates else cameras_from_points
    cameras = placed(bundle.given, directions, bundle.points)
    if len(cameras) > 1:
        corners = triangulated(cameras, directions)
        r, R = plates(corners, bundle.points)
    else:
        corners = np.full((*directions.shape[1:3], 3), np.nan)
        r, R = plates_of_one(directions[0], bundle.points)
    if not np.all(np.isfinite(r)):
        lost = np.flatnonzero(~np.isfinite(r[:, 0]))
        raise VisionError(
            f"reconstruct: {len(lost)} poses have no place ahead of all cameras, the first is row {lost[0]} of those found; "
            "check the lenses, and that images of cameras are of the same poses"
        )
    corners = np.where(np.isfinite(corners), corners, r[:, None] + bundle.points @ R.transpose(0, 2, 1))
    if bundle.told.alike:
        R = np.broadcast_to(mean_rotation(R), R.shape).copy()
    return State(cameras, r, R, 1.0, corners, np.zeros((0, 3)), np.zeros(0))


def scaled_by(spacing: Spacing, state: State, sized: bool) -> State:
    """The state with lines of poses where it has them; sized: as large as spacing says, whatever the pattern says."""
    size = 1 / float(np.linalg.norm(spacing.displaced(state.r))) if sized else 1.0
    cameras = tuple(replace(camera, r=camera.r * size) for camera in state.cameras)
    r = state.r * size
    offsets = -spacing.middles(np.repeat(spacing.x[:, None], 3, axis=1))[:, 0]
    return replace(state, cameras=cameras, r=r, size=size, middles=spacing.middles(r), offsets=offsets)


def adjusted(bundle: Bundle, state: State) -> tuple[Bundle, State, BlockRows, int]:
    """The bundle with the weights of its corners, its least squares, the rows there, and how many steps it took."""
    taken, sigma, share = 0, SIGMA, np.ones(bundle.seen.shape)
    for _ in range(ROUNDS):
        bundle = replace(bundle, weights=bundle.seen * share / sigma)
        state, rows, steps = minimised(state, bundle.rows, bundle.moved)
        taken += steps
        missed = np.linalg.norm(np.nan_to_num(bundle.residuals(state)), axis=-1)
        blocks = len(rows.error) if bundle.told.plate else np.count_nonzero(bundle.seen.max(axis=0))
        freedom = 2 * bundle.seen.sum() - blocks * rows.by_own.shape[2] - bundle.shared
        before, sigma = (
            sigma,
            max(float(np.sqrt(np.sum((share * missed) ** 2) / max(freedom, 1))), LEAST_SIGMA),
        )
        beyond = max(HUBER * float(np.median(missed[bundle.seen > 0])), LEAST_SIGMA)
        old, share = share, np.sqrt(huber_weights(missed, beyond))
        if np.allclose(share, old, atol=0.01) and abs(sigma / before - 1) < 0.1:
            break
    bundle = replace(bundle, weights=bundle.seen * share / sigma)
    return bundle, state, bundle.rows(state), taken


@dataclass(frozen=True, eq=False)
class Located:
    """Places of the pattern (N, 3), their covariances (N, 3, 3) with what they share of it, (N, 3, S), a scale, and
    deviations of the lenses (C, 5).
    """

    r: Array
    covariance: Array
    shared: Array
    scale: float
    lens_deviations: Array


def places(bundle: Bundle, state: State, rows: BlockRows, lengths: Spacing | None) -> tuple[State, Located]:
    """Where the pattern is, in metres; lengths: what tells the scale of free corners, spacing or None for the pattern."""
    equations = reduced(rows)
    shared = np.linalg.pinv(equations.complement, rcond=1e-15, hermitian=True)
    lenses = np.zeros((len(bundle.given), LENS))
    if bundle.told.lenses:
        for c in range(len(lenses)):
            where = bundle.columns[f"lens {c}"]
            lenses[c] = np.sqrt(np.maximum(np.diag(shared)[where], 0.0))
    own, coupling = equations.own[:, :3, :3], -equations.coupling[:, :3]
    if bundle.told.plate:
        return state, Located(state.r, *free_covariance(state.r, own, coupling, shared), state.size, lenses)
    seen = bundle.seen.max(axis=0)  # corners that nothing is known of stand where the others have them
    r, R = plates(np.where(seen[..., None] > 0, state.corners, np.nan), bundle.points)
    filled = r[:, None] + bundle.points @ R.transpose(0, 2, 1)
    state = replace(state, corners=np.where(seen[..., None] > 0, state.corners, filled))
    count, corners = seen.shape
    share = seen / seen.sum(axis=1, keepdims=True)
    each = own.reshape(count, corners, 3, 3) * seen[..., None, None]
    own = np.einsum("np,npij->nij", share**2, each)
    coupling = coupling.reshape(count, corners, 3, -1) * seen[..., None, None]
    scale, slopes = _by_pattern(bundle, state) if lengths is None else _by_spacing(lengths, r, corners)
    spread = float(np.einsum("nki,nkij,nkj->", slopes, each, slopes))
    by_shared = np.einsum("nki,nkis->s", slopes, coupling)
    away = r - r.mean(axis=0)
    coupling = np.einsum("np,npis->nis", share, coupling) - away[:, :, None] * by_shared
    coupling = np.concatenate([coupling, away[:, :, None]], axis=2)
    both = np.zeros((len(shared) + 1,) * 2)
    both[:-1, :-1], both[-1, -1] = shared, spread
    covariance, factor = free_covariance(r, own, coupling, both)
    cameras = tuple(replace(camera, r=scale * camera.r) for camera in state.cameras)
    state = replace(state, cameras=cameras, r=scale * r, R=R, corners=scale * state.corners)
    return state, Located(scale * r, scale**2 * covariance, scale * factor, _size(state, bundle), lenses)


def _size(state: State, bundle: Bundle) -> float:
    return float(np.median(extents(state.corners)) / extents(bundle.points[None])[0])


def _by_pattern(bundle: Bundle, state: State) -> tuple[float, Array]:
    """The scale by which corners are as far apart as those of the pattern, and derivatives of -ln scale by corners."""
    middle = state.corners.mean(axis=1, keepdims=True)
    size = extents(state.corners)
    slopes = (state.corners - middle) / (state.corners.shape[1] * size**2)[:, None, None] / len(size)
    return float(extents(bundle.points[None])[0] / np.exp(np.mean(np.log(size)))), slopes


def _by_spacing(spacing: Spacing, r: Array, corners: int) -> tuple[float, Array]:
    """The scale by which poses are as far apart as spacing says, and derivatives of -ln scale by corners (N, P, 3)."""
    moved = spacing.displaced(r)
    length = float(np.linalg.norm(moved))
    slopes = spacing.shares[:, None] * moved / length**2
    return 1 / length, np.repeat(slopes[:, None] / corners, corners, axis=1)
