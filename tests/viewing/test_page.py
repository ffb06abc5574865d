"""The page: what is in it, how large it is, and what it says where it cannot be made."""

import html
import re
import sys
import threading

import numpy as np
import pytest
import trimesh

from gantrytau import InitializationError, ModelError, Result, animate, simulate, view
from gantrytau.commands.demo.motion_problems import SixLinks
from gantrytau.language.self_description.appearance import Ball, MeshFile
from gantrytau.viewing.film import film_of
from gantrytau.viewing.page import Page
from gantrytau_models import GantryTau, Pendulum, SixLinkGantryTau, prototypes
from gantrytau_optimica import optimize

LARGEST = 3e6  # bytes of a page that travels by mail


@pytest.fixture(scope="module")
def swing():
    return simulate(Pendulum(), stop=0.5, points=11)


@pytest.fixture(scope="module")
def fastest():
    return optimize(SixLinks, elements=8)


def test_the_page_of_a_fastest_motion_is_small_and_whole(fastest, tmp_path):
    page = animate(fastest, file=tmp_path / "move.html")
    assert page.file == tmp_path / "move.html"
    assert page.file is not None
    assert page.file.read_text(encoding="utf-8") == page.text
    assert len(page.text.encode()) < LARGEST
    assert "<title>SixLinks</title>" in page.text
    # nothing is fetched: scripts, pictures and styles stand in the page
    fetched = re.findall(r"<(?:script|link|img|iframe)[^>]*?(?:src|href)=[\"']?([^\"'> ]+)", page.text)
    assert [place for place in fetched if not place.startswith("data:")] == []


def test_parts_at_their_limits_are_told_from_others(fastest):
    film = film_of(fastest)
    assert {binding.name for binding in film.bindings} == {f"robot.carts[{i}].f" for i in range(3)}
    assert all(0 <= b.begin < b.end <= fastest.final_time for b in film.bindings)


def test_a_pose_is_a_page_and_one_that_is_out_of_reach_is_told(tmp_path):
    robot = GantryTau(prototypes.L1)
    page = view(robot, {"tool.r": [0.5, 3.0, -0.6]}, file=tmp_path / "robot.html")
    assert repr(page) == f"<Page GantryTau: {len(page.text) / 1e6:.2f} MB, {tmp_path / 'robot.html'}>"
    with pytest.raises(InitializationError):
        view(robot, {"tool.r": [50.0, 3.0, -0.6]})


@pytest.mark.parametrize("value", [[0.5, 3.0], 0.5, [np.nan, 3.0, -0.6], [[0.5, 3.0, -0.6]], "near", None])
def test_poses_of_another_shape_are_told(value):
    with pytest.raises(ModelError, match=r"tool\.r"):
        view(GantryTau(prototypes.L1), {"tool.r": value})


def test_names_that_the_model_does_not_have_are_told():
    with pytest.raises(ModelError, match=r"tol\.r.*tool\.r"):
        view(GantryTau(prototypes.L1), {"tol.r": [0.5, 3.0, -0.6]})


def test_a_robot_of_six_links_takes_a_position_alone():
    page = view(SixLinkGantryTau(prototypes.D1))
    assert isinstance(page, Page)


def test_two_results_stand_side_by_side(swing):
    assert "<title>Pendulum</title>" in animate([swing, swing], names=["one", "two"]).text
    longer = simulate(Pendulum(damping=1.0), stop=1.0, points=11)
    assert len(animate([swing, longer]).text) > len(animate(swing).text)


def test_a_notebook_shows_the_page_in_a_frame(swing):
    page = animate(swing)
    frame = page._repr_html_()
    inside = re.fullmatch(r'<iframe srcdoc="([^"]*)" style="[^"]*"></iframe>', frame, re.DOTALL)
    assert inside is not None
    assert html.unescape(inside[1]) == page.text


def test_a_mesh_is_read_from_a_file(tmp_path):
    file = tmp_path / "part.stl"
    trimesh.creation.box((1.0, 2.0, 3.0)).export(file)
    moved = Result(
        [0.0, 1.0], {"x": [0.0, 1.0]}, shapes=[MeshFile(file=str(file), at=("x", 0.0, 0.0), scale=1e-3)]
    )
    ball = Result([0.0, 1.0], {"x": [0.0, 1.0]}, shapes=[Ball(at=("x", 0.0, 0.0))])
    assert len(animate(moved).text) != len(animate(ball).text)


@pytest.mark.parametrize(
    ("name", "text"), [("none.stl", None), ("text.stl", "no mesh"), ("odd.xyzw", "1 2 3")]
)
def test_files_that_are_no_meshes_are_told(tmp_path, name, text):
    file = tmp_path / name
    if text is not None:
        file.write_text(text)
    moved = Result([0.0, 1.0], {"x": [0.0, 1.0]}, shapes=[MeshFile(file=str(file), at=("x", 0.0, 0.0))])
    with pytest.raises(ModelError) as error:
        animate(moved)
    assert f"{file}: found no mesh" in str(error.value)
    assert "expected a file of STL, OBJ, PLY or GLB" in str(error.value)


def test_without_the_extra_its_name_is_told(swing, monkeypatch):
    monkeypatch.setitem(sys.modules, "viser", None)
    with pytest.raises(ModelError, match=r"found no viser.*expected it installed"):
        animate(swing)


def test_a_title_is_no_markup():
    odd = Result([0.0], {"x": 0.1}, title="<b>&", shapes=[Ball(at=("x", 0.0, 0.0))])
    assert "<title>&lt;b&gt;&amp;</title>" in animate(odd).text


def test_making_a_page_leaves_no_server_and_prints_nothing(swing, capfd):
    before = threading.active_count()
    animate(swing)
    assert threading.active_count() <= before
    assert capfd.readouterr().out == ""


def test_a_folder_is_no_file(swing, tmp_path):
    with pytest.raises(ModelError, match=r"found a folder, expected the name of a file in it"):
        animate(swing, file=tmp_path)


def test_a_folder_that_is_not_there_is_told(swing, tmp_path):
    with pytest.raises(ModelError, match="none' does not exist; create it"):
        animate(swing, file=tmp_path / "none" / "move.html")
