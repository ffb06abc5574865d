"""Servos from steps: Dressler (2012), (6.11)."""

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica import StepResponse, identify_servo
from gantrytau_optimica.identification import IdentificationError

POLE, GAIN = np.array([0.9647, 0.9656, 0.9728]), np.array([0.03527, 0.03425, 0.02748])  # (6.11), as printed
DELAY, PERIOD = 5, 0.004
SIZES = (0.001, 0.0015, 0.002)  # m, as printed
NOISE = 1e-6  # m, of encoders
BEFORE, ROWS = 50, 400


def motion(u, pole=POLE, gain=GAIN, delay=DELAY):
    """Positions (N, n) by the recursion of (6.11), term by term."""
    y = np.zeros((len(u), len(pole)))
    for k in range(1, len(u)):
        y[k] = pole * y[k - 1] + (gain * u[k - delay] if k >= delay else 0.0)
    return y


def steps(noise=0.0, seed=0, sizes=SIZES, rows=ROWS, **law):
    """Steps of three actuators at once, from a reference of 0.5 m and positions 20 um short of it."""
    rng = np.random.default_rng(seed)
    found = []
    for size in sizes:
        u = np.where(np.arange(rows) >= BEFORE, size, 0.0)[:, None] * np.ones(3)
        y = motion(u, **law)
        found.append(
            StepResponse(PERIOD * np.arange(rows), 0.5 + u, 0.49998 + y + noise * rng.normal(size=y.shape))
        )
    return found


def kinds(servo):
    return {finding.kind for finding in servo.findings}


@pytest.fixture(scope="module")
def exact():
    return identify_servo(steps())


def test_printed_servos_are_found_in_their_own_response(exact):
    assert np.array_equal(exact.delay, [DELAY] * 3)
    assert np.allclose(exact.pole, POLE, rtol=0, atol=1e-9)
    assert np.allclose(exact.gain, GAIN, rtol=0, atol=1e-9)
    assert np.allclose(exact.rest, 0.49998, rtol=0, atol=1e-12)
    assert not exact.findings
    assert np.all(exact.fit > 99.999)


def test_what_follows_from_the_printed_servos(exact):
    assert np.allclose(exact.time_constant, [0.1113, 0.1143, 0.1450], rtol=0, atol=1e-4)
    assert np.allclose(exact.bandwidth, [1.431, 1.394, 1.099], rtol=2e-3)  # which were read off a grid
    gains = np.abs(exact.system.response(exact.bandwidth))
    at_rest = np.abs(exact.system.response([0.0]))[:, :, 0]
    # by the closed form
    assert np.allclose([gains[i, i, i] for i in range(3)], np.diag(at_rest) / np.sqrt(2), rtol=1e-9)


@pytest.mark.parametrize("delay", [0, 1, 2, 5])
def test_the_system_is_the_recursion(delay):
    servo = identify_servo(steps(delay=delay))
    assert np.array_equal(servo.delay, [delay] * 3)
    u = np.random.default_rng(delay).normal(size=(100, 3))
    u[:5] = 0.0  # the recursion of the test begins at rest
    assert np.allclose(servo.system.simulate(u), motion(u, delay=delay), rtol=0, atol=1e-12)
    step = servo.steps[1]
    by_system = servo.system.simulate(step.reference - step.reference[0]) + servo.rest[1]
    assert np.allclose(servo.simulated(1), by_system, rtol=0, atol=1e-12)
    assert ("delay" in kinds(servo)) == (delay == 0)


@pytest.mark.parametrize("corner", [None, 2.0])
def test_deviations_hold_with_noise_white_or_coloured(corner):
    """Twenty seeds: squares of errors over variances have a mean near one, as the spectrum of the residual is used."""
    found = []
    rng = np.random.default_rng(7)
    for _ in range(20):
        noise = NOISE * rng.normal(size=(3, ROWS, 3))
        if corner:
            a = np.exp(-2 * np.pi * corner * PERIOD)
            for k in range(1, ROWS):
                noise[:, k] += a * noise[:, k - 1]
        noisy = [
            StepResponse(step.t, step.reference, step.position + e)
            for step, e in zip(steps(), noise, strict=True)
        ]
        servo = identify_servo(noisy)
        assert np.array_equal(servo.delay, [DELAY] * 3)
        errors = np.column_stack([servo.pole - POLE, servo.gain - GAIN]).ravel()
        found.append(errors / np.array(list(servo.deviations.values())))
    sizes = np.sqrt(np.mean(np.square(found), axis=0))
    assert np.all((sizes > 0.6) & (sizes < 1.8))
    assert 0.75 < np.mean(sizes) < 1.45


