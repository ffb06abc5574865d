"""Variables that are sampled and held: against zero-order-hold solutions."""

import re

import casadi
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

from gantrytau import (
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    SolveError,
    Start,
    check,
    cos,
    der,
    sampled,
    simulate,
    sin,
    translate,
)
from gantrytau_models import FourBar, GantryTau, prototypes
from tests.simulation.sampled_models import Held, Slide

TOLERANCE = 1e-9
NEAR = 1e-8  # ten times the tolerance of the result


class Counter(Model):
    """Counts instants, and what it had counted one instant before."""

    count = Real(unit="1", description="instants so far")
    before = Real(unit="1", description="instants so far, one instant later", start=7.0)
    double = Real(unit="1", description="twice the count")

    def equations(self):
        yield sampled(self.count, self.count + 1, period=0.1)
        yield sampled(self.before, self.count, period=0.1)
        yield self.double == 2 * self.count


def held_solution(times, period, flow, renew, state):
    """Exact states of a linear system x' = flow x whose states are renewed at every period, (times, n)."""
    found = np.zeros((times.size, len(state)))
    for k in range(round(times[-1] / period) + 1):
        state = renew(k, state)
        after = times - k * period
        for row in np.flatnonzero((after > -1e-9) & (after < period - 1e-9)):
            found[row] = expm(flow * after[row]) @ state
        state = expm(flow * period) @ state
    return found


@pytest.mark.parametrize(("period", "points"), [(0.004, 501), (0.01, 38), (0.1, 101), (0.3, 11), (2.0, 7)])
def test_discrete_pd_moves_a_mass_as_the_zero_order_hold_says(period, points):
    found = simulate(Held(control=dict(period=period)), stop=1.0, tolerance=TOLERANCE, points=points)
    flow = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.5], [0.0, 0.0, 0.0]])

    def renew(k, s):
        return np.array([s[0], s[1], -50.0 * s[0] - 5.0 * s[1]])

    exact = held_solution(found.time, period, flow, renew, np.array([1.0, 0.0, 0.0]))
    assert np.abs(found["slide.x"] - exact[:, 0]).max() < NEAR
    assert np.abs(found["slide.v"] - exact[:, 1]).max() < NEAR
    assert np.abs(found["control.force"] - exact[:, 2]).max() < 50 * NEAR  # the gain


class Cascade(Slide):
    """A position controller every 20 ms leads a speed controller with integral part every 5 ms."""

    speed = Real(description="wanted speed")  # gains are plain numbers here, so no units
    integral = Real(description="integral part", start=0.5)
    gain = Parameter(20.0, description="gain of the speed")
    f = Real(unit="N", description="force of the motor")

    def equations(self):
        yield from super().equations()
        error = self.speed - self.v
        yield sampled(self.speed, 3 * (0.2 - self.x), period=0.02)
        yield sampled(self.integral, self.integral + 0.005 * 80 * error, period=0.005)
        yield sampled(self.f, self.gain * error + self.integral, period=0.005)


def test_two_rates_see_what_was_there_before_a_common_instant():
    found = simulate(Cascade(), stop=0.5, tolerance=TOLERANCE, points=201)
    flow = np.zeros((5, 5))  # x, v, speed, integral, force
    flow[0, 1], flow[1, 4] = 1.0, 0.5

    def renew(k, s):
        error = s[2] - s[1]
        speed = 3 * (0.2 - s[0]) if k % 4 == 0 else s[2]
        return np.array([s[0], s[1], speed, s[3] + 0.4 * error, 20 * error + s[3]])

    exact = held_solution(found.time, 0.005, flow, renew, np.array([1.0, 0.0, 0.0, 0.5, 0.0]))
    for name, column in zip(["x", "v", "speed", "integral", "f"], exact.T, strict=True):
        assert np.abs(found[name] - column).max() < 20 * NEAR, name  # the largest gain


def test_instants_are_counted_from_the_start_whatever_rounding_does():
    found = simulate(Counter(), start=0.3, stop=1.0, points=8)  # 0.3 + 7 * 0.1 is not 1.0 in binary numbers
    assert found["count"].tolist() == [1, 2, 3, 4, 5, 6, 7, 8]
    assert found["before"].tolist() == [0, 1, 2, 3, 4, 5, 6, 7]
    assert found["double"].tolist() == [2, 4, 6, 8, 10, 12, 14, 16]
    assert simulate(Counter(), start=0.3, stop=1.0, points=2).final("count") == 8


