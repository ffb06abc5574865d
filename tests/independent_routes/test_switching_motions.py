"""Motions that switch on states and on time end where exact solutions end, however many points are asked for."""

import numpy as np

from gantrytau import simulate, translate
from tests.independent_routes.switching_motions import END, SwitchingMotion, pulse_of_time, random_motion
from tests.independent_routes.test_cells import MODELS

SHARE = 0.2  # of the random models
DENSE_SHARE = 0.02
CLOSE = 1e-6  # of the size of the states, at a tolerance of 1e-8


def wrong_ends(motion: SwitchingMotion, text: str, tolerance: float = 1e-8) -> list[str]:
    """What differs from where a motion ends, for several numbers of points."""
    dae, found = translate(motion.model()), []
    for points in (2, 11, 501):
        inputs = {"f": pulse_of_time(motion.pulse)}
        end = simulate(dae, stop=END, points=points, inputs=inputs, tolerance=tolerance).final("x")
        wanted = np.asarray(motion.end)
        if not np.abs(end - wanted).max() <= CLOSE * (1 + np.abs(wanted).max()):
            found.append(f"{text}, {motion.text}, {points} points: {end}, expected {wanted}")
    return found


def test_what_a_simulation_finds_does_not_depend_on_its_points():
    wrong, asked = [], 0
    for seed in range(round(MODELS * SHARE)):
        motion = random_motion(np.random.default_rng(seed))
        if motion.end is None:
            continue
        asked += 3
        wrong += wrong_ends(motion, f"seed {seed}")
    assert asked > MODELS * SHARE
    assert not wrong, f"{len(wrong)} of {asked} wrong:\n" + "\n".join(wrong)


def test_switches_on_sines_of_states_are_found():
    wrong, asked, seed = [], 0, 0
    while asked < MODELS * DENSE_SHARE:
        motion = random_motion(np.random.default_rng(seed), ["sine", "kink"])
        if motion.end is not None and "sine" in motion.text:
            asked += 1
            wrong += wrong_ends(motion, f"seed {seed}", 1e-10)  # each of many starts anew adds an error
        seed += 1
    assert not wrong, f"{len(wrong)} of {asked} wrong:\n" + "\n".join(wrong)
