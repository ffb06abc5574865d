"""Parameters by their names: a SCARA, five bars, a Delta and an arm of six joints, found from measured poses."""

import itertools
import json
import re
from functools import cache

import numpy as np
import pytest

from gantrytau import Model, ModelError, Start, connect
from gantrytau.kinematics import Kinematics
from gantrytau.kinematics.rotations import of_vector, turned
from gantrytau.mechanics.multibody import Body, FixedTranslation, Prismatic, Revolute, World
from gantrytau_models import DeltaRobot, FiveBar, Pendulum
from gantrytau_optimica import Measurements, calibrate, cross_validate, judge, select_poses
from tests.families import first_of
from tests.kinematics.test_serial_arms import JOINTS, SixJoints

NOISE, ANGLE = 1e-5, 5e-5  # m and rad, per axis
TURN, SHIFT = of_vector(np.array([0.3, -0.2, 1.0])), np.array([1.0, 2.0, 0.5])  # base = TURN measured + SHIFT


class Scara(Model):
    """Two bars that turn about z, and a quill."""

    world, column = World(), FixedTranslation(r=[0.0, 0.0, 0.2])
    shoulder, elbow = Revolute(phi=Start(0.5)), Revolute(phi=Start(1.0))
    upper, fore = FixedTranslation(r=[0.4, 0.0, 0.0]), FixedTranslation(r=[0.3, 0.0, 0.0])
    quill = Prismatic(n=[0.0, 0.0, 1.0], s=Start(-0.1))
    tool = Body(m=1.0, J=np.eye(3))

    def equations(self):
        chain = [
            self.world,
            self.column,
            self.shoulder,
            self.upper,
            self.elbow,
            self.fore,
            self.quill,
            self.tool,
        ]
        for one, other in itertools.pairwise(chain):
            yield connect(one.frame_b, other.frame_a)


SCARA = ["shoulder.phi", "elbow.phi", "quill.s"]
ROBOTS = {  # nominal robot, its joints, parameters, true values, range of joints about the start, whether it is turned
    "scara": (Scara(), SCARA, ["upper.r[0]", "fore.r[0]"], [0.412, 0.295], 0.8, False),
    "five bars": (FiveBar(), None, ["crank_length", "coupler_length"], [0.303, 0.396], 0.5, False),
    "delta": (DeltaRobot(), None, ["arm_length", "rod_length"], [0.304, 0.793], 0.4, False),
    "six joints": (SixJoints(), JOINTS, ["upper.r", "fore.r[0]"], [0.603, -0.002, 0.001, 0.496], 0.7, True),
}  # fmt: skip


def changed(robot, parameters, values):
    """The robot with true values, (k,)."""
    nested = {}
    for name, *_ in [p.partition("[") for p in parameters]:
        owner, _, last = name.rpartition(".")
        inner = nested.setdefault(owner, {}) if owner else nested
        mine = [x for p, x in zip(_elements(parameters), values, strict=True) if p.startswith(name)]
        inner[last] = mine[0] if not owner else [*mine, 0.0, 0.0][:3]
    return robot.modified(nested)


def _elements(parameters):
    return [e for p in parameters for e in ([f"{p}[{k}]" for k in range(3)] if p.endswith(".r") else [p])]


@cache
def true_poses(name, count=60):
    """Joints and true poses of a robot, in the frame of the device."""
    robot, joints, parameters, values, size, turning = ROBOTS[name]
    kinematics = Kinematics(changed(robot, parameters, values), joints=joints)
    q = kinematics.home.q + np.random.default_rng(3).uniform(-size, size, (2 * count, len(kinematics.home.q)))
    r, R = kinematics.fk(q)
    good = np.flatnonzero(np.isfinite(r).all(axis=1))[:count]
    return q[good], (r[good] - SHIFT) @ TURN, TURN.T @ R[good] if turning else None


def measured(name, seed=0):
    q, r, R = true_poses(name)
    random = np.random.default_rng(seed)
    r = r + NOISE * random.standard_normal(r.shape)
    return Measurements(q, r, None if R is None else turned(R, ANGLE * random.standard_normal(r.shape)))


def found_of(name, seed=0, **policy):
    robot, joints, parameters, *_ = ROBOTS[name]
    return calibrate(robot, measured(name, seed), parameters=parameters, joints=joints, **policy)


@pytest.mark.parametrize("name", first_of(ROBOTS))
def test_true_values_are_found_within_three_deviations(name):
    _, _, parameters, values, *_ = ROBOTS[name]
    found = found_of(name)
    assert found.success
    assert found.rank == len(found.names) == 6 + len(values)
    elements = _elements(parameters)
    off = np.array([found.minimum.x[found.names.index(n)] for n in elements]) - values
    # of 4 in 2,000 seeds
    assert np.all(np.abs(off) < 3.5 * np.array([found.deviations[n] for n in elements]))
    assert found.findings == ()
    # three coordinates of 10 um are 16 um in the mean, beside what 30 poses leave of the parameters
    assert 12e-6 < found.error < 24e-6
    np.testing.assert_allclose(found.parameters["frame.t"], SHIFT, atol=3e-4)
    np.testing.assert_allclose(found.parameters["frame.R"], TURN, atol=3e-4)


@pytest.mark.nightly
@pytest.mark.parametrize("name", ROBOTS)
def test_told_deviations_are_those_counted_over_seeds(name):
    """40 seeds tell a deviation to 11 %."""
    runs = [found_of(name, seed, holdout=None) for seed in range(40)]
    values = np.array([run.minimum.x[6:] for run in runs])
    told = np.mean([np.diag(run.covariance(run.names[6:])) for run in runs], axis=0)
    assert 0.8 < np.sqrt(np.mean(told / values.var(axis=0, ddof=1))) < 1.25


