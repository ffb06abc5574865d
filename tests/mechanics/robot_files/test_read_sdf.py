"""Robots from SDF against MuJoCo, with poses worked out here once more, and what is refused or left out."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import ModelError, simulate, translate
from gantrytau.mechanics.robot_files import read_sdf
from tests.mechanics.robot_files import sdf_texts
from tests.mechanics.robot_files.mujoco_reference import Reference
from tests.mechanics.robot_files.sdf_texts import ACROSS, joint, link, written


@dataclass(frozen=True)
class Pose:
    """A place (3,) in m and an orientation."""

    r: np.ndarray
    turn: Rotation

    @staticmethod
    def of(*numbers: float) -> "Pose":
        return Pose(np.array(numbers[:3]), Rotation.from_euler("xyz", numbers[3:] or (0, 0, 0)))

    def __mul__(self, inner: "Pose") -> "Pose":
        return Pose(self.r + self.turn.apply(inner.r), self.turn * inner.turn)

    def seen_from(self, other: "Pose") -> "Pose":
        return Pose(other.turn.inv().apply(self.r - other.r), other.turn.inv() * self.turn)


def text(numbers: np.ndarray) -> str:
    return " ".join(f"{x:.17g}" for x in numbers)


def body(
    name: str, pose: Pose, joints: list[tuple[str, str, Pose, np.ndarray]], inside: str = "", m: float = 1.0
) -> str:
    """The link of `sdf_texts` as an MJCF body; joints: name, kind, pose and axis of each, in the axes of its body."""
    written_joints = "".join(
        f'<joint name="{one}" type="{kind}" pos="{text(at.r)}" axis="{text(axis)}"/>'
        for one, kind, at, axis in joints
    )
    quat = np.roll(pose.turn.as_quat(), 1)
    inertia = f'mass="{m}" diaginertia="{text(PRINCIPAL)}" quat="{text(np.roll(AXES.as_quat(), 1))}"'
    inertial = f'<inertial pos=".2 0 0.01" {inertia}/>'
    return f'<body name="{name}" pos="{text(pose.r)}" quat="{text(quat)}">{written_joints}{inertial}{inside}</body>'


TENSOR = np.array([[0.01, 0.001, 0], [0.001, 0.02, 0], [0, 0, 0.025]])
PRINCIPAL, _columns = np.linalg.eigh(TENSOR)
AXES = Rotation.from_euler("x", 0.3) * Rotation.from_matrix(_columns * np.linalg.det(_columns))
WORLD = Pose.of(0, 0, 0)


def reference(folder: Path, bodies: str, equality: str = "") -> Reference:
    file = folder / "reference.xml"
    file.write_text(f"<mujoco><worldbody>{bodies}</worldbody><equality>{equality}</equality></mujoco>")
    return Reference(file)


def test_poses_relative_to_others_give_the_forces_of_mujoco(tmp_path):
    one = Pose.of(0, 0, 1, 0.1, 0.2, 0.3)
    two = one * Pose.of(0.3, 0.1, 0, 0, 0, 0.5)
    tool = two * Pose.of(0, 0, 0.2, 0, 0, 1)
    three = tool * Pose.of(0, 0, 0.1, 0, np.pi / 2, 0)
    p, q = Pose.of(0, 0, 0.05), (tool * Pose.of(0.1, 0, 0, 0, 1, 0)).seen_from(three)
    axis_p = one.turn.inv().apply([0.0, 1.0, 1.0])
    inner = body("three", three.seen_from(two), [("q", "hinge", q, q.turn.apply([0, 0.3, 1]))], m=0.5)
    inner = body("two", two.seen_from(one), [("s", "slide", WORLD, np.array([1.0, 0, 1]))], inner)
    known = reference(tmp_path, body("one", one, [("p", "hinge", p, axis_p)], inner, 2.0))
    robot = read_sdf(written(tmp_path, sdf_texts.SERIAL))
    speeds = ["p.w", "s.v", "q.w"]
    given = ["p.phi", "s.s", "q.phi", *speeds, *(f"der({one})" for one in speeds)]
    function = translate(robot()).function(given, ["p_drive.tau", "s_drive.f", "q_drive.tau"])
    for state in np.random.default_rng(2).normal(size=(3, 3, 3)):
        expected = known.forces(*state)
        found = np.array(function(*state.ravel())).ravel()
        # some thousand operations on numbers of that size
        assert np.abs(found - expected).max() < 1e-12 * np.abs(expected).max()


def test_joints_close_loops_and_move_for_a_second_as_with_the_exact_constraints_of_mujoco(tmp_path):
    axis = np.array([0.0, -1.0, 0.0])
    crank, coupler, rocker = (
        Pose.of(x, 0, z, 0, pitch, 0) for x, z, pitch in ((0, 0, -np.pi / 2), (0, 0.3, -0.3), (1, 0, -1.2))
    )
    inner = body("coupler", coupler.seen_from(crank), [("pin", "hinge", WORLD, axis)])
    bodies = body("crank", crank, [("turn", "hinge", WORLD, axis)], inner)
    bodies += body("rocker", rocker, [("swing", "hinge", WORLD, axis)])
    known = reference(tmp_path, bodies, '<connect body1="coupler" body2="rocker" anchor="0.9 0 0"/>')
    dae = translate(read_sdf(written(tmp_path, sdf_texts.FOUR_BAR))())
    assert dae.diagnosis.mobility == 1
    motion = simulate(dae, stop=1.0, tolerance=1e-9)
    names = [f"{known.joints[k]}.phi" for k in range(3)]
    end = np.array([motion.final(name) for name in names])
    assert np.abs(end).max() > 0.5
    # a thousand times the integrator's tolerance
    assert np.abs(end - known.motion(1.0, np.zeros(3))).max() < 1e-6


@pytest.mark.parametrize("name", ["HUNG", "GIMBAL", "FREE"])
def test_balls_crosses_and_free_bodies_move_for_a_second_as_in_mujoco(tmp_path, name):
    at = Pose.of(-0.3, 0, 0.1)
    crossed = [("x", "hinge", at, np.array([1.0, 0, 0])), ("y", "hinge", at, np.array([0, 1.0, 0]))]
    bodies = {
        "HUNG": body("bob", WORLD, [("ball", "ball", at, np.ones(3))]),
        "GIMBAL": body("bob", WORLD, crossed),
    }
    base = Pose.of(0, 0, 1, 0.3, 0.2, 0.1)
    arm = body("arm", WORLD.seen_from(base), [("elbow", "hinge", WORLD, np.array([0, -1.0, 0]))])
    bodies["FREE"] = body("base", base, [], f"<freejoint/>{arm}")
    known = reference(tmp_path, bodies[name]).stepped(1.0)
    motion = simulate(read_sdf(written(tmp_path, getattr(sdf_texts, name)))(), stop=1.0, tolerance=1e-9)
    names = {
        "HUNG": ["ball.q"],
        "GIMBAL": ["cross.phi_a", "cross.phi_b"],
        "FREE": ["base.r", "base.q", "elbow.phi"],
    }
    found = np.concatenate([np.atleast_1d(motion.final(one)) for one in names[name]])
    # steps of 1 ms and of order four: errors of 1e-9 and less
    assert np.abs(found - known).max() < 1e-7


def test_what_an_axis_says_is_that_of_the_joint(tmp_path):
    inside = "<axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>inf</upper><effort>5</effort></limit>"
    inside += "<dynamics><damping>.2</damping><friction>3</friction><spring_stiffness>4</spring_stiffness></dynamics></axis>"
    follows = '<axis><mimic joint="p" axis="axis"><multiplier>2</multiplier><reference>.5</reference></mimic></axis>'
    text = (
        link("a", more="<sensor name='eye' type='camera'/>")
        + link("b")
        + joint("p", "revolute", "world", "a", inside)
    )
    robot = read_sdf(
        written(tmp_path, text + joint("q", "revolute", "a", "b", follows) + "<plugin name='x'/>")
    )
    dae = translate(robot())
    assert dae.diagnosis.mobility == 1
    assert dae.evaluate({"p.phi": 0.7})["q.phi"] == pytest.approx(0.4)
    values = {
        name: dae.parameter_values[name] for name in ("p_friction.tau_c", "p_friction.tau_v", "p_spring.c")
    }
    assert values == {"p_friction.tau_c": 3.0, "p_friction.tau_v": 0.2, "p_spring.c": 4.0}
    assert robot.left_out == ("sdf/model[robot]/plugin[x]", "sdf/model[robot]/link[a]/sensor[eye]")


def test_masses_by_collisions_gravity_of_the_world_and_static_models(tmp_path):
    shape = "<collision name='c'><pose>0 0 1 0 0 0</pose><density>500</density><geometry><box><size>.1 .2 .3</size></box>"
    body = f"<link name='a'><inertial auto='true'/>{shape}</geometry></collision></link>"
    values = translate(
        read_sdf(written(tmp_path, body, "<world name='w'><gravity>0 1 -3</gravity>{}</world>"))()
    ).parameter_values
    assert values["a.m"] == pytest.approx(3.0)
    assert values["a.J[0,0]"] == pytest.approx(3.0 * (0.04 + 0.09) / 12)
    assert (values["a.r_cm[2]"], values["world.gravity[1]"], values["world.gravity[2]"]) == (1.0, 1.0, -3.0)
    assert translate(read_sdf(written(tmp_path, link("a") + "<static>1</static>"))()).diagnosis.mobility == 0
    (told,) = read_sdf(written(tmp_path, "<link name='a'/>")).left_out
    assert told.startswith("sdf/model[robot]/link[a]: without <inertial>, so 1 kg")


def test_meshes_of_packages_have_their_mass(tmp_path):
    (tmp_path / "meshes").mkdir()
    corners = "v 0 0 0\nv 0.3 0 0\nv 0 0.2 0\nv 0 0 0.4\n"
    (tmp_path / "meshes" / "wedge.obj").write_text(corners + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    mesh = "<geometry><mesh><uri>model://parts/wedge.obj</uri><scale>1 1 2</scale></mesh></geometry>"
    file = written(
        tmp_path, f"<link name='a'><inertial auto='true'/><collision name='c'>{mesh}</collision></link>"
    )
    values = translate(read_sdf(file, packages={"parts": tmp_path / "meshes"})()).parameter_values
    assert values["a.m"] == pytest.approx(1000 * 0.3 * 0.2 * 0.8 / 6)
    assert values["a.r_cm[2]"] == pytest.approx(0.2)
    with pytest.raises(ModelError, match=r"the mesh model://parts/wedge\.obj without a file"):
        read_sdf(file)


PAIR = link("a") + link("b")


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("", "model[robot]: found no <link>, expected one or more"),
        ("<include/>", "model[robot]/include: found <include> in a model, expected links and joints; `gz"),
        (link("a", '<pose relative_to="c"/>') + joint("q", "ball", "world", "a"), "found the frame 'c'"),
        (link("a", '<pose relative_to="b"/>') + link("b", '<pose relative_to="a"/>'), "relative to itself"),
        (link("a", '<pose rotation_format="quat_xyzw">0 0 0 0 0 0 0</pose>'), "link[a]/pose: found the"),
        (link("a", "<pose>1 2 3</pose>"), "link[a]/pose: found <pose>1 2 3, expected 6 finite numbers"),
        (PAIR + joint("q", "screw", "a", "b"), "joint[q]: found type 'screw', expected a kind of joint"),
        (PAIR + joint("q", "revolute", "a", "c"), "joint[q]: found the frame 'c', expected a link, joint or"),
        (PAIR + joint("q", "revolute", "a", "a"), "joint[q]: found 'a' as both links, expected two links"),
        (PAIR + joint("q", "revolute", "a", "b", ""), "joint[q]: found no <axis>, expected one"),
        (PAIR + joint("q", "revolute", "a", "b", ACROSS.replace("-1", "0")), "axis/xyz: found the axis 0 0"),
        (link("a", m=-1.0), "link[a]/inertial: found -1 kg, expected a mass above 0"),
        (link("a") * 2, "found two links of the name 'a'"),
    ],
)
def test_what_is_no_sdf_is_refused_by_its_place(tmp_path, body, words):
    with pytest.raises(ModelError) as raised:
        read_sdf(written(tmp_path, body))
    assert words in str(raised.value)
    assert raised.value.argument == "file"
