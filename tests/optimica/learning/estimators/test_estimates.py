"""What estimators make of a run: sensors set at rest, linear, and refused by name."""

import numpy as np
import pytest

from gantrytau import ModelError, Result
from gantrytau_optimica import Complementary, Kinematic, Measured
from gantrytau_optimica.learning import Actuators, plot_estimates
from tests.optimica.learning.estimators.analytic_runs import PERIOD, PLACE, l1_kinematics, run_of, swung_ramp

KINEMATICS = l1_kinematics()
EXACT = 1e-9  # m, of forward after inverse kinematics


def moved(rows: int = 900) -> tuple[np.ndarray, np.ndarray]:
    """Three axes that move each in its way, (rows, 3) in m, and their accelerations."""
    z, a = swung_ramp(PERIOD * np.arange(rows), stop=3.0)
    sizes = np.array([1.0, -0.7, 0.4])
    return z[:, None] * sizes, a[:, None] * sizes


def test_sensors_are_set_to_zero_where_the_robot_rests():
    z, a = moved()
    run = run_of(KINEMATICS, z, a=a + np.array([0.3, -0.2, 9.81]), r=z + np.array([0.1, 0.0, -5.0]))
    for estimator in (Kinematic(), Complementary(), Measured()):
        found = estimator.estimate(run, KINEMATICS)
        # a bias is not seen, and jerk that jumps is not in the samples
        assert np.abs(found - PLACE - z).max() < 1e-7, estimator
    assert np.abs(Actuators().estimate(run, KINEMATICS) - run["measured.q"]).max() < 1e-12
    # a deflection is told by the gauge alone
    deflected = run_of(KINEMATICS, z, r=1.1 * z)
    np.testing.assert_allclose(Measured().estimate(deflected, KINEMATICS) - PLACE, 1.1 * z, atol=EXACT)
    np.testing.assert_allclose(Kinematic().estimate(deflected, KINEMATICS) - PLACE, z, atol=EXACT)


def test_noise_at_rest_counts_by_its_mean():
    z, a = moved()
    noise = 0.07 * np.random.default_rng(4).standard_normal(a.shape)
    still = np.arange(245)  # the reference leaves its first position about there
    of_rest = noise[still].mean(axis=0)
    one = Complementary().estimate(run_of(KINEMATICS, z, a=a + noise), KINEMATICS)
    other = Complementary().estimate(run_of(KINEMATICS, z, a=a + noise - of_rest), KINEMATICS)
    np.testing.assert_allclose(one, other, atol=1e-7)  # m: rest ends a few samples later


@pytest.mark.parametrize(
    ("estimator", "missing"), [(Complementary(), r"measured\.a"), (Measured(), r"measured\.r")]
)
def test_runs_without_a_sensor_are_refused(estimator, missing):
    z, _ = moved()
    with pytest.raises(
        ModelError, match=rf"{type(estimator).__name__}: found a run with measured\.q, expected {missing}"
    ):
        estimator.estimate(run_of(KINEMATICS, z), KINEMATICS)


def test_runs_that_begin_in_motion_are_refused():
    z, a = (x[245:] for x in moved())
    run = run_of(KINEMATICS, z, a=a, r=z)
    for estimator in (Complementary(), Measured()):
        with pytest.raises(ModelError, match="samples of rest before the motion, expected 25 at least"):
            estimator.estimate(run, KINEMATICS)
    # what needs no sensor that drifts needs no rest
    np.testing.assert_allclose(Kinematic().estimate(run, KINEMATICS) - PLACE, z, atol=EXACT)


@pytest.mark.parametrize(
    ("read", "words"),
    [
        (lambda a: -a, "reads -1 times what kinematics accelerates in x below 2 Hz"),
        (lambda a: a / 9.81, r"reads 0\.1 times what kinematics accelerates in x"),
        (lambda a: 1e3 * a, r"reads 1e\+03 times what kinematics accelerates in x"),
        (lambda a: a * [1, -1, 1], "in y below 2 Hz, expected about once; give accelerations resolved in the world"),
        (lambda a: a * [1, 0.4, 1], r"reads 0\.4 times what kinematics accelerates in y"),
        (lambda a: a[:, [2, 1, 0]] * [0.1, 1, 1], "kinematics accelerates in x"),
    ],
)  # fmt: skip
def test_accelerometers_along_other_axes_are_refused(read, words):
    z, a = moved()
    with pytest.raises(ModelError, match=words):
        Complementary().estimate(run_of(KINEMATICS, z, a=read(a)), KINEMATICS)
    # where it hardly accelerates nothing can be told, and little is lost
    Complementary().estimate(run_of(KINEMATICS, 0.01 * z, a=read(0.01 * a)), KINEMATICS)


def test_records_with_holes_are_refused():
    z, a = moved()
    broken = a.copy()
    broken[[17, 500], 1] = np.nan
    with pytest.raises(ModelError, match=r"found measured\.a that is not finite in 2 of 900 rows, first 17"):
        Complementary().estimate(run_of(KINEMATICS, z, a=broken), KINEMATICS)
    run = run_of(KINEMATICS, z, a=a)
    kept = np.delete(np.arange(900), 333)
    lost = Result(run.time[kept], {name: run[name][kept] for name in run.names})
    with pytest.raises(ModelError, match=r"found 0\.008 s after row 332 of a run and 0\.004 s elsewhere"):
        Complementary().estimate(lost, KINEMATICS)
    away = {name: run[name] + 50.0 * (name == "measured.q[0]") for name in run.names}
    with pytest.raises(ModelError, match=r"measured\.q that puts the tool out of reach at 0 s in 900 of 900"):
        Kinematic().estimate(Result(run.time, away), KINEMATICS)


def test_figure_shows_axes_that_moved_and_what_estimates_lack():
    z, a = moved()
    z, a = z * [1.0, 1.0, 0.01], a * [1.0, 1.0, 0.01]
    bent = z + 1e-4 * np.sin(10.0 * np.clip(PERIOD * np.arange(len(z)) - 1.0, 0.0, np.inf))[:, None]
    run = run_of(KINEMATICS, z, a=a, r=bent)
    figure = plot_estimates(run, {"stiff": Kinematic(), "gauge": Measured()}, KINEMATICS)
    above, below = figure.axes[:2], figure.axes[2:]
    assert [axis.get_title() for axis in above] == ["tool x", "tool y"]
    for k, axis in enumerate(below):
        stiff, gauge = (np.asarray(line.get_ydata(), dtype=float) for line in axis.lines)
        np.testing.assert_allclose(stiff, 1e6 * (z - bent)[:, k], atol=1e-2)  # um
        assert np.abs(gauge).max() < 1e-9
        legend = axis.get_legend()
        assert legend is not None
        words = [text.get_text() for text in legend.get_texts()]
        assert words[1] == "gauge, 0 um"
        assert words[0].startswith("stiff, 7")  # 100 um / sqrt(2), about


@pytest.mark.parametrize(
    ("estimators", "words"),
    [
        ({}, "plot_estimates: found no estimators"),
        ({"carts": Actuators()}, r"found carts that is Actuators\(\), expected an estimator of the tool"),
        ({"none": None}, "found none that is None, expected an estimator of the tool"),
    ],
)
def test_what_is_no_estimate_of_the_tool_is_not_drawn(estimators, words):
    z, _ = moved()
    with pytest.raises(ModelError, match=words):
        plot_estimates(run_of(KINEMATICS, z, r=z), estimators, KINEMATICS)
