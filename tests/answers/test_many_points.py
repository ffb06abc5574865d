"""Array functions: the answers of `Dae.function` point by point, for many points at once."""

import casadi as ca
import numpy as np
import pytest

from gantrytau import Input, Model, Parameter, Real, cos, fmin, sin, table, translate
from gantrytau.answers.branch_follower import follow
from gantrytau.answers.many_points.array_program import ArrayProgram, NotForArrays
from gantrytau.answers.many_points.elimination import eliminated, order_of_pivots, pivots_in_order
from gantrytau.answers.many_points.followed_branches import FollowedBranch
from gantrytau.answers.many_points.kept_unknowns import ReducedBranch, reduced
from gantrytau.border.refusal import ModelError, StructureError
from gantrytau_models import (
    DeltaRobot,
    FiveBar,
    FourBar,
    GantryTau,
    SixLinkGantryTau,
    StewartPlatform,
    prototypes,
)
from tests.answers.test_branches import Coupled, Cubic
from tests.families import first_of

PHI = [f"arms[{i}].phi" for i in range(3)]
LEGS = [f"legs[{k}].s" for k in range(6)]
POSE = ["platform.r", *(f"platform.q[{k}]" for k in (1, 2, 3))]
CARTS = [f"carts[{i}].s" for i in range(3)]


def one_by_one(dae, given, find, arguments):
    """Results (N, m) of `Dae.function`."""
    function = dae.function(given, find)
    rows = [function.call([ca.DM(a[k]) for a in arguments]) for k in range(len(arguments[0]))]
    return [np.array([np.array(y).ravel(order="F") for y in column]) for column in zip(*rows, strict=True)]


def spread(dae, given, size, count=300):
    """Arguments around the start."""
    start, random = dae.evaluate(), np.random.default_rng(3)
    return [np.atleast_1d(start[n]) + size * random.uniform(-1, 1, (count, np.size(start[n]))) for n in given]


ROBOTS = {
    "delta, mostly out of reach": (DeltaRobot, ["tool.r"], PHI, 1.0),
    "delta, forward": (DeltaRobot, PHI, ["tool.r", "tool.R"], 0.8),
    "Stewart, forward": (StewartPlatform, LEGS, ["platform.r", "platform.R"], 0.1),
    "six links, inverse": (lambda: SixLinkGantryTau(prototypes.D1), ["tool.r"], CARTS, 0.4),
    "four bars, whole turns": (FourBar, ["crank.phi"], ["rocker.phi", "coupler.phi"], 7.0),
    "delta, inverse": (DeltaRobot, ["tool.r"], PHI, 0.2),
    "Stewart, inverse": (StewartPlatform, POSE, LEGS, 0.15),
    "three links, inverse": (lambda: GantryTau(prototypes.L1), ["tool.r"], CARTS, 1.0),
}


@pytest.mark.parametrize("name", first_of(ROBOTS, 5))
def test_robots_answer_as_point_by_point(name):
    make, given, find, size = ROBOTS[name]
    dae = translate(make(), units=False)
    arguments = spread(dae, given, size)
    function = dae.array_function(given, find)
    for found, expected in zip(function(*arguments), one_by_one(dae, given, find, arguments), strict=True):
        # NaN in the same places; roundings of 1 m
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    # derivatives beside differences, of which a step of 1e-6 loses half of the digits
    step = 1e-6 * np.eye(arguments[0].shape[1])[0]
    before, behind = (np.hstack(function(arguments[0] + s * step, *arguments[1:])) for s in (-1, 1))
    rates = function.jacobian(*arguments)[:, :, 0]
    known = np.isfinite(behind - before).all(axis=1) & (np.abs(rates) < 10).all(axis=1)
    assert known.sum() > 20
    np.testing.assert_allclose(rates[known], (behind - before)[known] / 2e-6, atol=1e-6)


