"""Delays against closed solutions: the method of steps, characteristic roots, what was put in."""

from math import factorial

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import lambertw

from gantrytau import (
    Discrete,
    InitializationError,
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    check,
    cos,
    delay,
    der,
    if_else,
    linearize,
    reinit,
    sampled,
    sign,
    simulate,
    sin,
    time,
    translate,
    when,
)  # fmt: skip

TOLERANCE = 1e-8  # of simulate


class Oscillator(Model):
    """x' = -k x(t - T), x = 1 before the start."""

    x = Real(start=1.0, fixed=True, description="deflection")
    T = Parameter(np.pi / 2, unit="s", description="delay")
    k = Parameter(1.0, unit="1/s", description="gain")

    def equations(self):
        yield der(self.x) == -self.k * delay(self.x, self.T)


def by_steps(t, T, k=1.0):
    """The oscillator by the method of steps, a polynomial more for each delay."""
    n = int(t / T) + 1
    return sum((-k) ** j * max(t - (j - 1) * T, 0.0) ** j / factorial(j) for j in range(n + 1))


@pytest.mark.parametrize("points", [3, 501])
def test_the_delayed_oscillator_is_that_of_the_method_of_steps(points):
    motion = simulate(Oscillator(), stop=10.0, points=points)
    true = [by_steps(t, np.pi / 2) for t in motion.time]
    assert np.max(np.abs(motion["x"] - true)) < TOLERANCE


def test_the_delayed_oscillator_swings_on():
    """cos(t) solves x' = -x(t - pi/2); with x = 1 before the start it is approached, with the residue of its root."""
    motion = simulate(Oscillator(), stop=60.0)
    late = motion.time > 50.0
    amplitude = 2 / np.hypot(1, np.pi / 2)  # of 1 / s - exp(-s T) / s (s + exp(-s T)) at s = i
    waves = np.stack([np.cos(motion.time), np.sin(motion.time)], axis=1)[late]
    found, *_ = np.linalg.lstsq(waves, motion["x"][late], rcond=None)
    assert np.max(np.abs(waves @ found - motion["x"][late])) < 1e-6
    assert abs(np.hypot(*found) - amplitude) < 1e-6


def test_parameters_are_others_without_a_new_model():
    motion = simulate(Oscillator(), stop=4.0, parameters={"T": 0.8, "k": 2.0})
    assert abs(motion.final("x") - by_steps(4.0, 0.8, 2.0)) < TOLERANCE


def test_the_delayed_logistic_equation_is_that_of_scipy_step_by_step():
    class Logistic(Model):
        x = Real(start=0.5, fixed=True)

        def equations(self):
            yield der(self.x) == 1.8 * self.x * (1 - delay(self.x, 1.0))

    before, begin = (lambda t: 0.5), 0.5
    for k in range(8):
        step = solve_ivp(
            lambda t, x, past=before: 1.8 * x * (1 - past(t - 1)),
            (k, k + 1), [begin], method="DOP853", rtol=1e-12, atol=1e-13, dense_output=True,
        )  # fmt: skip
        before, begin = (lambda t, dense=step.sol: dense(t)[0]), step.y[0, -1]
    assert abs(simulate(Logistic(), stop=8.0).final("x") - begin) < 5 * TOLERANCE


def test_a_delay_much_shorter_than_the_run_decays_with_its_root():
    motion = simulate(Oscillator(T=0.01), stop=5.0)
    root = np.real(lambertw(-0.01)) / 0.01  # s + exp(-s T) = 0
    # 500 delays, each of some tolerance
    assert abs(motion.final("x") / motion["x"][250] / np.exp(2.5 * root) - 1) < 1e-6


def test_chains_and_vectors_of_delays_are_what_went_in():
    class Chain(Model):
        x = Real(unit="m", start=0.0, fixed=True)
        y, z, w = Real(unit="m"), Real(unit="m"), Real(2, unit="m")

        def equations(self):
            yield der(self.x) == cos(time)
            yield self.y == delay(self.x, 0.3)
            yield self.z == delay(self.y, 0.45)
            yield self.w == delay(ca.vertcat(self.x, 3 * self.x), 1.0)

    motion = simulate(Chain(), stop=5.0)

    def past(T):
        return np.sin(np.maximum(motion.time - T, 0.0))

    assert np.max(np.abs(motion["y"] - past(0.3))) < TOLERANCE
    assert np.max(np.abs(motion["z"] - past(0.75))) < TOLERANCE
    assert np.max(np.abs(motion["w"] - past(1.0)[:, None] * [1, 3])) < 3 * TOLERANCE


