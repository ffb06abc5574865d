"""Robots whose joints turn learn as robots with carts do."""

import re
from pathlib import Path

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, der
from gantrytau_models import CartServo, DeltaRobot, JointServo
from gantrytau_optimica import Gradient, Learning, NormOptimal, Rig, Tukey, ZeroPhase, learn, square_reference
from gantrytau_optimica.learning import Reference, Scatter, StraightAxes, read_corrections
from gantrytau_optimica.learning.runs.corrections_file import write_corrections

PERIOD = 0.004
WINDOW = Tukey(0.3, 1.6, lead=0.2)


@pytest.fixture(scope="module")
def delta() -> Rig:
    servos = [JointServo(k_p=20.0, k_v=12.0, delay=2) for _ in range(3)]
    return Rig(DeltaRobot(), servos, period=PERIOD, noise=Scatter(encoder=1e-5))


def square(rig):
    start = tuple(rig.kinematics.home.r)
    return square_reference(0.02, start=start, move=0.2, edge=0.25, begin=0.4, rounds=1, duration=1.6)


def test_a_turning_joint_follows_as_its_gain_says(delta):
    """Steps of the angle have the pole exp(-k_p period), and measured angles the noise of the encoder, in rad."""
    q = np.tile(delta.kinematics.home.q, (150, 1))
    q[10:, 0] += 0.01
    run = delta.run(q, seed=1)
    left = 0.01 - (np.asarray(run["arms[0].phi"]) - q[0, 0])[30:60]
    pole = (left[-1] / left[0]) ** (1 / (len(left) - 1))  # in the mean, as other arms swing along
    assert pole == pytest.approx(np.exp(-20 * PERIOD), abs=0.015)
    assert np.std(run["measured.q"][:9] - q[:9]) == pytest.approx(1e-5, rel=0.4)
    assert run.unit("measured.q") == "rad"


@pytest.mark.parametrize(
    ("law", "hertz", "most"), [(None, 10.0, 8.0), (NormOptimal(), 25.0, 3.0), (Gradient(), 25.0, 25.0)]
)
def test_a_delta_robot_learns_a_square_by_three_laws(delta, law, hertz, most):
    learning = Learning(law=law, q=ZeroPhase.butterworth(2, hertz), window=WINDOW)
    found = learn(delta, square(delta), learning, iterations=5, seed=1)
    assert found.stability is not None
    assert found.stability.monotone
    assert np.all(found.relative[5] < most)
    assert np.all(found.tool_relative[5, :2] < most)
    # no run leaves more than was foretold, but for noise and friction
    for before, after in zip(found.relative[:3], found.relative[1:4], strict=True):
        assert np.all(after < found.stability.sigma * before + 5)


class Sledge(Model):
    """A mass on a guideway, held by a spring."""

    m = Parameter(80.0, unit="kg", description="mass")
    c = Parameter(2e4, unit="N/m", description="stiffness")
    s = Real(unit="m", description="position")
    v = Real(unit="m/s", description="speed")
    f = Input(unit="N", start=0.0, description="force")

    def equations(self):
        yield self.v == der(self.s)
        yield self.m * der(self.v) + self.c * self.s == self.f


class Machine(Model):
    """Two axes without a tool."""

    x, y = Sledge(), Sledge(m=40.0)


@pytest.mark.parametrize("axes", [1, 2])
def test_machines_of_one_and_two_axes_learn(axes):
    servos = [CartServo(k_v=300 * 80.0), CartServo(k_v=300 * 40.0)][:axes]
    rig = Rig((Lone, Machine)[axes - 1](), servos, period=PERIOD, noise=Scatter())
    t = PERIOD * np.arange(300)
    share = np.clip((t - 0.3) / 0.5, 0, 1)
    r = np.zeros((300, 3))
    r[:, :axes] = (
        0.02 * np.column_stack([np.sin(np.pi * share) ** 4, np.sin(2 * np.pi * share) ** 4])[:, :axes]
    )
    found = learn(rig, Reference(t, r), Learning(window=Tukey(0.2, 1.2, lead=0.1)), iterations=6, seed=1)
    assert found.names == ("x.s", "y.s")[:axes]
    assert found.stability is not None
    assert found.stability.monotone
    assert np.all(found.relative[6] < [5, 20][:axes])  # what is left lies above 10 Hz
    assert found.tool_relative[6, :axes] == pytest.approx(found.relative[6], abs=0.5)


class Lone(Model):
    """One axis without a tool."""

    x = Sledge()


