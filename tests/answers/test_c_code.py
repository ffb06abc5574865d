"""C source against the CasADi function it comes from: compiled, loaded, compared."""

import math
import os
import shutil
import subprocess

import casadi as ca
import numpy as np
import pytest

from gantrytau import (
    Discrete,
    Input,
    Model,
    ModelError,
    Real,
    ceil,
    der,
    extract_mechanism,
    fabs,
    floor,
    fmax,
    fmin,
    if_else,
    limit,
    logic_and,
    logic_not,
    logic_or,
    mod,
    pre,
    sign,
    sqrt,
    translate,
    when,
)
from gantrytau.answers.c_code import c_source
from gantrytau_models import GantryTau, prototypes
from gantrytau_models.mechanisms.six_link import SixLinkGantryTau
from tests.answers.test_linearization import Kepler

CARTS, FORCES = ([f"carts[{i}].{letter}" for i in range(3)] for letter in "sf")
COMPILER = shutil.which("cc") or shutil.which("gcc")
compiled_only = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
MOTION = ([0.5, 3.0, -0.6], [0.3, -0.2, 0.1], [1.0, 2.0, -1.0])
ROUNDING = 1e-14  # relative: the compiler may contract products and sums


@pytest.fixture(scope="module")
def inverse_dynamics():
    return translate(GantryTau(prototypes.L1)).function(["tool.r", "tool.v", "der(tool.v)"], FORCES)


@pytest.fixture(scope="module")
def anomaly():
    found = translate(Kepler()).function(["M"], ["E"])
    # else the test is about nothing
    assert any(f.class_name() == "FastNewton" for f in found.find_functions())
    return found


def load(source, folder, *names):
    """The functions of a C source, compiled as strict C99 without warnings of missing or wrong things."""
    path, library = folder / "code.c", folder / "code.so"
    path.write_text(source)
    # -O0 rounds as -O1 does
    flags = "-std=c99 -pedantic -Werror=implicit-function-declaration -O0 -shared -fPIC"
    subprocess.run([str(COMPILER), *flags.split(), "-o", library, path, "-lm"], check=True, timeout=120)
    return [ca.external(name, str(library)) for name in names]


def error(found, expected):
    """The greatest difference of results in turn, each of the largest number in it if that is above one."""
    pairs = [(np.array(a), np.array(b)) for a, b in zip(found, expected, strict=True)]
    return np.max([np.abs(a - b).max() / max(1.0, np.abs(b).max()) for a, b in pairs])


@compiled_only
def test_compiled_function_and_derivatives_equal_casadi(inverse_dynamics, tmp_path):
    source = c_source(inverse_dynamics, name="forces", jacobian=True, forward=1, reverse=2)
    names = ("forces", "jac_forces", "fwd1_forces", "adj2_forces")
    value, jacobian, forward, reverse = load(source, tmp_path, *names)
    expected = inverse_dynamics(*MOTION)
    assert error(value(*MOTION), expected) <= ROUNDING
    assert error(jacobian(*MOTION, *expected), inverse_dynamics.jacobian()(*MOTION, *expected)) <= ROUNDING
    at = (*MOTION, *expected, [0.1, 0.2, 0.3], [1.0, 0.0, -1.0], [0.5, 0.5, 0.5])
    assert error([forward(*at)[i] for i in range(3)], inverse_dynamics.forward(1)(*at)) <= ROUNDING
    at = (*MOTION, *expected, ca.DM([[1.0, 2.0]]), ca.DM([[0.0, 1.0]]), ca.DM([[3.0, 0.0]]))
    assert error(reverse(*at), inverse_dynamics.reverse(2)(*at)) <= ROUNDING


@compiled_only
def test_newton_iterations_are_written_in_c(anomaly, tmp_path):
    source = c_source(anomaly, name="anomaly", jacobian=True)
    value, jacobian = load(source, tmp_path, "anomaly", "jac_anomaly")
    for E in (0.1, 1.0, 2.5):
        M = E - 0.3 * np.sin(E)
        # Newton's method stops at a residual of 1e-13, the slope of the equation is at least 0.7
        assert float(value(M)) == pytest.approx(E, abs=2e-13)
        assert float(jacobian(M, E)) == pytest.approx(1 / (1 - 0.3 * np.cos(E)), rel=1e-12)


@compiled_only
def test_functions_of_a_mechanism_compile(tmp_path):
    mechanism = extract_mechanism(GantryTau(prototypes.L1), tool="tool.r", joints=CARTS, forces=FORCES)
    (masses,) = load(c_source(mechanism.M2, name="carts_inertia"), tmp_path, "carts_inertia")
    at = [0.5, 3.0, -0.6], [0.1, 0.2, 0.3]
    assert error([masses(*at)], [mechanism.M2(*at)]) <= ROUNDING


