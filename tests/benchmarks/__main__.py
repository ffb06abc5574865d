"""`make bench`: every figure of the project as one table, measured now on this machine."""

import sys

from tests.benchmarks import (
    answers,
    calibration,
    engine,
    fmus,
    growth,
    kinematics,
    mechanisms,
    motion,
    procedure,
    sampling,
    studies,
)
from tests.benchmarks.table import print_table

if __name__ == "__main__":
    mechanics = (engine.rows(), mechanisms.rows(), motion.rows(), kinematics.rows(), calibration.rows())
    timed = (fmus.rows(), sampling.rows(), studies.rows())
    parts = (*mechanics, procedure.rows(), growth.rows(), answers.rows(), *timed)
    sys.exit(print_table("Benchmarks", parts))
