"""Which side of a quincunx is up: it looks the same after a quarter of a turn, and one image cannot tell."""

import numpy as np

from gantrytau_optimica.fitting.finding import Finding, rows_in_words
from gantrytau_optimica.vision.detection.quincunx import quarter_turned

Array = np.ndarray
QUARTER = np.pi / 2
ALIKE = 0.9  # mean length of directions, times four, above which a camera sees the pattern always alike
DOUBT = np.radians(40.0)  # from up; at 45 degrees two sides are


def told_up(corners: Array, sigma: Array, up: float) -> list[Finding]:
    """Number corners (C, N, 20, 2) alike in images that see the pattern alike, in place; say where it is in doubt.

    Where all images of a camera have one direction but for quarters of a turn, all get the same, the mean nearest to `up`;
    other cameras with a pattern near 45 degrees follow the first. Where directions differ, each is the nearest.
    """
    findings, first = [], None
    order = quarter_turned()
    for c in range(len(corners)):
        rows = np.flatnonzero(np.isfinite(corners[c]).any(axis=(1, 2)))
        if not rows.size:
            continue
        angle = _directions(corners[c, rows]) - up
        mean = np.mean(np.exp(4j * angle))
        if np.abs(mean) > ALIKE:
            common = float(np.angle(mean)) / 4
            if first is not None and abs(common) > np.radians(30):
                common += QUARTER * np.round((first - common) / QUARTER)
            first = common if first is None else first
            for k, turns in zip(rows, np.round((angle - common) / QUARTER).astype(int), strict=True):
                for _ in range(turns % 4):
                    corners[c, k], sigma[c, k] = corners[c, k, order], sigma[c, k, order]
            doubtful = rows if abs(common) > DOUBT else rows[:0]
        else:
            nearest = np.abs((angle + QUARTER / 2) % QUARTER - QUARTER / 2)
            doubtful = rows[nearest > DOUBT]
        if doubtful.size:
            message = (
                f"camera {c + 1}: the pattern is turned by nearly 45 degrees in {rows_in_words(doubtful)}, and looks the "
                "same after 90: which side is up may be wrong; say it by up=, or use Pattern.charuco"
            )
            findings.append(Finding("orientation", doubtful, message))
    return findings


def _directions(corners: Array) -> Array:
    """Directions of up in images (N, 20, 2), rad clockwise from the upper edge, NaN corners left out."""
    upper, lower = list(range(8)), list(range(12, 20))
    way = np.nanmean(corners[:, upper], axis=1) - np.nanmean(corners[:, lower], axis=1)
    return np.arctan2(way[:, 0], -way[:, 1])
