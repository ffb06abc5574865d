"""Poses of a robot from the images of its pattern: start, bundle adjustment, scale, covariance."""

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from gantrytau.border.checks import check_words
from gantrytau.progress import shows_progress
from gantrytau_optimica.fitting.blocks import BlockRows
from gantrytau_optimica.fitting.diagnostics import Diagnostics
from gantrytau_optimica.vision.detection.detections import Detections
from gantrytau_optimica.vision.intrinsics import Camera
from gantrytau_optimica.vision.opencv import VisionError
from gantrytau_optimica.vision.reconstruction.adjustment import Located, adjusted, places, scaled_by, started
from gantrytau_optimica.vision.reconstruction.bundle import Bundle, State, TakenAsKnown
from gantrytau_optimica.vision.reconstruction.image_diagnostics import image_diagnostics, image_findings
from gantrytau_optimica.vision.reconstruction.image_mistakes import (
    CONTRADICTED,
    LARGE,
    check_left,
    check_spacing,
    left_over,
    suspected,
)
from gantrytau_optimica.vision.reconstruction.reconstruction import Reconstruction
from gantrytau_optimica.vision.reconstruction.reconstruction_checks import (
    check_facing,
    check_images,
    told_scale,
    usable_poses,
)
from gantrytau_optimica.vision.reconstruction.spacing import spacing_of
from gantrytau_optimica.vision.reconstruction.stray_images import (
    in_words,
    left_by_poses,
    other_moments,
    stray_images,
)

Array = np.ndarray


@shows_progress
def reconstruct(
    detections: Detections,
    cameras: Sequence[Camera],
    *,
    intrinsics: Literal["fixed", "estimate"] = "fixed",
    scale: Literal["spacing", "pattern", "both"] | None = None,
    spacing: Any = None,
    orientation: Literal["fixed", "free"] = "fixed",
    corners: Literal["plate", "free"] = "plate",
) -> Reconstruction:
    """Poses of the pattern, and where the cameras stand, from what `detect` found. Thesis section 5.5.

    cameras: what is known of each lens, in the order of the images. intrinsics: "estimate" fits focal length, centre, k1 and
    k2 of each as well, about what is given. scale: what tells lengths: the side of the pattern, `spacing` along the
    guideways, or both; by default whatever is given. spacing: positions of the carts (N, n) in m, of which those that differ
    by a common shift say how far apart poses are, or distances along the guideways (N,). orientation: "fixed" for robots
    that never turn their plate, "free" fits one for each pose. corners: "plate" keeps them where the pattern has them,
    "free" takes each as a point of its own, as the thesis does, with the scale afterwards.

    One camera needs the plate. Poses that fewer than two of several cameras saw are NaN. Raises ModelError for lenses that
    are not as many as the images or of another size and for spacing that tells nothing, VisionError for fewer than ten poses
    and images that do not belong together; what is doubtful stands in `.findings`.
    """
    check_words(reconstruct, locals())
    begin = time.perf_counter()
    lenses = check_images(detections, cameras)
    tells = told_scale(scale, spacing, corners, intrinsics, len(lenses))
    rows = usable_poses(detections)
    check_facing(detections, rows)
    plate = corners == "plate"
    told = TakenAsKnown(lenses=intrinsics == "estimate", plate=plate, alike=orientation == "fixed")
    pixels = detections.corners[:, rows]
    bundle = Bundle(pixels, np.ones(pixels.shape[:-1]), detections.pattern.points, lenses, told)
    bundle, state, fitted, steps = _begun(bundle)
    check_left(bundle, state, float(np.nanmedian(detections.sigma[:, rows])))
    strays = stray_images(bundle, state)
    noticed = in_words(strays, rows)
    if strays:
        bundle, kept = _without(bundle, strays)
        rows = rows[kept]
        bundle, state, fitted, more = adjusted(bundle, state.of(kept))
        steps += more
    distances = None if tells == "pattern" else spacing_of(spacing, len(detections.numbers)).select(rows)
    if distances is not None:
        size = check_spacing(distances, places(bundle, state, fitted, None)[1].r, rows)
        if plate:
            sized = tells == "spacing" or abs(size - 1) > CONTRADICTED
            bundle = replace(bundle, told=replace(told, sized=sized, spacing=distances))
            bundle, state, fitted, more = adjusted(bundle, scaled_by(distances, state, sized))
            steps += more
    state, placed = places(bundle, state, fitted, distances)
    poses = left_by_poses(bundle, state)
    beyond = poses.beyond(1 / float(bundle.weights.max()))
    placed = replace(placed, covariance=beyond * placed.covariance, shared=np.sqrt(beyond) * placed.shared)
    left = image_diagnostics(poses, bundle.pixels, detections.sigma[:, rows], rows)
    found = _of_all_poses(bundle, state, placed, rows, detections, left)
    noticed += suspected(bundle, state, placed.scale, rows, placed.lens_deviations)
    noticed += image_findings(left, noticed, other_moments(poses, rows))
    seconds = time.perf_counter() - begin
    return replace(found, steps=steps, seconds=seconds, findings=(*detections.findings, *noticed))


def _without(bundle: Bundle, strays: list[tuple[int, tuple[int, ...]]]) -> tuple[Bundle, Array]:
    """The bundle without images that do not belong to their poses, and which poses enough cameras saw even so."""
    pixels = bundle.pixels.copy()
    for pose, cameras in strays:
        pixels[list(cameras), pose] = np.nan
    seen = np.isfinite(pixels[..., 0]).any(axis=2).sum(axis=0)
    kept = np.flatnonzero(seen >= min(2, len(pixels)))
    return replace(bundle, pixels=pixels, weights=np.ones(pixels.shape[:-1])).of(kept), kept


def _begun(bundle: Bundle) -> tuple[Bundle, State, BlockRows, int]:
    """The least squares without spacing, from five points, or where these lead nowhere from the plates."""
    trials, failed = [], None
    for by_plates in (False, True):
        try:
            trials.append(adjusted(bundle, started(bundle, by_plates)))
        except (VisionError, np.linalg.LinAlgError) as error:
            failed = failed or error
            continue
        if left_over(*trials[-1][:2]) < LARGE:
            break
    if not trials:
        assert failed is not None
        raise failed
    return min(trials, key=lambda trial: left_over(*trial[:2]))


def _of_all_poses(
    bundle: Bundle, state: State, placed: Located, rows: Array, detections: Detections, left: Diagnostics
) -> Reconstruction:
    def of_all(found: Array) -> Array:
        whole = np.full((len(detections.numbers), *found.shape[1:]), np.nan)
        whole[rows] = found
        return whole

    residuals = np.swapaxes(of_all(np.swapaxes(bundle.residuals(state), 0, 1)), 0, 1)
    return Reconstruction(
        r=of_all(placed.r),
        R=of_all(state.R),
        covariance=of_all(placed.covariance),
        shared=of_all(placed.shared),
        cameras=state.cameras,
        rms=float(np.sqrt(np.nanmean(residuals**2))),
        residuals=residuals,
        scale=placed.scale,
        lens_deviations=placed.lens_deviations,
        turning=not bundle.told.alike,
        numbers=detections.numbers,
        diagnostics=left,
    )
