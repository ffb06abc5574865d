"""Grey values of a scene as a camera sees it, light left out: a wall, bodies before it, and the pattern exactly.

Outlines are bent by the lens like points. Shapes are drawn SAMPLES times as fine in each direction and averaged; of the
pattern the mean over squares of a quarter of a pixel is known in closed form, so that its edges are in their places.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from gantrytau_optimica.calibration.devices.cameras import PlacedCamera
from gantrytau_optimica.calibration.devices.sight import Bars
from gantrytau_optimica.vision.intrinsics import Camera
from gantrytau_optimica.vision.opencv import opencv
from gantrytau_optimica.vision.scenes.scene import Scene

Array = np.ndarray
SAMPLES = 4
BENT = 12  # pieces of an outline's side: lenses bend it
WALL, WHITE, INK, LINKS, TOOL, PLATE = 120, 215, 22, 70, 60, 90
BORDER = 0.5  # cells of white around the pattern
BEHIND = 1.5  # m, from the scene to the wall
AT_PATTERN = 0.05  # m, bars nearer to the camera than this before the pattern are drawn over it
FAR = 1e3  # m, of a plane
TURNS = np.linspace(0, 2 * np.pi, 24, endpoint=False)


@dataclass(frozen=True, eq=False)
class Wall:
    """What stands still: outlines in the image, (k, 2) in pixels, and their grey values, from behind."""

    camera: PlacedCamera
    outlines: tuple[tuple[Array, int], ...]

    @cached_property
    def fine(self) -> Array:
        """Its drawing, SAMPLES times as fine."""
        width, height = self.camera.size
        canvas = np.full((height * SAMPLES, width * SAMPLES), WALL, np.uint8)
        fill(canvas, self.outlines, (0, 0))
        return canvas

    @cached_property
    def grey(self) -> Array:
        """Its grey values, float32 of the image's size."""
        return _averaged(self.fine)


def wall_of(scene: Scene, camera: PlacedCamera) -> Wall:
    """Clutter and decoys on a wall that all cameras see at the same places."""
    random = np.random.default_rng(scene.seed)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) - 0.5
    shapes: list[tuple[Array, int]] = []
    for k in range(scene.clutter + scene.decoys):
        middle = np.array([-BEHIND - 1.8, *(np.array([3.0, -0.6]) + random.uniform(-2.6, 2.6, 2))])
        grey, angle = int(random.integers(20, 230)), random.uniform(0, np.pi)
        size = random.uniform(0.04, 0.5, 2)
        if k >= scene.clutter:  # a single square as of the pattern, on white
            size, grey = np.full(2, scene.pattern.side * random.uniform(1.0, 2.5)), INK
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        round_one = k < scene.clutter and k % 3 == 0
        flat = np.column_stack([np.cos(TURNS), np.sin(TURNS)]) / 2 if round_one else corners
        for scale, value in ((1.6, WHITE), (1.0, grey)) if k >= scene.clutter else ((1.0, grey),):
            places = middle + np.column_stack([np.zeros(len(flat)), (scale * size * flat) @ turn.T])
            shapes.append((outline(camera, places), value))
    return Wall(camera, tuple(shape for shape in shapes if np.isfinite(shape[0]).all()))


def outline(camera: PlacedCamera, corners: Array) -> Array:
    """Image of a polygon with corners (k, 3) in m, (BENT k, 2) in pixels; NaN where a part of it is behind the camera."""
    part = np.arange(BENT)[:, None] / BENT
    ends = np.roll(corners, -1, axis=0)
    return camera.project((corners[:, None] * (1 - part) + ends[:, None] * part).reshape(-1, 3))


def fill(canvas: Array, outlines: Sequence[tuple[Array, int]], corner: Any) -> None:
    """Fill outlines on a canvas SAMPLES times as fine, whose first pixel is `corner` (x, y)."""
    for points, grey in outlines:
        fine = (points + 0.5 - corner) * SAMPLES - 0.5
        near = np.clip(fine, -30000, 30000)  # as far as OpenCV counts, in sixteenths
        opencv().fillPoly(canvas, [np.round(near * 16).astype(np.int32)], grey, shift=4)


def bodies(scene: Scene, camera: PlacedCamera, bars: Bars | None, k: int) -> list[tuple[float, Array, int]]:
    """Distance in m from the camera, outline and grey value of each bar of row k."""
    found = []
    for which, grey in ((bars, LINKS), *((extra, TOOL) for extra in scene.bars)):
        if which is None:
            continue
        row = k if len(which.start) > 1 else 0
        for a, b in zip(which.start[row], which.end[row], strict=True):
            across = np.cross(b - a, (a + b) / 2 - camera.r)
            across *= which.radius / max(float(np.linalg.norm(across)), 1e-12)
            points = outline(camera, np.array([a - across, a + across, b + across, b - across]))
            middle = a + (b - a) * np.linspace(0, 1, 20)[:, None]
            if np.isfinite(points).all():
                found.append((float(np.linalg.norm(middle - camera.r, axis=1).min()), points, grey))
    return found


def tool_body(scene: Scene, camera: PlacedCamera, r: Array, R: Array) -> list[tuple[Array, int]]:
    """A plate of the robot and a body between it and the pattern, as outlines."""
    shapes = []
    x, y = 0.7 * np.cos(TURNS[::4] + 0.3), 0.7 * np.sin(TURNS[::4] + 0.3)
    for along, wide, grey in ((0.0, 0.35, PLATE), (0.5, 0.22, TOOL)):
        hexagon = np.column_stack([np.zeros(6), wide * x, wide * y]) + along * scene.place
        shapes.append((outline(camera, r + hexagon @ R.T), grey))
    return [shape for shape in shapes if np.isfinite(shape[0]).all()]


