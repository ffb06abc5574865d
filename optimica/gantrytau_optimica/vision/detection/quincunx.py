"""A quincunx in one image: from fours of touching corners to twenty measured ones, or the step that ended it."""

from dataclasses import dataclass, field

import numpy as np

from gantrytau_optimica.vision.boards import AROUND, BLACK, Pattern
from gantrytau_optimica.vision.detection.detections import homography, mapped
from gantrytau_optimica.vision.detection.square_edges import Edges, measure_edges, sampled
from gantrytau_optimica.vision.detection.touching_corners import fours, saddles
from gantrytau_optimica.vision.opencv import opencv

Array = np.ndarray
SIZES = (1, 2, 4)  # an image is looked at in its size, and smaller where nothing was found
CELLS = np.array([[x, y] for y in (1, 0, -1) for x in (-1, 0, 1)])
CHECK = np.array([(x + y) % 2 == 0 for x, y in CELLS])  # black ones
CLEAR = 0.35  # of the contrast, between the brightest black and the darkest white cell
FIXED = 30.0  # grey values of contrast that an image needs where light is not made up for
LIKE = 0.8  # correlation with the background, above which the pattern stands in it
ORDER = ("corners", "squares", "edges")  # steps, the farthest an image came is told
TRIED = 40  # fours that are measured


@dataclass(frozen=True, eq=False)
class Sighting:
    """What one image shows: the step that lost it, "" if none; corners and sigma as of `Edges`; candidates (k, 4, 2)."""

    step: str
    edges: Edges | None = None
    candidates: Array = field(default_factory=lambda: np.zeros((0, 4, 2)))


def find_quincunx(
    grey: Array, pattern: Pattern, background: Array | None, normalise: bool, up: float
) -> Sighting:
    """The quincunx in an image of grey values (height, width), float32 on the scale of 8 bits."""
    noise = noise_of(grey)
    least = 0.0 if normalise else FIXED
    step, squares = "corners", np.zeros((0, 4, 2))
    for size in SIZES:
        small = grey if size == 1 else _smaller(grey, size)
        if min(small.shape) < 32:
            break
        points = saddles(small, least)
        if len(points.places) < 4:
            continue
        squares = points.places[fours(points)[:TRIED]] * size + (size - 1) / 2
        step = max(step, "squares" if len(squares) == 0 else "edges", key=ORDER.index)
        measured = []
        for square in squares:
            corners = _from_up(square, up)
            H = homography(pattern.side / 2 * AROUND.astype(float), corners)
            if _checks(grey, H, pattern) and not any(_same(H, other) for other, _ in measured):
                edges = measure_edges(grey, H, pattern, noise, least)
                if edges is not None:
                    measured.append((H, edges))
        moving = [edges for _, edges in measured if not _stands(grey, edges, background)]
        if len(moving) > 1:
            return Sighting("ambiguous", candidates=squares)
        if moving:
            return Sighting("", moving[0], squares)
        if measured:
            return Sighting("background", candidates=squares)
    return Sighting(light_of(grey, noise) or step, candidates=squares)


def noise_of(grey: Array) -> float:
    """Standard deviation of the noise of an image, from what differs from its neighbours' mean (Immerkaer 1996)."""
    part = grey[::3]
    rest = part[:, 1:-1] - (part[:, :-2] + part[:, 2:]) / 2
    return float(np.median(np.abs(rest[:, ::3]))) / 0.6745 / np.sqrt(1.5) + 0.3  # rounding adds 0.29


def light_of(grey: Array, noise: float) -> str:
    """Whether an image without a pattern is dark or saturated."""
    small = _smaller(grey, 8) if min(grey.shape) >= 16 else grey
    if np.ptp(small) < 3 * noise:
        return "dark" if small.mean() < 200 else "saturated"
    return "saturated" if np.mean(grey[::4, ::4] >= 254.5) > 0.3 else ""


def _smaller(grey: Array, size: int) -> Array:
    height, width = (n // size * size for n in grey.shape)
    cv2 = opencv()
    return cv2.resize(grey[:height, :width], (width // size, height // size), interpolation=cv2.INTER_AREA)


def _from_up(corners: Array, up: float) -> Array:
    """Corners clockwise, from the upper left one: the side that looks most towards `up`, rad clockwise in the image."""
    direction = np.array([np.sin(up), -np.cos(up)])
    sides = (corners + np.roll(corners, -1, axis=0)) / 2 - corners.mean(axis=0)
    return np.roll(corners, -int(np.argmax(sides @ direction)), axis=0)


def _checks(grey: Array, H: Array, pattern: Pattern) -> bool:
    """Whether nine cells are black and white in turn, at their middles."""
    near = np.array([[-0.2, -0.2], [0.2, -0.2], [0.0, 0.0], [-0.2, 0.2], [0.2, 0.2]])
    places = mapped(H, ((CELLS[:, None] + near) * pattern.side).reshape(-1, 2))
    values = sampled(grey, places).reshape(9, -1).mean(axis=1)
    if np.isnan(values).sum() > 2:
        return False
    black, white = values[CHECK], values[~CHECK]
    gap = np.nanmean(white) - np.nanmean(black)
    return bool(gap > 0 and np.nanmin(white) - np.nanmax(black) > CLEAR * gap)


def _same(H: Array, other: Array) -> bool:
    """Whether two maps put the pattern's middle in one place."""
    a, b = H[:2, 2], other[:2, 2]
    return bool(np.linalg.norm(a - b) < 3.0)


def _stands(grey: Array, edges: Edges, background: Array | None) -> bool:
    """Whether the background has the pattern at the same place: light does not change a correlation."""
    if background is None:
        return False
    corners = edges.corners[np.isfinite(edges.corners[:, 0])]
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
    high = np.ceil(corners.max(axis=0)).astype(int) + 1
    a, b = (image[low[1] : high[1], low[0] : high[0]] for image in (grey, background))
    a, b = a - a.mean(), b - b.mean()
    return bool(np.sum(a * b) > LIKE * np.sqrt(np.sum(a * a) * np.sum(b * b)) > 0)


def quarter_turned() -> Array:
    """Which corner stands in the place of each one after a quarter of a turn clockwise, (20,)."""
    turn = np.array([[0, 1], [-1, 0]])  # x right, y up, clockwise
    cells = [tuple(cell) for cell in BLACK]
    squares = [cells.index(tuple(turn.T @ cell)) for cell in BLACK]
    return np.array([4 * square + (k - 1) % 4 for square in squares for k in range(4)])
