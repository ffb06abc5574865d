"""Simulation against analytic solutions, balances of energy, and what wrong input gets."""

import itertools
import signal

import matplotlib
import numpy as np
import pytest

import gantrytau.simulation.integration
from gantrytau import (
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    SolveError,
    cos,
    der,
    exp,
    simulate,
    sin,
    time,
    translate,
)
from gantrytau_models import GantryTau, Pendulum, prototypes

matplotlib.use("Agg")
TOLERANCE = 1e-9
NEAR = 1e3 * TOLERANCE  # the integrator holds its tolerance per step; over a few seconds errors add up


class Oscillator(Model):
    """A mass on a spring, pushed by a force."""

    m = Parameter(2.0, unit="kg", description="mass")
    c = Parameter(8.0, unit="N/m", description="stiffness")
    x = Real(unit="m", description="position", start=1.0, fixed=True)
    v = Real(unit="m/s", description="speed", start=0.0, fixed=True)
    f = Input(unit="N", description="force", start=0.0)
    energy = Real(unit="J", description="energy")

    def equations(self):
        yield self.v == der(self.x)
        yield self.m * der(self.v) == -self.c * self.x + self.f
        yield self.energy == self.m * self.v**2 / 2 + self.c * self.x**2 / 2


class Circuit(Model):
    """A resistor charges a capacitor."""

    R = Parameter(2.0, unit="Ohm", description="resistance")
    C = Parameter(0.25, unit="F", description="capacitance")
    source = Input(unit="V", description="voltage of the source")
    u = Real(unit="V", description="voltage of the capacitor", start=0.0, fixed=True)
    i = Real(unit="A", description="current")

    def equations(self):
        yield self.source == self.R * self.i + self.u
        yield self.C * der(self.u) == self.i


