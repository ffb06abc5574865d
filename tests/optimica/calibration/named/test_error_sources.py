"""Cyclic racks, ball screws on turntables, sagging links and wrists: their numbers found from simulated poses, and told
where a model lacks them.
"""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from gantrytau import Model, ModelError, Start, connect, translate
from gantrytau.kinematics import Kinematics, TurntableScrew
from gantrytau.kinematics.rotations import turned
from gantrytau.mechanics.gears import ScrewLever
from gantrytau.mechanics.multibody import Body, FixedTranslation, Revolute, World
from gantrytau_models import (
    F1OnScrews,
    GantryTau,
    GantryTauOnRacks,
    SaggingGantryTau,
    SerialWrist,
    prototypes,
)
from gantrytau_optimica import Measurements, calibrate
from gantrytau_optimica.calibration.fitting.tool_function import tool_function
from tests.mechanisms.rows import in_a_row

NOISE, ANGLE = 1e-5, 5e-5  # m and rad, per axis
SHARE = 4.0  # deviations that a true value may be off, of 15 at most: once in a thousand seeds
LENGTHS = [f"arms[{i}].length" for i in range(3)]


def measured(robot, names, true, moves, *, joints=None, turning=False, tool="tool", count=60):
    """Noisy poses of the robot with the true values (k,) of named numbers, joints moved evenly by +-moves (n,) about the
    start; what was measured is told to be as sure as it is.
    """
    function = tool_function(robot, names, joints, turning, tool)
    home, rng = function.dae.evaluate(), np.random.default_rng(0)
    q = np.array([home[j] for j in function.joints]) + rng.uniform(-1, 1, (count, len(moves))) * moves
    r, R = function(q, np.asarray(true))
    R = None if R is None else turned(R, ANGLE * rng.standard_normal(r.shape))
    data = Measurements(q, r + NOISE * rng.standard_normal(r.shape), R)
    return data if turning else data.uncertain(np.tile(NOISE**2 * np.eye(3), (count, 1, 1)))


def assert_found(found, names, true):
    """All named numbers within a few of their own deviations."""
    x = np.array([found.minimum.x[found.names.index(n)] for n in names])
    assert np.all(np.abs(x - true) < SHARE * np.array([found.deviations[n] for n in names]))
    assert found.findings == ()


def test_cyclic_errors_of_racks_are_found_and_missed_by_a_model_without():
    robot = GantryTauOnRacks(prototypes.L1, racks=[dict(pitch=12.3e-3)] * 3)
    joints, waves = (
        [f"racks[{i}].s" for i in range(3)],
        [f"racks[{i}].{n}" for i in range(3) for n in ("cosine", "sine")],
    )
    true = [30e-6, -40e-6, -20e-6, 45e-6, 10e-6, 23e-6]  # as large as those that make Table 5.3
    data = measured(robot, waves, true, [0.3] * 3, joints=joints)
    found = calibrate(robot, data, parameters=[*LENGTHS, *waves], joints=joints, frame="base")
    assert_found(found, waves, true)
    without = calibrate(GantryTau(prototypes.L1), data)  # by the closure of its links, 21 numbers
    assert without.error > 4 * found.error
    assert "noise larger" in {f.kind for f in without.findings}


def test_sag_does_the_work_of_the_weight():
    """Clapeyron: m g z = sum of compliance f^2, to first order in the sag; and none where links are stiff."""
    give = np.array([2.5e-6, 2e-6, 1.25e-6])
    robot = SaggingGantryTau(prototypes.L1, arms=[dict(compliance=c) for c in give])
    at = translate(robot).evaluate()
    stiff = Kinematics(GantryTau(prototypes.L1)).fk(np.ones(3))[0]
    f = np.array([at[f"arms[{i}].f"] for i in range(3)])
    work = prototypes.L1.plate_mass * 9.81 * (stiff[2] - at["tool.r"][2])
    assert work == pytest.approx(float(give @ f**2), rel=1e-3)  # sag over length, 2e-4, times some
    none = translate(SaggingGantryTau(prototypes.L1)).evaluate()["tool.r"]
    np.testing.assert_allclose(none, stiff, atol=1e-12)


