"""Models that sample go from place to place in explicit steps: exact solutions, and the integrator as a second route."""

import signal

import casadi as ca
import numpy as np
import pytest
from scipy.linalg import expm

from gantrytau import (
    Discrete,
    Input,
    Mode,
    Model,
    Parameter,
    Real,
    Samples,
    SolveError,
    der,
    fabs,
    if_else,
    pre,
    reinit,
    sampled,
    simulate,
    sin,
    time,
    transition,
    translate,
    when,
)
from gantrytau.kernels import c_compiler, kernel
from gantrytau.simulation.motion import all_coordinates
from gantrytau.simulation.sampling.buffers import Buffer
from gantrytau.simulation.sampling.runge_kutta import one_step
from gantrytau.simulation.sampling.sampler import Sampler
from gantrytau.simulation.sampling.sampling_interval import linear, passage
from gantrytau_models import SixLinkGantryTau, prototypes
from gantrytau_models.control.tracking import ControlledRobot
from tests.simulation.sampled_models import Held

TOLERANCE = 1e-9
NEAR = 1e-8  # ten times the tolerance of the result


def both_ways(monkeypatch, model, names, **arguments):
    """Values of variables, (2, names, times): in explicit steps, and with the integrator started anew at each instant."""
    dae = translate(model, events=True)
    quick = simulate(dae, tolerance=TOLERANCE, **arguments)
    calls = []
    monkeypatch.setattr(Sampler, "suits", property(lambda self: calls.append(1) or False))
    slow = simulate(dae, tolerance=TOLERANCE, **arguments)
    assert calls
    return np.array([[found[n] for n in names] for found in (quick, slow)])


def test_a_step_has_order_eight_and_estimates_of_its_error():
    t, x, h = (ca.MX.sym(n) for n in "txh")
    step = ca.Function("step", [t, x, h], one_step(lambda t, x: x * ca.cos(t), t, x, h))
    errors, fifth = [], []
    for n in (4, 8):
        at = ca.DM(1.0)
        for k in range(n):
            at, _, e5 = step(2.0 * k / n, at, 2.0 / n)
            fifth.append(abs(float(e5)))
        errors.append(abs(float(at) - np.exp(np.sin(2.0))))
    assert 7.5 < np.log2(errors[0] / errors[1]) < 9.5
    # a rate: one less than the order of the step's own error
    assert np.log2(max(fifth[:4]) / max(fifth[4:])) > 4.5


class Oscillator(Model):
    """A mass on a spring, held by a discrete controller with an integral part; gains are plain numbers, so no units."""

    m = Parameter(2.0, description="mass")
    c = Parameter(300.0, description="stiffness")
    x = Real(description="position", start=0.3, fixed=True)
    v = Real(description="speed", start=0.0, fixed=True)
    f = Real(description="sampled force")
    integral = Real(description="sampled integral part")

    def equations(self):
        yield self.v == der(self.x)
        yield self.m * der(self.v) == self.f - self.c * self.x
        yield sampled(self.integral, self.integral - 20.0 * self.x, period=0.02)
        yield sampled(self.f, -5.0 * self.v + self.integral, period=0.02)


def test_a_linear_plant_moves_as_the_matrix_exponential_says():
    found = simulate(Oscillator(), stop=2.0, points=101, tolerance=1e-11)
    flow = np.array([[0.0, 1.0, 0.0], [-150.0, 0.0, 0.5], [0.0, 0.0, 0.0]])
    x, v, integral = 0.3, 0.0, 0.0
    for k in range(101):
        f, integral = -5.0 * v + integral, integral - 20.0 * x
        row = [found[n][k] for n in ("x", "v", "f", "integral")]
        assert np.abs(np.array(row) - [x, v, f, integral]).max() < 1e-10, k  # ten times the tolerance
        x, v, _ = expm(0.02 * flow) @ [x, v, f]


