"""Motions that switch, and sampled laws with limits, end where exact solutions end: simulated at any points, and as FMUs."""

import shutil

import numpy as np
import pytest

from gantrytau import simulate, translate
from gantrytau_fmu import export_fmu
from gantrytau_fmu.systems.run_fmu import run_fmu
from tests.independent_routes import sampled_laws
from tests.independent_routes.sampled_laws import SampledLaw, random_law
from tests.independent_routes.switching_motions import END, SwitchingMotion, pulse_of_time, random_motion
from tests.independent_routes.test_cells import MODELS

SHARE = 0.2  # of the random models
DENSE_SHARE = 0.02
CLOSE = 1e-6  # of the size of the states, at a tolerance of 1e-8
COMPILER = shutil.which("cc") or shutil.which("gcc")
FMUS = 0.05  # of the random models
LOOSE = 1e-4  # by the integrator of an importer, which begins anew at each instant


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


def laws(count: int) -> list[tuple[int, SampledLaw]]:
    """Sampled laws of which the end is sure, by seed."""
    found = [(seed, random_law(np.random.default_rng(seed))) for seed in range(count)]
    return [(seed, law) for seed, law in found if law.end is not None]


def off(law: SampledLaw, values: list[np.ndarray], close: float = CLOSE) -> bool:
    """values: x, s and d."""
    assert law.end is not None
    apart = np.concatenate([np.ravel(v) for v in values]) - law.end
    return not np.abs(apart).max() <= close * (1 + np.abs(law.end).max())


def test_sampled_laws_with_limits_take_what_was_before_their_instants():
    wrong = []
    for seed, law in laws(round(MODELS * SHARE)):
        points = 2 if seed % 2 else 101
        found = simulate(
            law.model(), stop=sampled_laws.END, points=points, tolerance=1e-9, inputs={"r": law.r}
        )
        if off(law, [found.final(name) for name in ("x", "s", "d")]):
            wrong.append(f"seed {seed}, {points} points: {law.text}")
    assert not wrong, f"{len(wrong)} wrong:\n" + "\n".join(wrong)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_sampled_laws_with_limits_do_so_as_fmus(tmp_path):
    wrong, end = [], sampled_laws.END
    for seed, law in laws(round(MODELS * FMUS)):
        file = tmp_path / f"{seed}.fmu"
        export_fmu(law.model(), file, fmi="2.0" if seed % 2 else "3.0", tolerance=1e-9, find=["x", "s", "d"])
        for step, exchange in ((0.05, False), (0.01, False), (0.05, True)):
            more = 0.0 if exchange else step  # what is due at the end of a step is sampled by the next one
            found = run_fmu(
                file, stop=end + more, step=step, tolerance=1e-9, model_exchange=exchange, inputs={"r": law.r}
            )
            values = [found["x"][-1 if exchange else -2], found["s"][-1], found["d"][-1]]
            if off(law, values, LOOSE if exchange else CLOSE):
                wrong.append(f"seed {seed}, steps of {step:g} s, Model Exchange {exchange}: {law.text}")
    assert not wrong, f"{len(wrong)} wrong:\n" + "\n".join(wrong)
