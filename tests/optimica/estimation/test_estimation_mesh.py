"""Estimates do not depend on the mesh: corners of inputs, refinement, and words for what a mesh costs."""

import signal
import time
from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, Parameter, Real, SolveError, between, der, exp, if_else, sin
from gantrytau import time as now
from gantrytau_optimica import Free, Samples
from gantrytau_optimica.estimation.estimate import estimate
from gantrytau_optimica.estimation.experiments import Experiment

TIMES = np.linspace(0.0, 2.0, 81)
STEPS = np.where(TIMES % 0.8 < 0.4, 5.0, 0.0)  # V, joined by straight lines


class Filter(Model):
    """A resistor and a capacitor; optionally two stages, of which the current is measured."""

    T = Parameter(0.05, unit="s", description="time constant")
    u = Input(unit="V", description="input")
    v = Real(unit="V", start=0.0, fixed=True, description="voltage")

    def equations(self):
        yield self.T * der(self.v) == self.u - self.v


class Stages(Model):
    """Two stages of resistors and capacitors in a row."""

    R1 = Parameter(120.0)
    C1 = Parameter(1e-3)
    R2 = Parameter(300.0)
    C2 = Parameter(5e-4)
    u = Input()
    v1 = Real(start=0.0, fixed=True)
    v2 = Real(start=0.0, fixed=True)
    i = Real()

    def equations(self):
        between = (self.v1 - self.v2) / self.R2
        yield self.i == (self.u - self.v1) / self.R1
        yield self.C1 * der(self.v1) == self.i - between
        yield self.C2 * der(self.v2) == between


