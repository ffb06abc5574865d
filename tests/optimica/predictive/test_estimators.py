"""Moving-horizon estimators and extended Kalman filters: next to a filter by hand, on a pendulum, and refusals."""

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import lsq_linear

from gantrytau import Input, Model, ModelError, Parameter, Real, Samples, cos, der, sin
from gantrytau_optimica import Experiment, ExtendedKalman, Free, MovingHorizon, Optimization

PERIOD = 0.05


class Cart(Model):
    """A cart with friction, in bare numbers."""

    x, v = Real(start=1.0), Real(start=0.3)
    u = Input()

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == self.u - 0.5 * self.v


class Pendulum(Model):
    """A pendulum whose height is measured, with sizes of its own; in bare numbers."""

    length = Parameter(1.0, min=0.2, max=2.0)
    phi, w = Real(start=0.6), Real(start=0.0, nominal=3.0)
    height, pull = Real(), Real()
    tau = Input()

    def equations(self):
        yield der(self.phi) == self.w
        yield self.length * der(self.w) == self.tau - 9.81 * sin(self.phi) - 0.1 * self.w
        yield self.height == -self.length * cos(self.phi)
        yield self.pull == self.length * self.w**2 + 9.81 * cos(self.phi)


CART: Any = dict(period=PERIOD, measured={"x": 0.1}, noise={"v": 0.2}, prior={"x": 0.5, "v": 2.0})


def samples(count=40):
    """Measured places, some of them lost, and inputs."""
    random = np.random.default_rng(1)
    y = np.sin(PERIOD * np.arange(count)) + 0.1 * random.standard_normal(count)
    y[[5, 6]] = np.nan
    return y, np.cos(np.arange(count))


def filtered(y, inputs, held):
    """Means and deviations of a discrete Kalman filter; held: A and B from sample to sample."""
    A, B = held
    x, P = np.array([1.0, 0.3]), np.diag([0.25, 4.0])
    C, found = np.array([[1.0, 0.0]]), []
    for k, one in enumerate(y):
        if k:
            x, P = A @ x + B * inputs[k], A @ P @ A.T + np.diag([0.0, 0.2**2 * PERIOD])
        if np.isfinite(one):
            K = P @ C.T / (C @ P @ C.T + 0.1**2)
            x, P = x + K[:, 0] * (one - x[0]), P - K @ C @ P
        found.append([*x, *np.sqrt(np.diag(P))])
    return np.array(found)


def of_radau(h):
    """A and B of a period by Radau's method with two points: its stability function, of all that is linear."""
    M = h * np.array([[0.0, 1.0, 0.0], [0.0, -0.5, 1.0], [0.0, 0.0, 0.0]])
    whole = np.linalg.solve(np.eye(3) - 2 / 3 * M + M @ M / 6, np.eye(3) + M / 3)
    assert np.abs(whole - expm(M)).max() < h**4
    return whole[:2, :2], whole[:2, 2]


@pytest.mark.parametrize("estimator", [ExtendedKalman(Cart, **CART), MovingHorizon(Cart, **CART, samples=6)])
def test_of_a_linear_model_both_are_the_kalman_filter(estimator):
    y, inputs = samples()
    found = []
    for one, u in zip(y, inputs, strict=True):
        states = estimator.step({"x": one}, {"u": u})
        assert estimator.status == ("estimated" if np.isfinite(one) else "lost")
        found.append([*states.values(), *estimator.deviations.values()])
    np.testing.assert_allclose(found, filtered(y, inputs, of_radau(PERIOD)), atol=1e-8)


def test_samples_that_never_came_are_lost_ones():
    y, inputs = samples(12)
    found, expected = {}, {}
    whole, some = ExtendedKalman(Cart, **CART), MovingHorizon(Cart, **CART, samples=1)
    for k, (one, u) in enumerate(zip(y, inputs, strict=True)):
        expected = whole.step({"x": one}, {"u": inputs[7] if k in (5, 6) else u})
        if k not in (5, 6):
            found = some.step({"x": one}, {"u": u}, k * PERIOD)
    assert found == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("kind", [ExtendedKalman, MovingHorizon])