def test_what_data_do_not_tell_is_named():
    found = calibrate(
        Scara(), measured("scara"), parameters=["upper.r[0]", "column.r", "tool.m"], joints=SCARA
    )
    (told,) = (f for f in found.findings if f.kind == "undetermined")
    assert "frame.t[0] and column.r[0] cannot be told apart by these data" in str(told)
    assert "nothing that was measured depends on tool.m" in str(told)
    assert "or measure in the base of the robot, frame='base'" in str(told)
    assert found.deviations["tool.m"] == np.inf
    with pytest.raises(ModelError, match=r"data do not hold column.r\[0\].*leave them out of parameters="):
        found.covariance(["column.r"])


def test_in_the_base_no_frame_is_fitted_and_a_prior_holds_what_data_do_not():
    q, r, _ = true_poses("scara")
    data = Measurements(q, r @ TURN.T + SHIFT)
    names = ["upper.r[0]", "fore.r[0]", "column.r"]
    found = calibrate(Scara(), data, parameters=names, joints=SCARA, frame="base")
    assert "frame.R" not in found.parameters
    assert found.rank == 5
    assert found.parameters["column.r"] == pytest.approx([0.0, 0.0, 0.2], abs=1e-9)
    held = calibrate(Scara(), measured("scara"), parameters=names, joints=SCARA, prior={"column.r": 1e-3})
    assert held.undetermined == ()
    assert held.deviations["column.r[0]"] == pytest.approx(1e-3, rel=0.05)


@pytest.mark.parametrize("loss", ["linear", "robust"])
def test_a_stray_pose_is_told_and_a_robust_fit_leaves_it_out(loss):
    data = measured("scara")
    r = data.r.copy()
    r[6] += 0.01
    found = calibrate(
        Scara(), Measurements(data.q, r), parameters=["upper.r[0]", "fore.r[0]"], joints=SCARA, loss=loss
    )
    assert [(f.kind, f.rows.tolist()) for f in found.findings] == [("outliers", [6])]
    assert (found.error < 3e-5) == (loss == "robust")


def test_a_robust_fit_follows_the_majority_of_poses():
    """The device moves by 10 mm behind 24 of 60 poses: least squares are led so far that no pose fits beside them."""
    _, _, parameters, values, *_ = ROBOTS["five bars"]
    built, random = Kinematics(changed(FiveBar(), parameters, values)), np.random.default_rng(0)
    q = built.home.q + random.uniform(-0.5, 0.5, (60, 2))
    r = built.fk(q)[0] + NOISE * random.standard_normal((60, 3))
    r[:24, 0] += 0.01
    found = calibrate(FiveBar(), Measurements(q, r), parameters=parameters, loss="robust")
    assert [(f.kind, f.rows.tolist()) for f in found.findings] == [("outliers", [*range(24)])]
    for name, value in zip(parameters, values, strict=True):
        assert abs(found.parameters[name] - value) < 3.5 * found.deviations[name] < 5e-5


def test_a_parameter_that_is_off_and_was_not_named_is_told():
    found = calibrate(Scara(), measured("scara"), parameters=["upper.r[0]"], joints=SCARA)
    assert {f.kind for f in found.findings} & {"trend", "not white", "outliers", "misfit"}


def test_verdict_cross_validation_and_report(tmp_path):
    robot, joints, parameters, *_ = ROBOTS["scara"]
    checked = cross_validate(robot, measured("scara"), parameters=parameters, joints=joints, parts=2)
    assert 14e-6 < checked.error < 20e-6
    good = judge(checked, wanted=30e-6)
    assert good.good
    assert "fitted beside the parameters" in str(good)
    assert not judge(checked, wanted=5e-6).good
    found = checked.calibration
    told = json.loads(found.report(tmp_path / "scara.html").with_suffix(".json").read_text())
    assert told["robot"] == "Scara"
    assert told["deviations"]["fore.r[0]"] == pytest.approx(found.deviations["fore.r[0]"])
    assert "standard deviation" in str(found.__describe__())
    q, r, _ = true_poses("scara")
    there, _ = found.kinematics.fk(q)
    np.testing.assert_allclose(there, r @ TURN.T + SHIFT, atol=5e-5)  # five deviations


@pytest.mark.parametrize("method", first_of(["d-optimal", "tool", "random"]))
def test_poses_are_selected_for_named_parameters(method):
    robot, joints, parameters, *_ = ROBOTS["scara"]
    data = measured("scara")
    rows, others = (
        select_poses(robot, data, 10, method=m, parameters=parameters, joints=joints)
        for m in (method, "random")
    )
    told = []
    for each in (rows, others):
        found = calibrate(robot, data.select(each), parameters=parameters, joints=joints, holdout=None)
        told.append(found.expected.mean() / found.noise)
    assert len(rows) == 10
    assert told[0] <= 1.3 * told[1]


@pytest.mark.parametrize(
    ("change", "names"),
    [
        (dict(parameters=["uper.r"]), "upper.r"),
        (dict(parameters="upper.r"), "parameters"),
        (dict(method="ipopt"), "method"),
        (dict(joints=SCARA[:2]), "shoulder.phi, elbow.phi"),
        (dict(prior={"upperr": 1e-3}), "upperr"),
        (dict(prior={"upper.r[0]": 0.0}), "upper.r[0]"),
        (dict(robot=3), "robot"),
        (dict(robot=Pendulum(), parameters=["length"], joints=["phi"]), "tool.r"),
    ],
)
def test_what_does_not_fit_is_refused(change, names):
    policy = dict(robot=Scara(), parameters=["upper.r[0]"], joints=SCARA) | change
    with pytest.raises(ModelError, match=re.escape(names)):
        calibrate(policy.pop("robot"), measured("scara"), **policy)