def through_corners(a: np.ndarray, b: np.ndarray, times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """x' = a x + b u from x = 0 at the times of u, which is joined by straight lines: exact, by exponentials, (n, m)."""
    from scipy.linalg import expm

    m = b.size
    found: list[Any] = [np.zeros(m)]
    for k, step in enumerate(np.diff(times)):
        whole = np.zeros((m + 2, m + 2))  # of x, u and its slope
        whole[:m, :m], whole[:m, m], whole[m, m + 1] = a, b, 1.0
        slope = (values[k + 1] - values[k]) / step
        found.append((expm(whole * step) @ np.concatenate([found[-1], [values[k], slope]]))[:m])
    return np.array(found)


def filtered(T: float = 0.05) -> np.ndarray:
    return through_corners(np.array([[-1 / T]]), np.array([1 / T]), TIMES, STEPS)[:, 0]


def within(fit, truth: dict[str, float], deviations: float = 4.0) -> None:
    for name, value in truth.items():
        assert abs(fit.parameters[name] - value) < deviations * fit.deviations[name], name


def test_inputs_with_corners_that_are_no_borders_of_the_default_mesh():
    experiment = Experiment({"v": Samples(TIMES, filtered())}, inputs={"u": (TIMES, STEPS)})
    fit = estimate(Filter, {"T": 0.1}, experiment)
    assert fit.parameters["T"] == pytest.approx(0.05, rel=1e-7)
    within(fit, {"T": 0.05})
    assert "as those of computed data" in fit.warnings[0]


def test_the_current_of_two_stages_tells_all_four_numbers():
    truth = dict(R1=120.0, C1=1e-3, R2=300.0, C2=5e-4)
    c1, c2 = 1e3, 2e3
    a = np.array([[-c1 / 120 - c1 / 300, c1 / 300], [c2 / 300, -c2 / 300]])
    current = (STEPS - through_corners(a, np.array([c1 / 120, 0.0]), TIMES, STEPS)[:, 0]) / 120
    guesses = {n: Free(x, min=0.0) for n, x in dict(R1=100.0, C1=1.5e-3, R2=250.0, C2=6e-4).items()}
    fit = estimate(Stages, guesses, Experiment({"i": Samples(TIMES, current)}, inputs={"u": (TIMES, STEPS)}))
    assert [fit.parameters[n] for n in truth] == pytest.approx(list(truth.values()), rel=1e-6)
    noise = 2e-4
    noisy = current + np.random.default_rng(3).normal(0.0, noise, current.size)
    experiment = Experiment({"i": Samples(TIMES, noisy, deviation=noise)}, inputs={"u": (TIMES, STEPS)})
    within(estimate(Stages, guesses, experiment), truth)


def test_what_a_chosen_mesh_costs_is_printed():
    experiment = Experiment({"v": Samples(TIMES, filtered())}, inputs={"u": (TIMES, STEPS)})
    fit = estimate(Filter, {"T": 0.1}, experiment, elements=4)
    assert "the mesh is coarse: on twice the elements T moves by" in repr(fit)
    assert repr(fit).split("Note: ")[1:] == [f"{w}\n" for w in fit.warnings[:-1]] + [fit.warnings[-1]]
    within(fit, {"T": 0.05})  # the deviation holds what the mesh costs


@pytest.mark.parametrize("step", [1, 8, 12])
def test_an_interruption_keeps_what_was_solved(step):
    """In the steps from the first guesses, of the fit on the first mesh, and of those that refine it."""
    experiment = Experiment({"v": Samples(TIMES, filtered())}, inputs={"u": (TIMES, STEPS)})

    def press(iteration: int, objective: float):
        if iteration == step:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(SolveError, match="interrupted") as caught:
        estimate(Filter, {"T": 0.1}, experiment, progress=press)
    assert caught.value.optimum.success == (step > 1)
    assert caught.value.optimum.numbers["T"] == pytest.approx(0.05 if step > 1 else 0.1, rel=1e-3)


def test_the_time_is_that_of_all_meshes():
    experiment = Experiment({"v": Samples(TIMES, filtered())}, inputs={"u": (TIMES, STEPS)})

    def wait(iteration: int, objective: float):
        if iteration == 8:
            time.sleep(3.1)

    fit = estimate(Filter, {"T": 0.1}, experiment, progress=wait, max_time=3.0)
    assert "raise max_time=" in repr(fit)
    with pytest.raises(SolveError, match="time limit reached"):
        estimate(Filter, {"T": 0.1}, experiment, max_time=1e-3)


class Pushed(Model):
    """A mass with a damper."""

    m = Parameter(2.0, unit="kg")
    d = Parameter(0.7, unit="N.s/m")
    f = Input(unit="N")
    x = Real(unit="m", start=0.0, fixed=True)
    v = Real(unit="m/s", start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.v
        yield self.m * der(self.v) == self.f - self.d * self.v


@pytest.mark.parametrize("told", ["samples", "function"])
def test_a_pulse_within_an_element_tells_mass_and_damper(told):
    """A hundredth of a second in ten, between borders of the default mesh; exact by its closed form."""
    begin, end, force = 1.003, 1.013, 100.0
    m, d = 2.0, 0.7
    times = np.linspace(0.0, 10.0, 101)
    since = np.maximum(times - end, 0.0)
    speed = force / d * (1 - np.exp(-d / m * (end - begin)))
    way = force / d * (end - begin) - m / d * speed
    x = np.where(times > begin, way + m / d * speed * (1 - np.exp(-d / m * since)), 0.0)
    inputs = {
        "samples": Samples([0.0, begin, end], [0.0, force, 0.0], kind="constant", largest_gap=99.0),
        "function": lambda t: if_else(between(begin, t, end), force, 0.0),
    }
    fit = estimate(
        Pushed,
        {"m": Free(1.0, min=0.0), "d": Free(0.3, min=0.0)},
        Experiment({"x": Samples(times, x)}, inputs={"f": inputs[told]}),
    )
    # a millionth: of sizes, ten times what the mesh may cost
    assert fit.parameters == pytest.approx({"m": m, "d": d}, rel=1e-6)


def test_an_input_that_switches_with_a_clock_of_its_own():
    """A square wave sin(7 t) > 0 as a condition of the model on time."""

    class Clocked(Model):
        T = Parameter(0.5, unit="s")
        y = Real(start=0.0, fixed=True)

        def equations(self):
            yield self.T * der(self.y) == if_else(sin(7.0 * now) > 0, 1.0, 0.0) - self.y

    times = np.linspace(0.0, 3.0, 31)
    edges = np.arange(0, 7) * np.pi / 7.0
    y, T = np.zeros(times.size), 0.31
    for k, a in enumerate(edges[::2]):
        b = edges[2 * k + 1] if 2 * k + 1 < edges.size else np.inf
        y += np.where(
            times > a, np.exp(-np.maximum(times - b, 0) / T) - np.exp(-np.maximum(times - a, 0) / T), 0
        )
    fit = estimate(Clocked, {"T": 0.5}, Experiment({"y": Samples(times, y)}))
    assert fit.parameters["T"] == pytest.approx(T, rel=1e-6)


class Fading(Model):
    """A decay that must not fall below a half."""

    k = Parameter(1.0, unit="1/s")
    y = Real(start=2.0, fixed=True, min=0.5)

    def equations(self):
        yield der(self.y) == -self.k * self.y


def test_a_limit_of_the_model_that_holds_the_fit_is_told():
    times = np.linspace(0.0, 3.0, 31)
    fit = estimate(Fading, {"k": 1.0}, Experiment({"y": (times, 2.0 * np.exp(-0.7 * times))}))
    assert fit.parameters["k"] == pytest.approx(np.log(4.0) / 3.0, rel=1e-7)  # y(3) = 0.5
    assert "declares for its variables bind and pull the fit" in repr(fit)
    assert "experiment_1.model.y at its lower limit 0.5 at t = 3 s; measured y of experiment_1" in repr(fit)
    assert f"beyond by up to {0.5 - 2.0 * np.exp(-2.1):.3g}, at t = 3 s" in repr(fit)


def test_deviations_finer_than_the_default_mesh():
    """A thousand millionth of the values: the mesh must not be what chi-square tells."""
    times = np.linspace(0.0, 1.0, 31)
    noise = 1e-9 * np.random.default_rng(1).normal(0.0, 1.0, 31)
    experiment = Experiment({"y": Samples(times, 2.0 * np.exp(-0.7 * times) + noise, deviation=1e-9)})
    fit = estimate(Fading, {"k": 1.0}, experiment)
    within(fit, {"k": 0.7})
    assert 1e-3 < fit.probability < 1 - 1e-3
    assert fit.warnings == ()


@pytest.mark.parametrize("width", [1e-2, 1e-3])
def test_a_smooth_pulse_that_the_points_of_the_default_mesh_miss(width):
    """A bell in time of unit area: what follows is a decay, but for its width by its moments, exp(width^2 / (4 T^2))."""
    times, T, peak = np.linspace(0.0, 2.0, 41), 0.3, 0.78
    area = np.sqrt(np.pi)
    y = np.where(
        times > peak, area / T * np.exp((width / T) ** 2 / 4 - np.maximum(times - peak, 0.0) / T), 0.0
    )
    bell = {"u": lambda t: exp(-(((t - peak) / width) ** 2)) / width}
    far = np.abs(times - peak) > 10 * width
    fit = estimate(
        Filter, {"T": Free(0.5, min=1e-3)}, Experiment({"v": Samples(times[far], y[far])}, inputs=bell)
    )
    assert fit.parameters["T"] == pytest.approx(T, rel=1e-6)
