"""Where cameras stand to one another, and poses of the pattern, to begin a bundle adjustment with."""

import numpy as np

from gantrytau.kinematics.rotations import best_rotation, mean_rotation
from gantrytau_optimica.calibration.devices.cameras import PlacedCamera
from gantrytau_optimica.vision.intrinsics import Camera
from gantrytau_optimica.vision.opencv import VisionError, opencv

Array = np.ndarray
THRESHOLD = 2.0  # pixels off the epipolar line, up to which a corner takes part: lenses are not known well
CONFIDENCE = 0.9999
FAR = 1e4  # bases: farthest point
LEAST_POINTS = 8
LEAST_CORNERS = 4  # of a pattern, to tell its size


def relative_orientation(first: Array, second: Array, pixel: float) -> tuple[Array, Array]:
    """Axes R (3, 3) and place (3,), of length 1, of a second camera in the axes of the first, from directions of points.

    first, second: x and y at depth 1 of the same points, (k, 2); pixel: size of a pixel there. Five points of all are tried
    until one essential matrix fits most (Nister 2004; OpenCV's `findEssentialMat`), and points lie ahead of both cameras.
    Raises VisionError where there are too few points, or none fits.
    """
    if len(first) < LEAST_POINTS:
        raise VisionError(
            f"relative_orientation: found {len(first)} points that both cameras see, expected at least {LEAST_POINTS}"
        )
    cv2 = opencv()
    eye = np.eye(3)
    E, mask = cv2.findEssentialMat(
        first, second, eye, method=cv2.USAC_MAGSAC, prob=CONFIDENCE, threshold=THRESHOLD * pixel
    )
    if E is None or E.shape != (3, 3):
        raise VisionError(
            "relative_orientation: found no essential matrix, expected points of a scene seen from two places; "
            "check that images of both cameras are of the same poses"
        )
    count, turn, shift, _, _ = cv2.recoverPose(E, first, second, eye, distanceThresh=FAR, mask=mask.copy())
    if count < len(first) / 4:
        raise VisionError(
            f"relative_orientation: found {count} of {len(first)} points ahead of both cameras, expected most of them; "
            "check that images of both cameras are of the same poses, in the same order"
        )
    return turn.T, (-turn.T @ shift).ravel()


def triangulated(cameras: tuple[PlacedCamera, ...], directions: Array) -> Array:
    """Points (..., 3) nearest to rays of cameras, in squares of distances; directions: x and y at depth 1, (C, ..., 2).

    NaN where fewer than two cameras see a point.
    """
    normal = np.zeros((*directions.shape[1:-1], 3, 3))
    right = np.zeros((*directions.shape[1:-1], 3))
    for camera, flat in zip(cameras, directions, strict=True):
        ray = np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1) @ camera.R.T
        ray = ray / np.linalg.norm(ray, axis=-1, keepdims=True)
        beside = np.nan_to_num(np.eye(3) - ray[..., :, None] * ray[..., None, :])
        beside = np.where(np.isfinite(ray[..., :1, None]), beside, 0.0)
        normal += beside
        right += beside @ camera.r
    twice = np.isfinite(directions[..., 0]).sum(axis=0) > 1
    safe = np.where(twice[..., None, None], normal, np.eye(3))
    found = np.linalg.solve(safe, right[..., None])[..., 0]
    return np.where(twice[..., None], found, np.nan)


def cameras_from_points(
    cameras: tuple[Camera, ...], directions: Array, points: Array
) -> tuple[PlacedCamera, ...]:
    """Where cameras stand in the axes of the first, m; the side of the pattern tells the length of the first base."""
    placed = [cameras[0].placed(np.zeros(3), np.eye(3))]
    for c in range(1, len(cameras)):
        both = np.asarray(np.isfinite(directions[[0, c], ..., 0]).all(axis=0))
        pixel = 1 / min(cameras[0].K[0, 0], cameras[c].K[0, 0])
        R, r = relative_orientation(directions[0][both], directions[c][both], pixel)
        pair = (placed[0], cameras[c].placed(r, R))
        corners = triangulated(pair, directions[[0, c]])
        several = np.count_nonzero(both, axis=1) >= LEAST_CORNERS
        mask = both[several][..., None]
        apart = extents(np.where(mask, corners[several], np.nan))
        scale = float(np.median(extents(np.where(mask, points, np.nan)) / apart))
        placed.append(cameras[c].placed(scale * r, R))
    return tuple(placed)


def cameras_from_plates(
    cameras: tuple[Camera, ...], directions: Array, points: Array
) -> tuple[PlacedCamera, ...]:
    """Where cameras stand in the axes of the first, m, by the poses of a plate in each: for those that stand together."""
    placed = [cameras[0].placed(np.zeros(3), np.eye(3))]
    r_0, R_0 = plates_of_one(directions[0], points)
    for c in range(1, len(cameras)):
        r, R = plates_of_one(directions[c], points)
        both = np.isfinite(r_0[:, 0]) & np.isfinite(r[:, 0])
        turn = mean_rotation(R_0[both] @ R[both].transpose(0, 2, 1))
        placed.append(cameras[c].placed(np.median(r_0[both] - r[both] @ turn.T, axis=0), turn))
    return tuple(placed)


def plates(corners: Array, points: Array) -> tuple[Array, Array]:
    """Places (N, 3) and orientations (N, 3, 3) of a pattern from its corners (N, P, 3), of which some may be NaN."""
    r, R = np.full((len(corners), 3), np.nan), np.full((len(corners), 3, 3), np.nan)
    for k, found in enumerate(corners):
        there = np.isfinite(found[:, 0])
        if np.count_nonzero(there) >= 4:
            a, b = found[there], points[there]
            R[k] = best_rotation((a - a.mean(axis=0))[None], (b - b.mean(axis=0))[None])[0]
            r[k] = a.mean(axis=0) - R[k] @ b.mean(axis=0)
    return r, R


def plates_of_one(directions: Array, points: Array) -> tuple[Array, Array]:
    """Places (N, 3) and orientations (N, 3, 3) of a flat pattern before one camera, from directions (N, P, 2).

    A flat pattern nearly has two poses (Schweighofer and Pinz 2006); that with the smaller error is taken, and where all
    poses are turned about alike, the one that is nearer to the others.
    """
    cv2 = opencv()
    r, turns = np.full((len(directions), 2, 3), np.nan), np.full((len(directions), 2, 3, 3), np.nan)
    for k, flat in enumerate(directions):
        there = np.isfinite(flat[:, 0])
        if np.count_nonzero(there) < 4:
            continue
        _, vectors, shifts, _ = cv2.solvePnPGeneric(
            points[there], flat[there], np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
        )
        for s in range(min(2, len(vectors))):
            turns[k, s], r[k, s] = cv2.Rodrigues(vectors[s])[0], shifts[s].ravel()
    good = np.isfinite(r[:, 0, 0])
    middle = mean_rotation(turns[good, 0])
    angles = np.einsum("nsij,ij->ns", np.nan_to_num(turns), middle)  # traces: largest where nearest
    nearer = np.argmax(np.where(np.isfinite(r[..., 0]), angles, -np.inf), axis=1)
    rows = np.arange(len(r))
    return r[rows, nearer], turns[rows, nearer]


def extents(corners: Array) -> Array:
    """How large patterns are, the root of the mean square of distances from the middle, (N, P, 3) -> (N,) in m."""
    middle = np.nanmean(corners, axis=1, keepdims=True)
    return np.sqrt(np.nanmean(np.sum((corners - middle) ** 2, axis=2), axis=1))
