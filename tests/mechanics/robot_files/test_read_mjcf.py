"""Robots from MJCF: forces and motion against MuJoCo, loops closed exactly in both, and what is refused or left out."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, simulate, translate
from gantrytau.mechanics.robot_files import DescribedRobot, read_mjcf
from tests.mechanics.robot_files import mjcf_texts
from tests.mechanics.robot_files.mujoco_reference import Reference


def written(folder: Path, body: str) -> Path:
    file = folder / "robot.xml"
    file.write_text(f'<mujoco model="robot">{body}</mujoco>')
    return file


def coordinates(robot: type[DescribedRobot], joints: list[str], letters: str = "s phi") -> list[str]:
    """Names of the coordinates of joints, or of what is like them."""
    slides, turns = letters.split()
    parts = [robot.names.get(f"joint {joint}", joint) for joint in joints]
    return [f"{part}.{slides if 's' in dir(robot.members()[part]) else turns}" for part in parts]


@pytest.mark.parametrize("name", mjcf_texts.TREES)
def test_trees_need_the_forces_that_mujoco_says(tmp_path, name):
    file = written(tmp_path, mjcf_texts.TREES[name])
    reference = Reference(file)
    robot = read_mjcf(file, driven=reference.joints)
    q, v = (coordinates(robot, reference.joints, letters) for letters in ("s phi", "v w"))
    forces = [f"{one.rpartition('.')[0]}_drive.{'f' if one.endswith('.s') else 'tau'}" for one in q]
    function = translate(robot()).function([*q, *v, *(f"der({one})" for one in v)], forces)
    seeds = np.random.default_rng(1)
    for _ in range(3):
        state = [reference.model.qpos0 + seeds.normal(size=len(q)), *seeds.normal(size=(2, len(q)))]
        known = reference.forces(*state)
        found = np.array(function(*np.concatenate(state))).ravel()
        # some thousand operations on numbers of that size
        assert np.abs(found - known).max() < 1e-11 * np.abs(known).max()


@pytest.mark.parametrize("name", mjcf_texts.LOOPS)
def test_loops_move_for_a_second_as_with_the_exact_constraints_of_mujoco(tmp_path, name):
    file = written(tmp_path, mjcf_texts.LOOPS[name])
    reference = Reference(file)
    robot = read_mjcf(file)
    dae = translate(robot())
    assert dae.diagnosis.mobility == 1
    motion = simulate(dae, stop=1.0, tolerance=1e-9)
    names = coordinates(robot, reference.joints)
    start = np.array([motion[one][0] for one in names])
    assert reference.violation(start) < 1e-9
    if reference.violation(reference.model.qpos0) < 1e-9:  # the pose that is written is closed
        assert np.abs(start - reference.model.qpos0).max() < 1e-9
    end = np.array([motion.final(one) for one in names])
    assert np.abs(end - start).max() > 0.05
    # a thousand times the integrator's tolerance
    assert np.abs(end - reference.motion(1.0, start)).max() < 1e-6


@pytest.mark.parametrize("name", ["BALL", "FREE"])
def test_bodies_on_balls_and_free_ones_move_for_a_second_as_in_mujoco(tmp_path, name):
    file = written(tmp_path, getattr(mjcf_texts, name))
    known = Reference(file).stepped(1.0)
    motion = simulate(read_mjcf(file)(), stop=1.0, tolerance=1e-9)
    names = ["ball.q"] if name == "BALL" else ["base.r", "base.q", "elbow.phi"]
    found = np.concatenate([np.atleast_1d(motion.final(one)) for one in names])
    # steps of 1 ms and of order four: errors of 1e-9 and less
    assert np.abs(found - known).max() < 1e-7


def test_meshes_have_the_inertia_that_mujoco_finds(tmp_path):
    corners = [(0, 0, 0), (0.3, 0, 0), (0, 0.2, 0), (0.1, 0.1, 0.4)]
    faces = [(1, 3, 2), (1, 2, 4), (2, 3, 4), (1, 4, 3)]
    lines = ["v {} {} {}".format(*corner) for corner in corners] + [
        "f {} {} {}".format(*face) for face in faces
    ]
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "wedge.obj").write_text("\n".join(lines))
    body = '<compiler meshdir="parts"/><asset><mesh file="wedge.obj" scale="2 1 1"/></asset><worldbody>'
    body += '<body name="b" pos="0 0 1"><joint name="q" axis="1 2 3"/>'
    body += '<geom type="mesh" mesh="wedge" pos=".1 0 0" quat="1 2 0 0"/></body>'
    file = written(tmp_path, body + "</worldbody>")
    reference = Reference(file)
    dae = translate(read_mjcf(file)())
    found = float(dae.function(["q.phi", "q.w", "der(q.w)"], ["q_drive.tau"])(0.3, 0.0, 2.0))
    # MuJoCo reads meshes in single precision
    assert found == pytest.approx(
        reference.forces(np.array([0.3]), np.zeros(1), np.full(1, 2.0))[0], rel=1e-6
    )


def test_what_is_left_out_is_told_and_sensors_are_variables(tmp_path):
    body = mjcf_texts.SERIAL + '<actuator><motor joint="a" gear="3"/><position joint="c"/></actuator>'
    body += '<contact><exclude body1="one" body2="two"/></contact><sensor><jointpos name="angle" joint="a"/>'
    body += '<framepos name="place" objtype="site" objname="tip"/><accelerometer site="tip"/></sensor>'
    robot = read_mjcf(written(tmp_path, body))
    assert robot.sensors == {"angle": "a.phi", "place": "tip.r"}
    assert robot.left_out == (
        "mujoco/actuator/motor: gear",
        "mujoco/actuator/position",
        "mujoco/sensor/accelerometer",
        "mujoco/contact",
    )
    assert {name for name in robot.members() if name.endswith("_drive")} == {"a_drive", "c_drive"}


def test_files_include_others(tmp_path):
    (tmp_path / "arm.xml").write_text(f"<mujocoinclude>{mjcf_texts.TREE}</mujocoinclude>")
    members = read_mjcf(written(tmp_path, f'<include file="arm.xml"/>{PIN}')).members()
    assert {"swing", "p"} <= set(members)
    (tmp_path / "arm.xml").write_text('<mujocoinclude><include file="arm.xml"/></mujocoinclude>')
    with pytest.raises(ModelError, match=r"arm\.xml which includes itself"):
        read_mjcf(written(tmp_path, '<include file="arm.xml"/>'))


PIN = '<worldbody><body name="a"><joint name="p"/><geom size=".1"/></body></worldbody>'


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("", "robot.xml: found no <worldbody>, expected one"),
        (PIN.replace('name="p"', 'type="pin"'), "body[a]/joint: found type 'pin'"),
        (PIN.replace('name="p"', 'axis="0 0 0"'), 'body[a]/joint: found axis="0 0 0", expected a direction'),
        (PIN.replace('name="p"', 'range="2 1"'), "found range from 2 to 1, expected limits in their order"),
        (PIN.replace(".1", "0"), 'body[a]/geom: found size="0", expected lengths above 0'),
        (PIN.replace("<geom", '<geom class="x"'), "found class 'x', expected a default class"),
        (PIN.replace("<geom", '<geom quat="0 0 0 0"'), 'found quat="0 0 0 0", expected a direction'),
        (PIN.replace("<geom", '<geom type="mesh" mesh="x"'), "found mesh 'x', expected a mesh of <asset>"),
        (PIN.replace("<geom", "<frame/><geom"), "body[a]/frame: found <frame>, expected bodies; MuJoCo"),
        (PIN + '<equality><weld body1="b"/></equality>', "equality/weld: found body1 'b', expected a body"),
        (PIN + '<equality><weld body1="a" body2="a"/></equality>', "found 'a' as both bodies"),
        (PIN + '<equality><joint joint1="p" joint2="p"/></equality>', "'p' which follows twice or itself"),
        (PIN.replace("<geom", "<freejoint/><body><freejoint/></body><geom"), "a free joint, one of several"),
        (PIN.replace("</body>", '<body name="a"/></body>'), "found two bodies or sites of the name 'a'"),
    ],
)
def test_what_is_no_mjcf_is_refused_by_its_place(tmp_path, body, words):
    with pytest.raises(ModelError) as raised:
        read_mjcf(written(tmp_path, body))
    assert words in str(raised.value)
    assert raised.value.argument == "file"


def test_a_curve_between_joints_is_refused(tmp_path):
    file = written(tmp_path, mjcf_texts.GEARED.replace("0 0.2", "0 0.2 1 0 0"))
    with pytest.raises(ModelError, match="a line, its first two numbers"):
        read_mjcf(file)


def test_another_name_of_a_driven_joint_is_refused(tmp_path):
    wrong: Any = "p"
    with pytest.raises(ModelError, match="read_mjcf: found driven='p', expected a list"):
        read_mjcf(written(tmp_path, PIN), driven=wrong)