class Late(Model):
    """y = u(t - 0.3), and its integral."""

    u = Input(start=0.0)
    y = Real()
    v = Real(start=0.0, fixed=True)

    def equations(self):
        yield self.y == delay(self.u, 0.3)
        yield der(self.v) == self.y


def test_an_input_comes_later_as_function_and_as_samples():
    motion = simulate(Late(), stop=2.0, inputs={"u": lambda t: sin(5 * t)})
    assert np.max(np.abs(motion["y"] - np.sin(5 * np.maximum(motion.time - 0.3, 0.0)))) < TOLERANCE
    ts, us = np.array([0.0, 0.5, 1.01, 2.0]), np.array([0.0, 1.0, -1.0, 0.0])
    motion = simulate(Late(), stop=2.0, inputs={"u": (ts, us)})
    assert np.max(np.abs(motion["y"] - np.interp(motion.time - 0.3, ts, us))) < TOLERANCE
    knots = np.array([0.0, 0.5, 1.01, 1.7])
    exact = np.trapezoid(np.interp(knots, ts, us), knots)
    assert abs(motion.final("v") - exact) < TOLERANCE


def test_a_jump_of_an_input_travels():
    motion = simulate(Late(), stop=2.0, inputs={"u": lambda t: if_else(t < 0.51234, 0, 1)}, points=7)
    assert abs(motion.final("v") - (1.7 - 0.51234)) < TOLERANCE


def test_an_echo_jumps_again_and_again():
    class Echo(Model):
        y = Real(start=0.0)
        area = Real(start=0.0, fixed=True)

        def equations(self):
            yield self.y == if_else(time < 0.1, 0, 1) + 0.5 * delay(self.y, 0.25)
            yield der(self.area) == self.y

    motion = simulate(Echo(), stop=1.99)
    waits = 1.99 - 0.1 - 0.25 * np.arange(8)
    assert abs(motion.final("y") - 2 * (1 - 0.5**8)) < TOLERANCE
    assert abs(motion.final("area") - np.sum(0.5 ** np.arange(8) * waits)) < TOLERANCE


def test_an_algebraic_variable_is_delayed():
    """a^3 + a = x with x = 3 t has the rate 3 / (3 a^2 + 1)."""

    class Algebraic(Model):
        a, b = Real(start=0.0), Real()
        x = Real(start=0.0, fixed=True)

        def equations(self):
            yield self.a**3 + self.a == self.x
            yield der(self.x) == 3
            yield self.b == delay(self.a, 0.5)

    motion = simulate(Algebraic(), stop=3.0)
    past = motion["b"]
    assert np.max(np.abs(past**3 + past - 3 * np.maximum(motion.time - 0.5, 0.0))) < 10 * TOLERANCE


def test_two_delays_are_the_same_at_a_thousandth_of_the_tolerance():
    class Two(Model):
        x = Real(start=1.0, fixed=True)

        def equations(self):
            yield der(self.x) == -delay(self.x, 0.7) + 0.5 * delay(self.x, np.sqrt(2))

    coarse, fine = (simulate(Two(), stop=4.0, tolerance=t).final("x") for t in (TOLERANCE, 1e-11))
    assert abs(coarse - fine) < TOLERANCE


def test_what_switches_on_the_past_is_an_event():
    """x' = -sign(x(t - 0.2)) is a triangle between 0.2 and -0.2."""

    class Relay(Model):
        x = Real(start=0.5, fixed=True)

        def equations(self):
            yield der(self.x) == -sign(delay(self.x, 0.2))

    motion = simulate(Relay(), stop=4.0)

    late = motion.time > 0.7
    assert (
        np.max(
            np.abs(np.abs(motion["x"][late]) - np.abs(0.2 - np.abs((motion.time[late] - 0.7) % 0.8 - 0.4)))
        )
        < 1e-7
    )
    assert np.max(motion["x"][late]) <= 0.2 + 1e-7


def test_a_bounce_is_seen_later():
    class Ball(Model):
        h = Real(unit="m", start=1.0, fixed=True)
        v = Real(unit="m/s", start=0.0, fixed=True)
        late = Real(unit="m/s")
        s = Real(unit="m", start=0.0, fixed=True)

        def equations(self):
            yield der(self.h) == self.v
            yield der(self.v) == -9.81
            yield self.late == delay(self.v, 0.1)
            yield der(self.s) == self.late
            yield when(self.h < 0, reinit(self.v, -0.8 * self.v))

    motion = simulate(Ball(), stop=1.5)
    assert abs(motion.final("s") + 1.0 - motion.at(1.4, "h")) < 10 * TOLERANCE  # of the height 0.1 s ago


