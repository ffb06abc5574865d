"""A picture of a scene of `view` without a browser: each solid is cut by the rays of the pixels.

A solid is convex: its points x, in its own coordinates, have x'Qx <= 1/4 and n_k x <= d_k. A ray o + t d is in the solid
from the largest t at which it enters one of these sets to the least t at which it leaves one. The projection is parallel,
along `VIEW`, the direction of the camera of the pages.
"""

import io
import itertools
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from gantrytau.viewing.film import Film
from gantrytau.viewing.page import VIEW
from gantrytau.viewing.solids import COLOURS, THIN, Solid, along, extent, solids

WIDTH, HEIGHT, FINE = 720, 480, 2  # pixels of a picture, and rays along the edge of each
MARGIN = 0.04  # of the size of the picture
PIECES = 12  # of a long cylinder: each has a small box around it on the picture
LIGHT = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
AMBIENT = 0.55
ON_BOTH = {"ball": (104, 112, 126)}  # the colour of the page is lost on a dark ground
AXES = ((214, 60, 60), (60, 160, 70), (60, 100, 220))
SIDES = 24  # of a cone


def scene_picture(film: Film) -> bytes:
    """The middle instant of a film as a PNG on a transparent ground, cropped to what is seen."""
    from PIL import Image

    low, high = extent(film)
    size = float(np.linalg.norm(high - low)) or 1.0
    seen = [part for solid in solids(film) for part in _parts(solid, size, len(film.times) // 2)]
    if (np.maximum(low, -high) <= 0.1 * size).all():  # the axes of the world, where they stand near
        axes = Solid("", "axes", "bar", np.zeros((1, 3)), np.eye(3)[None], np.full((1, 3), size))
        seen += _parts(axes, size, 0)
    camera = _camera()
    corners = np.concatenate([_corners(one) for one, *_ in seen]) @ camera
    low, high = corners[:, :2].min(axis=0), corners[:, :2].max(axis=0)
    middle, scale = (low + high) / 2, FINE * (1 - 2 * MARGIN) / max((high - low) / (WIDTH, HEIGHT))
    canvas = _Canvas(camera, middle, scale)
    for one, colour, opacity in sorted(seen, key=lambda part: -part[2]):  # what is seen through comes last
        canvas.add(one, colour, opacity)
    picture = Image.fromarray(canvas.pixels())
    file = io.BytesIO()
    picture.crop(picture.getbbox()).quantize(255).save(file, "PNG", optimize=True)
    return file.getvalue()


def _camera() -> np.ndarray:
    """Columns: to the right, upwards, towards the reader."""
    towards = VIEW / np.linalg.norm(VIEW)
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards], axis=1)


def _parts(solid: Solid, size: float, k: int) -> Iterator[tuple[Solid, tuple[int, ...], float]]:
    """Convex solids at picture k, with colour and opacity."""
    colour = ON_BOTH.get(solid.role, COLOURS[solid.role])
    if solid.kind in ("line", "dots"):
        r = solid.r[:: max(1, len(solid.r) // 150)]
        for a, b in itertools.pairwise(r) if solid.kind == "line" else ():
            yield _bar(a, b, 0.8 * size * THIN), colour, 1.0
        return
    now = min(k, len(solid.r) - 1)
    one = replace(solid, r=solid.r[now : now + 1], R=solid.R[now : now + 1], size=solid.size[now : now + 1])
    if solid.kind == "axes":
        for axis, paint in zip(one.R[0].T, AXES, strict=True):
            yield _bar(one.r[0], one.r[0] + 0.06 * size * axis, 0.008 * size), paint, 1.0
    else:
        seen_through = solid.role == "around" or (solid.kind == "cuboid" and solid.role == "body")
        yield one, colour, 0.55 if seen_through else 1.0


def _bar(a: np.ndarray, b: np.ndarray, diameter: float) -> Solid:
    way = (b - a)[None]
    size = np.array([[diameter, diameter, np.linalg.norm(way)]])
    return Solid("", "cylinder", "bar", (a + b)[None] / 2, along(way), size)


def _corners(one: Solid, low: float = -0.5, high: float = 0.5) -> np.ndarray:
    """Corners of the box around a solid, (8, 3) in m; low, high: its ends along z in its own coordinates."""
    ends = (low, high + 0.5) if one.kind == "cone" else (low, high)
    box = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in ends])
    return one.r[0] + (box * one.size[0]) @ one.R[0].T