@pytest.mark.parametrize(
    ("model", "widest"), [(Cubic(), 3.0), (Cubic(unit=1e-9, amount=1e-9), 3e-9), (Coupled(), 3.0)]
)
def test_branches_end_at_the_same_folds(model, widest):
    dae = translate(model)
    u = np.concatenate([np.linspace(-widest, widest, 500), widest * np.array([1e3, -1e3])])
    (found,), (expected,) = dae.array_function(["u"], ["x"])(u), one_by_one(dae, ["u"], ["x"], [u])
    assert 0 < np.isnan(expected).sum() < 500
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.fixture(scope="module")
def delta():
    return translate(DeltaRobot(), units=False)


def test_an_unknown_that_turns_back_is_no_end(delta):
    """The first shoulder of a delta robot stands still where the way to a pose is across its arm's circle."""
    r = np.array([[-0.56726626, -0.39382483, -0.3260063]])
    (expected,) = one_by_one(delta, ["tool.r"], ["arms[0].phi"], [r])
    (found,) = delta.array_function(["tool.r"], ["arms[0].phi"])(np.tile(r, (300, 1)))
    np.testing.assert_allclose(found, np.tile(expected, (300, 1)), atol=1e-12)

    # the same alone: sin(x) = y(q) with y back where it was at the start
    x, q = ca.SX.sym("x"), ca.SX.sym("q", 2)
    residual = ca.Function("f", [x, q], [ca.sin(x) - 0.5 * q[0] * (1 - q[0]) - 0.1 * q[1]])
    end = np.array([[1.0], [0.0]])
    assert FollowedBranch(residual, np.zeros(1), np.zeros(2))(end)[0, 0] == pytest.approx(0.0, abs=1e-14)
    one, arrived = follow("f", residual, ca.DM(0.0), ca.DM([0.0, 0.0]), ca.MX(ca.DM(end)))
    assert float(ca.evalf(arrived)) == 1.0
    assert float(ca.evalf(one)) == pytest.approx(0.0, abs=1e-6)


def test_sizes_of_none_one_and_many(delta):
    function = delta.array_function(["tool.r"], [*PHI, "tool.R"])
    assert [x.shape for x in function(np.zeros((0, 3)))] == [(0, 1)] * 3 + [(0, 9)]
    assert function.jacobian(np.zeros((0, 3))).shape == (0, 12, 3)
    r = delta.evaluate()["tool.r"] + np.random.default_rng(0).uniform(-0.2, 0.2, (100_000, 3))
    r[17] = np.nan
    many = np.hstack(function(r))
    assert np.isnan(many[17]).all()
    assert np.isfinite(np.delete(many, 17, axis=0)).all()
    for count in (1, 2, 255, 256, 2049):
        np.testing.assert_allclose(np.hstack(function(r[:count])), many[:count], atol=1e-13)


def test_arrays_of_other_shapes_are_refused(delta):
    function = delta.array_function(["tool.r"], PHI)
    for arguments in ((), (np.zeros(3),), (np.zeros((2, 2)),), (np.zeros((2, 3)), np.zeros(2))):
        with pytest.raises(ModelError, match=r"expected tool.r \(N, 3\); one row a point"):
            function(*arguments)


def test_what_is_not_determined_is_refused_at_once(delta):
    with pytest.raises(StructureError, match="Undetermined"):
        delta.array_function(["arms[0].phi"], ["tool.r"])


class Looked(Model):
    """y is read from a table, z where |y| and a limit meet."""

    u = Input(start=0.0)
    y = Real()
    z = Real()

    def equations(self):
        yield self.y == table(self.u, [0.0, 1.0, 2.0], [0.0, 1.0, 4.0])
        yield self.z + 0.1 * fmin(self.z, 1.0) ** 3 == self.y


def test_what_numpy_does_not_compute_goes_point_by_point():
    dae = translate(Looked())
    u = np.linspace(0.0, 2.0, 400)
    found = dae.array_function(["u"], ["y", "z"])(u)
    for one, other in zip(found, one_by_one(dae, ["u"], ["y", "z"], [u]), strict=True):
        np.testing.assert_array_equal(one, other)
    x = ca.SX.sym("x")
    with pytest.raises(NotForArrays):
        ArrayProgram(ca.Function("f", [x], [ca.remainder(x, 2.0)]))


