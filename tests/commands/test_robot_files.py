"""Files of robots where a command takes a model."""

import shutil
from pathlib import Path

from tests.mechanics.robot_files import mjcf_texts, sdf_texts

FILES = Path(__file__).parents[1] / "mechanics" / "robot_files"


def test_a_urdf_file_is_a_model_with_the_loops_beside_it(run, tmp_path):
    for name in ("four_bar.urdf", "four_bar.loops.toml"):
        shutil.copy(FILES / name, tmp_path)
    said = run("check", tmp_path / "four_bar.urdf")
    assert (said.exit_code, "mobility 1" in said.stdout) == (0, True), said.output
    (tmp_path / "four_bar.loops.toml").unlink()
    assert "mobility 3" in run("check", tmp_path / "four_bar.urdf").stdout


def test_what_is_wrong_with_it_is_told(run, tmp_path):
    (tmp_path / "robot.urdf").write_text("<robot/>")
    said = run("check", tmp_path / "robot.urdf")
    assert said.exit_code == 1
    assert "found no <link>, expected one or more" in " ".join(said.stderr.split())
    assert "no file that can be read" in " ".join(run("check", tmp_path / "other.urdf").stderr.split())


def test_mjcf_and_sdf_files_are_models(run, tmp_path):
    (tmp_path / "arm.xml").write_text(f'<mujoco model="arm">{mjcf_texts.TREE}</mujoco>')
    assert "mobility 4" in run("check", tmp_path / "arm.xml").stdout
    assert "mobility 1" in run("check", sdf_texts.written(tmp_path, sdf_texts.FOUR_BAR)).stdout