class Integrator(Model):
    """x is the integral of u."""

    u = Input(unit="m/s", description="rate")
    x = Real(unit="m", description="integral", start=0.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.u


def test_a_free_oscillator_is_a_cosine():
    found = simulate(Oscillator(), stop=5.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["x"], np.cos(2 * found.time), atol=NEAR)
    np.testing.assert_allclose(found["v"], -2 * np.sin(2 * found.time), atol=NEAR)
    np.testing.assert_allclose(found["der(v)"], -4 * np.cos(2 * found.time), atol=4 * NEAR)
    assert np.ptp(found["energy"]) < NEAR
    assert (found.time[0], found.time[-1], found.time.size) == (0.0, 5.0, 501)


def test_a_constant_input():
    found = simulate(Circuit(), stop=2.0, inputs={"source": 5.0}, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["u"], 5 * (1 - np.exp(-found.time / 0.5)), atol=NEAR)
    np.testing.assert_allclose(found["i"], 2.5 * np.exp(-found.time / 0.5), atol=NEAR)


def test_an_input_as_function_of_time():
    # resonance-free forcing: m x'' + c x = sin t has the particular solution sin t / (c - m)
    found = simulate(Oscillator(), stop=5.0, inputs={"f": lambda t: sin(t)}, tolerance=TOLERANCE)
    t = found.time
    np.testing.assert_allclose(found["x"], np.cos(2 * t) + np.sin(t) / 6 - np.sin(2 * t) / 12, atol=NEAR)
    np.testing.assert_allclose(found["f"], np.sin(t), atol=1e-15)


def test_kinks_of_samples_between_output_points_are_met_exactly():
    times = np.array([0.0, 0.137, 0.4111, 1.0])
    values = np.array([0.0, 3.0, -1.0, -1.0])
    found = simulate(Integrator(), stop=1.0, inputs={"u": (times, values)}, points=8, tolerance=TOLERANCE)

    def area(t):
        knots = np.union1d(times[times < t], [t])
        heights = np.interp(knots, times, values)
        return np.sum(np.diff(knots) * (heights[1:] + heights[:-1]) / 2)

    assert found.time.size == 8
    # piecewise linear input: its integral is quadratic between the kinks, which the integrator finds exactly
    np.testing.assert_allclose(found["x"], [area(t) for t in found.time], atol=10 * TOLERANCE)
    np.testing.assert_allclose(found["u"], np.interp(found.time, times, values), atol=1e-15)


def test_samples_that_reach_beyond_the_simulated_time():
    times = np.linspace(-1.0, 3.0, 5)
    found = simulate(Integrator(), start=0.5, stop=2.0, inputs={"u": (times, 2 * times)}, points=11)
    np.testing.assert_allclose(found["x"], found.time**2 - 0.25, atol=1e-7)


def test_a_later_start_counts_time_from_there():
    class Clock(Model):
        x = Real(unit="s2", description="integral of time", start=0.0, fixed=True)

        def equations(self):
            yield der(self.x) == time

    found = simulate(Clock(), start=2.0, stop=4.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["x"], (found.time**2 - 4) / 2, atol=NEAR)
    assert found.time[0] == 2.0


def test_a_later_start_with_a_function_and_constraints():
    class Driven(Model):
        w = Parameter(1.0, unit="rad/s", description="frequency")
        x = Real(description="follows a function", unit="1")
        v = Real(unit="1/s", description="its rate")
        y = Real(unit="1", description="on the unit circle with x", start=1.0)

        def equations(self):
            yield self.x == 0.5 * sin(self.w * time)
            yield self.v == der(self.x)
            yield self.x**2 + self.y**2 == 1

    found = simulate(Driven(), start=1.0, stop=3.0, points=21)
    np.testing.assert_allclose(found["v"], 0.5 * np.cos(found.time), atol=1e-9)
    np.testing.assert_allclose(found["y"], np.sqrt(1 - 0.25 * np.sin(found.time) ** 2), atol=1e-9)


def test_errors_fall_with_the_tolerance():
    errors = []
    for tolerance in (1e-4, 1e-6, 1e-8, 1e-10):
        found = simulate(Oscillator(), stop=5.0, tolerance=tolerance)
        errors.append(np.max(np.abs(found["x"] - np.cos(2 * found.time))))
    assert all(fine < coarse / 10 for coarse, fine in itertools.pairwise(errors))
    assert errors[-1] < 1e-7


def test_a_pendulum_holds_its_rod_for_100_s():
    swing = simulate(Pendulum(), stop=100.0, tolerance=1e-8)
    assert np.max(np.abs(np.hypot(swing["x"], swing["y"]) - 1.0)) < 1e-10
    assert np.max(np.abs(swing["x"] * swing["v_x"] + swing["y"] * swing["v_y"])) < 1e-10
    energy = swing["kinetic_energy"] + swing["potential_energy"]
    assert np.ptp(energy) < 1e-4 * abs(energy[0])  # some 5000 steps of 1e-8 each


def test_the_work_of_the_robot_goes_into_energy_and_friction():
    robot = GantryTau(prototypes.L1)
    inputs = {f"carts[{k}].f": (lambda t, k=k: 300 * sin(3 * t + k)) for k in range(3)}
    found = simulate(robot, stop=1.0, inputs=inputs, tolerance=1e-10, points=2001)
    masses = [prototypes.L1.plate_mass, *prototypes.L1.cart_masses]
    speeds = [
        found["tool.v"],
        *(np.outer(found[f"carts[{k}].v"], prototypes.L1.arms[k].direction) for k in range(3)),
    ]
    energy = np.sum([m * np.sum(v**2, axis=1) / 2 for m, v in zip(masses, speeds, strict=True)], axis=0)
    heights = [found["tool.r"][:, 2]]
    heights += [found[f"carts[{k}].s"] * prototypes.L1.arms[k].direction[2] for k in range(3)]
    energy += np.sum([9.81 * m * z for m, z in zip(masses, heights, strict=True)], axis=0)
    net = [found[f"carts[{k}].f"] - found[f"carts[{k}].friction"] for k in range(3)]
    power = np.sum([net[k] * found[f"carts[{k}].v"] for k in range(3)], axis=0)
    h = found.time[1]
    work = h / 3 * (power[0] + 4 * power[1:-1:2].sum() + 2 * power[2:-1:2].sum() + power[-1])  # Simpson
    assert abs(energy[-1] - energy[0] - work) < 1e-6 * np.max(np.abs(energy))
    assert np.ptp(energy) > 1.0  # J, it does move


def test_parameters_change_without_a_new_model():
    found = simulate(Oscillator(), stop=2.0, parameters={"c": 18.0}, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["x"], np.cos(3 * found.time), atol=NEAR)
    np.testing.assert_array_equal(found["c"], 18.0)
    dae = translate(Oscillator())
    for c in (8.0, 32.0):
        found = simulate(dae, stop=2.0, parameters={"c": c}, tolerance=TOLERANCE)
        np.testing.assert_allclose(found["x"], np.cos(np.sqrt(c / 2) * found.time), atol=NEAR)


def test_parameters_that_shape_the_equations_may_change_too():
    # directions of guideways are folded into the equations; turned by 90 degrees about x, nothing else changes
    lifted = simulate(GantryTau(prototypes.L1), stop=0.2, parameters={"arms[0].length": 2.3}, points=11)
    across = lifted["tool.r"] - lifted["arms[0].frame_cart.r"]
    np.testing.assert_allclose(np.linalg.norm(across, axis=1), 2.3, atol=1e-10)
    tilted = simulate(
        GantryTau(prototypes.L1), stop=0.2, parameters={"arms[0].direction": [1.0, 0.0, 0.01]}, points=11
    )
    slope = np.diff(tilted["arms[0].frame_cart.r"][:, 2]) / np.diff(tilted["carts[0].s"])
    np.testing.assert_allclose(slope, 0.01, atol=1e-6)


def test_only_the_outputs_asked_for_are_kept():
    found = simulate(
        GantryTau(prototypes.L1), stop=0.1, outputs=["tool.r", "carts[1].s", "der(tool.v)"], points=5
    )
    assert set(found.names) == {
        *(f"tool.r[{k}]" for k in range(3)),
        "carts[1].s",
        *(f"der(tool.v[{k}])" for k in range(3)),
    }
    assert found["tool.r"].shape == (5, 3)
    with pytest.raises(ModelError, match="velocity"):
        simulate(Oscillator(), stop=1.0, outputs=["velocity"])


def test_a_model_without_states():
    class Lever(Model):
        u = Input(unit="m", description="hand")
        x = Real(unit="m", description="load", start=1.0)
        m = Parameter(1.0, unit="m", description="one metre")
        y = Real(unit="m", description="solved by iteration", start=0.5)

        def equations(self):
            yield self.x == 3 * self.u
            yield self.y + self.m / 2 * sin(self.y / self.m) == self.u

    found = simulate(Lever(), stop=1.0, inputs={"u": lambda t: 1 + t}, points=11)
    np.testing.assert_allclose(found["x"], 3 + 3 * found.time, atol=1e-12)
    np.testing.assert_allclose(found["y"] + 0.5 * np.sin(found["y"]), 1 + found.time, atol=1e-7)


def test_an_algebraic_loop_without_closed_form():
    class Loop(Model):
        x = Real(start=0.0, fixed=True, unit="1", description="state")
        y = Real(start=0.5, unit="1", description="solution of Kepler's equation")

        def equations(self):
            yield der(self.x) == 1 / self.second
            yield self.y - 0.3 * sin(self.y) == self.x

        second = Parameter(1.0, unit="s", description="one second")

    found = simulate(Loop(), stop=2.0, tolerance=TOLERANCE, points=21)
    np.testing.assert_allclose(found["x"], found.time, atol=NEAR)
    np.testing.assert_allclose(found["y"] - 0.3 * np.sin(found["y"]), found["x"], atol=NEAR)


def test_a_constant_model():
    class Constant(Model):
        x = Real(unit="m", description="constant")

        def equations(self):
            yield self.x == 3.0

    np.testing.assert_array_equal(simulate(Constant(), stop=1.0, points=3)["x"], 3.0)


class Explosion(Model):
    """x' = x^2 from 1: x = 1 / (1 - t), infinite at 1 s."""

    one = Parameter(1.0, unit="m.s", description="scale")
    x = Real(unit="m", description="position", start=1.0, fixed=True)

    def equations(self):
        yield der(self.x) == self.x**2 / self.one


def test_a_solution_that_ends_in_finite_time_stops_with_what_was_found():
    with pytest.raises(SolveError) as caught:
        simulate(Explosion(), stop=2.0)
    error = caught.value
    assert error.time == pytest.approx(1.0, abs=0.01)
    assert "Explosion: the integration stopped at t = " in str(error)
    partial = error.result
    assert partial.time[-1] <= error.time < partial.time[-1] + 0.004  # the next output point
    inside = partial.time < 0.9
    # errors grow with the solution
    np.testing.assert_allclose(partial["x"][inside], 1 / (1 - partial.time[inside]), rtol=1e-4)


def test_a_tool_led_out_of_reach_stops_and_names_the_link():
    # the tool is led sideways at 1 m/s until link 1 is across its guideway: no cart position reaches further
    arm = prototypes.GT_A.arms[1]
    low = 2.51 - arm.offset[1], -1.03 - arm.offset[2]
    reached = np.sqrt(arm.length**2 - low[1] ** 2) - low[0]
    dae = translate(GantryTau(prototypes.GT_A), given=["tool.r"])
    with pytest.raises(SolveError) as caught:
        simulate(dae, stop=3.0, inputs={"tool.r": lambda t: [0.0, 2.51 + t, -1.03]}, points=31)
    error = caught.value
    assert error.time == pytest.approx(reached, abs=0.01)
    assert error.equations[0] == "arms[1].link (SphericalSpherical), equation 1"
    assert "the motion meets a singular pose at t = 1.38" in str(error)
    ahead = error.result["tool.r"][:, 0] - error.result["arms[1].frame_cart.r"][:, 0]
    np.testing.assert_allclose(
        ahead, np.sqrt(arm.length**2 - (low[0] + error.result.time) ** 2 - low[1] ** 2), atol=1e-8
    )


def test_ctrl_c_keeps_what_was_computed(monkeypatch):
    class Interrupting(gantrytau.simulation.integration.Progress):
        def at(self, t: float) -> None:
            if t > 5.0:
                signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(gantrytau.simulation.integration, "Progress", Interrupting)
    with pytest.raises(SolveError, match="Pendulum: simulation interrupted at t = ") as caught:
        simulate(Pendulum(), stop=20.0)
    assert 5.0 < caught.value.time < 8.0
    assert caught.value.result.time[-1] == caught.value.time
    assert np.all(np.isfinite(caught.value.result["tension"]))


def test_a_result_answers_names_of_vectors_and_derivatives_and_survives_a_file(tmp_path):
    found = simulate(GantryTau(prototypes.L1), stop=0.1, points=6)
    assert found["tool.r"].shape == (6, 3)
    np.testing.assert_array_equal(found["der(tool.r[2])"], found["tool.v"][:, 2])
    assert found.unit("der(tool.v[0])") == "m/s2"
    np.testing.assert_array_equal(found.final("tool.r"), found["tool.r"][-1])
    with pytest.raises(ModelError, match=r"did you mean 'tool.r"):
        found["tool.rr"]
    file = found.save(tmp_path / "robot.csv")
    header, *rows = file.read_text().splitlines()
    column = header.split(",").index("carts[1].s [m]")
    np.testing.assert_array_equal([float(row.split(",")[column]) for row in rows], found["carts[1].s"])
    found.plot("tool.r", "carts[0].s", file=tmp_path / "robot.png")
    assert (tmp_path / "robot.png").stat().st_size > 1000


def test_functions_of_gantrytau_work_as_inputs():
    found = simulate(Integrator(), stop=1.0, inputs={"u": lambda t: exp(-t) * cos(t)}, tolerance=TOLERANCE)
    t = found.time
    np.testing.assert_allclose(found["x"], 0.5 * np.exp(-t) * (np.sin(t) - np.cos(t)) + 0.5, atol=NEAR)