@pytest.mark.parametrize("T", [1e-9, 1.0, 1e9])
def test_delays_of_any_scale_and_any_start(T):
    class Scaled(Model):
        x = Real(start=1.0, fixed=True)

        def equations(self):
            yield T * der(self.x) == -delay(self.x, T)

    assert abs(simulate(Scaled(), stop=3 * T).final("x") + 1 / 6) < TOLERANCE  # 1 - 3 + 2^2 / 2 - 1 / 6
    assert abs(simulate(Scaled(), start=-T, stop=2 * T).final("x") + 1 / 6) < TOLERANCE
    assert abs(simulate(Scaled(), stop=0.5 * T).final("x") - 0.5) < TOLERANCE  # shorter than the delay


def test_a_sampled_controller_with_a_late_measurement():
    class Sampled(Model):
        u = Real(start=0.0)
        y = Real()
        x = Real(start=1.0, fixed=True)

        def equations(self):
            yield sampled(self.u, -2 * delay(self.x, 0.05), period=0.1)
            yield der(self.x) == self.u
            yield self.y == delay(self.u, 0.03)

    x, u = 1.0, 0.0
    for k in range(10):
        u = -2 * (x - 0.05 * u if k else 1.0)
        x += 0.1 * u
    motion = simulate(Sampled(), stop=1.0)
    assert abs(motion.final("x") - x) < TOLERANCE
    assert abs(motion.final("y") - u) < TOLERANCE  # the sample at 1 s arrives at 1.03 s


def test_a_discrete_is_delayed():
    class Counting(Model):
        n = Discrete(0.0)
        area = Real(start=0.0, fixed=True)

        def equations(self):
            yield when(time > 0.3, self.n == 2.0)
            yield der(self.area) == delay(self.n, 0.25)

    assert abs(simulate(Counting(), stop=1.0).final("area") - 2 * 0.45) < TOLERANCE


def test_a_start_that_is_delayed_is_consistent():
    class Loop(Model):
        y, x = Real(), Real(start=3.0, fixed=True)

        def equations(self):
            yield self.y == self.x + 0.5 * delay(self.y, 1.0)
            yield der(self.x) == 0

    motion = simulate(Loop(), stop=3.0)
    assert np.max(np.abs(motion["y"] - 6.0)) < 1e-10

    class Growing(Loop):
        def equations(self):
            yield self.y == self.x + 2 * delay(self.y, 1.0)
            yield der(self.x) == 0

    with pytest.raises(InitializationError, match=r"Growing: found no value for delay\(y"):
        simulate(Growing(), stop=1.0)


@pytest.mark.parametrize("wrong", [0, -0.1, np.inf])
def test_a_time_that_is_not_above_zero_is_refused(wrong):
    class Wrong(Late):
        def equations(self):
            yield self.y == delay(self.u, wrong)
            yield der(self.v) == self.y

    with pytest.raises(ModelError, match=r"delay: found T=.*, expected a finite time above zero, in s"):
        simulate(Wrong(), stop=1.0)


def test_other_faults_are_refused_by_name():
    class OfVariable(Late):
        def equations(self):
            yield self.y == delay(self.u, 1 + self.v)
            yield der(self.v) == self.y

    with pytest.raises(ModelError, match=r"found v in the time of a delay"):
        simulate(OfVariable(), stop=1.0)

    class Differentiated(Late):
        def equations(self):
            yield self.y == der(delay(self.u, 0.1))
            yield der(self.v) == self.y

    with pytest.raises(ModelError, match=r"der\(\): found delay\(u, 0\.1\).*delay\(der\(x\), T\)"):
        simulate(Differentiated(), stop=1.0)
    with pytest.raises(ModelError, match=r"expected a time above zero, in s, in delay\(x, T\)"):
        simulate(Oscillator(T=-1.0), stop=1.0)
    with pytest.raises(ModelError, match=r"delay\(x, T\): 1e-09 s is less than a \d+th of the 10 s of the"):
        simulate(Oscillator(T=1e-9), stop=10.0)
    with pytest.raises(ModelError, match=r"delay\(\) was called outside of equations"):
        delay(ca.SX.sym("x"), 1.0)

    class Metres(Late):
        x = Real(unit="m", start=0.0, fixed=True)

        def equations(self):
            yield from super().equations()
            yield der(self.x) == delay(self.x, 1.0)

    with pytest.raises(ModelError, match="units disagree"):
        simulate(Metres(), stop=1.0)


@pytest.mark.parametrize("use", [translate, linearize])
def test_what_knows_no_past_refuses_it_with_a_remedy(use):
    words = r"delay\(x, T\): found a value of the past, expected equations of one time\. .*chain of first-order lags"
    with pytest.raises(ModelError, match=words):
        use(Oscillator())
    assert check(Oscillator()).states == ("x",)