def test_an_outlier_is_a_lost_sample_unless_it_goes_on(kind):
    some, other = kind(Cart, **CART), kind(Cart, **CART)
    for k, y in enumerate([1.0, 1.0, 1e9, 1.1, -1e300]):
        found = some.step({"x": y}, {"u": 0.0})
        wanted = other.step({"x": y if abs(y) < 2.0 else np.nan}, {"u": 0.0})
        assert found == wanted
        assert some.status == ("estimated" if abs(y) < 2.0 else "outlier"), k
    assert [round(some.step({"x": 500.0}, {"u": 0.0})["x"]) for _ in range(2)][-1] > 100  # third in a row


def swung(estimator, count=60, **changes):
    """What an estimator makes of a pendulum of 0.8 m, by an integrator of its own; deviations of the noise are 0.002."""
    random, x, u = np.random.default_rng(3), np.array([0.6, 0.0]), 0.0
    length, found, truth = 0.8, {}, x
    for k in range(count):
        y = -length * np.cos(x[0]) + 0.002 * random.standard_normal()
        pull = length * x[1] ** 2 + 9.81 * np.cos(x[0]) + 0.02 * random.standard_normal()
        found = estimator.step({"height": y, "pull": pull} | changes, {"tau": u}, k * PERIOD)
        u = float(np.sin(0.3 * k))
        slopes = lambda _, s, u=u: [s[1], (u - 9.81 * np.sin(s[0]) - 0.1 * s[1]) / length]  # noqa: E731
        truth, x = x, solve_ivp(slopes, (0.0, PERIOD), x, rtol=1e-10, atol=1e-10).y[:, -1]
    return found, truth


HEIGHT: Any = dict(
    period=PERIOD, measured={"height": 0.002, "pull": 0.02}, parameters={"length": 0.3}, start={"phi": 0.5},
    noise={"w": 1e-3}, prior={"phi": 0.2, "w": 0.1},
)  # fmt: skip


@pytest.mark.parametrize("kind", [ExtendedKalman, MovingHorizon])
def test_the_length_of_a_pendulum_is_found(kind):
    estimator = kind(Pendulum, **HEIGHT)
    found, truth = swung(estimator)
    assert abs(found["length"] - 0.8) < 4 * estimator.deviations["length"] < 0.004
    np.testing.assert_allclose([found["phi"], found["w"]], truth, atol=0.02)


def test_a_state_at_its_limit_is_the_bounded_least_squares_solution():
    class Slow(Optimization):
        cart = Cart(v=dict(max=0.4))

    y, u, n = np.sin(PERIOD * np.arange(8)), np.cos(np.arange(8)), 8
    given: Any = dict(noise={"cart.x": 0.02, "cart.v": 0.2}, prior={"cart.x": 0.5, "cart.v": 2.0})
    estimator = MovingHorizon(Slow, period=PERIOD, measured={"cart.x": 0.01}, **given)
    found = {}
    for one, force in zip(y, u, strict=True):
        found = estimator.step({"cart.x": one}, {"cart.u": force})
    A, B = of_radau(PERIOD)
    q = np.array([0.02, 0.2]) * np.sqrt(PERIOD)
    rows: list[Any]
    right: list[Any]
    rows, right = [np.eye(2, 2 * n) / [[0.5], [2.0]]], [np.array([1.0, 0.3]) / [0.5, 2.0]]
    for k in range(n):
        rows.append(np.eye(1, 2 * n, 2 * k) / 0.01)
        right.append([y[k] / 0.01])
        if k:
            rows.append((np.eye(2, 2 * n, 2 * k) - A @ np.eye(2, 2 * n, 2 * k - 2)) / q[:, None])
            right.append(B * u[k] / q)
    ends = -np.inf, np.tile([np.inf, 0.4], n)
    best = lsq_linear(np.vstack(rows), np.concatenate(right), ends, method="bvls", tol=1e-14).x
    assert list(found.values()) == pytest.approx(best[-2:], abs=1e-8)
    assert found["cart.v"] == pytest.approx(0.4, abs=1e-9)