def test_a_line_of_one_axis_is_drawn_over_time(tmp_path):
    """To and fro on one axis the way over the plane would be a line; over time, it is the reference and what was driven."""
    rig = Rig(Lone(), [CartServo(k_v=300 * 80.0)], period=PERIOD)
    t = PERIOD * np.arange(300)
    r = np.outer(0.02 * np.sin(np.pi * np.clip((t - 0.3) / 0.5, 0, 1)) ** 4, [1, 0, 0])
    found = learn(rig, Reference(t, r), Learning(window=Tukey(0.2, 1.2, lead=0.1)), iterations=1, seed=1)
    (axis,) = found.plot("path", file=tmp_path / "path.png").axes
    lines = {str(line.get_label()): np.asarray(line.get_ydata()) for line in axis.lines}
    assert list(lines) == ["reference", "run 0", "run 1"]
    assert lines["reference"] == pytest.approx(1e3 * r[:, 0])  # mm
    assert axis.get_xlabel() == "time [s]"
    assert axis.get_ylabel() == "x from the start [mm]"
    assert {what: found.plot(what).axes[0].get_title() for what in ("error", "input", "tool")} == {
        "error": "errors of what is learnt from",
        "input": "corrections",
        "tool": "errors of the tool",
    }


def test_what_a_lone_axis_cannot_do_is_told_in_its_words():
    rig = Rig(Lone(), [CartServo()], period=PERIOD)
    t = PERIOD * np.arange(300)
    across = Reference(t, np.outer(0.01 * np.clip(t - 0.3, 0, 0.5), [0, 1, 0]))
    with pytest.raises(ModelError, match=r"reference: found the tool at .* in row \d+, .* within reach of"):
        learn(rig, across)
    with pytest.raises(ModelError, match=r"Rig: found Sledge with the inputs f, expected .*; make what is"):
        Rig(Sledge(), [CartServo()], period=PERIOD)
    assert repr(rig) == "<Rig: Lone under 1 servo, every 0.004 s>"


def test_axes_that_are_not_there_cannot_move():
    axes = StraightAxes(["x.s"])
    assert axes.fk([[0.1], [0.2]])[0].tolist() == [[0.1, 0, 0], [0.2, 0, 0]]
    assert np.isnan(axes.ik([[0.1, 0.0, 0.0], [0.1, 0.2, 0.0]])).tolist() == [[False], [True]]
    with pytest.raises(ModelError, match="found the joints a, b, c, d, expected one to three"):
        StraightAxes(list("abcd"))


def test_servos_and_references_that_do_not_fit_are_told():
    with pytest.raises(ModelError, match="found position of 9 x 2, expected n x 3 numbers"):
        Rig(DeltaRobot(), [JointServo() for _ in range(3)], period=PERIOD).run(np.zeros((9, 2)))
    with pytest.raises(ModelError, match="found 2 controllers, expected one for each joint"):
        Rig(DeltaRobot(), [JointServo(), JointServo()], period=PERIOD)
    with pytest.raises(Exception, match="unit"):
        Rig(DeltaRobot(), [CartServo() for _ in range(3)], period=PERIOD)


def test_corrections_of_joints_that_slide_and_turn_have_units_of_their_own(tmp_path):
    """A robot of carts and turntables: m of one, rad of the other, in the file and in what reads it."""
    t, u = PERIOD * np.arange(3), np.array([[0.0, 0.0], [1e-3, 2e-3], [0.0, 1e-3]])
    joints = ["carts[0].s", "turntables[0].phi"]
    file = write_corrections(tmp_path / "u.csv", t, joints, u)
    assert file.read_text().splitlines()[0] == "time [s],carts[0].s [m],turntables[0].phi [rad]"
    assert read_corrections(file, joints, t) == pytest.approx(u, abs=1e-15)
    written = file.read_text()
    file.write_text(written.replace("carts[0].s [m]", "carts[0].s [mm]"))
    assert read_corrections(file, joints, t) == pytest.approx(u * [1e-3, 1.0], abs=1e-15)
    file.write_text(written.replace("[rad]", "[m]"))
    with pytest.raises(ModelError, match=r"column turntables\[0\].phi: found 'm', a length, expected an"):
        read_corrections(file, joints, t)


def test_errors_of_joints_that_turn_are_drawn_in_mrad(delta):
    found = learn(delta, square(delta), Learning(window=WINDOW), iterations=1, seed=1)
    assert found.plot("error").axes[0].get_ylabel() == "arms[0].phi [mrad]"
    assert found.plot("tool").axes[0].get_ylabel() == "tool x [mm]"


def test_the_machine_of_the_page_learns_as_a_model_and_as_an_fmu(tmp_path, monkeypatch):
    """The blocks of optimica/README.md, as they stand there."""
    monkeypatch.chdir(tmp_path)
    page = (Path(__file__).parents[3] / "optimica" / "README.md").read_text(encoding="utf-8")
    part = page[page.index("**A machine of your own**") : page.index("**Paths.**")]
    names = {}
    for block in re.findall(r"```python\n(.*?)```", part, re.DOTALL):
        exec(block, names)
    assert names["history"].relative[3, 0] < 0.2
    told = {name: learn(names[name], names["way"], iterations=1).relative[1, 0] for name in ("rig", "plant")}
    assert told["rig"] == pytest.approx(told["plant"], abs=0.01)
