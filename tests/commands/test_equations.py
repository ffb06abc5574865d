"""`gantrytau equations`: text in several formats, causality, C code."""

import shutil
import subprocess

import casadi as ca
import numpy as np
import pytest

from gantrytau import translate
from gantrytau_models import Pendulum, prototypes

FAULT, MISUSE = 1, 2


def test_the_text_is_that_of_the_model(run, answer):
    text = translate(Pendulum()).equations()
    assert run("equations", "Pendulum").stdout == text
    found = answer("equations", "Pendulum")
    assert found == {
        "model": "Pendulum",
        "prototype": None,
        "format": "text",
        "given": [],
        "find": [],
        "file": None,
        "text": text,
    }


def test_given_and_find_choose_the_causality(run):
    names = "carts[0].s,carts[1].s, carts[2].s"
    found = run("equations", "GantryTau(GT_A)", "--given", "tool.r", "--find", names)
    assert found.exit_code == 0
    assert "known: tool.r[0], tool.r[1], tool.r[2]" in found.stdout
    assert "states: none" in found.stdout
    assert "wanted: carts[0].s, carts[1].s, carts[2].s\n3 of 55 blocks" in found.stdout
    assert [line[:3] for line in found.stdout.splitlines()[5:]] == ["[1]", "[2]", "[3]"]


def test_the_equations_go_to_a_file(run, answer, tmp_path):
    file = tmp_path / "pendulum.txt"
    found = run("equations", "Pendulum", "--output", file)
    assert found.stdout == ""
    assert f"The equations of Pendulum are in {file}" in found.stderr
    assert file.read_text() == translate(Pendulum()).equations()
    told = answer("equations", "Pendulum", "--output", file)
    assert told["file"] == str(file)
    assert "text" not in told


@pytest.mark.parametrize("format", ["latex", "html", "base-modelica"])
def test_other_formats(run, format):
    found = run("equations", "Pendulum", "--format", format)
    assert found.exit_code == 0, found.output
    assert found.stdout == translate(Pendulum()).equations(format).rstrip("\n") + "\n"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--c",), "--c: a function needs arguments and results, as --given tool.r --find carts[0].s"),
        (("--jacobian",), "--jacobian, --forward and --reverse are derivatives of C code; add --c"),
        (("--output", "no_such_folder/a.txt"), "the folder 'no_such_folder' does not exist"),
    ],
)
def test_misuse(fails, options, message):
    assert message in fails(MISUSE, "equations", "Pendulum", *options)


def test_c_code_of_a_function(answer):
    names = ("--c", "--given", "tool.r", "--find", "carts[0].s,carts[1].s")
    plain = answer("equations", "GantryTau(GT_A)", *names)
    assert plain["format"] == "c"
    assert "GantryTau of prototype GT_A: carts[0].s, carts[1].s from tool.r" in plain["text"]
    assert "int GantryTau(const casadi_real** arg" in plain["text"]
    assert "jac_GantryTau" not in plain["text"]
    more = answer("equations", "GantryTau(GT_A)", *names, "--jacobian", "--forward", "1", "--reverse", "2")
    for function in ("jac_GantryTau", "fwd1_GantryTau", "adj2_GantryTau"):
        assert f"int {function}(const casadi_real** arg" in more["text"]


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
def test_compiled_c_code_keeps_the_length_of_a_link(run, tmp_path):
    """The cart that the code finds is as far from the tool as the link is long."""
    source, binary = tmp_path / "inverse.c", tmp_path / "inverse.so"
    names = ("--given", "tool.r", "--find", "carts[0].s")
    assert run("equations", "GantryTau(GT_A)", "--c", *names, "--output", source).exit_code == 0
    subprocess.run(["cc", "-shared", "-fPIC", "-o", binary, source, "-lm"], check=True)
    arm, tool = prototypes.GT_A.arms[0], np.array([0.5, 3.0, -0.6])
    s = float(ca.external("GantryTau", str(binary))(tool))
    link = tool - (np.array(arm.offset) + s * np.array(arm.direction))
    assert np.linalg.norm(link) == pytest.approx(arm.length, rel=1e-14)  # a square root and few sums
    assert link[0] > 0  # the tool is ahead of the cart
