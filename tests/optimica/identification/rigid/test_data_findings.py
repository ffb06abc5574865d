"""What is told of a fit by what it leaves: late forces, and fixed values that are wrong."""

from dataclasses import replace

import numpy as np
import pytest

from gantrytau import translate
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import MotionLog, identify
from tests.optimica.identification import gantry_logs as logs

NO_LINKS = dict(link_masses=0)


def told(found):
    return {finding.kind: finding.message for finding in found.findings}


@pytest.mark.parametrize(("extras", "late"), [(logs.PLAIN, 1), (logs.REAL, -1), (logs.REAL, 2)])
def test_forces_that_come_late_by_one_sample_are_told(extras, late):
    log = logs.log(0, extras)
    inner = slice(10, -10)
    shifted = MotionLog(log.t[inner], log.q[inner], np.roll(log.f, late, axis=0)[inner])
    message = told(identify(logs.robot(), shifted, fixed=NO_LINKS))["delay"]
    samples = float(message.split()[2])
    assert samples == pytest.approx(abs(late), abs=0.2)
    assert ("late" if late > 0 else "early") in message
    assert f"shift the columns of f by {-late:+d} rows" in message
    mended = MotionLog(shifted.t[5:-5], shifted.q[5:-5], np.roll(shifted.f, -late, axis=0)[5:-5])
    assert "delay" not in told(identify(logs.robot(), mended, fixed=NO_LINKS))  # the remedy helps


@pytest.mark.parametrize("extras", [logs.PLAIN, logs.REAL])
def test_forces_in_time_and_links_left_out_are_not_told(extras):
    for fixed in ({}, NO_LINKS, dict(plate_mass=9.13, link_masses=[0.8, 0.8, 1.2])):
        found = told(identify(logs.robot(), logs.log(0, extras), fixed=fixed))
        assert not {"delay", "fixed", "unit of force"} & set(found)


def test_fixed_values_that_the_motion_contradicts_are_named():
    log = logs.log(0)
    found = told(identify(logs.robot(), log, fixed=NO_LINKS | dict(plate_mass=20.0)))
    assert "the motion contradicts plate_mass = 20, which would be" in found["fixed"]
    assert "cart_masses" not in found["fixed"]
    frictions = dict(coulomb=[200.0, 145.0, 194.0])
    found = told(identify(logs.robot(), log, fixed=NO_LINKS | frictions))
    assert "coulomb[0] = 200, which would be 128." in found["fixed"]
    assert "coulomb[2]" not in found["fixed"]
    pairs = dict(coulomb=[[128.0, 200.0], [145.0, 145.0], [300.0, 320.0]])
    found = told(identify(logs.robot(), log, fixed=NO_LINKS | pairs))
    assert "coulomb[2] = 300 to 320, which would be 19" in found["fixed"]


def test_the_robot_that_was_found_has_what_was_fixed():
    """A robot whose record says otherwise: links of 1 kg, and frictions of another day."""

    other = GantryTau(replace(prototypes.L1, link_masses=(1.0, 1.0, 1.0), plate_mass=3.0))
    fixed = dict(link_masses=0, plate_mass=10.5, viscous=[100.0, 350.0, 380.0])
    robot = identify(other, logs.log(0), fixed=fixed).robot
    values = translate(robot).parameter_values
    assert [values[f"arms[{i}].link.m"] for i in range(3)] == [0.0, 0.0, 0.0]
    assert values["plate_mass"] == 10.5
    assert [values[f"carts[{i}].law.f_v"] for i in range(3)] == [100.0, 350.0, 380.0]
    assert values["carts[0].law.f_c"] == pytest.approx(128.6, rel=0.05)


def test_friction_that_is_another_near_rest_is_told_and_the_remedy_helps():
    """A sign that is smoothed by tanh, and Stribeck friction."""
    log = logs.log(0)
    _, _, v, *_ = logs.motion()
    smooth = MotionLog(log.t, log.q, log.f + logs.COULOMB * (np.tanh(v / 0.05) - np.sign(v)))
    messages = [
        f.message
        for f in identify(logs.robot(), smooth, fixed=NO_LINKS).findings
        if f.kind == "law of friction"
    ]
    assert len(messages) == 3
    assert all("falls by" in words and "friction='stribeck'" in words for words in messages)
    rising = identify(logs.robot(), logs.log(0, logs.Extras(stribeck=60.0)), fixed=NO_LINKS)
    messages = [f.message for f in rising.findings if f.kind == "law of friction"]
    assert any("rises by" in words for words in messages)
    speed = max(float(words.rsplit("minimum_speed=")[1].split(",")[0]) for words in messages)
    mended = identify(
        logs.robot(), logs.log(0, logs.Extras(stribeck=60.0)), fixed=NO_LINKS, minimum_speed=speed
    )
    assert "law of friction" not in told(mended)
    assert abs(mended.parameters["coulomb[0]"] - logs.COULOMB[0]) < 0.5 * abs(
        rising.parameters["coulomb[0]"] - logs.COULOMB[0]
    )


@pytest.mark.parametrize(("factor", "words"), [(1 / 190, "times smaller"), (1e3, "times larger")])
def test_forces_in_another_unit_are_told(factor, words):
    log = logs.log(0)
    found = told(identify(logs.robot(), MotionLog(log.t, log.q, factor * log.f), fixed=NO_LINKS))
    assert words in found["unit of force"]