def draw(scene: Scene, wall: Wall, r: Array, R: Array, bars: list[tuple[float, Array, int]]) -> Array:
    """The scene at one pose, grey values as float32 of the image's size, light left out."""
    image, camera = wall.grey.copy(), wall.camera
    middle = r + R @ scene.place
    distance = float(np.linalg.norm(middle - camera.r)) - AT_PATTERN
    behind = [(points, grey) for far, points, grey in bars if far >= distance]
    moving = [*behind, *tool_body(scene, camera, r, R)]
    low, high = _window(camera, [points for points, _ in moving])
    if np.all(high > low):
        part = tuple(slice(low[k] * SAMPLES, high[k] * SAMPLES) for k in (1, 0))
        canvas = wall.fine[part].copy()
        fill(canvas, moving, low)
        image[low[1] : high[1], low[0] : high[0]] = _averaged(canvas)
    _lay_pattern(image, scene, camera, middle, R @ scene.R)
    for points, grey in ((points, grey) for far, points, grey in bars if far < distance):
        low, high = _window(camera, [points])
        if np.all(high > low):
            mask = np.zeros((high - low)[::-1] * SAMPLES, np.uint8)
            fill(mask, [(points, 255)], low)
            window = image[low[1] : high[1], low[0] : high[0]]
            window += _averaged(mask) / 255 * (grey - window)
    return image


def _window(camera: PlacedCamera, outlines: Sequence[Array]) -> tuple[Array, Array]:
    """First pixel, and the one after the last, of what outlines take of an image: x, y each."""
    points = np.concatenate([*outlines, np.empty((0, 2))])
    if not len(points):
        return np.zeros(2, dtype=int), np.zeros(2, dtype=int)
    ends = np.clip([points.min(axis=0) - 1, points.max(axis=0) + 2], 0, camera.size).astype(int)
    return ends[0], ends[1]


def _averaged(canvas: Array) -> Array:
    """A drawing SAMPLES times as fine as pixels."""
    size = (canvas.shape[1] // SAMPLES, canvas.shape[0] // SAMPLES)
    return opencv().resize(canvas, size, interpolation=opencv().INTER_AREA).astype(np.float32)


def _lay_pattern(image: Array, scene: Scene, camera: PlacedCamera, middle: Array, axes: Array) -> None:
    """Put the pattern with its white border into the image, seen from its front."""
    pattern = scene.pattern
    half = pattern.extent / 2 + BORDER * pattern.side
    corners = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) * half
    points = outline(camera, middle + np.column_stack([corners, np.zeros(4)]) @ axes.T)
    if not np.isfinite(points).all() or axes[:, 2] @ (camera.r - middle) <= 0:
        return
    low, high = _window(camera, [points])
    if np.any(high <= low):
        return
    flat = _on_plane(camera, low, high, middle, axes)  # (h, w, 2) at the middles of samples
    footprint = float(np.median(np.linalg.norm(np.diff(flat, axis=1), axis=2)))
    x, y = flat[..., 0], flat[..., 1]
    covered = np.clip((half[0] - np.abs(x)) / footprint + 0.5, 0, 1) * np.clip(
        (half[1] - np.abs(y)) / footprint + 0.5, 0, 1
    )
    black = pattern.blackness(x, y, footprint)
    shape = (high[1] - low[1], SAMPLES, high[0] - low[0], SAMPLES)
    ink = (covered * (WHITE + (INK - WHITE) * black)).reshape(shape).mean(axis=(1, 3))
    part = covered.reshape(shape).mean(axis=(1, 3))
    window = image[low[1] : high[1], low[0] : high[0]]
    window[:] = (1 - part) * window + ink


def _on_plane(camera: PlacedCamera, low: Array, high: Array, middle: Array, axes: Array) -> Array:
    """Coordinates in a plane, m, of the middles of samples between two pixels, (h SAMPLES, w SAMPLES, 2).

    Where the rays through the corners of pixels meet it, FAR where they do not, and linear within a pixel, where
    perspective bends by 1e-4 of it.
    """
    nodes = np.stack(np.meshgrid(*(np.arange(low[k], high[k] + 1) - 0.5 for k in (0, 1))), axis=-1)
    (f_x, f_y), (c_x, c_y) = camera.focal, camera.centre
    lens = Camera([[f_x, 0, c_x], [0, f_y, c_y], [0, 0, 1]], camera.distortion, camera.size)
    flat = lens.directions(nodes)
    rays = np.concatenate([flat, np.ones_like(flat[..., :1])], axis=-1) @ camera.R.T
    towards = rays @ axes[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = (middle - camera.r) @ axes[:, 2] / towards
        found = (camera.r - middle + depth[..., None] * rays) @ axes[:, :2]
    meets = (depth > 0) & np.isfinite(found).all(axis=-1)
    found = np.where(meets[..., None], np.clip(found, -FAR, FAR), FAR)
    within = (np.arange(SAMPLES) + 0.5) / SAMPLES
    for axis in (0, 1):
        first, last = np.delete(found, -1, axis), np.delete(found, 0, axis)
        weight = within.reshape(-1, *[1] * (2 - axis))
        fine = np.expand_dims(first, axis + 1) * (1 - weight) + np.expand_dims(last, axis + 1) * weight
        shape = list(found.shape)
        shape[axis] = (shape[axis] - 1) * SAMPLES
        found = fine.reshape(shape)
    return found
