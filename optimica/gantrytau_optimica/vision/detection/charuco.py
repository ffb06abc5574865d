"""A ChArUco board in one image: its markers say which corner is which."""

import numpy as np

from gantrytau_optimica.vision.boards import Pattern
from gantrytau_optimica.vision.detection.detections import homography, mapped
from gantrytau_optimica.vision.detection.quincunx import FIXED, Sighting, light_of, noise_of
from gantrytau_optimica.vision.detection.square_edges import Edges
from gantrytau_optimica.vision.opencv import opencv

LEAST = 6  # corners; four fit any projective map
WRONG = 1.5  # pixels from the projective map of all
EXACT = 0.01  # pixels


def find_charuco(grey: np.ndarray, pattern: Pattern, normalise: bool) -> Sighting:
    """The inner corners of a board in an image of grey values (height, width), float32 on the scale of 8 bits.

    Where light is made up for, grey values are stretched to all of 8 bits first. sigma is what corners scatter about the
    projective map of all.
    """
    low, high = np.percentile(grey[::2, ::2], (0.5, 99.5))
    noise = noise_of(grey)
    if high - low < max(3 * noise, 0.0 if normalise else FIXED):
        return Sighting(light_of(grey, noise) or "corners")
    stretched = (grey - low) * (255 / (high - low)) if normalise else grey
    image = np.clip(np.rint(stretched), 0, 255).astype(np.uint8)
    found, ids, _, _ = opencv().aruco.CharucoDetector(pattern.board).detectBoard(image)
    if ids is None or len(ids) < LEAST:
        return Sighting(light_of(grey, noise) or "corners")
    ids, places = np.ravel(ids), np.reshape(found, (-1, 2)).astype(float)
    missed = mapped(homography(pattern.points[ids, :2], places), pattern.points[ids, :2]) - places
    if np.linalg.norm(missed, axis=1).max() > WRONG:
        return Sighting("edges")
    corners, sigma = np.full((len(pattern.points), 2), np.nan), np.full(len(pattern.points), np.nan)
    corners[ids] = places
    sigma[ids] = max(float(np.sqrt(np.sum(missed**2) / (2 * len(ids) - 8))), EXACT)
    return Sighting("", Edges(corners, sigma, len(ids), float(high - low)))
