"""A match led into its hole, for 20 seeds: what the study costs, and what comes of it."""

import sys
import time
from collections.abc import Iterator

import numpy as np

from gantrytau import study
from gantrytau_models.leadthrough import PegInHole, peg_disturbances
from tests.benchmarks.table import Row, at_least, at_most, print_table

SEEDS, STOP, HELD = 20, 85.0, 79.0  # the hand withdraws at the last, s
TOLERANCE = 1e-6  # angles at the end are those of 1e-8 to ten digits, as only what is sampled feeds back


def rows() -> Iterator[Row]:
    """Seconds of the study, with translation and compilation; the worst seeds."""
    begin = time.perf_counter()
    led = study(
        PegInHole(),
        stop=STOP,
        seeds=SEEDS,
        inputs=peg_disturbances(),
        outputs=["tool.angle", "tool.r"],
        points=426,
        tolerance=TOLERANCE,
    )
    taken = time.perf_counter() - begin
    results = [led.result(seed=k) for k in range(SEEDS)]
    angles = [float(np.degrees(r.at(HELD, "tool.angle"))) for r in results]
    depths = [-1e3 * float(r["tool.r"][r.time <= HELD, 2].min()) for r in results]
    yield at_most(f"a match led into its hole, {STOP:g} s, study of {SEEDS} seeds", taken, 20.0, "s")
    yield at_most("its largest angle at the end, of 6 at the start", max(angles), 2.2, "deg")
    yield at_least("its least depth, mm", min(depths), 28.0)


if __name__ == "__main__":
    sys.exit(print_table("Peg in hole", [rows()]))