class Sliding(Model):
    """y and z follow x over a pivot that vanishes at x = 0, 90 and 180 degrees, in turns."""

    x = Input(unit="rad", start=0.3)
    y = Real(start=1.0)
    z = Real(start=1.0)
    length = Parameter(2.0)
    unit = Parameter(1.0, description="unit of y")

    def equations(self):
        yield cos(self.x) * self.unit * self.y + sin(self.x) * self.z == self.length
        yield -sin(self.x) * self.unit * self.y + cos(self.x) * self.z == 1.0


def test_pivots_that_vanish_at_right_angles():
    dae = translate(Sliding())
    x = np.concatenate([np.arange(-8, 9) * np.pi / 2, np.linspace(-7.0, 7.0, 400)])
    y, z = (found[:, 0] for found in dae.array_function(["x"], ["y", "z"])(x))
    np.testing.assert_allclose(y, 2 * np.cos(x) - np.sin(x), atol=1e-12)
    np.testing.assert_allclose(z, 2 * np.sin(x) + np.cos(x), atol=1e-12)


def test_exactly_symmetric_poses_of_a_delta_robot(delta):
    """Poses on the axis, and turned by 120 degrees: joints are equal, and change places."""
    function = delta.array_function(["tool.r"], PHI)
    down = np.column_stack([np.zeros((300, 2)), np.linspace(-0.9, -0.5, 300)])
    q = np.hstack(function(down))
    np.testing.assert_allclose(q, np.repeat(q[:, :1], 3, axis=1), atol=1e-13)
    turn = np.array([[-0.5, -np.sqrt(0.75), 0.0], [np.sqrt(0.75), -0.5, 0.0], [0.0, 0.0, 1.0]])
    r = down + np.random.default_rng(2).uniform(-0.1, 0.1, down.shape)
    np.testing.assert_allclose(
        np.hstack(function(r @ turn.T)), np.hstack(function(r))[:, [2, 0, 1]], atol=1e-12
    )


def test_a_plate_that_turns_is_no_unknown_that_keeps_its_value():
    y, q = ca.SX.sym("y", 2), ca.SX.sym("q", 1)
    kept = ca.Function("kept", [y, q], [ca.vertcat(y[0] + y[1] ** 3 - q, y[1] * (1 + y[0] ** 2))])
    whole = FollowedBranch(kept, np.zeros(2), np.zeros(1))
    near = np.linspace(-0.5, 0.5, 20)[None]
    found = reduced(whole, whole(near))
    assert isinstance(found, ReducedBranch)
    assert found.places == [[0]]
    np.testing.assert_allclose(found(near), np.vstack([near, 0 * near]), atol=1e-14)
    turning = ca.Function("turning", [y, q], [ca.vertcat(y[0] + y[1] - q, y[0] - 2 * y[1])])
    whole = FollowedBranch(turning, np.zeros(2), np.zeros(1))
    assert reduced(whole, whole(near)) is whole


def test_an_angle_in_closed_form_is_the_one_that_is_followed():
    """An arm of length 1 whose rod of length 2 holds a point: on its side it is known wherever the rod reaches."""
    phi, r = ca.SX.sym("phi"), ca.SX.sym("r", 2)
    rod = ca.sumsqr(r - ca.vertcat(ca.cos(phi), ca.sin(phi))) - 4
    start, begin = np.array([np.arccos(0.25)]), np.array([2.0, 0.0])
    arm = FollowedBranch(ca.Function("rod", [phi, r], [rod]), start, begin)
    ends = np.random.default_rng(6).uniform(-4, 4, (2, 500))
    far = np.linalg.norm(ends, axis=0)
    found = arm.beside(ends, np.tile(begin[:, None], 500), np.tile(start[:, None], 500))[0]
    np.testing.assert_array_equal(np.isnan(found), (far < 1) | (far > 3))
    straight = arm(ends)[0]
    led = np.isfinite(straight)  # the others lie behind the circle that the rod cannot enter
    assert 0 < led.sum() < np.isfinite(found).sum()
    np.testing.assert_allclose(np.cos(found - straight)[led], 1.0, atol=1e-12)
    bent = FollowedBranch(ca.Function("bent", [phi, r], [rod + phi / 9]), start, begin)
    assert bent.angle is None


