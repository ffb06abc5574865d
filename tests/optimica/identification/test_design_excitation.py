"""Motions that tell the parameters of the L1: what they foretell, and that they keep their limits."""

import functools

import numpy as np
import pytest

from gantrytau import ModelError, SolveError, simulate
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import MotionLog, design_excitation

CENTRE, HALF = np.array([0.9, 2.7, -0.7]), np.array([0.25, 0.15, 0.15])
LIMITS = dict(speed=1.0, acceleration=10.0, force=1200.0, box=(CENTRE - HALF, CENTRE + HALF))
ROBOT = GantryTau(prototypes.L1)


@functools.cache
def excitation():
    return design_excitation(ROBOT, duration=10.0, limits=LIMITS, starts=1)


def test_five_harmonics_tell_thirteen_parameters():
    assert len(excitation().names) == 13
    assert excitation().condition <= 400


@pytest.mark.nightly
def test_ten_harmonics_tell_more():
    found = design_excitation(ROBOT, duration=10.0, limits=LIMITS, harmonics=10, starts=1)
    assert found.condition <= 200


def test_masses_are_told_better_than_by_a_motion_that_somebody_thought_of():
    """Sines along three axes in the same box, as fast as the carts may go, which need not even begin at rest."""
    found = excitation()
    t = found.time
    phase = 2 * np.pi * np.array([0.43, 0.54, 0.36]) * t[:, None]
    q = Kinematics(ROBOT).ik(CENTRE + HALF * np.sin(phase))
    assert 0.9 < np.max(np.abs(np.gradient(q, t, axis=0))) < 1.1  # m/s, the limit of the design is 1
    gain = found.gain(MotionLog(t, q, np.zeros_like(q)))
    masses = [f"{family}[{i}]" for family in ("cart_masses", "link_masses") for i in range(3)]
    assert min(gain[name] for name in masses) > 1.3


def test_limits_are_kept_and_it_begins_at_rest():
    found = excitation()
    q, v, f, t = found.q, found.log.v, found.log.f, found.time
    a = np.gradient(v, t, axis=0)
    assert np.max(np.abs(v)) <= 1.0
    assert np.max(np.abs(f)) <= 1200.0
    assert np.max(np.abs(a)) <= 10.0
    assert np.all(np.abs(found.log.r - CENTRE) <= HALF + 1e-12)
    np.testing.assert_allclose(v[0], 0.0, atol=1e-12)
    np.testing.assert_allclose(q[-1], q[0], atol=1e-12)  # one whole period
    np.testing.assert_allclose(
        v[1:-1], (q[2:] - q[:-2]) / 0.008, atol=3e-4
    )  # h^2 / 6 times the third derivative, 100 m/s3


def test_foretold_deviations_are_those_of_least_squares():
    """Two routes: covariance of the slopes, and fits of forces with noise of 1 N."""
    found = excitation()
    Y = found.by_actuators.rows(motion_of(found))[4].reshape(-1, 13)
    rng = np.random.default_rng(2)
    fits = np.linalg.lstsq(Y, rng.standard_normal((len(Y), 200)), rcond=None)[0]
    ratio = np.std(fits, axis=1) / np.array(list(found.predicted.values()))
    assert np.all((ratio > 0.8) & (ratio < 1.2))  # 200 tries: 5 % each


def motion_of(found):
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(found.time, found.q, k=5)
    return np.hstack([found.q, found.log.v, spline(found.time, 2)])


def test_forces_are_linear_in_the_parameters():
    """f without friction is Y p at the nominal masses."""
    bare = GantryTau(prototypes.L1, friction=None)
    names = ["plate_mass", *(f"cart_masses[{i}]" for i in range(3))]
    found = design_excitation(
        bare, duration=5.0, period=5.0, limits=LIMITS, parameters=names, harmonics=3, starts=1, criterion="d"
    )
    Y = found.by_actuators.rows(motion_of(found))[4]
    told = Y @ np.array([9.13, 13.58, 13.64, 38.23])
    np.testing.assert_allclose(told, found.log.f, atol=0.05)  # of 200 N; ends of the spline's acceleration


def test_another_motion_tells_less():
    found = excitation()
    half = found.log.q[0] + 0.5 * (found.log.q - found.log.q[0])
    gains = found.gain(MotionLog(found.time, half, found.log.f))
    assert min(gains[name] for name in ("plate_mass", "cart_masses[0]", "link_masses[2]")) > 1.5
    same = found.gain(found.log)
    assert all(value == pytest.approx(1.0, abs=0.01) for value in same.values())
    rest = found.gain(MotionLog(found.time, np.tile(found.q[0], (len(found.q), 1)), found.log.f))
    assert rest["cart_masses[0]"] == np.inf


def test_the_signal_drives_the_simulation():
    """Forces alone keep the tool on its way for a second: nothing draws it back."""
    found = excitation()
    run = simulate(ROBOT, stop=1.0, inputs=found.signal, starts=found.start)
    reached = np.array([run[f"carts[{i}].s"][-1] for i in range(3)])
    np.testing.assert_allclose(reached, found.q[250], atol=2e-3)


def test_it_is_saved_as_csv_and_as_a_program(tmp_path):
    found = excitation()
    again = MotionLog.read(found.save(tmp_path / "excitation.csv"))
    np.testing.assert_allclose(again.q, found.q, atol=1e-9)
    words = found.program("Swing", step=0.1)
    assert words.startswith("MODULE Swing")
    assert words.count("MoveAbsJ") == 101  # both ends of 10 s
    assert f"[[{1e3 * found.q[0, 0]:.4f}," in words
    with pytest.raises(ModelError, match=r"found step=.*expected a multiple of"):
        found.program(step=0.001)
    with pytest.raises(ModelError, match="expected a name of RAPID"):
        found.program("1st")
    with pytest.raises(ModelError, match="expected a log of the 3 actuators"):
        found.gain(MotionLog(found.time, found.q[:, :2], found.log.f[:, :2]))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (dict(parameters=["plate_masses"]), "found parameters=.*expected names among plate_mass"),
        (dict(parameters=[]), "found parameters=\\[\\], expected names"),
        (dict(limits=dict(speed=1.0)), "found limits \\['speed'\\], expected dict"),
        (dict(limits=LIMITS | dict(force=-1.0)), "found limit force=-1.0, expected a number above 0 or 3"),
        (dict(limits=LIMITS | dict(box=([1, 2], [3, 4]))), "found limits of 2 x 2, expected 2 x 3 numbers"),
        (dict(harmonics=1), "found harmonics=1"),
        (dict(duration=0.0), "found duration=0.0"),
    ],
)
def test_what_does_not_fit_is_refused(options, words):
    with pytest.raises(ModelError, match=words):
        design_excitation(ROBOT, **(dict(duration=10.0, limits=LIMITS) | options))


def test_forces_too_weak_are_refused():
    weak = LIMITS | dict(force=1.0)  # weight alone takes tens of N
    with pytest.raises(SolveError, match="found no motion within the limits from 1 starts"):
        design_excitation(ROBOT, duration=10.0, limits=weak, harmonics=2, starts=1, parameters=["plate_mass"])


@pytest.mark.nightly
def test_robots_whose_loops_have_no_closed_form_are_excited_too():
    """Six links: a minute, as Newton's method is differentiated at each point."""
    found = design_excitation(
        SixLinkGantryTau(prototypes.L1),
        duration=6.0,
        limits=LIMITS,
        parameters=["plate_mass", "cart_masses[0]"],
        starts=1,
    )
    assert found.condition < 10
    assert max(found.used.values()) <= 1.0