def test_a_parameter_at_its_limit_stays_there():
    class Short(Optimization):
        pendulum = Pendulum(length=Free(0.5, min=0.2, max=0.7))

    one = MovingHorizon(
        Short, period=PERIOD, measured={"pendulum.phi": 0.01}, noise={"pendulum.w": 0.1}, samples=8
    )
    assert one.parameters == ("pendulum.length",)
    found = {}
    for k in range(25):
        swing = 0.6 * np.cos(np.sqrt(9.81 / 0.8) * PERIOD * k)
        found = one.step({"pendulum.phi": swing}, {"pendulum.tau": 0.0})
        assert one.status == "estimated"
        assert found["pendulum.length"] <= 0.7
    assert found["pendulum.length"] == pytest.approx(0.7, abs=1e-6)


def test_along_a_record_it_is_the_same():
    y, inputs = samples(12)
    some, times = np.isfinite(y), PERIOD * np.arange(12)
    record = Experiment(
        {"x": Samples(times[some], y[some])},
        {"u": Samples(times, np.append(inputs[1:], 0.0), kind="constant")},
    )
    estimator = ExtendedKalman(Cart, **CART)
    found = estimator.run(record)
    expected = filtered(y, inputs, of_radau(PERIOD))
    np.testing.assert_allclose(np.column_stack([found["x"], found["v"]]), expected[:, :2], atol=1e-8)
    np.testing.assert_allclose(found.time, times)
    for other, told in [
        (
            Experiment({"x": Samples(times + 0.01 * (times > 0.1), times)}, {"u": 0.0}),
            "lies between whole periods of 0.05 s",
        ),
        (Experiment({"v": Samples(times, times)}, {"u": 0.0}), "v is not among what is measured, x"),
        (Experiment({"x": Samples(times, times)}), "inputs of the experiment lack u"),
        (Experiment({"x": Samples(times, times)}, {"u": 0.0}, {"x": 1.0}), "found start of the experiment"),
        (record.measured, "expected Experiment"),
    ]:
        with pytest.raises(ModelError) as raised:
            estimator.run(other)
        assert told in str(raised.value)


@pytest.mark.parametrize("size", [1e-13, 1e6])
def test_sizes_do_not_count(size):
    given: Any = dict(
        measured={"x": size}, noise={"v": size}, prior={"x": size, "v": size}, start={"x": 0.0, "v": 0.0}
    )
    one, other = (kind(Cart, period=PERIOD, **given) for kind in (ExtendedKalman, MovingHorizon))
    for k in range(15):
        y, u = {"x": size * np.sin(k)}, {"u": 0.0}
        assert other.step(y, u) == pytest.approx(one.step(y, u), abs=1e-8 * size)
        assert other.status == "estimated"


class Cubic(Model):
    """A state that is seen through an equation without closed form; in bare numbers."""

    gain = Parameter(1.0)
    x, z = Real(start=1.0), Real(start=0.5)
    u = Input()

    def equations(self):
        yield der(self.x) == self.gain * self.u - 0.1 * self.x
        yield self.z + self.z**3 == self.x


# a filter linearises once a sample, a horizon until nothing changes
EXACT = pytest.mark.parametrize(("kind", "within"), [(ExtendedKalman, 0.1), (MovingHorizon, 1e-3)])


@EXACT
def test_a_state_is_found_through_an_implicit_equation(kind, within):
    estimator = kind(Cubic, period=0.1, measured={"z": 1e-3}, parameters={"gain": 1.0})
    assert estimator.observed.stages.nz == 1
    x, found = 2.0, {}
    for k in range(20):
        z = next(r.real for r in np.roots([1.0, 0.0, 1.0, -x]) if abs(r.imag) < 1e-9)
        found = estimator.step({"z": z}, {"u": 0.5})
        assert k < 5 or found["x"] == pytest.approx(x, abs=within)
        x = 10.0 + (x - 10.0) * np.exp(-0.1 * 0.1)  # the gain is 2
    assert found["gain"] == pytest.approx(2.0, abs=20 * within)


@EXACT
def test_a_model_without_motion_has_parameters(kind, within):
    class Spring(Model):
        c, length, f = Parameter(1.0), Real(), Input()

        def equations(self):
            yield self.f == self.c * self.length

    estimator = kind(Spring, period=0.1, measured={"length": 1e-3}, parameters={"c": 1.0})
    found = {}
    for k in range(20):
        found = estimator.step({"length": k / 2.0}, {"f": float(k)})
    assert found["c"] == pytest.approx(2.0, abs=within)


