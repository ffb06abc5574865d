"""Linear systems against scipy.signal and the textbook."""

from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import pytest
import scipy.signal as signal
from scipy.linalg import block_diag

from gantrytau import Input, Model, ModelError, StateSpace, connect, linearize, simulate
from tests.answers.test_linearization import Oscillator

OSCILLATOR = ([[0, 1], [-25, -1.5]], [0, 0.5], [50, 0])


def random_system(seed, n=5, m=2, k=3):
    rng = np.random.default_rng(seed)
    return tuple(rng.normal(size=shape) for shape in ((n, n), (n, m), (k, n), (k, m)))


def test_oscillator_has_the_poles_and_the_damping_of_the_textbook():
    system = StateSpace(*OSCILLATOR)
    w, zeta = 5.0, 0.15
    assert system.poles == pytest.approx(w * (-zeta + 1j * np.sqrt(1 - zeta**2) * np.array([-1, 1])), 1e-14)
    assert system.damping == pytest.approx([zeta, zeta], rel=1e-13)
    assert system.eigenfrequencies == pytest.approx([w / (2 * np.pi)] * 2, rel=1e-14)
    assert system.zeros.size == 0
    assert (system.inputs, system.outputs, system.states) == (("u",), ("y",), ("x[0]", "x[1]"))


@pytest.mark.parametrize("slow", [1e-2, 1e-5, 1e-8])
def test_poles_of_a_free_body_are_exactly_zero_and_a_slow_one_beside_it_stays(slow):
    free, spring = [[0, 1], [0, 0]], [[0, 1], [-1e4, -3]]
    A = block_diag(free, -slow, spring, -200.0)
    turn = np.linalg.qr(np.random.default_rng(0).normal(size=(6, 6)))[0] @ np.diag([1, 10, 0.1, 3, 5, 1])
    system = StateSpace(turn @ A @ np.linalg.inv(turn), np.ones(6), np.ones(6))
    poles = system.poles
    assert np.all(poles[:2] == 0)
    assert poles[2] == pytest.approx(-slow, abs=1e-11)  # ten times the rounding of 1e4
    assert np.count_nonzero(poles == 0) == 2
    assert np.count_nonzero(system.discrete(0.01).poles == 1) == 2
    assert linearize(Oscillator(spring=dict(c=0.0), damper=dict(d=0.0))).poles.tolist() == [0, 0]


def test_frequency_response_is_that_of_scipy():
    A, B, C, D = random_system(1)
    hertz = np.geomspace(1e-3, 1e3, 300)
    found = StateSpace(A, B, C, D).response(hertz)
    assert found.shape == (3, 2, 300)
    for j in range(2):
        for i in range(3):
            one = signal.StateSpace(A, B[:, [j]], C[[i]], D[[i]][:, [j]])
            _, expected = signal.freqresp(one, 2 * np.pi * hertz)
            assert found[i, j] == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_discrete_system_has_the_response_of_scipy_up_to_half_the_sampling_frequency():
    A, B, C, D = random_system(2, m=1, k=1)
    system = StateSpace(A - 3 * np.eye(5), B, C, D).discrete(0.05)
    hertz = np.linspace(0.0, 10.0, 101)
    _, expected = signal.dfreqresp(
        signal.dlti(system.A, system.B, system.C, system.D, dt=0.05), 2 * np.pi * hertz * 0.05
    )
    assert system.response(hertz)[0, 0] == pytest.approx(expected, rel=1e-9)


def test_response_is_infinite_at_a_pole_and_finite_beside_it():
    found = StateSpace([[0, 1], [-4 * np.pi**2, 0]], [0, 1], [1, 0]).response([0.5, 1.0, 2.0])[0, 0]
    assert found[0] == pytest.approx(1 / (4 * np.pi**2 - np.pi**2), rel=1e-12)
    assert abs(found[1]) > 1e10 or not np.isfinite(found[1])
    integrator = StateSpace(0, 1, 1).response([0.0, 1.0])[0, 0]
    assert not np.isfinite(integrator[0])
    assert integrator[1] == pytest.approx(1 / (2j * np.pi), rel=1e-14)


def test_held_inputs_and_samples_are_those_of_scipy():
    A, B, C, D = random_system(3)
    system, rng = StateSpace(A, B, C, D), np.random.default_rng(4)
    held = system.discrete(0.1)
    expected = signal.cont2discrete((A, B, C, D), 0.1)
    assert held.A == pytest.approx(expected[0], rel=1e-12)
    assert held.B == pytest.approx(expected[1], rel=1e-12, abs=1e-14)
    u, x = rng.normal(size=(40, 2)), rng.normal(size=5)
    _, y, _ = signal.dlsim(expected, u, x0=x)
    assert held.simulate(u, x=x) == pytest.approx(y, rel=1e-10, abs=1e-9 * np.abs(y).max())
    t = np.linspace(0.0, 2.0, 41)[:40]
    _, y, _ = signal.lsim((A, B, C, D), u, t, X0=x)
    assert system.simulate((t, u), x=x) == pytest.approx(y, rel=1e-10, abs=1e-9 * np.abs(y).max())


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_zeros_are_those_of_the_numerator_in_any_units(size):
    numerator, denominator = [1.0, 3.0, 2.0 + 9.0], [1.0, 2.0, 5.0, 3.0, 1.0]
    A, B, C, D = signal.tf2ss(numerator, denominator)
    units = np.diag([1.0, size, 1 / size, size**0.5])
    system = StateSpace(
        np.linalg.solve(units, A @ units), np.linalg.solve(units, B), size * C @ units, size * D
    )
    expected = sorted(np.roots(numerator), key=lambda z: z.imag)
    assert sorted(system.zeros, key=lambda z: z.imag) == pytest.approx(expected, rel=1e-6)