class Bounded(Oscillator):
    """The same with a limit of the force, a stop that is hit, and friction."""

    held = Real(description="limited force")
    low = Real(description="force of the stop and of friction")

    def equations(self):
        yield self.v == der(self.x)
        yield self.held == ca.fmax(-1.0, ca.fmin(self.f, 6.0))
        yield self.low == if_else(self.x > 0.1, 400.0 * (0.1 - self.x), 0.0) - 0.3 * fabs(self.v) * self.v
        yield self.m * der(self.v) == self.held - self.c * self.x + self.low + sin(self.v)
        yield sampled(self.integral, self.integral - 20.0 * self.x, period=0.03)
        yield sampled(self.f, -5.0 * self.v + self.integral, period=0.02)


@pytest.mark.parametrize("points", [2, 77, 1001])
def test_switches_of_states_and_of_what_is_held_are_those_of_the_integrator(monkeypatch, points):
    names = ["x", "v", "f", "integral", "held"]
    quick, slow = both_ways(monkeypatch, Bounded(), names, stop=2.0, points=points)
    assert np.abs(quick - slow).max() < 10 * NEAR  # gains of 5 and 20
    assert points < 3 or np.ptp(slow[4]) == 7.0  # both limits are met


class Kicked(Oscillator):
    """The same with friction, kicked by an input that jumps."""

    kick = Input(start=0.0, description="force of the kicks")
    seen = Real(description="sampled kick")

    def equations(self):
        yield self.v == der(self.x)
        yield self.m * der(self.v) == self.f - self.c * self.x + self.kick - 0.3 * fabs(self.v) * self.v
        yield sampled(self.seen, self.kick, period=0.03)
        yield sampled(self.integral, self.integral - 20.0 * self.x, period=0.03)
        yield sampled(self.f, -5.0 * self.v + self.integral, period=0.02)


def test_inputs_that_jump_between_switches_and_instants(monkeypatch):
    times = np.unique(np.round(np.random.default_rng(2).uniform(0.0, 1.0, 60), 3))
    times = np.unique([0.0, *times, 0.63, 1.0])
    kicks = np.random.default_rng(3).uniform(-9.0, 9.0, times.size)
    given = {"kick": Samples(times, kicks, kind="constant")}
    names = ["x", "v", "f", "seen"]
    found = both_ways(monkeypatch, Kicked(), names, stop=1.0, points=41, inputs=given)
    assert np.abs(found[0] - found[1]).max() < 10 * NEAR  # gains of 5 and 20
    latest = {kicks[np.searchsorted(times, 0.03 * k + 1e-9) - 1] for k in range(34)}
    assert set(found[0][3].tolist()) <= latest | {0.0}


def test_a_stiff_plant_is_left_to_the_integrator_and_right(monkeypatch):
    class Stiff(Oscillator):
        lag = Real(description="fast lag of the force", start=0.0, fixed=True)

        def equations(self):
            yield self.v == der(self.x)
            yield der(self.lag) == 1e7 * (self.f - self.lag)
            yield self.m * der(self.v) == self.lag - self.c * self.x
            yield sampled(self.f, -5.0 * self.v, period=0.02)
            yield sampled(self.integral, self.integral + 1, period=0.02)

    quick, slow = both_ways(monkeypatch, Stiff(c=200.0), ["x", "v", "integral"], stop=0.2, points=11)
    assert np.abs(quick - slow).max() < NEAR
    lagged = simulate(Oscillator(c=200.0), stop=0.02, points=3)
    assert abs(quick[0][0] - lagged["x"][0]) < NEAR


@pytest.mark.parametrize("kind", ["linear", "constant"])
def test_samples_as_inputs_have_corners_between_instants(monkeypatch, kind):
    t = np.linspace(0.0, 1.0, 334)
    wanted = np.random.default_rng(3).uniform(-0.1, 0.1, t.size)
    names = ["slide.x", "slide.v", "control.force"]
    found = both_ways(
        monkeypatch,
        Held(),
        names,
        stop=1.0,
        points=51,
        inputs={"control.wanted": Samples(t, wanted, kind=kind)},
    )
    assert np.abs(found[0] - found[1]).max() < 50 * NEAR  # the gain


