"""What is left of image points, camera by camera: size against told noise, drifts over the poses, images that come twice."""

from dataclasses import replace

import numpy as np

from gantrytau_optimica.fitting.diagnostics import Diagnostics, ResidualSeries, diagnose, repeated_rows
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.vision.reconstruction.stray_images import PoseFit

Array = np.ndarray
ROUGH = 2.0  # times, by which told noise is off: scatter of edges is 1.4 times too small on rendered images
ALONE = ("duplicates", "drift")  # facts; those that strays, lenses and moments cause are told by these
REMEDIES = {"drift": "a camera or the pattern moves slowly: fasten it, and take the images again"}


def image_diagnostics(poses: PoseFit, pixels: Array, sigma: Array, rows: Array) -> Diagnostics:
    """Of poses with images (C, N, P, 2) in pixels and told deviations of corners (C, N, P); rows: numbers of the poses."""
    series = [
        ResidualSeries(
            "image points",
            left.ravel(),
            measured=seen.ravel(),
            noise=None if np.any(told <= 0) else np.repeat(told, 2),  # corners that are computed have none
            run=f"camera {c + 1}",
        )
        for c, (left, seen, told) in enumerate(zip(poses.left, pixels, sigma, strict=True))
    ]
    middles = np.moveaxis(np.nan_to_num(pixels).mean(axis=2), 2, 1).reshape(-1, len(rows))
    series += [
        ResidualSeries(
            f"camera {k // 2 + 1} {('across', 'down')[k % 2]}",
            -along,  # measured less model
            measured=middle * reach,
            jacobian=slopes,
            signals={"poses": rows * reach},
        )
        for k, (along, middle, reach, slopes) in enumerate(
            zip(poses.along, middles, poses.reach, poses.slopes, strict=True)
        )
    ]
    images = np.swapaxes(pixels, 0, 1).reshape(len(rows), -1)
    found = diagnose(series, known=repeated_rows("images", images, rows), remedies=REMEDIES)
    facts = [f for f in found.facts if f.kind in ALONE]
    facts += [f for f in found.facts if f.kind.startswith("noise") and not 1 / ROUGH < f.size < ROUGH]
    return replace(found, facts=tuple(facts))


def image_findings(left: Diagnostics, causes: list[Finding], moments: list[Finding]) -> list[Finding]:
    """What is told beside causes: nothing that they explain. moments: told where neither lenses nor drifts are."""
    drifts = [f for f in left.findings if f.kind in ALONE]
    known = any(f.kind == "images" for f in causes) or any(f.kind == "drift" for f in drifts)
    told = [*drifts, *(() if known else moments)]
    noise = [f for f in left.findings if f.kind not in ALONE]
    return told if known or moments else [*told, *noise]