def test_noise_does_not_draw_the_pole_to_zero():
    """Output error is without bias where a regression of measured on measured samples is not."""
    noise = 50 * NOISE
    output, equation = [], []
    for seed in range(10):
        step = steps(noise, seed, sizes=(0.001,))[0]
        output.append(identify_servo([step]).pole - POLE)
        y, u = (x - x[0] for x in (step.position - 0.49998, step.reference))
        fits = [
            np.linalg.lstsq(np.column_stack([y[4:-1, i], u[:-DELAY, i]]), y[DELAY:, i], rcond=None)[0][0]
            for i in range(3)
        ]
        equation.append(np.array(fits) - POLE)
    assert np.all(np.mean(equation, axis=0) < -0.01)
    assert np.all(np.abs(np.mean(output, axis=0)) < 0.001)


def test_a_delay_is_found_where_the_grid_of_poles_would_have_another():
    """10 kHz: half a time constant is 500 samples, and 10 of them of delay make up for a pole that is 1e-5 off."""
    t = 1e-4 * np.arange(20_000)
    u = np.where(t > 0.1, 1.0, 0.0)
    y = np.where(t > 0.1 + 30e-4, 1 - 0.999 ** np.maximum(np.round((t - 0.1) / 1e-4) - 30, 0), 0.0)
    servo = identify_servo(StepResponse(t, u, y + 1e-3 * np.random.default_rng(0).normal(size=t.shape)))
    assert abs(servo.delay[0] - 30) <= 1
    assert servo.pole[0] == pytest.approx(0.999, abs=3e-6)


@pytest.mark.parametrize("factor", [1e-9, 1e9])
def test_units_of_length_do_not_matter(factor, exact):
    scaled = [StepResponse(s.t, factor * s.reference, factor * s.position) for s in steps()]
    assert np.allclose(identify_servo(scaled).pole, exact.pole, rtol=0, atol=1e-7)  # digits lost beside 0.5 m


def test_any_motion_from_rest_will_do_and_one_actuator_alone():
    t = PERIOD * np.arange(1000)
    u = np.where(t > 0.1, 0.001 * np.sign(np.sin(9 * t**2)), 0.0)
    y = motion(u[:, None], POLE[:1], GAIN[:1])[:, 0]
    servo = identify_servo(StepResponse(t, u, y))
    assert np.allclose([servo.pole[0], servo.gain[0]], [POLE[0], GAIN[0]], rtol=0, atol=1e-9)
    assert kinds(servo) == {"one size"}


def test_actuators_that_step_one_after_another():
    found = []
    for step, i in zip(steps(), range(3), strict=True):
        alone = np.arange(3) == i
        found.append(
            StepResponse(
                step.t,
                np.where(alone, step.reference, step.reference[0]),
                np.where(alone, step.position, step.position[0]),
            )
        )
    servo = identify_servo(found)
    assert np.allclose(servo.pole, POLE, rtol=0, atol=1e-9)
    assert np.array_equal(np.isnan(servo.rest), ~np.eye(3, dtype=bool))


def held_back(size):
    """A servo with friction: a velocity loop with integrator pushes a mass against Coulomb friction; (N,) of u and y."""
    mass, friction, speed_gain, integral_time, pole_rate = 80.0, 130.0, 8000.0, 0.03, 9.0
    fine, u, y = 20, np.where(np.arange(ROWS) >= BEFORE, size, 0.0), np.zeros(ROWS)
    s = v = pushed = 0.0
    for k in range(ROWS):
        y[k] = s
        for _ in range(fine):
            error = pole_rate * (u[k] - s) - v
            pushed += error * PERIOD / fine / integral_time
            force = speed_gain * (error + pushed) - friction * np.tanh(v / 1e-4)
            v += force / mass * PERIOD / fine
            s += v * PERIOD / fine
    return StepResponse(PERIOD * np.arange(ROWS), u, y)


def limited(size):
    """A servo of first order whose speed is limited."""
    u, y = np.where(np.arange(ROWS) >= BEFORE, size, 0.0), np.zeros(ROWS)
    for k in range(1, ROWS):
        y[k] = y[k - 1] + np.clip(0.0353 * (u[k - 1] - y[k - 1]), -4e-5, 4e-5)
    return StepResponse(PERIOD * np.arange(ROWS), u, y)


