"""Detection of a pattern on a robot in rendered images, in good, dim and noisy light, and poses from its corners."""

import time
from collections.abc import Iterator
from typing import Any

import numpy as np

from gantrytau.kinematics.rotations import of_vector, rotation_vector
from gantrytau_optimica.fitting.blocks import minimised
from gantrytau_optimica.vision import (
    Detections,
    Light,
    Pattern,
    PatternTracker,
    compare,
    detect,
    reconstruct,
    render,
    true_corners,
)
from gantrytau_optimica.vision.reconstruction.adjustment import started
from gantrytau_optimica.vision.reconstruction.bundle import Bundle, State, TakenAsKnown
from tests.benchmarks.table import Row, at_least, at_most
from tests.optimica.vision.camera_rig import LENS, MIDDLE, SIDE, TYPICAL, lines, pair, scene, seen, views

PAIRS, SEED, SEEDS = 60, 100, 10
RECONSTRUCTIONS: tuple[
    tuple[str, Any, dict[str, Any], float], ...
] = (  # name, cameras, options, the most that is asked for in mm
    ("lenses known", pair(), {}, 0.25),
    ("typical lenses estimated", pair(TYPICAL), dict(intrinsics="estimate"), 0.5),
    ("one camera, plate and spacing", pair()[:1], {}, 1.3),
)
LIGHTS = {  # name -> light, and the part of pairs that is asked for
    "good light": (Light(), 0.99),
    "0.15 of good light": (Light(0.15), 0.95),
    "noise of 8 grey values": (Light(noise=8.0), 0.95),
}


def rows() -> Iterator[Row]:
    """Detection, then reconstruction."""
    yield from _detected()
    yield from _reconstructed()
    yield from _followed()


def _followed() -> Iterator[Row]:
    """A moving pattern at 250 Hz: processor time of a pair of images."""
    times = 0.004 * np.arange(30)
    r = MIDDLE + np.column_stack([0.5 * times, 0.2 * np.sin(8 * times), -0.1 * np.cos(8 * times)])
    images = render(scene(), r, pair(), seed=SEED)
    tracker = PatternTracker(Pattern.quincunx(SIDE), pair())
    spent, error = [], []
    for k, true in enumerate(r + scene().place):
        begin = time.process_time()
        here = tracker.update([frames[k] for frames in images.frames])
        spent.append(time.process_time() - begin)
        error.append(np.inf if here is None else np.linalg.norm(here.r - true))
    yield at_most("a pair of images, pattern followed", 1e3 * float(np.median(spent[1:])), 4.0, "ms")
    yield at_most("pattern followed: largest error", 1e3 * float(max(error)), 0.5, "mm")


def _reconstructed() -> Iterator[Row]:
    """Errors in the median of ten seeds, how well they are foretold, and the bundle beside sparse least squares of SciPy."""
    for name, rig, options, most in RECONSTRUCTIONS:
        errors, foretold = [], []
        for seed in range(SEEDS):
            r, q = lines(seed)
            found = reconstruct(seen(r, rig, seed=seed), [LENS] * len(rig), spacing=q, **options)
            distances = compare(found.r, r).distances
            errors.append(distances.mean())
            foretold.append(found.expected / np.sqrt(np.mean(distances**2)))
        yield at_most(f"{name}: error, median of {SEEDS} seeds", 1e3 * float(np.median(errors)), most, "mm")
        off = float(np.median(np.maximum(foretold, 1 / np.array(foretold))))
        yield at_most(f"{name}: foretold within a factor of", off, 1.5)
    r, _ = lines(0)
    images = seen(r, pair())
    told = TakenAsKnown(lenses=False, plate=False, alike=True)
    bundle = Bundle(
        images.corners, np.ones(images.corners.shape[:3]) / 0.1, images.pattern.points, (LENS, LENS), told
    )
    start = started(bundle)
    taken, state = [], start
    for _ in range(5):
        begin = time.perf_counter()
        state, _, _ = minimised(start, bundle.rows, bundle.moved)
        taken.append(time.perf_counter() - begin)
    ours = float(np.sqrt(np.nanmean(bundle.residuals(state) ** 2)))
    peer, rms = by_scipy(images, start)
    yield at_least(f"bundle of {20 * len(r)} corners: times quicker than SciPy", peer / min(taken), 10.0)
    yield at_most("bundle: image points miss by more than SciPy's", ours - rms, 1e-4, "pixel")


def by_scipy(images: Detections, start: State) -> tuple[float, float]:
    """Seconds of the same bundle by `least_squares` with differences along the sparsity, and what is left, rms in pixels."""
    from scipy.optimize import least_squares
    from scipy.sparse import lil_matrix

    pixels = images.corners.reshape(2, -1, 2)
    count = pixels.shape[1]

    def projected(points: np.ndarray, turn: np.ndarray, r: np.ndarray) -> np.ndarray:
        local = (points - r) @ of_vector(turn)
        return local[:, :2] / local[:, 2:] * 1290 + [511.5, 383.5]

    def errors(x: np.ndarray) -> np.ndarray:
        points = x[6:].reshape(count, 3)
        first = projected(points, np.zeros(3), np.zeros(3))
        second = projected(points, x[:3], x[3:6])
        images = np.stack([first, second]) - pixels
        return np.concatenate([images.ravel(), [np.linalg.norm(x[3:6]) - base]])

    sparsity = lil_matrix((4 * count + 1, 6 + 3 * count), dtype=int)
    sparsity[2 * count :, :6] = 1
    for k in range(count):
        for row in (2 * k, 2 * k + 1, 2 * count + 2 * k, 2 * count + 2 * k + 1):
            sparsity[row, 6 + 3 * k : 9 + 3 * k] = 1
    camera = start.cameras[1]
    base = float(np.linalg.norm(camera.r))
    x = np.concatenate([rotation_vector(camera.R[None])[0], camera.r, start.corners.ravel()])
    begin = time.perf_counter()
    found = least_squares(errors, x, jac_sparsity=sparsity)
    return time.perf_counter() - begin, float(np.sqrt(np.mean(found.fun[:-1] ** 2)))


def _detected() -> Iterator[Row]:
    """Pairs found, the worst corner, centres and processor time, of images that no other test has seen."""
    for k, (name, (light, least)) in enumerate(LIGHTS.items()):
        images = views(PAIRS, SEED + k, light)
        true = true_corners(scene(), pair(), images.r)
        begin = time.process_time()
        found = detect(images, Pattern.quincunx(SIDE))
        spent = (time.process_time() - begin) / PAIRS
        yield at_least(f"pairs found, {name}", round(float(found.pairs.mean()), 4), least)
        worst = float(np.nanmax(np.linalg.norm(found.corners - true, axis=-1)))
        yield at_most(f"worst corner, {name}", worst, 3.0, "pixel")
        error = (found.centres - true.mean(axis=2))[found.found]
        yield at_most(f"centres, rms, {name}", float(np.sqrt(np.mean(error**2))), 0.025, "pixel")
        yield at_most(f"detection of a pair, {name}", 1e3 * spent, 120.0, "ms")
