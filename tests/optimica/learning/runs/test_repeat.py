"""Corrections on file, and how well a motion is repeated."""

import numpy as np
import pytest

from gantrytau import ModelError, Result
from gantrytau.kinematics import Kinematics
from gantrytau_models import FlexibleGantryTau, GantryTau, PreslidingFriction, cart_servos, prototypes
from gantrytau_optimica import Learning, Rig, Tukey, learn, square_reference
from gantrytau_optimica.learning import LearningError, Scatter, read_corrections, repeat
from tests.optimica.learning.runs.linear_plant import RESPONSE, LinearPlant, line

WINDOW = Tukey(0.2, lead=0.2)


def test_corrections_that_were_learnt_are_read_and_run_again(tmp_path):
    """From a file, without learning, the plant does what it did in the last run."""
    reference = line()
    history = learn(LinearPlant(), reference, Learning(window=WINDOW), iterations=3, response=RESPONSE)
    file = history.save_corrections(tmp_path / "u.csv")
    u = read_corrections(file, history.joints, reference.t)
    assert np.array_equal(u, history.corrected)
    again = repeat(LinearPlant(), reference, u, runs=2)
    assert again.q[0] == pytest.approx(history.q[-1], abs=1e-12)
    assert np.all(again.rms < 1e-15)


def test_deviations_are_those_of_noise():
    """The difference of two readings has sqrt(2) times the deviation of one."""
    found = repeat(LinearPlant(noise=1e-5), line(), runs=20, seed=3)
    assert found.deviations.shape == (19, 400, 3)
    assert found.rms == pytest.approx(np.sqrt(2) * 1e-5, rel=0.1)
    assert "um rms" in str(found)


def test_the_flexible_robot_repeats_itself_to_a_tenth_of_its_error():
    """ "An order of magnitude smaller": friction and where it rests are drawn for each run."""
    record = prototypes.L1_flexible
    robot = FlexibleGantryTau(record, friction=PreslidingFriction)
    rig = Rig(robot, cart_servos(record), period=0.004, noise=Scatter(), stiff=GantryTau(record))
    found = repeat(rig, square_reference(), window=Tukey(1.2, 4.5))
    assert np.all(found.relative < 10)
    assert np.all(found.rms > 1e-6)  # m, more than encoders read


def with_row(text, number, row):
    lines = text.splitlines()
    lines[number] = row
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda text: text.replace("carts[1].s", "carts[4].s"), r"no column 'carts\[1\].s'; did you mean"),
        (lambda text: "\n".join(text.splitlines()[:-1]), "found 399 rows, expected 400"),
        (lambda text: text.replace("0.008,", "0.009,", 1), "found the time 0.009 s in row 2"),
        (lambda text: with_row(text, 3, "0.008,nan,0,0"), "line 4, column .*: found 'nan', expected a"),
        (lambda text: text.replace("carts[1].s [m]", "carts[1].s [rad]"), r"column carts\[1\].s: found"),
        (lambda text: text.replace("time", "clock"), "found no column time"),
    ],
)
def test_files_that_do_not_fit_are_told(tmp_path, change, words):
    reference = line()
    history = learn(LinearPlant(), reference, Learning(window=WINDOW), iterations=1, response=RESPONSE)
    file = history.save_corrections(tmp_path / "u.csv")
    file.write_text(change(file.read_text()))
    with pytest.raises(ModelError, match=words):
        read_corrections(file, history.joints, reference.t)


def test_columns_in_another_order_are_found(tmp_path):
    reference = line()
    history = learn(LinearPlant(), reference, Learning(window=WINDOW), iterations=1, response=RESPONSE)
    file = history.save_corrections(tmp_path / "u.csv")
    turned = read_corrections(file, history.joints[::-1], reference.t)
    assert np.array_equal(turned, history.corrected[:, ::-1])
    with pytest.raises(ModelError) as refusal:
        repeat(LinearPlant(), reference, turned[:, :2])
    assert refusal.value.argument == "corrections"


class Bounded(Kinematics):
    """Of a robot whose carts stay within 10 m."""

    @property
    def limits(self) -> np.ndarray:
        return np.tile([-10.0, 10.0], (len(self.joints), 1))


def test_repetitions_keep_to_limits_and_to_the_period_of_the_rig():
    """As `learn` does: a robot is not sent beyond its limits, nor faster than its reference."""
    slow = LinearPlant()
    slow.period = 0.008
    with pytest.raises(ModelError, match=r"repeat: found a reference every 0.004 s, expected every 0.008 s"):
        repeat(slow, line())
    plant = LinearPlant()
    plant.kinematics = Bounded(GantryTau(prototypes.L1))
    with pytest.raises(ModelError, match=r"of carts\[\d\]\.s at .*within its limits, -10 to 10"):
        repeat(plant, line(), np.full((400, 3), 50.0))
    assert plant.runs == 0  # refused before it moved


def test_a_repetition_that_fails_is_told_with_its_number():
    class Broken(LinearPlant):
        def run(self, position: np.ndarray, velocity: np.ndarray, seed: int = 0) -> Result:
            if seed == 2:
                raise ModelError("the drive is off")
            return super().run(position, velocity, seed)

    with pytest.raises(LearningError, match="repeat: run 2 failed: the drive is off"):
        repeat(Broken(), line())