def test_elimination_beside_numpy():
    random = np.random.default_rng(4)
    for n in range(1, 7):
        matrix = random.normal(size=(n, n)) * (random.uniform(size=(n, n)) < 0.6)
        matrix += np.eye(n)[random.permutation(n)]
        order = order_of_pivots(matrix)
        assert order is not None
        assert sorted(p for p, _ in order) == list(range(n))
        right = random.normal(size=(n, 2))
        found = np.array(ca.evalf(eliminated(ca.SX(matrix), ca.SX(right), order)))
        np.testing.assert_allclose(found, np.linalg.solve(matrix, right), atol=1e-9)
        pivots = np.array(ca.evalf(pivots_in_order(ca.SX(matrix), order)))
        assert abs(pivots.prod()) == pytest.approx(abs(np.linalg.det(matrix)))
    assert order_of_pivots(np.ones((2, 2))) is None


class Still(Model):
    """Two unknowns that are 0 where the model starts."""

    a, b = Input(start=0.0), Input(start=0.0)
    x, y = Real(start=0.0), Real(start=0.0)

    def equations(self):
        yield self.a == self.x + 0.3 * sin(self.y + self.x)
        yield self.b == self.y - 0.3 * sin(self.x)


def test_the_start_itself_is_answered_where_unknowns_are_zero_there():
    a = np.linspace(-1, 1, 301)
    a[0] = 1e-300
    assert a[150] == 0
    x, y = (one.ravel() for one in translate(Still()).array_function(["a", "b"], ["x", "y"])(a, a))
    assert x[150] == y[150] == 0
    assert abs(x[0]) < 1e-299
    assert np.abs(x + 0.3 * np.sin(x + y) - a).max() < 1e-14


@pytest.mark.parametrize("count", [3, 300])
def test_an_arm_out_of_reach_does_not_lead_the_other_one_astray(count):
    beside = np.array([0.49, -0.45])  # for the second arm alone
    where = beside + np.random.default_rng(0).uniform(-0.03, 0.03, (count, 2))
    found = translate(FiveBar()).array_function(
        ["tool.r[0]", "tool.r[1]"], ["cranks[0].phi", "cranks[1].phi"]
    )
    left, right = (one.ravel() for one in found(*where.T))
    assert np.isnan(left).all()
    # two circles about its pivot and about the tool meet in its elbow, which stays on the outer side
    x, y = where[:, 0] - 0.1, where[:, 1]
    d = np.hypot(x, y)
    expected = np.arctan2(y, x) - np.arccos((d**2 + 0.3**2 - 0.4**2) / (2 * 0.3 * d))
    there = d < 0.68
    assert there.any()
    assert np.abs(right - expected)[there].max() < 1e-12


class Constant(Model):
    """A block that nothing given stands in, before one."""

    a = Input(start=0.0)
    x, y, z = Real(start=0.5), Real(start=0.5), Real(start=0.0)

    def equations(self):
        yield self.x == 0.9 * cos(self.x + self.y)
        yield self.y == 0.8 * cos(self.y - self.x)
        yield self.a == self.z + 0.3 * sin(self.z)


@pytest.mark.parametrize("count", [3, 300])
def test_blocks_that_nothing_given_stands_in(count):
    a = np.linspace(-1, 1, count)
    x, y, z = (one.ravel() for one in translate(Constant()).array_function(["a"], ["x", "y", "z"])(a))
    assert np.ptp(x) == 0
    assert np.abs([x - 0.9 * np.cos(x + y), y - 0.8 * np.cos(y - x), z + 0.3 * np.sin(z) - a]).max() < 1e-14
