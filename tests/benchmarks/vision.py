"""Detection of a pattern on a robot in rendered images, in good, dim and noisy light."""

import time
from collections.abc import Iterator

import numpy as np

from gantrytau_optimica.vision import Light, Pattern, detect, true_corners
from tests.benchmarks.table import Row, at_least, at_most
from tests.optimica.vision.camera_rig import SIDE, pair, scene, views

PAIRS, SEED = 60, 100
LIGHTS = {  # name -> light, and the part of pairs that is asked for
    "good light": (Light(), 0.99),
    "0.15 of good light": (Light(0.15), 0.95),
    "noise of 8 grey values": (Light(noise=8.0), 0.95),
}


def rows() -> Iterator[Row]:
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
