"""`make bench`: every figure of the project as one table, measured now on this machine."""

import sys
import time
from collections.abc import Iterator

from tests.benchmarks import (
    answers,
    calibration,
    controller_samples,
    engine,
    fmus,
    growth,
    identification,
    kinematics,
    mechanisms,
    modelica_text,
    motion,
    pages,
    peg_seeds,
    procedure,
    rig_runs,
    sampling,
    studies,
    surface_seeds,
    vision,
)
from tests.benchmarks.in_the_loop import rows as in_the_loop
from tests.benchmarks.peers import rows as peers
from tests.benchmarks.table import Row, at_most, print_table

LONGEST = 20.0  # min


def _duration(begin: float) -> Iterator[Row]:
    yield at_most("the whole table", (time.perf_counter() - begin) / 60, LONGEST, "min")


if __name__ == "__main__":
    begin = time.perf_counter()
    mechanics = (
        engine.rows(),
        mechanisms.rows(),
        motion.rows(),
        peers.rows(),
        kinematics.rows(),
        calibration.rows(),
    )
    timed = (
        fmus.rows(),
        sampling.rows(),
        controller_samples.rows(),
        studies.rows(),
        pages.rows(),
        modelica_text.rows(),
        identification.rows(),
        rig_runs.rows(),
        peg_seeds.rows(),
        surface_seeds.rows(),
        vision.rows(),
        in_the_loop.rows(),
    )
    parts = (*mechanics, procedure.rows(), growth.rows(), answers.rows(), *timed, _duration(begin))
    sys.exit(print_table("Benchmarks", parts))