def test_a_held_value_jumps_at_its_instants_only():
    found = simulate(Held(control=dict(period=0.1)), stop=1.0, points=1001)
    force = found["control.force"].reshape(-1)[:1000].reshape(10, 100)
    assert np.all(force == force[:, :1])
    assert force[0, 0] == -50.0  # from the start at x = 1 m, at the first instant already
    x, v = found["slide.x"], found["slide.v"]
    assert np.allclose(force[:, 0], -50 * x[:1000:100] - 5 * v[:1000:100], rtol=1e-12)


class Vectors(Model):
    """A vector that is sampled, a matrix, and one element of a vector."""

    r = Real(3, unit="m", description="position", start=[1.0, 2.0, 3.0], fixed=True)
    last = Real(3, unit="m", description="sampled position", start=9.0)
    table = Real((2, 2), unit="1", description="sampled matrix")
    half = Real(2, unit="m", description="its second element is sampled")
    rate = Parameter([1.0, 0.0, -1.0], unit="m/s", description="speed")

    def equations(self):
        yield der(self.r) == self.rate
        yield sampled(self.last, self.r, period=0.25)
        yield sampled(self.table, self.table + casadi.DM([[1, 2], [3, 4]]), period=1.0)
        yield sampled(self.half[1], self.r[1], period=0.5)
        yield self.half[0] == 2 * self.half[1]


def test_vectors_and_matrices_are_sampled_element_by_element():
    found = simulate(Vectors(), stop=1.0, points=9)
    begun = np.floor(found.time / 0.25 + 1e-9) * 0.25
    places = np.array([1, 2, 3]) + np.outer(begun, [1, 0, -1])
    assert np.allclose(found["last"], places, rtol=0, atol=NEAR)
    assert found.final("table[1,0]") == 6  # twice: at 0 and at 1 s
    assert found.final("table[0,1]") == 4
    assert np.allclose(found["half"], [4.0, 2.0], rtol=0, atol=NEAR)


class Meter(Slide):
    """Measures the acceleration that a push causes, and repeats the push with the opposite sign."""

    f = Real(unit="N", description="sampled force", start=6.0)
    seen = Real(unit="m/s2", description="sampled acceleration")
    y = Real(unit="N", description="solves a cubic", start=1.5)
    root = Real(unit="N", description="sampled solution of the cubic")
    one = Parameter(1.0, unit="N2", description="one")

    def equations(self):
        yield from super().equations()
        yield self.y + self.y**3 / self.one == self.f
        yield sampled(self.f, -self.f, period=0.1)
        yield sampled(self.seen, der(self.v), period=0.1)
        yield sampled(self.root, self.y, period=0.1)


def test_an_instant_sees_accelerations_and_solved_unknowns_just_before_it():
    found = simulate(Meter(), stop=0.5, points=6)
    signs = (-1.0) ** np.arange(6)
    assert np.allclose(found["seen"], 3 * signs, rtol=1e-12)
    assert np.allclose(found["f"], -6 * signs, rtol=1e-12)
    solution = 1.6343652660048757  # of y + y^3 = 6
    assert np.allclose(found["root"], solution * signs, rtol=1e-6)
    cubic = found["y"] + found["y"] ** 3
    assert np.allclose(cubic, found["f"], rtol=1e-9)  # with the new value of the force


class Later(Model):
    """A held value under a second name, which has a start of its own."""

    inner = Counter()
    alias = Real(unit="1", description="the same", start=3.0)
    first = Real(unit="1", description="starts where it is told to")
    origin = Parameter(4.0, unit="1", description="start")

    def equations(self):
        yield self.alias == self.inner.before
        yield sampled(self.first, 2 * self.first, period=1.0, start=self.origin)


def test_before_the_first_instant_a_held_variable_has_its_own_start():
    dae = translate(Later(), events=True)
    start = dae.evaluate()
    assert (start["inner.before"], start["alias"], start["inner.count"], start["first"]) == (
        7.0,
        7.0,
        0.0,
        4.0,
    )
    assert simulate(dae, stop=0.5)["first"][0] == 8.0
    assert simulate(dae, stop=0.5, parameters={"origin": 1.5})["first"][0] == 3.0
    assert simulate(Later(inner=dict(count=Start(5.0))), stop=0.05)["inner.before"][0] == 5.0


