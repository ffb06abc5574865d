"""C source against the CasADi function it comes from: compiled, loaded, compared."""

import os
import shutil
import subprocess

import casadi as ca
import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Real, der, extract_mechanism, sin, translate
from gantrytau.answers.c_code import c_source
from gantrytau_models import GantryTau, prototypes
from gantrytau_models.mechanisms.six_link import SixLinkGantryTau

FORCES = [f"carts[{i}].f" for i in range(3)]
COMPILER = shutil.which("cc") or shutil.which("gcc")
compiled_only = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
MOTION = ([0.5, 3.0, -0.6], [0.3, -0.2, 0.1], [1.0, 2.0, -1.0])
ROUNDING = 1e-14  # relative: the compiler may contract products and sums


class Kepler(Model):
    """M = E - e sin E has no closed form; f pushes E."""

    E = Real(unit="rad", description="eccentric anomaly", start=0.5)
    M = Real(unit="rad", description="mean anomaly")
    w = Input(unit="rad/s", description="rate of the mean anomaly", start=1.0)

    def equations(self):
        yield der(self.M) == self.w
        yield self.M == self.E - 0.3 * sin(self.E)


@pytest.fixture(scope="module")
def inverse_dynamics():
    return translate(GantryTau(prototypes.L1)).function(["tool.r", "tool.v", "der(tool.v)"], FORCES)


@pytest.fixture(scope="module")
def anomaly():
    found = translate(Kepler()).function(["M"], ["E"])
    assert any(
        f.class_name() == "FastNewton" for f in found.find_functions()
    )  # else the test is about nothing
    return found


def load(source, folder, *names):
    """The functions of a C source, compiled as strict C99 without warnings of missing or wrong things."""
    path, library = folder / "code.c", folder / "code.so"
    path.write_text(source)
    command = [
        COMPILER,
        "-std=c99",
        "-pedantic",
        "-Werror=implicit-function-declaration",
        "-O1",
        "-shared",
        "-fPIC",
    ]
    subprocess.run([*command, "-o", str(library), str(path), "-lm"], check=True, timeout=120)
    return [ca.external(name, str(library)) for name in names]


def same(found, expected):
    for a, b in zip(found, expected, strict=True):
        a, b = np.array(a), np.array(b)
        assert np.abs(a - b).max() <= ROUNDING * max(1.0, np.abs(b).max())


@compiled_only
def test_compiled_function_and_derivatives_equal_casadi(inverse_dynamics, tmp_path):
    source = c_source(inverse_dynamics, name="forces", jacobian=True, forward=1, reverse=2)
    names = ("forces", "jac_forces", "fwd1_forces", "adj2_forces")
    value, jacobian, forward, reverse = load(source, tmp_path, *names)
    expected = inverse_dynamics(*MOTION)
    same(value(*MOTION), expected)
    same(jacobian(*MOTION, *expected), inverse_dynamics.jacobian()(*MOTION, *expected))
    seeds = [[0.1, 0.2, 0.3], [1.0, 0.0, -1.0], [0.5, 0.5, 0.5]]
    same(
        [forward(*MOTION, *expected, *seeds)[i] for i in range(3)],
        inverse_dynamics.forward(1)(*MOTION, *expected, *seeds),
    )
    seeds = [ca.DM([[1.0, 2.0]]), ca.DM([[0.0, 1.0]]), ca.DM([[3.0, 0.0]])]
    same(reverse(*MOTION, *expected, *seeds), inverse_dynamics.reverse(2)(*MOTION, *expected, *seeds))


@compiled_only
def test_newton_iterations_are_written_in_c(anomaly, tmp_path):
    value, jacobian = load(
        c_source(anomaly, name="anomaly", jacobian=True), tmp_path, "anomaly", "jac_anomaly"
    )
    for E in (0.1, 1.0, 2.5):
        M = E - 0.3 * np.sin(E)
        # Newton's method stops at a residual of 1e-13, the slope of the equation is at least 0.7
        assert float(value(M)) == pytest.approx(E, abs=2e-13)
        assert float(jacobian(M, E)) == pytest.approx(1 / (1 - 0.3 * np.cos(E)), rel=1e-12)


@compiled_only
def test_functions_of_a_mechanism_compile(tmp_path):
    mechanism = extract_mechanism(
        GantryTau(prototypes.L1), tool="tool.r", joints=[f"carts[{i}].s" for i in range(3)], forces=FORCES
    )
    (masses,) = load(c_source(mechanism.M2, name="carts_inertia"), tmp_path, "carts_inertia")
    same([masses([0.5, 3.0, -0.6], [0.1, 0.2, 0.3])], [mechanism.M2([0.5, 3.0, -0.6], [0.1, 0.2, 0.3])])


@compiled_only
def test_iterations_and_linear_systems_of_the_six_link_robot_compile(tmp_path):
    mechanism = extract_mechanism(
        SixLinkGantryTau(prototypes.L1),
        tool="tool.r",
        joints=[f"carts[{i}].s" for i in range(3)],
        forces=FORCES,
    )
    pose = [0.5, 3.0, -0.6]
    q = translate(GantryTau(prototypes.L1)).function(["tool.r"], [f"carts[{i}].s" for i in range(3)])(pose)
    (speeds,) = load(c_source(mechanism.velocity_jacobian, name="speeds"), tmp_path, "speeds")
    at = pose, ca.vertcat(*q)
    found, expected = np.array(speeds(*at)), np.array(mechanism.velocity_jacobian(*at))
    # Newton's method stops at 1e-13 on a way of its own
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()


def test_comment_says_which_argument_is_what(inverse_dynamics, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = ["tool.r", "tool.v", "der(tool.v)"]
    source = c_source(inverse_dynamics, given=given, find=FORCES, header="Inverse dynamics of L1\nSI units")
    comment = source.partition("*/")[0]
    assert " * Inverse dynamics of L1\n * SI units\n" in comment
    assert "arg[2]  der_tool_v (3, 1)  der(tool.v)" in comment
    assert "res[1]  carts_1_f (1, 1)  carts[1].f" in comment
    assert os.listdir(tmp_path) == []  # nothing is left behind


@pytest.mark.parametrize("name", ["double", "2nd", "a b", "a__b", "jac", ""])
def test_names_that_c_does_not_allow_are_refused(inverse_dynamics, name):
    with pytest.raises(ModelError, match="expected a C identifier"):
        c_source(inverse_dynamics, name=name)


def test_numbers_of_names_and_directions_are_checked(inverse_dynamics):
    with pytest.raises(ModelError, match=r"found given=\['tool.r'\], expected a list of 3 names"):
        c_source(inverse_dynamics, given=["tool.r"])
    with pytest.raises(ModelError, match="found find='carts', expected a list of 3 names"):
        c_source(inverse_dynamics, find="carts")
    with pytest.raises(ModelError, match="found forward=-1, expected a number of directions"):
        c_source(inverse_dynamics, forward=-1)


def test_functions_without_c_code_are_refused():
    x, y, p = ca.MX.sym("x"), ca.SX.sym("y"), ca.SX.sym("p")
    residual = ca.Function("residual", [y, p], [y**2 - p])
    lost = ca.rootfinder("lost", "nlpsol", residual, {"nlpsol": "ipopt"})
    flow = ca.integrator("flow", "cvodes", {"x": y, "p": p, "ode": -p * y})
    for results in ([lost(1.0, x)], [flow(x0=1.0, p=x)["xf"]]):
        with pytest.raises(ModelError, match="f contains what has no C code"):
            c_source(ca.Function("f", [x], results))