def test_the_controlled_robot_tracks_as_with_the_integrator(monkeypatch):
    robot = ControlledRobot(prototypes.L1)
    begin = translate(robot, events=True).start
    t = np.linspace(0.0, 0.1, 11)
    course = np.array([begin[f"r_ref[{k}]"] + 0.05 * (1 - np.cos(20 * t)) for k in range(3)]).T
    inputs = {"r_ref": Samples(t, course, kind="linear")}
    names = [f"{name}[{k}]" for name in ("r", "robot.tool.v", "error") for k in range(3)]
    quick, slow = both_ways(monkeypatch, robot, names, stop=0.1, points=26, inputs=inputs)
    assert np.abs(quick - slow).max() < NEAR


@pytest.mark.skipif(c_compiler() is None, reason="no C compiler")
def test_kernels_give_the_same_numbers_bit_by_bit(monkeypatch, tmp_path):
    monkeypatch.setenv("GANTRYTAU_CACHE", str(tmp_path))
    coordinates = all_coordinates(translate(ControlledRobot(prototypes.L1), events=True), {})
    function = passage(coordinates).function
    quick = kernel(function, 1e9, wait=True)
    assert quick.class_name() == "External"
    start = coordinates.dae.start
    held = [start[n] for n in coordinates.held] + [0.0] * len(coordinates.switches)
    y = np.array([*(start[n] for n in coordinates.states), *held])
    told = np.array([0.0, 0.004, 0.0, *(1.0 for _ in coordinates.held), 0.0])
    random = np.random.default_rng(5)
    for _ in range(20):
        point = y * random.uniform(0.99, 1.01, y.size)
        for one, other in zip(function(point, told), quick(point, told), strict=True):
            assert np.array_equal(np.array(one), np.array(other), equal_nan=True)


def test_an_interrupt_between_two_calls_keeps_what_was_computed(monkeypatch):
    calls, steps = [], Buffer.steps

    def pressed(self, *arguments):
        calls.append(1)
        if len(calls) == 5:
            signal.raise_signal(signal.SIGINT)
        return steps(self, *arguments)

    monkeypatch.setattr(Buffer, "steps", pressed)
    with pytest.raises(SolveError, match="simulation interrupted at t = ") as stopped:
        simulate(Held(), stop=60.0, points=1001)
    assert len(calls) == 5  # none behind it
    assert 0 < stopped.value.result.time[-1] < 60.0


class Unbounded(Held):
    """Its controller divides by what vanishes after a second."""

    inverse = Real(description="sampled inverse")
    clock = Real(description="falls to zero", start=1.0, fixed=True)

    def equations(self):
        yield from super().equations()
        yield der(self.clock) == -1
        yield sampled(self.inverse, 1 / (1e-6 + self.clock) ** 400, period=0.25)


def test_a_sampled_value_that_is_not_finite_is_named_at_its_instant():
    with pytest.raises(SolveError, match=r"inverse.*t = 1 s") as stopped:
        simulate(Unbounded(), stop=2.0)
    assert stopped.value.time == 1.0


def test_two_points_and_many_show_the_same_end():
    ends = [simulate(Bounded(), stop=1.0, points=points).final("x") for points in (2, 3, 501, 3001)]
    assert np.ptp(ends) < 1e-8  # the tolerance


class BrakedSixLinks(Model):
    """The six-link robot, whose accelerations and forces are algebraic unknowns, braked by sampled forces."""

    robot = SixLinkGantryTau(prototypes.L1)
    d = Parameter(500.0, unit="N.s/m", description="gain of the speed")
    m = Parameter(2.0, unit="kg", description="gain of the acceleration")
    force = Real(3, unit="N", description="sampled forces of the motors")

    def equations(self):
        for j, cart in enumerate(self.robot.carts):
            yield sampled(self.force[j], -self.d * cart.v - self.m * der(cart.v), period=0.01)
            yield cart.f == self.force[j]