def test_sampled_inputs_and_sampled_variables_go_together():
    knots = np.array([0.0, 0.013, 0.2, 0.31, 0.5])
    values = np.array([0.0, 0.3, -0.1, 0.4, 0.4])
    course = {"control.wanted": (knots, values)}
    found = simulate(
        Held(control=dict(period=0.02)), stop=0.5, inputs=course, tolerance=TOLERANCE, points=126
    )
    flow = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.5], [0.0, 0.0, 0.0]])

    def renew(k, s):
        wanted = np.interp(0.02 * k, knots, values)
        return np.array([s[0], s[1], 50.0 * (wanted - s[0]) - 5.0 * s[1]])

    exact = held_solution(found.time, 0.02, flow, renew, np.array([1.0, 0.0, 0.0]))
    assert np.abs(found["slide.x"] - exact[:, 0]).max() < NEAR
    assert np.abs(found["control.wanted"] - np.interp(found.time, knots, values)).max() < 1e-12


def test_parameters_change_period_and_gain():
    dae = translate(Held(), events=True)
    found = simulate(dae, stop=0.3, parameters={"control.period": 0.1, "control.k": 10.0}, points=4)
    slow = simulate(Held(control=dict(period=0.1, k=10.0)), stop=0.3, points=4)
    assert np.array_equal(found["slide.x"], slow["slide.x"])
    assert found["control.force"][0] == -10.0


class Robot(Model):
    """The robot with a PD controller at each cart, sampled together."""

    robot = GantryTau(prototypes.L1)
    period = Parameter(0.01, unit="s", description="sampling period")
    k = Parameter(2e4, unit="N/m", description="gain of the position")
    d = Parameter(600.0, unit="N.s/m", description="gain of the speed")
    wanted = Input(3, unit="m", description="wanted positions")
    force = Real(3, unit="N", description="forces of the motors")

    def equations(self):
        for j, cart in enumerate(self.robot.carts):
            push = self.k * (self.wanted[j] - cart.s) - self.d * cart.v
            yield sampled(self.force[j], push, period=self.period)
            yield cart.f == self.force[j]