def test_friction_and_saturation_show_in_steps_of_several_sizes():
    friction, saturation = (
        identify_servo([law(size) for size in (0.001, 0.002, 0.004)]) for law in (held_back, limited)
    )
    assert "friction" in kinds(friction)
    assert "saturation" not in kinds(friction)
    assert "saturation" in kinds(saturation)
    assert "friction" not in kinds(saturation)


def altered(change):
    return [StepResponse(s.t, s.reference, change(s)) for s in steps(NOISE)]


@pytest.mark.parametrize(
    ("kind", "measured"),
    [
        ("unit", lambda: altered(lambda s: 1000 * s.position)),
        ("sign", lambda: altered(lambda s: -s.position)),
        ("fit", lambda: altered(lambda s: s.position + 2e-4 * np.sin(30 * s.t)[:, None])),
        ("noise", lambda: steps(1e-4)),
        ("not settled", lambda: steps(rows=BEFORE + 60)),
        ("not at rest", lambda: altered(lambda s: s.position + 1e-3 * np.minimum(s.t, 0.2)[:, None])),
        ("one size", lambda: steps(sizes=(0.001,) * 2)),
        ("delay", lambda: steps(delay=100)),
        ("fast", lambda: steps(pole=0 * POLE, gain=np.ones(3))),
    ],
)
def test_what_is_doubtful_is_told(kind, measured):
    found = [finding for finding in identify_servo(measured()).findings if finding.kind == kind]
    assert found
    assert all(finding.message.startswith("actuator") for finding in found)


T = PERIOD * np.arange(100)
JUMP = np.where(T > 0.1, 1.0, 0.0)
HOLE = np.where(np.arange(100) == 7, np.nan, JUMP)


@pytest.mark.parametrize(
    ("arguments", "wrong"),
    [
        ((T, JUMP, HOLE), "position"),
        ((T, HOLE, JUMP), "reference"),
        ((np.where(T > 0.2, T + 0.001, T), JUMP, JUMP), "t"),
        ((T[::-1], JUMP, JUMP), "t"),
        ((0 * T, JUMP, JUMP), "t"),
        ((T[:50], JUMP, JUMP), "reference"),
        ((T, np.ones((100, 2)), JUMP), "reference"),
        ((T[:, None], JUMP, JUMP), "t"),
        (([], [], []), "t"),
        (([0.0], [1.0], [1.0]), "t"),
    ],
)
def test_what_is_no_step_response(arguments, wrong):
    with pytest.raises(ModelError) as refusal:
        StepResponse(*arguments)
    assert refusal.value.argument == wrong


@pytest.mark.parametrize(
    ("measured", "error", "words"),
    [
        ([], ModelError, "expected a StepResponse"),
        ([JUMP], ModelError, "expected a StepResponse"),
        ([StepResponse(T, 0 * T, JUMP)], ModelError, "no step of actuator 0: its reference never changes"),
        ([StepResponse(T, JUMP, 0 * T)], ModelError, "actuator 0 does not move in step 0"),
        ([StepResponse(T[:30], JUMP[:30], JUMP[:30])], ModelError, "found 4 rows of step 0 from where the"),
        (
            [StepResponse(T, JUMP, JUMP), StepResponse(T, np.ones((100, 2)), np.ones((100, 2)))],
            ModelError,
            "step 1 of 2 actuators beside step 0 of 1",
        ),
        ([StepResponse(T, JUMP, JUMP), StepResponse(2 * T, JUMP, JUMP)], ModelError, "step 1 every 0.008 s"),
        ([StepResponse(T, JUMP, np.sin(300 * T))], IdentificationError, "of the motion of actuator 0"),
        ([StepResponse(T, JUMP, np.cumsum(JUMP))], IdentificationError, "does not come to an end of its"),
    ],
)
def test_steps_that_tell_nothing(measured, error, words):
    with pytest.raises(error, match=words):
        identify_servo(measured)


def test_names_figure_and_words(exact, tmp_path):
    assert exact.covariance(["gain[1]", "pole[1]"]).shape == (2, 2)
    with pytest.raises(ModelError, match=r"found 'pole\[7\]', expected names among pole\[0\]"):
        exact.covariance(["pole[7]"])
    assert "delay 5, pole 0.96470" in repr(exact)
    figure = exact.plot(file=tmp_path / "steps.png")
    assert (tmp_path / "steps.png").stat().st_size > 10_000
    assert len(figure.axes) == 6
    left = figure.axes[1].lines
    assert len(left) == 3
    assert np.abs(left[0].get_ydata()).max() < 1e-12  # the law is exact
