"""A robot under its servos is struck at its tool: as its linear equations say, and in the resonances that were printed."""

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, der, linearize
from gantrytau_models import CartServo
from gantrytau_models.mechanisms.flexible import unstretched
from gantrytau_optimica import Rig
from tests.optimica.learning.flexible_runs import PERIOD, PLACE, RECORD, WRIST, flexible_rig

ROWS = 500
START = unstretched(RECORD, PLACE)
STILL = np.tile(START, (ROWS, 1))


def hammer(axis: int, force: float, samples: int = 3) -> np.ndarray:
    """A force on the tool for 12 ms."""
    push = np.zeros((ROWS, 3))
    push[10 : 10 + samples, axis] = force
    return push


def deflection(rig: Rig, push: np.ndarray) -> np.ndarray:
    gauge = rig.run(STILL, push=push)["gauge.r"]
    return gauge - gauge[0]


def test_a_run_is_what_the_linear_loop_does():
    rig = flexible_rig(friction=None)
    rest = rig.run(STILL[:2])
    at = {f"controllers[{k}].f_ff": rest.final(f"carts[{k}].f") for k in range(3)}
    at |= {"q_ref": START, "v_ref": np.zeros(3), "push.f": np.zeros(3)}
    loop = linearize(rig.loop, at=at, steady=True, inputs=["push.f"], outputs=["robot.gauge.r"])
    assert loop.period == pytest.approx(PERIOD)
    for axis in range(3):
        push = hammer(axis, 20.0)
        exact, linear = deflection(rig, push), loop.simulate(push)
        size = np.abs(exact).max()
        assert size > 1e-5
        # of 0.2 mm on a rod of 2 m, and tolerance
        assert exact == pytest.approx(np.asarray(linear), abs=2e-3 * size)


def test_momentum_comes_before_anything_gives_way():
    rig = flexible_rig()
    speed = rig.run(STILL, push=hammer(1, 1000.0, samples=1))["tool.v"][11]
    assert speed[1] == pytest.approx(1000.0 * PERIOD / WRIST, rel=0.03)  # (w t)^2 / 6 at 12 Hz: 1.5 %


def strongest(signal: np.ndarray) -> float:
    """Frequency in Hz of the largest line of what is left of a blow."""
    spectrum = np.abs(np.fft.rfft(signal * np.hanning(len(signal)), 2**14))
    return float(np.fft.rfftfreq(2**14, PERIOD)[np.argmax(spectrum)])


@pytest.mark.parametrize("force", [200.0, 2000.0])
def test_a_blow_along_x_rings_in_the_frame_and_one_along_y_in_the_arms(force):
    """Table 6.4: 7.4 Hz along x; about 10.5 to 11.5 Hz along y, here with carts that give in their friction."""
    rig = flexible_rig()
    x, y = (deflection(rig, hammer(axis, force))[13:] for axis in (0, 1))
    assert strongest(x[:, 0]) == pytest.approx(7.4, abs=0.1)
    assert strongest(y[:, 1]) == pytest.approx(10.0, abs=0.2)
    assert np.ptp(y[:, 1]) > 5 * np.ptp(x[:, 0])  # much stiffer along x


class Sledge(Model):
    """A mass on a guideway."""

    m = Parameter(80.0, unit="kg", description="mass")
    s = Real(unit="m", description="position")
    v = Real(unit="m/s", description="speed")
    f = Input(unit="N", start=0.0, description="force")

    def equations(self):
        yield self.v == der(self.s)
        yield self.m * der(self.v) == self.f


class Lone(Model):
    """One sledge without a tool."""

    sledge = Sledge()


def test_a_rig_of_one_joint_without_a_tool():
    rig = Rig(Lone(), [CartServo(k_v=300 * 80.0, delay=0)], period=PERIOD)
    run = rig.run(np.where(np.arange(200) < 10, 0.0, 1e-3)[:, None])
    assert "measured.r[0]" not in run
    s = run["sledge.s"][11:] - 1e-3
    # the slowest pole, of s (s^2 + w s + w / T_i) + w k_p (s + 1 / T_i) = 0
    slow = np.roots([1, 300, 300 / 0.012 + 300 * 9.0, 300 * 9.0 / 0.012]).real.max()
    assert np.log(s[100] / s[50]) / (50 * PERIOD) == pytest.approx(slow, rel=1e-3)
    with pytest.raises(ModelError, match=r"found a push and Lone, expected a robot with a tool that has a"):
        rig.run(np.zeros((5, 1)), push=np.zeros((5, 3)))


def test_wrong_pushes_are_told():
    rig = flexible_rig(friction=None)
    for push in (np.zeros((ROWS - 1, 3)), np.zeros(3), np.full((ROWS, 3), np.nan)):
        with pytest.raises(ModelError, match=r"Rig\.run: found push") as refusal:
            rig.run(STILL, push=push)
        assert refusal.value.argument == "push"