def test_the_robot_under_discrete_control_moves_as_when_integrated_instant_by_instant():
    dae = translate(Robot(), events=True)
    carts = [f"robot.carts[{j}].s" for j in range(3)]
    begin = np.array([dae.evaluate()[n] for n in carts])
    course = {"wanted": lambda t: [begin[j] + 0.05 * (1 - cos(20 * t)) for j in range(3)]}
    found = simulate(dae, stop=0.1, inputs=course, tolerance=TOLERANCE, points=21)

    states, forces = ["robot.tool.r", "robot.tool.v"], [f"robot.carts[{j}].f" for j in range(3)]
    plant = translate(GantryTau(prototypes.L1))
    rate = plant.function(["tool.r", "tool.v", *(n.removeprefix("robot.") for n in forces)], ["der(tool.v)"])
    speeds = [f"carts[{j}].{letter}" for letter in "sv" for j in range(3)]
    carts_of = plant.function(["tool.r", "tool.v"], speeds)

    def move(_, y, push):
        return np.concatenate([y[3:], np.array(rate(y[:3], y[3:], *push)).ravel()])

    y = np.concatenate([found[n][0] for n in states])
    for k in range(10):
        measured = np.array([float(x) for x in carts_of(y[:3], y[3:])])
        wanted = begin + 0.05 * (1 - np.cos(20 * 0.01 * k))
        push = 2e4 * (wanted - measured[:3]) - 600 * measured[3:]
        # N; 2e4 N/m times the error of 1e-8 m
        assert np.allclose(found["force"][2 * k], push, rtol=0, atol=1e-3)
        y = solve_ivp(move, (0, 0.01), y, args=(push,), method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        assert np.abs(found[states[0]][2 * k + 2] - y[:3]).max() < NEAR
        assert np.abs(found[states[1]][2 * k + 2] - y[3:]).max() < 100 * NEAR  # 1/s, the closed loop's speed


def test_a_dae_takes_what_is_sampled_as_known_behind_its_inputs():
    dae = translate(Held(), events=True)
    assert dae.inputs == ("control.wanted",)
    assert dae.known == dae.system().inputs == ("control.wanted", "control.force")
    rate = dae.function(["control.force"], ["der(slide.v)"])
    assert float(rate(8.0)) == 4.0
    assert float(dae.function(["der(slide.v)"], ["slide.f"])(4.0)) == 8.0
    assert dae.evaluate({"control.force": 8.0})["der(slide.v)"] == 4.0
    text = dae.equations()
    assert "sampled: control.force = " in text
    assert "every control.period s, from control" in text
    assert "when sample(0, 'control.period') then" in dae.equations("base-modelica")
    assert r"sampled: $\mathit{control}.\mathit{force}$ = " in dae.equations("latex")
    assert "sampled: control.force = " in re.sub("</?a.*?>", "", dae.equations("html"))
    assert (dae.flat.sampled[0].path, dae.flat.sampled[0].model) == ("control", "Pd")
    assert check(Held()).unknowns == check(Held()).equations


class Standing(Model):
    """Two masses; the first may be led."""

    first = Slide()
    second = Slide()
    c = Parameter(2.0, unit="N/m", description="gain")
    held = Real(unit="N", description="sampled force")

    def equations(self):
        yield sampled(self.held, -self.c * self.second.x, period=0.1)
        yield self.second.f == self.held


def test_what_is_given_replaces_the_inputs_only():
    dae = translate(Standing(), given=["first.x"], find=["first.f"], events=True)
    assert dae.inputs == ("first.x",)
    assert dae.known == ("first.x", "held")
    found = simulate(dae, stop=0.2, inputs={"first.x": lambda t: 1 - cos(2 * t)})
    assert np.allclose(found["first.f"], 8 * np.cos(2 * found.time), atol=1e-9)
    assert found["held"][0] == -2.0


class Watched(Model):
    """A parallelogram that falls flat, its crank sampled."""

    bar = FourBar(1.0, 0.3, 1.0, 0.3)
    seen = Real(unit="rad", description="sampled angle")

    def equations(self):
        yield sampled(self.seen, self.bar.crank.phi, period=0.05)


def test_a_singular_pose_is_met_when_it_is_without_instants():
    with pytest.raises(SolveError, match="meets a singular pose") as watched:
        simulate(Watched(), stop=1.0)
    with pytest.raises(SolveError, match="meets a singular pose") as plain:
        simulate(FourBar(1.0, 0.3, 1.0, 0.3), stop=1.0)
    assert watched.value.time == pytest.approx(plain.value.time, abs=1e-6)
    result = watched.value.result
    # the fall to the pose grows errors a hundredfold
    crank = simulate(FourBar(1.0, 0.3, 1.0, 0.3), stop=0.25, points=6, tolerance=1e-11)["crank.phi"]
    assert result.final("seen") == pytest.approx(crank[-1], abs=NEAR)


class Rates(Model):
    """Derivatives that nothing but the sampling asks for."""

    course = Input(unit="1", description="a function of time")
    rate = Real(unit="1/s", description="sampled rate of it")
    x = Real(unit="1", description="falls off", start=1.0, fixed=True)
    square = Real(unit="1", description="its square")
    fall = Real(unit="1/s", description="sampled rate of the square")
    a = Parameter(1.0, unit="1/s", description="rate")

    def equations(self):
        yield der(self.x) == -self.a * self.x
        yield self.square == self.x**2
        yield sampled(self.rate, der(self.course), period=0.1)
        yield sampled(self.fall, der(self.square), period=0.1)


def test_derivatives_that_only_the_sampling_asks_for_are_found():
    found = simulate(Rates(), stop=1.0, points=11, inputs={"course": lambda t: sin(3 * t)})
    assert np.allclose(found["rate"], 3 * np.cos(3 * found.time), rtol=1e-12)
    assert np.abs(found["fall"] + 2 * np.exp(-2 * found.time)).max() < NEAR
    with pytest.raises(ModelError, match="input course is differentiated 1 times by the model"):
        simulate(Rates(), stop=1.0, inputs={"course": ([0.0, 1.0], [0.0, 1.0])})


@pytest.mark.parametrize("points", [2, 3, 21])
def test_what_is_sampled_is_found_between_output_points(points):
    found = simulate(Counter(), stop=2.0, points=points)
    times = np.linspace(0.0, 2.0, 97)
    count = np.floor(times / 0.1 + 1e-9) + 1
    assert found.time.size == points
    np.testing.assert_array_equal(found.at(times, "count"), count)
    np.testing.assert_array_equal(found.select(["count"]).at(times, "count"), count)
    np.testing.assert_array_equal(found.at(times[5:], "before"), count[5:] - 1)
    assert found.at(0.25, "double") == 6.0
