"""Motions with whens end where exact solutions end: simulated, whatever points are asked for, and as FMUs."""

import shutil

import numpy as np
import pytest

from gantrytau import simulate, translate
from gantrytau_fmu import export_fmu
from gantrytau_fmu.systems.run_fmu import run_fmu
from tests.independent_routes.hybrid_motions import END, HybridMotion, random_hybrid
from tests.independent_routes.test_cells import MODELS

COMPILER = shutil.which("cc") or shutil.which("gcc")
FMUS = 0.1  # of the random models
TOLERANCE = 1e-10  # events magnify errors: a motion that hardly crosses a margin crosses it late
CLOSE = 1e4 * TOLERANCE  # of the size of the states


def known(seeds: range) -> list[tuple[int, HybridMotion]]:
    """Motions of which the end is sure, by seed."""
    found = []
    for seed in seeds:
        motion = random_hybrid(np.random.default_rng(seed))
        if motion.end is not None:
            found.append((seed, motion))
    return found


def off(motion: HybridMotion, x: np.ndarray, d: float) -> bool:
    assert motion.end is not None
    expected, count, _ = motion.end
    return not np.abs(x - expected).max() <= CLOSE * (1 + np.abs(expected).max()) or abs(d - count) > 1e-9


def test_what_whens_make_of_a_motion_does_not_depend_on_points():
    wrong, events = [], 0
    motions = known(range(2 * MODELS))
    for seed, motion in motions:
        dae = translate(motion.model(), events=True)
        points = 2 if seed % 2 else 101
        found = simulate(dae, stop=END, points=points, tolerance=TOLERANCE)
        x, d = np.atleast_1d(found.final("x")), found.final("d")
        if off(motion, x, d):
            wrong.append(f"seed {seed}, {points} points: {x}, {d}, expected {motion.end}; {motion.text}")
        events += motion.end[2] if motion.end else 0
    assert len(motions) > 1.8 * MODELS
    assert events > 2 * MODELS
    assert not wrong, f"{len(wrong)} wrong:\n" + "\n".join(wrong)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_fmus_act_where_exact_solutions_do(tmp_path):
    wrong, asked = [], 0
    for seed, motion in known(range(round(2 * MODELS * FMUS))):
        file = tmp_path / f"{seed}.fmu"
        export_fmu(motion.model(), file, tolerance=TOLERANCE)
        for step, exchange in ((0.5, False), (0.01, False), (0.01, True)):
            found = run_fmu(file, stop=END, step=step, tolerance=TOLERANCE, model_exchange=exchange)
            x, d = np.atleast_1d(found.final("x")), found.final("d")
            asked += 1
            if off(motion, x, d):
                way = "Model Exchange" if exchange else f"steps of {step:g} s"
                wrong.append(f"seed {seed}, {way}: {x}, {d}, expected {motion.end}; {motion.text}")
    assert asked > 2 * 2 * MODELS * FMUS
    assert not wrong, f"{len(wrong)} of {asked} wrong:\n" + "\n".join(wrong)
