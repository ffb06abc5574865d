"""What jumps or bends and is differentiated throws the rest as balances of momentum and charge say, on every way to it."""

import shutil

import numpy as np
import pytest

from gantrytau import SolveError, simulate, translate
from gantrytau_fmu import export_fmu
from gantrytau_fmu.systems.run_fmu import run_fmu
from tests.independent_routes.test_cells import MODELS
from tests.independent_routes.thrown_motions import END, ThrownMotion, random_thrown

COMPILER = shutil.which("cc") or shutil.which("gcc")
SHARE = 0.25  # of the random models
FMUS = 0.05
TOLERANCE = 1e-10
CLOSE = 1e5 * TOLERANCE  # of the size of the motion: three pendulums magnify errors


def run(motion: ThrownMotion, points: int) -> np.ndarray:
    known = [] if motion.way == "equation" or motion.signal is None else ["s"]
    dae = translate(motion.model(), given=known if motion.way == "given" else [])
    inputs = dict.fromkeys(known, motion.signal.write) if motion.signal else {}
    found = simulate(dae, stop=END, points=points, inputs=inputs, tolerance=TOLERANCE)
    return np.array([found.final(name) for name in motion.find])


def off(motion: ThrownMotion, end: np.ndarray) -> bool:
    assert motion.end is not None
    return not np.abs(end - motion.end).max() <= CLOSE * (1 + np.abs(motion.end).max())


def test_what_is_thrown_moves_as_balances_say():
    wrong, refused = [], 0
    for seed in range(round(MODELS * SHARE)):
        motion = random_thrown(np.random.default_rng(seed))
        try:
            end = run(motion, (2, 101)[seed % 2])
        except SolveError as error:
            refused += 1
            if motion.end is not None or "more than an impulse" not in str(error):
                wrong.append(f"seed {seed}, {motion.text}: {error}")
            continue
        if motion.end is None or off(motion, end):
            wrong.append(f"seed {seed}, {motion.text}: {end}, expected {motion.end}")
    assert refused < 0.2 * max(MODELS * SHARE, 10)
    assert not wrong, f"{len(wrong)} wrong:\n" + "\n".join(wrong)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_fmus_throw_as_balances_say(tmp_path):
    wrong, motions, seed = [], [], 0
    while len(motions) < MODELS * FMUS:
        motion = random_thrown(np.random.default_rng(seed))
        seed += 1
        if motion.way == "equation" and motion.end is not None:
            motions.append((seed - 1, motion))
    for seed, motion in motions:
        file = tmp_path / f"{seed}.fmu"
        export_fmu(motion.model(), file, tolerance=TOLERANCE, fmi="2.0" if seed % 2 else "3.0")
        for exchange in (False, True):
            found = run_fmu(file, stop=END, step=0.02, tolerance=TOLERANCE, model_exchange=exchange)
            end = np.array([found.final(name) for name in motion.find])
            if off(motion, end):
                wrong.append(f"seed {seed}, {exchange}, {motion.text}: {end}, expected {motion.end}")
    assert not wrong, f"{len(wrong)} wrong:\n" + "\n".join(wrong)