class Unseen(Model):
    """Two parameters in a product, one nowhere, and a state that only decays."""

    a, b, c = Parameter(2.0), Parameter(3.0), Parameter(1.0)
    x, place, fading = Real(start=1.0), Real(start=0.0), Real(start=1.0)
    u = Input()

    def equations(self):
        yield der(self.x) == self.u - self.a * self.b * self.x
        yield der(self.place) == self.x
        yield der(self.fading) == -self.fading


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {},
            "nothing that was measured depends on place, whose samples are x; measure more, or estimate less",
        ),
        ({"measured": {"place": 1.0}, "parameters": {"c": 1.0}}, "nothing that was measured depends on c"),
        ({"measured": {"place": 1.0}, "parameters": {"a": 1.0, "b": 1.0}}, "a and b cannot be told apart"),
        (
            {"measured": {"place": 1.0}, "disturbance": {"u": 1.0, "place": 1.0}},
            "place and disturbance(place) cannot",
        ),
        ({"measured": {"plce": 1.0}}, "has no variable or parameter 'plce'; did you mean 'place'?"),
        ({"measured": {}}, "found nothing measured"),
        ({"measured": {"place": 0.0}}, "found measured[place]=0.0, expected a number above 0"),
        ({"measured": ["place"]}, "found measured=['place'], expected {name: number}"),
        ({"noise": {"u": 1.0}}, "found noise='u', expected some of place, fading, x"),
        ({"noise": {"x": np.nan}}, "found noise[x]=nan"),
        ({"disturbance": {"a": 1.0}}, "found disturbance='a', expected an input or a measured variable"),
        ({"parameters": {"x": 1.0}}, "found parameters='x', expected a parameter of the equations"),
        ({"start": {"x": [1.0, 2.0]}}, "found x of 2 numbers, expected a number"),
        ({"period": 0.0}, "found period=0.0"),
        ({"samples": 0}, "found samples=0"),
    ],
)
def test_what_cannot_be_estimated_is_told(changes, told):
    with pytest.raises(ModelError) as raised:
        MovingHorizon(Unseen, **{"period": 0.1, "measured": {"x": 1.0}} | changes)
    assert told in str(raised.value)


@pytest.mark.parametrize(
    ("measured", "inputs", "t", "told"),
    [
        ({"u": 0.0}, {"u": 0.0}, None, "found measured='u', expected some of x, v"),
        ({"x": 0.0}, {"u": 0.0}, None, "measured lacks v, expected all of x, v; a lost sample is NaN"),
        ({"x": [0.0, 1.0], "v": 0.0}, {"u": 0.0}, None, "found x of 2 numbers, expected a number"),
        ({"x": 0.0, "v": 0.0}, {"x": 0.0}, None, "found inputs='x', expected some of u"),
        ({"x": 0.0, "v": 0.0}, None, None, "inputs lack u"),
        ({"x": 0.0, "v": 0.0}, {"u": np.nan}, None, "found u = nan"),
        ({"x": 0.0, "v": 0.0}, {"u": 0.0}, 0.07, "found t=0.07, expected whole periods of 0.05 s"),
        ({"x": 0.0, "v": 0.0}, {"u": 0.0}, 0.0, "found t=0.0, expected whole periods"),
    ],
)
def test_samples_that_are_none_are_told_and_change_nothing(measured, inputs, t, told):
    estimator = ExtendedKalman(Cart, period=PERIOD, measured={"x": 0.1, "v": 0.1})
    with pytest.raises(ModelError, match="found no finite sample at the first step"):
        estimator.step({"x": np.nan, "v": np.inf})
    first = estimator.step({"x": 1.0, "v": np.nan})
    with pytest.raises(ModelError) as raised:
        estimator.step(measured, inputs, t)
    assert told in str(raised.value)
    assert estimator.step({"x": np.nan, "v": np.nan}, {"u": 0.0}, PERIOD)["x"] == pytest.approx(
        first["x"], abs=0.1
    )
