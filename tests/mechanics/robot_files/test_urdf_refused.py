"""URDF files and files of loops that cannot be read."""

from pathlib import Path
from typing import Any

import pytest

from gantrytau import ModelError
from gantrytau.mechanics.robot_files import read_urdf
from tests.mechanics.robot_files.urdf_texts import joint, link, read

HERE = Path(__file__).parent


def refused(folder: Path, body: str, **keywords: Any) -> str:
    with pytest.raises(ModelError) as raised:
        read(folder, body, **keywords)
    assert raised.value.argument in ("file", "loops")
    return str(raised.value)


ARM = '<link name="base"/>' + link("arm")


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("", "found no <link>, expected one or more"),
        (ARM, "found 2 links that no joint carries (base, arm), expected one, the base"),
        (ARM + joint("q", "hinge", "base", "arm"), "robot/joint[q]: found type 'hinge'"),
        (ARM + joint("q", "fixed", "base", "arms"), "robot/joint[q]/child: found the link 'arms', expected"),
        (ARM + joint("q", "fixed", "base", "arm") * 2, "found two joints of the name 'q'"),
        (ARM + ARM, "found two links of the name"),
        (ARM + joint("q", "continuous", "base", "arm", '<axis xyz="0 0 0"/>'), "robot/joint[q]/axis: found"),
        (ARM + joint("q", "continuous", "base", "arm", '<axis xyz="0 0"/>'), "robot/joint[q]/axis: found"),
        (ARM + joint("q", "fixed", "base", "arm", '<origin xyz="0 nan 1"/>'), "expected 3 finite numbers"),
        (ARM + joint("q", "revolute", "base", "arm", '<limit lower="2" upper="1"/>'), 'lower="2" above'),
        (ARM + joint("q", "continuous", "base", "arm", '<mimic joint="p"/>'), "mimics 'p', expected a"),
        (ARM + joint("q", "continuous", "base", "arm", '<mimic joint="q"/>'), "expected another one that"),
        (link("base") + joint("q", "fixed", "base", "base"), "found joints in a circle (q), expected a tree"),
        ('<link name="a"><inertial><mass value="-1"/></inertial></link>', "robot/link[a]/inertial/mass"),
        ('<link name="a"><inertial><inertia ixx="1"/></inertial></link>', "robot/link[a]/inertial: found no"),
        ('<link name="a"><visual><geometry><cone/></geometry></visual></link>', "'cone', expected a shape"),
        ("<link/>", "robot/link: found <link> without name="),
        ('<xacro:macro xmlns:xacro="x" name="m"/>', "found macros of xacro, expected URDF"),
        ('<link name="a">', "found no XML"),
        ('<link name="base"/><link name="f"/>' + joint("q", "floating", "base", "f"), "link 'f' without a"),
    ],
)
def test_what_is_no_urdf_is_refused_by_name(tmp_path, body, words):
    assert words in refused(tmp_path, body)


def test_a_loop_written_into_the_tree_is_told_where_it_belongs(tmp_path):
    body = (
        ARM + link("rod") + joint("a", "continuous", "base", "arm") + joint("b", "continuous", "base", "rod")
    )
    words = refused(tmp_path, body + joint("c", "continuous", "rod", "arm"))
    assert "joints 'a' and 'c' which both carry link 'arm'" in words
    assert "read_urdf(file, loops=...)" in words


def test_files_that_are_not_there_or_are_something_else_are_refused(tmp_path):
    with pytest.raises(ModelError, match="found no file that can be read"):
        read_urdf(tmp_path / "none.urdf")
    (tmp_path / "other.urdf").write_text("<sdf/>")
    with pytest.raises(ModelError, match="found <sdf>, expected <robot>"):
        read_urdf(tmp_path / "other.urdf")


LOOP = dict(link_a="rocker", link_b="coupler")


@pytest.mark.parametrize(
    ("loops", "words"),
    [
        (3, "found int, expected a TOML file"),
        ({"loops": []}, "'loops' in the file, expected loop, driven, start; did you mean 'loop'?"),
        ({"loop": [dict(link_a="rocker")]}, "loop[0] without link_b"),
        ({"loop": [dict(LOOP, link_b="couple")]}, "loop[0].link_b = 'couple', expected one that is there"),
        ({"loop": [dict(LOOP, link_b="rocker")]}, "from rocker to itself"),
        ({"loop": [dict(LOOP, kind="ball")]}, "loop[0].kind = 'ball'"),
        ({"loop": [dict(LOOP, axis=[0, 0, 0])]}, "loop[0].axis = [0.0, 0.0, 0.0], expected a direction"),
        ({"loop": [dict(LOOP, axis=[0, 1])]}, "expected 3 finite numbers"),
        ({"loop": [dict(LOOP, origin_a=dict(x=1))]}, "'x' in loop[0].origin_a, expected xyz, rpy"),
        ({"loop": [dict(LOOP, name="a b")]}, "loop[0].name = 'a b'"),
        ({"loop": [dict(LOOP, name="p")] * 2}, "two loops of the name 'p'"),
        ({"loop": LOOP}, "expected tables, each under [[loop]]"),
        ({"driven": "crank_pivot"}, 'expected a list of joints, driven = ["q1", "q2"]'),
        ({"driven": ["crank"]}, "driven = 'crank', expected one that is there; did you mean 'crank_pin'?"),
        ({"start": dict(crank_pivot="1 rad")}, "start.crank_pivot = ['1 rad'], expected 1 finite number"),
    ],
)
def test_what_is_no_loop_file_is_refused_by_its_entry(loops, words):
    with pytest.raises(ModelError) as raised:
        read_urdf(HERE / "four_bar.urdf", loops)
    assert words in str(raised.value)
    assert raised.value.argument == "loops"