def test_compliance_of_links_is_found_and_missed_by_a_model_without():
    robot, joints = SaggingGantryTau(prototypes.L1), [f"arms[{i}].s" for i in range(3)]
    names, true = [f"arms[{i}].compliance" for i in range(3)], [2.5e-6, 2e-6, 1.25e-6]
    data = measured(robot, names, true, [0.4] * 3, joints=joints)
    found = calibrate(robot, data, parameters=[*LENGTHS, *names], joints=joints, frame="base")
    assert_found(found, names, true)
    without = calibrate(robot, data, parameters=LENGTHS, joints=joints, frame="base")
    assert without.error > 2 * found.error
    assert "noise larger" in {f.kind for f in without.findings}


# An arm of two joints, the first turned by a ball screw as the turntables of an F1 are.
class OnAScrew(Model):
    world, screw, table = World(), ScrewLever(), Revolute()
    arm, elbow = FixedTranslation(r=[0.5, 0.0, 0.0]), Revolute(phi=Start(0.5))
    fore, tool = FixedTranslation(r=[0.3, 0.0, 0.0]), Body(m=1.0)

    def equations(self):
        chain = [self.world, self.table, self.arm, self.elbow, self.fore, self.tool]
        for one, other in pairwise(chain):
            yield connect(one.frame_b, other.frame_a)
        yield connect(self.screw.flange_b, self.table.axis)


def test_places_of_the_pivots_of_a_screw_are_found():
    joints, names, true = (
        ["screw.s", "elbow.phi"],
        ["screw.base", "screw.crank", "screw.angle"],
        [0.303, 0.099, 1.56],
    )
    data = measured(OnAScrew(), names, true, [0.04, 1.5], joints=joints)
    found = calibrate(OnAScrew(), data, parameters=names, joints=joints, frame="base")
    assert_found(found, names, true)
    without = calibrate(OnAScrew(), data, parameters=["arm.r", "fore.r"], joints=joints, frame="base")
    assert without.error > 4 * found.error
    assert "noise larger" in {f.kind for f in without.findings}


def test_turntables_of_an_f1_turn_as_the_law_of_cosines_says():
    at = translate(F1OnScrews(prototypes.F1)).evaluate()
    screw = TurntableScrew(**{n: at[f"screws[0].{n}"] for n in ("base", "crank", "angle", "lead")})
    for k in range(3):
        assert at[f"screws[{k}].flange_a.phi"] == pytest.approx(
            screw.motor(at[f"turntables[{k}].phi"]), abs=1e-12
        )
        assert at[f"screws[{k}].s"] == pytest.approx(
            at[f"screws[{k}].flange_a.phi"] * screw.lead / (2 * np.pi)
        )


# A wrist alone: where the plate is changes nothing of what its joints tell.
Mounted = in_a_row("Mounted", world=World(), mount=FixedTranslation(r=[0.3, 0.2, 0.5]), wrist=SerialWrist())


def test_a_wrist_is_calibrated_but_for_what_its_axes_hide():
    """15 numbers: of those along or about an axis, only sums with the next body's count."""
    names = [f"wrist.joints[{k}].{n}" for k in range(2) for n in ("offset", "tilt")] + ["wrist.offset"]
    nominal = tool_function(Mounted(), names, None, True, "wrist").nominal
    true = nominal + 1e-3 * np.random.default_rng(1).standard_normal(15)
    data = measured(Mounted(), names, true, [1.5, 1.5], turning=True, tool="wrist")
    found = calibrate(Mounted(), data, parameters=names, tool="wrist", frame="base")
    assert found.rank == 12
    assert {n.removeprefix("wrist.") for n in found.undetermined} == {
        "joints[0].offset[2]", "joints[1].offset[2]", "joints[0].tilt[2]",
        "joints[1].tilt[2]", "joints[1].offset[1]", "offset[1]",
    }  # fmt: skip
    assert found.error < 20e-6  # 16 um of noise, and what 30 poses leave
    without = calibrate(Mounted(), data, parameters=["wrist.offset"], tool="wrist", frame="base")
    assert without.error > 10 * found.error


def test_names_of_components_that_are_not_there_and_options_without_parameters():
    data = Measurements(np.zeros((30, 3)), np.ones((30, 3)))
    with pytest.raises(ModelError, match=r"no 'wrist\.r'"):
        calibrate(GantryTau(prototypes.L1), data, parameters=["arms[0].length"], tool="wrist")
    options: list[dict[str, Any]] = [dict(tool="wrist"), dict(joints=["carts[0].s"])]
    for option in options:
        with pytest.raises(ModelError, match="parameters") as refusal:
            calibrate(GantryTau(prototypes.L1), data, **option)
        assert refusal.value.argument in option
