"""Robots from URDF and MJCF as Pinocchio reads them: mass matrix, bias, and accelerations with loops."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio  # pyright: ignore[reportMissingImports]
import pytest

from gantrytau import translate
from gantrytau.mechanics.robot_files import read_mjcf, read_urdf
from tests.mechanics.robot_files import mjcf_texts
from tests.mechanics.robot_files.urdf_texts import joint

pin: Any = pinocchio
LETTERS = {True: ("s", "v", "f"), False: ("phi", "w", "tau")}


NO_PRODUCTS = 'ixy="0" ixz="0" iyz="0"'  # Pinocchio asks for all


def link(name: str, m: float) -> str:
    inertia = '<inertia ixx=".03" iyy=".02" izz=".025" ixy=".001" ixz="-.002" iyz="0"/>'
    centre = '<origin xyz=".1 -.2 .3" rpy=".5 1.5707963267948966 .2"/>'
    return f'<link name="{name}"><inertial>{centre}<mass value="{m}"/>{inertia}</inertial></link>'


def urdf(links: str, joints: str) -> str:
    return f'<robot name="robot"><link name="base"/>{links}{joints}</robot>'


def turned(name: str, kind: str, parent: str, child: str, axis: str) -> str:
    where = f'<origin xyz="0.2 0.1 {len(name)}e-1" rpy="0.3 1.2 -0.4"/><axis xyz="{axis}"/>'
    return joint(name, kind, parent, child, f'{where}<limit lower="-9" upper="9" effort="9" velocity="9"/>')


HEAVY = link("a", 2.0) + link("b", 1.0) + link("c", 0.5)
ROBOTS = {
    "serial": urdf(
        HEAVY,
        turned("p", "revolute", "base", "a", "0 1 1")
        + turned("qq", "prismatic", "a", "b", "1 0 1")
        + turned("rrr", "revolute", "b", "c", "1 2 3"),
    ),
    "tree": urdf(
        HEAVY,
        turned("p", "prismatic", "base", "a", "1 0 0")
        + turned("qq", "revolute", "a", "b", "0 0 1")
        + turned("rrr", "revolute", "a", "c", "0 1 0"),
    ),
    "sliders": urdf(
        HEAVY,
        turned("p", "prismatic", "base", "a", "1 0 0")
        + turned("qq", "prismatic", "a", "b", "0 1 0")
        + turned("rrr", "prismatic", "b", "c", "0 0 1"),
    ),
    "welded links": urdf(
        HEAVY,
        turned("p", "revolute", "base", "a", "0 1 0")
        + turned("qq", "fixed", "a", "b", "1 0 0")
        + turned("rrr", "revolute", "b", "c", "0 1 0"),
    ),
    **{
        f"MJCF {name}": f'<mujoco model="robot">{mjcf_texts.TREES[name]}</mujoco>'
        for name in ("tree", "upright")
    },
}


@pytest.mark.parametrize("name", ROBOTS)
def test_trees_have_the_mass_matrix_and_the_bias_of_pinocchio(tmp_path, name):
    file = tmp_path / f"robot.{'xml' if name.startswith('MJCF') else 'urdf'}"
    file.write_text(ROBOTS[name])
    read, build = (
        (read_mjcf, pin.buildModelFromMJCF)
        if name.startswith("MJCF")
        else (read_urdf, pin.buildModelFromUrdf)
    )
    model = build(str(file))
    data, n = model.createData(), model.nv
    joints = list(model.names)[1:]
    robot = read(file, driven=joints)
    letters = [LETTERS["s" in dir(robot.members()[one])] for one in joints]
    q, v, f = (
        [f"{one}{kind}.{letter[k]}" for one, letter in zip(joints, letters, strict=True)]
        for k, kind in enumerate(("", "", "_drive"))
    )
    function = translate(robot()).function([*q, *v, *(f"der({one})" for one in v)], f)
    seeds = np.random.default_rng(3)
    for _ in range(3):
        at, speed = seeds.normal(size=(2, n))
        bias = np.array(function(*at, *speed, *np.zeros(n))).ravel()
        still = np.array(function(*at, *np.zeros(2 * n))).ravel()
        M = np.array([np.array(function(*at, *np.zeros(n), *row)).ravel() - still for row in np.eye(n)])
        known = pin.crba(model, data, at)
        known = np.triu(known) + np.triu(known, 1).T
        scale = np.abs(known).max()
        # some thousand operations on numbers of that size
        assert np.abs(M - known).max() < 1e-11 * max(scale, np.abs(still).max())
        expected = pin.nonLinearEffects(model, data, at, speed)
        assert np.abs(bias - expected).max() < 1e-11 * np.abs(expected).max()


CONSTRAINT = """<constraint name="pin" type="revolute"><parent link="rocker"/><parent_origin xyz="0.6 0 0"/>
  <parent_axis xyz="0 -1 0"/><child link="coupler"/><child_origin xyz="0.9 0 0"/><child_axis xyz="0 -1 0"/></constraint>"""


def test_a_constraint_of_urdf_closes_a_loop_with_the_accelerations_of_pinocchio(tmp_path):
    tree = (
        Path(__file__).with_name("four_bar.urdf").read_text().replace("<inertia ", f"<inertia {NO_PRODUCTS} ")
    )
    file = tmp_path / "four_bar.urdf"
    file.write_text(tree.replace("</robot>", f"{CONSTRAINT}</robot>"))
    dae = translate(
        read_urdf(file, {"driven": ["crank_pivot"], "start": {"crank_pivot": 1.0, "rocker_pivot": 1.5}})()
    )
    assert dae.diagnosis.mobility == 1
    angles = ["crank_pivot", "crank_pin", "rocker_pivot"]
    find = [f"{one}.{letter}" for letter in ("phi", "w") for one in angles] + [
        f"der({one}.w)" for one in angles
    ]
    function = dae.function(["crank_pivot.phi", "crank_pivot.w", "crank_pivot_drive.tau"], find)
    found = dict(zip(find, map(float, function(1.1, 2.0, 3.0)), strict=True))
    model = pin.buildModelFromXML(tree)
    order = list(model.names)[1:]
    q, v, a = (np.array([found[key.format(one)] for one in order]) for key in ("{}.phi", "{}.w", "der({}.w)"))
    tau = np.array([3.0 if one == "crank_pivot" else 0.0 for one in order])
    ends = [model.getJointId(one) for one in ("rocker_pivot", "crank_pin")]
    at = [pin.SE3(np.eye(3), np.array([x, 0.0, 0.0])) for x in (0.6, 0.9)]
    loop = pin.RigidConstraintModel(
        pin.ContactType.CONTACT_3D, model, ends[0], at[0], ends[1], at[1], pin.LOCAL
    )
    loops, data, contacts = (
        pin.StdVec_RigidConstraintModel(),
        model.createData(),
        pin.StdVec_RigidConstraintData(),
    )
    loops.append(loop)
    contacts.append(loop.createData())
    pin.initConstraintDynamics(model, data, loops, contacts)
    settings = pin.ProximalSettings(1e-14, 1e-12, 50)
    known = pin.constraintDynamics(
        model, data, pin.integrate(model, pin.neutral(model), q), v, tau, loops, contacts, settings
    )
    assert np.abs(known).max() > 1
    # the proximal iterations of Pinocchio stop at 1e-12
    assert np.abs(a - known).max() < 1e-8 * np.abs(known).max()