def _planes(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """Normals (k, 3) and distances (k,) of the planes of a solid."""
    if kind == "cone":
        angle = 2 * np.pi * np.arange(SIDES) / SIDES
        sides = np.stack([np.cos(angle), np.sin(angle), np.full(SIDES, 0.5)], axis=1)
        return np.vstack([sides, [[0.0, 0.0, -1.0]]]), np.append(np.full(SIDES, 0.5), 0.0)
    normals = {"cuboid": np.eye(3), "cylinder": np.eye(3)[2:], "ball": np.zeros((0, 3))}[kind]
    return np.vstack([normals, -normals]), np.full(2 * len(normals), 0.5)


class _Canvas:
    """Colour and depth of each ray."""

    def __init__(self, camera: np.ndarray, middle: np.ndarray, scale: float):
        self.camera, self.middle, self.scale = camera, middle, scale
        self.colour = np.zeros((FINE * HEIGHT, FINE * WIDTH, 4))
        self.depth = np.full(self.colour.shape[:2], -np.inf)

    def add(self, one: Solid, colour: tuple[int, ...], opacity: float) -> None:
        """Draw a solid in front of what is behind it."""
        if one.size[0].min() <= 0:
            return
        if one.kind == "cylinder":
            ends = np.linspace(-0.5, 0.5, PIECES + 1)
            for low, high in itertools.pairwise(ends):
                self._cut(one, colour, opacity, low, high)
        else:
            self._cut(one, colour, opacity, -0.5, 0.5)

    def _cut(self, one: Solid, colour: tuple[int, ...], opacity: float, low: float, high: float) -> None:
        places = (_corners(one, low, high) @ self.camera)[:, :2]
        shape = np.array(self.colour.shape[1::-1])
        pixels = (places - self.middle) * self.scale + shape / 2  # upwards
        first = np.clip(np.floor(pixels.min(axis=0)).astype(int) - 1, 0, shape)
        last = np.clip(np.ceil(pixels.max(axis=0)).astype(int) + 1, 0, shape)
        x, y = np.meshgrid(*(np.arange(*pair) + 0.5 for pair in zip(first, last, strict=True)))
        plane = (np.stack([x, y], axis=-1) - shape / 2) / self.scale + self.middle
        own = one.R[0] / one.size[0]  # from the world to the coordinates of the solid
        begin = (plane @ self.camera[:, :2].T - one.r[0]) @ own
        t, normal = _nearest(one.kind, begin, -self.camera[:, 2] @ own, low, high)
        area = np.s_[first[1] : last[1], first[0] : last[0]]
        front = np.isfinite(t) & (-t > self.depth[area])
        world = normal @ own.T
        world /= np.maximum(np.linalg.norm(world, axis=-1, keepdims=True), 1e-12)
        bright = AMBIENT + (1 - AMBIENT) * np.clip(world @ LIGHT, 0.0, 1.0)
        paint = np.concatenate([np.array(colour) * bright[..., None], np.full((*t.shape, 1), 255.0)], axis=-1)
        paint[..., :3] = np.minimum(1.15 * paint[..., :3], 255.0)
        self.colour[area][front] = (opacity * paint + (1 - opacity) * self.colour[area])[front]
        if opacity == 1.0:
            self.depth[area][front] = -t[front]

    def pixels(self) -> np.ndarray:
        """RGBA (HEIGHT, WIDTH, 4), the mean over the rays of each pixel."""
        flipped = self.colour[::-1].reshape(HEIGHT, FINE, WIDTH, FINE, 4)
        mean = flipped.mean(axis=(1, 3))  # colours times their opacity
        straight = mean[..., :3] / np.maximum(mean[..., 3:] / 255, 1e-12)
        return np.concatenate([straight, mean[..., 3:]], axis=-1).round().astype(np.uint8)


def _nearest(
    kind: str, begin: np.ndarray, way: np.ndarray, low: float, high: float
) -> tuple[np.ndarray, np.ndarray]:
    """Parameters t where rays begin + t way enter a solid, inf for a miss, and normals; low, high: ends of a cylinder."""
    enter, leave = np.full(begin.shape[:2], -np.inf), np.full(begin.shape[:2], np.inf)
    normal = np.zeros_like(begin)
    if kind in ("ball", "cylinder"):
        Q = np.array([1.0, 1.0, kind == "ball"])
        a, b, c = (way * Q) @ way, (begin * Q) @ way, (begin * begin) @ Q - 0.25
        root = b * b - a * c
        with np.errstate(invalid="ignore", divide="ignore"):
            enter, leave = (-b - np.sqrt(root)) / a, (-b + np.sqrt(root)) / a
        enter, leave = np.where(root > 0, enter, np.inf), np.where(root > 0, leave, -np.inf)
        normal = (begin + np.where(np.isfinite(enter), enter, 0.0)[..., None] * way) * Q
    for n, d in zip(*_planes(kind), strict=True):
        bound = d if kind != "cylinder" else (high if n[2] > 0 else -low)
        towards, distance = n @ way, bound - begin @ n
        if abs(towards) < 1e-12:
            leave = np.where(distance < 0, -np.inf, leave)
            continue
        t = distance / towards
        if towards < 0:
            normal[t > enter] = n
            enter = np.maximum(enter, t)
        else:
            leave = np.minimum(leave, t)
    return np.where(enter < leave, enter, np.inf), normal
