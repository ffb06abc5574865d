"""A tool led along a surface, for 20 seeds: what the study costs, and what comes of it."""

import sys
import time
from collections.abc import Iterator

import numpy as np

from gantrytau import study
from gantrytau_models.leadthrough import SurfaceTracking, surface_disturbances, surfaces
from tests.benchmarks.table import Row, at_least, at_most, print_table

SEEDS, STOP, POINTS, PULL = 20, 16.0, 4001, 13.0


def rows() -> Iterator[Row]:
    """Seconds of the study, with translation and compilation; what is held, and what is lost without control."""
    taken, forces = _forces(True)
    yield at_most(f"a tool led along cardboard, {STOP:g} s, study of {SEEDS} seeds", taken, 5.0, "s")
    held = [force[np.argmax(force > 0.5) + 250 : int(PULL / 0.004)] for force in forces]
    yield at_most(
        "its largest deviation of the mean from 2 N", max(abs(f.mean() - 2) for f in held), 0.15, "N"
    )
    yield at_most("its largest peak", max(f.max() for f in forces), 2.5, "N")
    taken, forces = _forces(False)
    peaks = [force[: int(PULL / 0.004)].max() for force in forces]
    lost = [np.mean(f[np.argmax(f > 0.5) + 250 : int(PULL / 0.004)] <= 0) for f in forces]
    yield at_most("by hand alone: the same", taken, 5.0, "s")
    yield at_least("by hand alone: median peak, N", float(np.median(peaks)), 5.0)
    yield at_least("by hand alone: median share of the time without contact", float(np.median(lost)), 0.1)


def _forces(tool_control: bool) -> tuple[float, list[np.ndarray]]:
    begin = time.perf_counter()
    tracking = SurfaceTracking(surfaces.CARDBOARD, tool_control=tool_control)
    led = study(
        tracking, stop=STOP, points=POINTS, seeds=SEEDS, inputs=surface_disturbances(), outputs=["f_n"]
    )
    taken = time.perf_counter() - begin
    times = np.arange(POINTS) * 0.004
    results = [led.result(seed=k) for k in range(SEEDS)]
    # of the two sides of a jump the later one
    return taken, [r["f_n"][np.searchsorted(r.time, times + 1e-9) - 1] for r in results]


if __name__ == "__main__":
    sys.exit(print_table("Led along a surface", [rows()]))
