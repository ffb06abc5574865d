"""Robots from URDF files: against Pinocchio, against the same robots from components, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gantrytau import (
    DoubtfulResult,
    InitializationError,
    Model,
    ModelError,
    Result,
    connect,
    flatten,
    simulate,
    translate,
)
from gantrytau.mechanics.multibody import Body, FixedTranslation, Prismatic, Revolute, World
from gantrytau.mechanics.robot_files import read_urdf
from gantrytau.viewing.film import film_of
from gantrytau.viewing.solids import solids
from gantrytau_models import FourBar
from tests.mechanics.robot_files.urdf_texts import joint, link, read
from tests.mechanisms.rows import row

HERE = Path(__file__).parent
HALF_TURN = np.pi


def test_a_random_tree_has_the_forces_and_the_places_that_pinocchio_says():
    known = json.loads((HERE / "random_tree.json").read_text())
    dae = translate(read_urdf(HERE / "random_tree.urdf")())
    letters = {q: ("s", "v", "f") if q in ("q2", "q7") else ("phi", "w", "tau") for q in known["joints"]}
    given = [f"{q}.{s}" for q, (s, _, _) in letters.items()] + [
        f"{q}.{v}" for q, (_, v, _) in letters.items()
    ]
    given += [f"der({q}.{v})" for q, (_, v, _) in letters.items()]
    forces = [f"{q}_drive.{f}" for q, (_, _, f) in letters.items()]
    function = dae.function(given, [*forces, "l5.r", "l7.r"])
    assert len(known["cases"]) == 3
    for case in known["cases"]:
        found = [np.array(x).ravel() for x in function(*case["q"], *case["v"], *case["a"])]
        scale = np.abs(case["forces"]).max()
        # some thousand operations on numbers of that size
        assert np.abs(np.concatenate(found[:-2]) - case["forces"]).max() < 1e-13 * 100 * scale
        assert np.abs(found[-2] - case["l5"]).max() < 1e-13
        assert np.abs(found[-1] - case["l7"]).max() < 1e-13


def test_a_four_bar_of_a_tree_and_a_loop_moves_as_the_one_from_components():
    robot = read_urdf(HERE / "four_bar.urdf", HERE / "four_bar.loops.toml")
    dae = translate(robot())
    assert dae.diagnosis.mobility == 1
    assert dae.states == ("crank_pivot.phi", "crank_pivot.w")
    own = simulate(dae, stop=1.0, inputs={"crank_pivot_drive.tau": 2.0}, tolerance=1e-10)
    known = simulate(FourBar(), stop=1.0, inputs={"torque": 2.0}, starts={"crank.phi": 1.0}, tolerance=1e-10)
    # a thousand times the integrator's tolerance
    assert np.abs(own["crank_pivot.phi"] - known["crank.phi"]).max() < 1e-7
    assert np.abs(own["rocker_pivot.phi"] - known["rocker.phi"]).max() < 1e-7
    assert np.abs(own["crank_pin.phi"] - (known["coupler.phi"] - known["crank.phi"])).max() < 1e-7


@pytest.mark.parametrize("kind", ["spherical", "cylindrical", "universal"])
def test_the_planar_loop_closes_by_any_joint_that_lets_it_turn(kind):
    loops = {
        "driven": ["crank_pivot"],
        "loop": [
            dict(
                kind=kind,
                link_a="rocker",
                link_b="coupler",
                origin_a=dict(xyz=[0.6, 0, 0]),
                origin_b=dict(xyz=[0.9, 0, 0]),
                axis=[0, -1, 0],
                axis_b=[1, 0, 0],
            )
        ],
        "start": dict(crank_pivot=1.0, crank_pin=-0.73, rocker_pivot=1.43),
    }
    dae = translate(read_urdf(HERE / "four_bar.urdf", loops)())
    known = translate(FourBar()).evaluate({"crank.phi": 1.2})
    assert dae.diagnosis.mobility == 1
    assert dae.evaluate({"crank_pivot.phi": 1.2})["rocker_pivot.phi"] == pytest.approx(
        known["rocker.phi"], abs=1e-9
    )


@pytest.mark.parametrize("kind", ["revolute", "spherical"])
def test_a_parallelogram_that_is_mounted_by_half_turns_starts_as_it_is_written(tmp_path, kind):
    def pivot(name, parent, child, x, pitch):
        where = f'<origin xyz="{x} 0 0" rpy="{HALF_TURN!r} {pitch} {HALF_TURN!r}"/><axis xyz="0 -1 0"/>'
        return joint(name, "continuous", parent, child, where)

    body = '<link name="base"/>' + link("left") + link("top") + link("right")
    body += pivot("p", "base", "left", 0, 1.2) + pivot("q", "left", "top", 0.4, -1.2)
    body += pivot("u", "base", "right", 1, 1.2) + f'<constraint name="k" type="{kind}"><parent link="right"/>'
    body += '<parent_origin xyz="0.4 0 0"/><parent_axis xyz="0 -1 0"/><child link="top"/><child_origin xyz="1 0 0"/>'
    dae = translate(read(tmp_path, body + "</constraint>", loops={"driven": ["p"]})())
    found = dae.evaluate({})
    assert [found[f"{name}.phi"] for name in "pqu"] == pytest.approx([0, 0, 0], abs=1e-12)
    assert dae.diagnosis.mobility == 1


@pytest.mark.parametrize(
    "rpy", [(0, 0, 0), (0, HALF_TURN / 2, 0), (HALF_TURN, 0, HALF_TURN), (0.3, -1.2, 2.8)]
)
def test_the_inertia_stands_in_the_axes_of_its_origin(tmp_path, rpy):
    body = (
        f'<link name="base"/><link name="arm"><inertial><origin xyz="0 0 0" rpy="{rpy[0]} {rpy[1]} {rpy[2]}"/>'
        '<mass value="2"/><inertia ixx="0.1" iyy="0.2" izz="0.25"/></inertial></link>'
        + joint("q", "continuous", "base", "arm", '<axis xyz="0 0 1"/>')
    )
    dae = translate(read(tmp_path, body)())
    torque = dae.function(["q.phi", "q.w", "der(q.w)"], ["q_drive.tau"])(0, 0, 1)
    # z in its axes
    x, y, z = (-np.sin(rpy[1]), np.cos(rpy[1]) * np.sin(rpy[0]), np.cos(rpy[1]) * np.cos(rpy[0]))
    assert float(torque) == pytest.approx(0.1 * x**2 + 0.2 * y**2 + 0.25 * z**2, abs=1e-14)


def test_a_planar_joint_has_three_coordinates_and_a_floating_one_six(tmp_path):
    across = '<axis xyz="0 0 1"/>'
    planar = read(tmp_path, '<link name="base"/>' + link("car") + joint("p", "planar", "base", "car", across))
    flying = read(tmp_path, '<link name="base"/>' + link("drone") + joint("f", "floating", "base", "drone"))
    slides = simulate(planar(), stop=1.0, starts={"p.along_x.v": 1.0, "p.along_y.v": 2.0, "p.turn.w": 3.0})
    assert slides.final("car.r")[2] == pytest.approx(0, abs=1e-12)
    assert np.linalg.norm(slides.final("car.r")) == pytest.approx(np.sqrt(5), abs=1e-6)
    falls = simulate(flying(), stop=1.0)
    assert falls.final("drone.r")[2] == pytest.approx(-9.81 / 2, abs=1e-6)


@pytest.mark.parametrize(
    "kinds", [("revolute", "revolute"), ("prismatic", "prismatic"), ("prismatic", "revolute")]
)
def test_a_joint_that_mimics_another_follows_it_and_loads_it(tmp_path, kinds):
    body = '<link name="base"/>' + link("one") + link("two", 2.0)
    body += joint("a", kinds[1], "base", "one", '<axis xyz="0 0 1"/>')
    body += joint(
        "b", kinds[0], "base", "two", '<axis xyz="1 0 0"/><mimic joint="a" multiplier="0.5" offset="0.1"/>'
    )
    robot = read(tmp_path, body)
    coordinate = {"revolute": "phi", "prismatic": "s"}
    force = {"revolute": "tau", "prismatic": "f"}
    dae = translate(robot())
    assert dae.diagnosis.mobility == 1
    own = f"a.{coordinate[kinds[1]]}"
    assert dae.evaluate({own: 0.4})[f"b.{coordinate[kinds[0]]}"] == pytest.approx(0.3)
    rate = own.replace("phi", "w").replace(".s", ".v")
    found = dae.function([own, rate, f"der({rate})"], [f"a_drive.{force[kinds[1]]}"])(0, 0, 1)
    inertia = {"revolute": (0.1, 0.1), "prismatic": (1.0, 2.0)}
    weight = 9.81 if kinds[1] == "prismatic" else 0.0
    expected = inertia[kinds[1]][0] + 0.25 * inertia[kinds[0]][1] + weight
    assert float(found) == pytest.approx(expected, abs=1e-12)
    assert "b_drive" not in robot.members()


def test_limits_and_friction_of_the_file_are_those_of_the_joint(tmp_path):
    inside = '<axis xyz="0 1 0"/><limit lower="0.5" upper="2" effort="50" velocity="3"/>'
    inside += '<dynamics damping="0.2" friction="1.5"/>'
    robot = read(
        tmp_path, '<link name="base"/>' + link("arm") + joint("q", "revolute", "base", "arm", inside)
    )
    dae = translate(robot())
    known: Any = flatten(robot()).vectors
    limits = {
        name: [float(x[0]) for x in (known[name].min, known[name].max)] for name in ("q.phi", "q.w", "q.tau")
    }
    assert limits == {"q.phi": [0.5, 2.0], "q.w": [-3.0, 3.0], "q.tau": [-50.0, 50.0]}
    assert dae.parameter_values["q_friction.tau_c"] == 1.5
    assert dae.parameter_values["q_friction.tau_v"] == 0.2
    assert dae.evaluate({})["q.phi"] == 0.5  # 0 is none of its coordinates


def test_driven_joints_are_those_asked_for_those_with_a_transmission_or_all(tmp_path):
    body = '<link name="base"/>' + link("one") + link("two")
    body += joint("a", "continuous", "base", "one") + joint("b", "continuous", "one", "two")
    drives = lambda robot: {name for name in robot.members() if name.endswith("_drive")}  # noqa: E731
    assert drives(read(tmp_path, body)) == {"a_drive", "b_drive"}
    assert drives(read(tmp_path, body, driven=["b"])) == {"b_drive"}
    assert drives(read(tmp_path, body, driven=[])) == set()
    body += '<transmission name="t"><joint name="a"/></transmission>'
    assert drives(read(tmp_path, body)) == {"a_drive"}
    with pytest.raises(ModelError, match=r"driven=\['c'\], expected a list of joints that move, of a, b"):
        read(tmp_path, body, driven=["c"])


def test_names_become_words_of_python_and_stay_different(tmp_path):
    body = '<link name="world"/>' + link("arm-1") + link("arm 1") + link("class")
    body += joint("arm-1", "continuous", "world", "arm-1") + joint("2nd", "continuous", "arm-1", "arm 1")
    robot = read(tmp_path, body + joint("equations", "fixed", "arm-1", "class"))
    assert robot.names["link world"] == "world_link"
    assert robot.names["link arm-1"] == "arm_1"
    assert robot.names["link arm 1"] == "arm_1_link"
    assert robot.names["joint arm-1"] == "arm_1_joint"
    assert robot.names["joint 2nd"] == "part_2nd"
    assert robot.names["link class"] == "part_class"
    assert robot.names["joint equations"] == "equations_joint"
    assert len(translate(robot()).states) == 4


def test_the_base_stands_where_it_is_put_and_parameters_are_set_as_of_any_component():
    robot = read_urdf(HERE / "random_tree.urdf")
    moved = robot(placement=dict(xyz=[1.0, 2.0, 3.0], rpy=[0, 0, HALF_TURN]), l1=dict(m=5.0))
    here, there = (translate(one).evaluate({})["l7.r"] for one in (robot(), moved))
    assert there == pytest.approx(np.array([1 - here[0], 2 - here[1], 3 + here[2]]), abs=1e-12)
    assert translate(moved).parameter_values["l1.m"] == 5.0


def test_a_robot_is_a_component_among_others():
    Arm = read_urdf(HERE / "four_bar.urdf", HERE / "four_bar.loops.toml")

    class Loaded(Model):
        """The linkage with a load on its coupler."""

        linkage = Arm()
        load = Body(m=3.0, J=np.zeros((3, 3)).tolist())
        world = World()

        def equations(self):
            yield connect(self.linkage.coupler.frame_a, self.load.frame_a)

    assert translate(Loaded()).diagnosis.mobility == 1


def test_the_same_tree_from_components_has_the_same_motion(tmp_path):
    body = '<link name="base"/>' + link("cart", 2.0) + link("bob", 0.5)
    body += joint("rail", "prismatic", "base", "cart", '<axis xyz="1 0 0"/>')
    body += joint(
        "pin", "continuous", "cart", "bob", '<origin xyz="0 0 -0.2" rpy="1.57 0 0"/><axis xyz="0 0 1"/>'
    )
    body = body.replace('<mass value="0.5"/>', '<origin xyz="0 -0.7 0"/><mass value="0.5"/>')
    own = simulate(read(tmp_path, body)(), stop=1.0, starts={"pin.phi": 0.5}, tolerance=1e-10)

    class Crane(Model):
        """A pendulum on a cart."""

        world = World()
        rail = Prismatic(n=[1, 0, 0])
        bar = FixedTranslation(r=[0, 0, -0.2])
        cart = Body(m=2.0, J=np.diag([0.1, 0.1, 0.1]).tolist())
        pin = Revolute(n=[0, -np.sin(1.57), np.cos(1.57)])
        bob = Body(
            m=0.5, J=np.diag([0.1, 0.1, 0.1]).tolist(), r_cm=[0, -0.7 * np.cos(1.57), -0.7 * np.sin(1.57)]
        )

        def equations(self):
            yield from row(self.world, self.rail, self.cart)
            yield from row(self.rail, self.bar, self.pin, self.bob)

    known = simulate(Crane(), stop=1.0, starts={"pin.phi": 0.5}, tolerance=1e-10)
    assert np.ptp(known["rail.s"]) > 0.05
    for name in ("rail.s", "pin.phi"):
        # a thousand times the integrator's tolerance
        assert np.abs(own[name] - known[name]).max() < 1e-7


def test_links_are_seen_as_their_visuals(tmp_path):
    where = '<origin xyz="0 0 0.5" rpy="1.5707963267948966 0 0"/>'
    shapes = '<box size="1 2 3"/>', '<cylinder radius="0.1" length="2"/>', '<sphere radius="0.2"/>'
    seen = "".join(f"<visual>{where}<geometry>{shape}</geometry></visual>" for shape in shapes)
    (tmp_path / "robot_description").mkdir()
    (tmp_path / "robot_description" / "arm.stl").write_text("solid arm\nendsolid arm\n")
    for mesh in (
        "package://robot_description/arm.stl",
        "robot_description/arm.stl",
        "package://lost/arm.stl",
    ):
        seen += f'<visual><geometry><mesh filename="{mesh}" scale="0.001 0.001 0.001"/></geometry></visual>'
    body = '<link name="base"/>' + link("arm", 1.0, seen) + joint("q", "fixed", "base", "arm")
    arm = read(tmp_path, body)
    assert arm.left_out == ("link arm: mesh package://lost/arm.stl, not found or of another format",)
    with pytest.raises(ModelError, match=r"no folder .* for the package lost"):
        read_urdf(tmp_path / "robot.urdf", packages={"lost": tmp_path / "nowhere"})
    film = film_of(Result([0.0], {}, shapes=flatten(arm()).shapes), model=None, around=())
    seen_of_arm: list[Any] = [shape for shape in film.shapes if shape.owner == "arm"]
    box, cylinder, sphere, *meshes = seen_of_arm
    assert [type(shape).__name__ for shape in seen_of_arm] == [
        "Cuboid",
        "RoundBar",
        "Ball",
        "MeshFile",
        "MeshFile",
    ]
    assert {mesh.file for mesh in meshes} == {str(tmp_path / "robot_description" / "arm.stl")}
    # a quarter turn about x: the axis of the cylinder, z, comes to lie along -y
    assert cylinder.turn @ [0, 0, 1] == pytest.approx(np.array([0, -1, 0]), abs=1e-15)
    assert (box.offset, sphere.radius) == ((0.0, 0.0, 0.5), 0.2)


def test_solids_stand_where_the_link_is(tmp_path):
    seen = '<visual><origin xyz="1 0 0" rpy="0 1.5707963267948966 0"/>'
    seen += '<geometry><cylinder radius="0.1" length="2"/></geometry></visual>'
    body = '<link name="base"/>' + link("arm", 1.0, seen)
    body += joint("q", "continuous", "base", "arm", '<axis xyz="0 0 1"/>')
    motion = simulate(read(tmp_path, body)(), stop=0.1, starts={"q.phi": HALF_TURN / 2})
    (cylinder,) = [solid for solid in solids(film_of(motion)) if solid.owner == "arm"]
    # 1 m along x of the link, turned by 90 degrees
    assert cylinder.r[0] == pytest.approx(np.array([0, 1, 0]), abs=1e-9)
    assert cylinder.R[0][:, 2] == pytest.approx(np.array([0, 1, 0]), abs=1e-9)
    assert cylinder.size[0] == pytest.approx(np.array([0.2, 0.2, 2.0]))


def test_rounded_half_turns_are_meant_where_a_loop_would_stay_open(tmp_path):
    """The rocker turned over and back: its angle counts the other way."""

    def turned_over(angle):
        tree = (HERE / "four_bar.urdf").read_text()
        loops = (HERE / "four_bar.loops.toml").read_text()
        file = tmp_path / "turned.urdf"
        file.write_text(tree.replace('"1 0 0"/>', f'"1 0 0" rpy="{angle} 0 0"/>'))
        loops = loops.replace("xyz = [0.6, 0, 0]", f"xyz = [0.6, 0, 0], rpy = [{angle}, 0, 0]")
        closing = tmp_path / "turned.toml"
        closing.write_text(loops.replace("rocker_pivot = 1.43", "rocker_pivot = -1.43"))
        return read_urdf(file, closing)

    exact = translate(turned_over(np.pi)())
    for angle in ("3.1416", "3.1415"):
        with pytest.warns(
            DoubtfulResult, match="stay open with the angles of rocker_pivot, rocker_pin as they are"
        ):
            found = translate(turned_over(angle)())
        assert found.start == exact.start
    with pytest.raises(InitializationError, match="stays open"):
        translate(turned_over("3.143")())