def test_linear_algebraics_are_solved_within_the_steps(monkeypatch):
    names = [f"robot.carts[{k}].{letter}" for k in range(3) for letter in "sv"]
    quick, slow = both_ways(monkeypatch, BrakedSixLinks(), [*names, "force[0]"], stop=0.05, points=6)
    assert np.abs(quick - slow)[:-1].max() < NEAR
    assert np.abs(quick - slow)[-1].max() < 500 * NEAR  # the gain
    coordinates = all_coordinates(translate(BrakedSixLinks(), events=True), {})
    assert coordinates.algebraics
    assert linear(coordinates)


class Counted(Model):
    """A sampled loop with whens on a state, on what is sampled, and on the time."""

    a = Real(start=0.0)
    x = Real(start=0.0, fixed=True)
    level = Discrete(1.0)
    crossed = Discrete(0)
    at = Discrete(0.0)
    full = Discrete(0)

    def equations(self):
        yield der(self.x) == -self.x + self.a
        yield sampled(self.a, if_else(self.x > 0.7, 0.0, self.level) + 0.1 * self.a, period=0.01)
        yield when(self.x >= 0.5, self.crossed == pre(self.crossed) + 1, self.at == time)
        yield when(self.a >= 1.05, self.full == pre(self.full) + 1)
        yield when(time >= 3.001, self.level == 0.6, reinit(self.x, 0.1))


def test_whens_act_between_and_at_instants_as_by_the_integrator(monkeypatch):
    ours = simulate(Counted(), stop=6.0, points=101)
    monkeypatch.setattr(Sampler, "suits", False)
    other = simulate(Counted(), stop=6.0, points=101)
    np.testing.assert_array_equal(ours.final("full"), other.final("full"))
    assert ours.final("crossed") == 2
    assert other.final("crossed") == 2
    for name in ("time", "x", "a", "level", "at"):
        mine, theirs = (r.time if name == "time" else r[name] for r in (ours, other))
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=3e-8)


def test_a_when_that_never_acts_leaves_the_sampling_to_explicit_steps(monkeypatch):
    calls = []
    over = Sampler.over
    monkeypatch.setattr(Sampler, "over", lambda *a: calls.append(over(*a)) or calls[-1])

    class Idle(Model):
        a = Real(start=0.0)
        x = Real(start=0.0, fixed=True)
        m = Discrete(0)

        def equations(self):
            yield der(self.x) == -self.x + self.a
            yield sampled(self.a, 0.9 * self.a + 0.1 - 0.01 * self.x, period=0.001)
            yield when(self.x >= 50.0, self.m == pre(self.m) + 1)

    simulate(Idle(), stop=2.0)
    assert len(calls) < 20  # for 2,000 instants
    assert min(calls) > 0


class Asked(Model):
    """What asks of a held input: a count, a mode, and an input through an algebraic."""

    go = Input(unit="1", start=0.0)
    count, phase = Discrete(0, unit="1"), Mode("off", "run")
    x, twice = Real(start=0.0, fixed=True), Real()

    def equations(self):
        yield der(self.x) == if_else(self.phase.is_in("run"), 1.0, 0.0)
        yield self.twice == 2 * self.go
        yield when(self.twice > 1.0, self.count == pre(self.count) + 1)
        yield transition(self.phase, "off", "run", self.go > 0.5)
        yield transition(self.phase, "run", "off", self.go < 0.5)


@pytest.mark.parametrize("max_step", [None, 0.01])
def test_what_asks_of_held_inputs_is_asked_where_they_jump(max_step):
    go = Samples([0.0, 0.5, 1.95, 2.5], [0.0, 1.0, 0.0, 1.0], kind="constant")
    result = simulate(Asked(), stop=3.0, inputs={"go": go}, points=31, max_step=max_step)
    assert result.final("count") == 2
    assert result.final("x") == pytest.approx(1.95, abs=1e-9)
    assert result.at(1.0, "x") == pytest.approx(0.5, abs=1e-9)
