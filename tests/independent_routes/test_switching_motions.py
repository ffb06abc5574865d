"""Motions that switch on states and on time end where exact solutions end, however many points are asked for."""

import numpy as np

from gantrytau import simulate, translate
from tests.independent_routes.switching_motions import END, pulse_of_time, random_motion
from tests.independent_routes.test_cells import MODELS

SHARE = 0.2  # of the random models
CLOSE = 1e-6  # of the size of the states, at a tolerance of 1e-8


def test_what_a_simulation_finds_does_not_depend_on_its_points():
    wrong, asked = [], 0
    for seed in range(round(MODELS * SHARE)):
        motion = random_motion(np.random.default_rng(seed))
        if motion.end is None:
            continue
        dae = translate(motion.model())
        for points in (2, 11, 501):
            end = simulate(dae, stop=END, points=points, inputs={"f": pulse_of_time(motion.pulse)}).final("x")
            asked += 1
            if not np.abs(end - motion.end).max() <= CLOSE * (1 + np.abs(motion.end).max()):
                wrong.append(f"seed {seed}, {motion.text}, {points} points: {end}, expected {motion.end}")
    assert asked > MODELS * SHARE
    assert not wrong, f"{len(wrong)} of {asked} wrong:\n" + "\n".join(wrong)
