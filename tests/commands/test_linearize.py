"""`gantrytau linearize`: matrices, poles, files and pictures, and what is refused."""

import csv
import json

import numpy as np
import pytest
from scipy.linalg import expm

from gantrytau import StateSpace

MISUSE = 2
PNG = b"\x89PNG"


def test_a_cart_is_a_double_integrator(answer, run, robots):
    found = answer("linearize", f"{robots}:Cart", "--set", "m=4", "--outputs", "x,der(v)")
    assert (found["states"], found["inputs"], found["outputs"]) == (["x", "v"], ["f"], ["x", "der(v)"])
    assert found["A"] == [[0.0, 1.0], [0.0, 0.0]]
    assert found["B"] == [[0.0], [0.25]]
    assert (found["C"], found["D"]) == ([[1.0, 0.0], [0.0, 0.0]], [[0.0], [0.25]])
    assert [pole["hertz"] for pole in found["poles"]] == [0.0, 0.0]
    spoken = run("linearize", f"{robots}:Cart", "--set", "m=4")
    assert ["der(v)", "0", "0", "0.25"] in [line.split() for line in spoken.stdout.splitlines()]


def test_from_sample_to_sample_it_is_the_matrix_exponential(answer, robots):
    found = answer("linearize", f"{robots}:Cart", "--set", "m=1", "--period", "0.5")
    whole = expm(np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]) * 0.5)
    np.testing.assert_allclose(found["A"], whole[:2, :2], atol=1e-14)
    np.testing.assert_allclose(found["B"], whole[:2, 2:], atol=1e-14)
    assert found["period"] == 0.5


def test_a_pendulum_at_rest_swings_with_its_textbook_frequency(answer, run):
    found = answer("linearize", "Pendulum", "--steady", "--set", "L=2", "--set", "damping=0.3")
    w = np.sqrt(9.81 / 2)  # rad/s
    assert [pole["hertz"] for pole in found["poles"]] == pytest.approx([w / (2 * np.pi)] * 2)
    assert [pole["damping"] for pole in found["poles"]] == pytest.approx([0.3 / (2 * w)] * 2)
    spoken = run("linearize", "Pendulum", "--steady", "--set", "L=2", "--set", "damping=0.3").stdout
    assert f"{w / (2 * np.pi):.5g}" in spoken
    assert "-0.15 + " in spoken


@pytest.mark.parametrize("suffix", [".json", ".npz", ".csv"])
def test_what_is_saved_is_the_same_system(run, robots, tmp_path, suffix):
    file = tmp_path / f"cart{suffix}"
    spoken = run("linearize", f"{robots}:Cart", "--set", "m=4", "--outputs", "x", "-o", file)
    assert f"Written: {file}" in spoken.stdout
    if suffix == ".json":
        held = json.loads(file.read_text())
        A, B, C = (np.array(held[name]) for name in "ABC")
        assert held["units"] == {"x": "m", "v": "m/s", "f": "N"}
    elif suffix == ".npz":
        with np.load(file) as held:
            A, B, C = (held[name] for name in "ABC")
            assert held["states"].tolist() == ["x", "v"]
            assert np.isnan(held["period"])
    else:
        head, *rows = list(csv.reader(file.read_text().splitlines()))
        assert head == ["", "x", "v", "f"]
        assert [row[0] for row in rows] == ["der(x)", "der(v)", "x"]
        table = np.array([row[1:] for row in rows], dtype=float)
        A, B, C = table[:2, :2], table[:2, 2:], table[2:, :2]
    system = StateSpace(A, B, C)
    assert abs(system.response([0.5])[0, 0, 0]) == pytest.approx(0.25 / np.pi**2)  # 1 / (m w^2)


def test_a_bode_picture_is_drawn(answer, robots, tmp_path):
    picture = tmp_path / "bode.png"
    found = answer("linearize", f"{robots}:Cart", "--set", "m=1", "--outputs", "x", "--plot", picture)
    assert found["files"] == [str(picture)]
    assert picture.read_bytes().startswith(PNG)


def test_matrices_fit_the_terminal(run, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    spoken = run("linearize", "GantryTau(L1)", "--outputs", "tool.r")
    assert spoken.exit_code == 0
    wide = [line for line in spoken.stdout.splitlines() if len(line) > 200]
    assert not wide  # COLUMNS of the fixture


REFUSED = {
    ("--at", "y=a"): "--at y=a: expected a number as 2.5",
    ("--at", "zz=1"): "Pendulum has no variable or parameter 'zz'",
    ("--period", "-1"): "--period",
    ("--output", "a.txt"): "--output a.txt: found the suffix '.txt', expected .json or .npz or .csv",
}


@pytest.mark.parametrize("options", REFUSED)
def test_wrong_options_are_told_as_options(fails, options):
    assert REFUSED[options] in fails(MISUSE, "linearize", "Pendulum", *options)


def test_a_point_out_of_reach_is_a_fault(fails):
    assert "Pendulum" in fails(1, "linearize", "Pendulum", "--at", "x=5")