def test_zeros_of_a_system_with_feedthrough_and_of_several_inputs():
    A, B, C, D = random_system(5, m=2, k=2)
    # where D is regular they are the poles of the inverse
    expected = np.linalg.eigvals(A - B @ np.linalg.solve(D, C))
    assert np.sort_complex(StateSpace(A, B, C, D).zeros) == pytest.approx(np.sort_complex(expected), 1e-10)
    blocked = StateSpace(A, B, C, D).zeros
    for z in blocked:  # each makes the system matrix lose rank
        whole = np.block([[A - z * np.eye(5), B], [C, D]])
        assert np.linalg.svd(whole)[1][-1] < 1e-12 * np.abs(whole).max()


def test_zeros_of_more_outputs_than_inputs_are_only_those_that_all_share():
    A, B, C, D = random_system(6, m=1, k=2)
    assert StateSpace(A, B, C, D).zeros.size == 0
    # both outputs behind one filter with a zero at -3
    first = signal.tf2ss([1.0, 3.0], [1.0, 4.0, 5.0])
    both = StateSpace(first[0], first[1], np.vstack([first[2], 2 * first[2]]), 0)
    assert both.zeros == pytest.approx([-3.0], rel=1e-12)
    assert StateSpace(first[0].T, np.hstack([first[2].T] * 2), first[1].T, 0).zeros == pytest.approx(
        [-3.0], rel=1e-12
    )


def test_series_and_feedback_are_made_by_connection():
    class Loop(Model):
        plant = StateSpace(*OSCILLATOR)
        controller = StateSpace(-10.0, 1.0, 100.0, 0.5)
        w = Input(start=0.0)

        def equations(self):
            yield connect(self.controller.y, self.plant.u)
            yield self.controller.u == self.w - self.plant.y

    hertz = np.geomspace(0.01, 100, 50)
    loop = linearize(Loop(), outputs=["plant.y"])
    plant, controller = (
        StateSpace(*OSCILLATOR).response(hertz),
        StateSpace(-10.0, 1.0, 100.0, 0.5).response(hertz),
    )
    open_loop = (plant * controller)[0, 0]
    assert loop.response(hertz)[0, 0] == pytest.approx(open_loop / (1 + open_loop), rel=1e-10)


def test_component_moves_as_its_matrices_say():
    class Driven(Model):
        system = StateSpace(*random_system(7), x=dict(start=[1.0, -1.0, 0.5, 0.0, 2.0]))
        w = Input(2, start=0.0)

        def equations(self):
            yield self.system.u == self.w

    t, rng = np.linspace(0.0, 1.0, 21), np.random.default_rng(8)
    w = rng.normal(size=(21, 2))
    motion = simulate(Driven(), stop=1.0, inputs={"w": (t, w)}, points=21, tolerance=1e-10)
    exact = StateSpace(*random_system(7)).simulate((t, w), x=[1.0, -1.0, 0.5, 0.0, 2.0])
    # a hundred times the tolerance
    assert motion["system.y"] == pytest.approx(exact, abs=1e-8 * np.abs(exact).max())


def test_linearization_answers_as_a_linear_system_with_units(tmp_path):
    linear = linearize(Oscillator(), outputs=["mass.s", "mass.v"])
    hertz = np.array([0.5, 2.0])
    s = 2j * np.pi * hertz
    assert linear.response(hertz)[0, 0] == pytest.approx(1 / (2 * s**2 + 3 * s + 50), rel=1e-12)
    assert linear.discrete(0.004).poles == pytest.approx(np.exp(linear.poles * 0.004), rel=1e-12)
    assert (linear.unit("mass.s"), linear.unit("force.f")) == ("m", "N")
    figure = linear.plot_bode(file=tmp_path / "bode.png")
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert labels == ["gain [m/N]", "phase [deg]", "gain [(m/s)/N]", "phase [deg]"]
    assert figure.axes[-1].get_xlabel() == "frequency [Hz]"
    figure = linear.plot_poles(file=tmp_path / "poles.png")
    assert figure.axes[0].get_xlabel() == "real part [1/s]"
    assert (tmp_path / "bode.png").stat().st_size > 10_000
    assert (tmp_path / "poles.png").stat().st_size > 10_000


