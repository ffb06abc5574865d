"""Motions with delays end where the method of steps ends: simulated, whatever points are asked for, and as FMUs."""

import shutil

import numpy as np
import pytest

from gantrytau import simulate
from gantrytau_fmu import export_fmu
from gantrytau_fmu.systems.run_fmu import run_fmu
from tests.independent_routes.delayed_motions import END, random_delayed
from tests.independent_routes.test_cells import MODELS

COMPILER = shutil.which("cc") or shutil.which("gcc")
SHARE, FMUS = 0.15, 0.1  # of the random models
TOLERANCE = 1e-10
CLOSE = (
    1e3 * TOLERANCE
)  # of the size of the states: an integrator begins anew at each place that is remembered


def test_what_delays_make_of_a_motion_does_not_depend_on_points():
    wrong = []
    for seed in range(round(MODELS * SHARE)):
        motion = random_delayed(np.random.default_rng(seed))
        points = 2 if seed % 2 else 101
        end = np.atleast_1d(simulate(motion.model(), stop=END, points=points, tolerance=TOLERANCE).final("x"))
        if not np.abs(end - motion.end).max() <= CLOSE * (1 + np.abs(motion.end).max()):
            wrong.append(f"seed {seed}, {points} points: {end}, expected {motion.end}; {motion.text}")
    assert not wrong, f"{len(wrong)} wrong:\n" + "\n".join(wrong)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_fmus_remember_what_exact_solutions_do(tmp_path):
    wrong = []
    for seed in range(round(MODELS * FMUS)):
        motion, file = random_delayed(np.random.default_rng(seed)), tmp_path / f"{seed}.fmu"
        export_fmu(motion.model(), file, tolerance=TOLERANCE)
        for step in (0.5, 0.01):
            end = np.atleast_1d(run_fmu(file, stop=END, step=step, tolerance=TOLERANCE).final("x"))
            if not np.abs(end - motion.end).max() <= CLOSE * (1 + np.abs(motion.end).max()):
                wrong.append(f"seed {seed}, steps of {step:g} s: {end}, expected {motion.end}; {motion.text}")
    assert not wrong, f"{len(wrong)} wrong:\n" + "\n".join(wrong)