@compiled_only
def test_iterations_and_linear_systems_of_the_six_link_robot_compile(tmp_path):
    mechanism = extract_mechanism(SixLinkGantryTau(prototypes.L1), tool="tool.r", joints=CARTS, forces=FORCES)
    pose = [0.5, 3.0, -0.6]
    q = translate(GantryTau(prototypes.L1)).function(["tool.r"], CARTS)(pose)
    (speeds,) = load(c_source(mechanism.velocity_jacobian, name="speeds"), tmp_path, "speeds")
    at = pose, ca.vertcat(*q)
    found, expected = np.array(speeds(*at)), np.array(mechanism.velocity_jacobian(*at))
    # Newton's method stops at 1e-13 on a way of its own
    assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()


class Switches(Model):
    """Everything that switches on its inputs, and a block that switches on its own unknown."""

    a = Input(description="input")
    b = Input(description="input")
    y = Real(9, description="results")
    i = Real(description="current through a diode")

    def equations(self):
        a, b = self.a, self.b
        # a root that is not real where it is not asked for
        yield self.y[0] == if_else(a < b, sqrt(b - a), a - b)
        yield self.y[1] == fabs(a) + sign(b)
        yield self.y[2] == fmin(a, b) - fmax(a, 2 * b)
        yield self.y[3] == floor(a) + 10 * ceil(b)
        yield self.y[4] == mod(a, 0.7)
        yield self.y[5] == limit(a, -1.0, b)
        yield self.y[6] == if_else(logic_and(a >= 0, b <= 1), a, b)
        yield self.y[7] == if_else(logic_or(a > 1, logic_not(b > 0)), 1.0, a * b)
        yield self.y[8] == if_else(a == b, 5.0, 7.0)
        yield self.i + if_else(self.i > 0, self.i, 10 * self.i) == a - b


@compiled_only
def test_what_switches_does_so_in_c_at_the_border_too(tmp_path):
    names = [*(f"y[{k}]" for k in range(9)), "i"]
    function = translate(Switches()).function(["a", "b"], names)
    source = c_source(function, name="switches", jacobian=True)
    value, jacobian = load(source, tmp_path, "switches", "jac_switches")
    points = [-2.1, -1.0, -0.7, 0.0, 0.35, 0.7, 1.0, 1.4, 2.0]
    for a in points:
        for b in points:
            found, expected = (np.array([float(v) for v in f(a, b)]) for f in (value, function))
            assert np.array_equal(found, expected)  # no product here is rounded
            drop = a - b
            own = [
                math.sqrt(-drop) if a < b else drop,
                abs(a) + np.sign(b),
                min(a, b) - max(a, 2 * b),
                math.floor(a) + 10 * math.ceil(b),
                a - 0.7 * math.floor(a / 0.7),
                min(max(a, -1.0), b),
                a if a >= 0 and b <= 1 else b,
                1.0 if a > 1 or not b > 0 else a * b,
                5.0 if a == b else 7.0,
                drop / 2 if drop > 0 else drop / 11,
            ]
            assert found == pytest.approx(np.array(own), abs=1e-15)
            slopes = jacobian(a, b, *expected)
            assert error(slopes, function.jacobian()(a, b, *expected)) <= ROUNDING
            assert float(slopes[2 * names.index("i")]) == (0.5 if drop > 0 else 1 / 11)


def test_what_is_done_when_has_no_c_of_one_function():
    class Counts(Model):
        x = Real(start=0.0, fixed=True, description="time")
        n = Discrete(0.0, description="seconds")

        def equations(self):
            yield der(self.x) == 1
            yield when(self.x >= pre(self.n) + 1, self.n == pre(self.n) + 1)

    with pytest.raises(ModelError, match=r"when\(.*simulate and FMUs act upon it"):
        c_source(translate(Counts()).function(["x"], ["der(x)"]))


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


@pytest.mark.parametrize("wrong", [dict(given=["tool.r"]), dict(find="carts"), dict(forward=-1)])
def test_numbers_of_names_and_directions_are_checked(inverse_dynamics, wrong):
    with pytest.raises(ModelError) as refused:
        c_source(inverse_dynamics, **wrong)
    assert [refused.value.argument] == list(wrong)


def test_functions_without_c_code_are_refused():
    x, y, p = ca.MX.sym("x"), ca.SX.sym("y"), ca.SX.sym("p")
    residual = ca.Function("residual", [y, p], [y**2 - p])
    lost = ca.rootfinder("lost", "nlpsol", residual, {"nlpsol": "ipopt"})
    flow = ca.integrator("flow", "cvodes", {"x": y, "p": p, "ode": -p * y})
    for results in ([lost(1.0, x)], [flow(x0=1.0, p=x)["xf"]]):
        with pytest.raises(ModelError, match="f contains what has no C code"):
            c_source(ca.Function("f", [x], results))
