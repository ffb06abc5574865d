"""Where black squares touch: saddles of brightness, and fours of them that may be the corners of a pattern's middle.

A saddle is where the determinant of the second derivatives is most negative. With a smoothing of s pixels two black
squares of contrast c that touch have sqrt(-det) = c / (pi s2): a contrast in grey values, wherever the light comes from.
"""

from dataclasses import dataclass

import numpy as np

from gantrytau_optimica.vision.opencv import opencv

Array = np.ndarray
SMOOTHING = 2.0  # pixels; cells of 8 pixels and more keep their corners
MOST = 80  # saddles of an image
ABOVE_NOISE = 4.0  # of what the whole image scatters
APART = 7  # pixels, of a saddle from the next
ALONG = np.radians(28.0)  # of a dark diagonal from the line to the opposite corner; squares are seen aslant
SHORTEST = 9.0  # pixels, a diagonal
MIDDLES = 0.12  # of a diagonal, between the middles of the two
LENGTHS, CONTRASTS = 1.8, 3.0  # ratios


@dataclass(frozen=True, eq=False)
class Saddles:
    """Saddles of an image: places (k, 2) in pixels, contrast (k,) in grey values, directions of the dark (k,) in rad."""

    places: Array
    contrast: Array
    dark: Array


def saddles(grey: Array, least: float) -> Saddles:
    """The saddles of greatest contrast above the noise of the image and `least` grey values, at most MOST."""
    cv2 = opencv()
    smooth = cv2.GaussianBlur(grey, (0, 0), SMOOTHING)
    xx, xy, yy = (cv2.Sobel(smooth, cv2.CV_32F, *order, ksize=3) / 4 for order in ((2, 0), (1, 1), (0, 2)))
    saddle = xy * xy - xx * yy
    peak = cv2.dilate(saddle, np.ones((APART, APART), np.uint8))
    contrast_of = np.pi * (SMOOTHING**2 + 0.5)  # of the differences themselves half a pixel squared
    noise = float(np.median(np.abs(xy[::4, ::4]))) / 0.6745
    floor = max(ABOVE_NOISE * noise, least / contrast_of)
    y, x = np.nonzero((saddle >= peak) & (saddle > floor * floor))
    inside = (x > 2) & (y > 2) & (x < grey.shape[1] - 3) & (y < grey.shape[0] - 3)
    y, x = y[inside], x[inside]
    best = np.argsort(-saddle[y, x], kind="stable")[:MOST]
    y, x = y[best], x[best]
    dark = 0.5 * np.arctan2(2 * xy[y, x], xx[y, x] - yy[y, x]) + np.pi / 2
    return Saddles(np.column_stack([x, y]).astype(float), contrast_of * np.sqrt(saddle[y, x]), dark)


def fours(found: Saddles) -> Array:
    """Fours of saddles that may be the corners of one black square, (k, 4) indices clockwise in the image.

    Dark diagonals end in opposite corners; two of them that share their middle make a square.
    """
    i, j = np.triu_indices(len(found.places), 1)
    way = found.places[j] - found.places[i]
    length, angle = np.hypot(*way.T), np.arctan2(way[:, 1], way[:, 0])
    fits = (length > SHORTEST) & (_ratio(found.contrast[i], found.contrast[j]) < CONTRASTS)
    for end in (i, j):
        fits &= np.abs(_turned(found.dark[end] - angle)) < ALONG
    i, j, length, angle = i[fits], j[fits], length[fits], angle[fits]
    middle = (found.places[i] + found.places[j]) / 2
    a, b = np.triu_indices(len(i), 1)
    near = np.hypot(*(middle[a] - middle[b]).T) < MIDDLES * np.minimum(length[a], length[b])
    near &= _ratio(length[a], length[b]) < LENGTHS
    near &= np.abs(_turned(angle[a] - angle[b])) > np.radians(45)
    a, b = a[near], b[near]
    four = np.column_stack([i[a], i[b], j[a], j[b]])
    places = found.places[four]
    around = places - places.mean(axis=1, keepdims=True)
    order = np.argsort(np.arctan2(around[..., 1], around[..., 0]), axis=1)
    four = np.take_along_axis(four, order, axis=1)
    return four[np.argsort(-found.contrast[four].min(axis=1), kind="stable")]


def _ratio(a: Array, b: Array) -> Array:
    return np.maximum(a, b) / np.minimum(a, b)


def _turned(angle: Array) -> Array:
    """Angles of lines, which have no direction, between -pi/2 and pi/2."""
    return (angle + np.pi / 2) % np.pi - np.pi / 2