def test_bode_picture_shows_the_peak_of_a_hardly_damped_resonance():
    system = StateSpace([[0, 1], [-1e4, -2e-4 * 1e2]], [0, 1], [1, 0])  # damping 1e-4
    line = system.plot_bode().axes[0].lines[0]
    assert np.max(line.get_ydata()) == pytest.approx(1 / (2e-4 * 1e4), rel=1e-3)


@dataclass
class Points:
    """A frequency response as it might have been measured."""

    hertz: np.ndarray
    response: np.ndarray


def drawn(line) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata())


def test_pictures_of_systems_beside_each_other_and_of_what_was_measured():
    system, sampled = StateSpace(*OSCILLATOR), StateSpace(*OSCILLATOR).discrete(0.1)
    hertz = np.linspace(0.1, 4.0, 30)
    measured = Points(hertz, system.response(hertz))
    gain, phase = system.plot_bode(beside={"sampled": sampled, "measured": measured}).axes[:2]
    own, held, points = gain.lines
    assert [line.get_label() for line in gain.lines] == ["StateSpace", "sampled", "measured"]
    assert np.max(held.get_xdata()) <= 5.0 < np.max(own.get_xdata())  # half of 10 Hz
    assert points.get_linestyle() == "None"
    assert np.allclose(points.get_ydata(), np.abs(measured.response[0, 0]))
    turned = np.interp(hertz, *drawn(phase.lines[0]))
    assert np.allclose(phase.lines[2].get_ydata(), turned, atol=0.1)  # between the points of the grid
    axis = system.plot_poles(beside={"sampled": sampled}).axes[0]
    assert axis.get_xlabel() == "real part [1/s]"
    crosses = [line for line in axis.lines if line.get_marker() == "x"]
    assert np.allclose(crosses[0].get_xdata(), crosses[1].get_xdata())  # as both have the same poles
    axis = sampled.plot_poles(beside={"other": StateSpace(0.5, 1, 1, period=0.1)}).axes[0]
    assert axis.get_xlabel() == "real part of z, 10 Hz"


def test_phases_of_measured_points_are_in_the_turn_of_the_line():
    system = StateSpace(*OSCILLATOR)
    hertz = np.linspace(2.0, 4.0, 20)
    noise = np.where(np.arange(20) % 2, np.exp(1j), np.exp(-1j))  # about -180 degrees, to both sides
    measured = Points(hertz, system.response(hertz) * noise)
    line, points = system.plot_bode(beside={"measured": measured}).axes[1].lines
    off = drawn(points)[1] - np.interp(hertz, *drawn(line))
    assert np.allclose(np.abs(off), np.degrees(1.0), atol=0.1)


ONE = StateSpace(1, 1, 1)
EACH_SECOND = StateSpace(1, 1, 1, period=1.0)
TWO_INPUTS = StateSpace(2, [[1.0, 2.0]], 1)


@pytest.mark.parametrize(
    ("wrong", "argument"),
    [
        (lambda: StateSpace(np.eye(2), [1.0, 2.0, 3.0], [1, 0]), "B"),
        (lambda: StateSpace(np.ones((2, 3)), [1, 0], [1, 0]), "A"),
        (lambda: StateSpace(np.eye(2), [1, 0], [1, np.nan]), "C"),
        (lambda: StateSpace(np.eye(2), [1, 0], [1, 0], [[1.0, 2.0]]), "D"),
        (lambda: ONE.discrete(-1.0), "period"),
        (lambda: ONE.response([-1.0]), "frequencies"),
        (lambda: ONE.plot_bode([0.0]), "frequencies"),
        (lambda: EACH_SECOND.response([0.6]), "frequencies"),
        (lambda: EACH_SECOND.simulate(np.ones((4, 2))), "u"),
        (lambda: EACH_SECOND.simulate([1.0], x=[1, 2]), "x"),
        (lambda: ONE.plot_bode(beside=cast(Any, [ONE])), "beside"),
        (lambda: ONE.plot_poles(beside=cast(Any, {"b": 3})), "beside"),
        (lambda: ONE.plot_bode(beside={"StateSpace": ONE}), "beside"),
        (lambda: ONE.plot_bode(beside={"b": TWO_INPUTS}), "beside"),
        (lambda: ONE.plot_poles(file="poles.xyz"), "file"),
    ],
)
def test_wrong_arguments_are_refused_by_their_names(wrong, argument):
    with pytest.raises(ModelError) as refused:
        wrong()
    assert refused.value.argument == argument


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: EACH_SECOND.discrete(0.2), "found a discrete system with a period of 1 s"),
        (lambda: ONE.simulate([1.0, 2.0]), "expected .times, values.: the system is continuous"),
        (lambda: ONE.simulate(([0, 0], [1, 2])), "times that do not rise"),
        (lambda: EACH_SECOND.simulate(([0, 1], [1, 2])), "expected values .N, 1. alone, one row"),
        (lambda: StateSpace(1, np.ones((1, 9)), np.ones((2, 1))).plot_bode(), "2 outputs and 9 inputs"),
    ],
)
def test_what_a_system_cannot_do_is_said(wrong, words):
    with pytest.raises(ModelError, match=words):
        wrong()
