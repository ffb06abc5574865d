"""The Kalman filter of the tool against its own model, Riccati's recursion, and noise that was drawn."""

from typing import Any, cast

import numpy as np
import pytest
from scipy.linalg import block_diag, solve_discrete_are

from gantrytau import ModelError, StateSpace
from gantrytau_optimica import Kalman
from gantrytau_optimica.learning.estimators.kalman import balanced, stationary_gain
from tests.optimica.learning.estimators.analytic_runs import PERIOD, PLACE, l1_kinematics, run_of, swung_ramp

HERTZ, DAMPING = (7.4, 11.5, 10.5), (0.04, 0.05, 0.05)
NOISE = 0.07  # m/s2


def springs(stretch=1.0, axes=3):
    """A tool on a spring and a damper in each axis, as springs that are stretch^2 as stiff have it."""
    blocks = []
    for f, zeta in zip(HERTZ[:axes], DAMPING, strict=False):
        w = 2 * np.pi * f * stretch
        blocks.append((np.array([[0.0, 1.0], [-(w**2), -2 * zeta * w]]), np.array([[0.0], [w**2]])))
    A, moved_axes = (block_diag(*each) for each in zip(*blocks, strict=True))
    B = np.zeros((2 * axes, 3))
    B[:, :axes] = moved_axes
    return StateSpace(A, B, np.eye(2 * axes)[::2], 0).discrete(PERIOD)


def changed(system, **matrices):
    """With other matrices."""
    return StateSpace(
        *(matrices.get(letter, getattr(system, letter)) for letter in "ABCD"),
        period=matrices.get("period", PERIOD),
    )


def motion(rows=1200):
    """Kinematics (rows, 3) that shake at first."""
    t = PERIOD * np.arange(rows)
    z = swung_ramp(t, stop=3.0)[0][:, None] * [1.0, -0.8, 0.3]
    return z + 2e-4 * (t > 1.0)[:, None] * np.sin(2 * np.pi * np.outer(t - 1.0, [6.0, 9.0, 3.0]))


def moved(system, z):
    """The tool (N, 3) of a system, and its accelerations, which look one sample ahead."""
    true = system.simulate(np.concatenate([z, 2 * z[-1:] - z[-2:-1]]))
    before = np.concatenate([true[:1], true[:-2]])
    return true[:-1], (true[1:] - 2 * true[:-1] + before) / PERIOD**2


@pytest.mark.parametrize("r", [1e-30, 1e-14, 1e-12, 1e-10, 1e-9])
@pytest.mark.parametrize("through", [0.0, 0.4])
def test_a_model_that_is_the_robot_is_exact_whatever_r(r, through):
    """Nothing is late: a reading a sample early or late would be taken for a motion."""
    system = springs()
    system = changed(system, C=(1 - through) * system.C, D=through * np.eye(3))
    z = motion()
    true, a = moved(system, z)
    found = Kalman(system, r).combine({"z": z, "a": a}, PERIOD)
    np.testing.assert_allclose(found, true, atol=1e-12)
    late = Kalman(system, r).combine({"z": z, "a": np.roll(a, 1, axis=0)}, PERIOD)
    assert r < 1e-20 or np.abs(late - true).max() > 1e-8


def test_stationary_gain_is_where_the_recursion_ends():
    """Riccati's recursion from no knowledge at all, and how the error is distributed."""
    random = np.random.default_rng(2)
    A = np.array([[0.9, 0.3, 0.0], [-0.3, 0.9, 0.1], [0.0, 0.0, 0.5]])
    C, R2 = random.standard_normal((2, 3)), np.array([[2.0, 0.3], [0.3, 1.0]])
    R1 = np.diag([1.0, 0.5, 2.0])
    P, gain = 1e6 * np.eye(3), np.zeros((3, 2))
    for _ in range(500):
        gain = P @ C.T @ np.linalg.inv(C @ P @ C.T + R2)
        P = A @ (P - gain @ C @ P) @ A.T + R1
    for size in (1e-9, 1.0, 1e9):  # units do not matter
        np.testing.assert_allclose(stationary_gain(A, C, size * R1, size * R2), gain, rtol=1e-9)


def printed(system, r, z, a):
    """(7.21), (7.22) letter by letter, innovations of accelerations alone, with readings that are as late as its states."""
    A, C = balanced(system.A, system.B, system.C)
    seen, known = (
        np.vstack([c @ np.linalg.matrix_power(m, k) for k in range(len(A))])
        for m, c in ((A, C), (system.A, system.C))
    )
    B = np.linalg.lstsq(seen, known @ system.B, rcond=None)[0]
    n, p, none = len(A), len(C), np.zeros
    step = C @ (A - np.eye(n))
    A_bar = np.block(
        [
            [A, none((n, 2 * p))],
            [step / PERIOD, none((p, 2 * p))],
            [step / PERIOD**2, -np.eye(p) / PERIOD, none((p, p))],
        ]
    )
    B_bar = np.vstack([B, C @ B / PERIOD, C @ B / PERIOD**2])
    C_y = np.hstack([none((p, n + p)), np.eye(p)])
    # a state that is moved moves its differences
    moved_by = np.vstack([np.eye(n), C / PERIOD, C / PERIOD**2])
    R1, R2 = r * moved_by @ moved_by.T, NOISE**2 * np.eye(p)
    units = np.concatenate([np.full(n + p, PERIOD), np.full(p, PERIOD**2)])  # so that rounding spares them
    units[:n] = 1.0
    P = solve_discrete_are(
        (units[:, None] * A_bar / units).T, (C_y / units).T, units[:, None] * R1 * units, R2
    )
    P = P / np.outer(units, units)
    gain = P @ C_y.T @ np.linalg.inv(C_y @ P @ C_y.T + R2)
    x, found = np.zeros(n + 2 * p), []
    for k in range(1, len(z) + 1):
        x = A_bar @ x + B_bar @ z[k - 1]
        x = x + gain @ (a[k - 1] - C_y @ x)
        found.append(C @ x[:n] - PERIOD * x[n : n + p])  # the position one sample ago
    return np.array(found)


def test_it_is_the_printed_filter_with_readings_as_late_as_its_states():
    z, off = motion(), springs(1.05)
    a = moved(springs(), z)[1] + NOISE * np.random.default_rng(6).standard_normal(z.shape)
    for r in (1e-13, 1e-11, 1e-9):
        expected = printed(off, r, z, a)
        found = Kalman(off, r).combine({"z": z, "a": a}, PERIOD)
        assert np.abs(expected - off.simulate(z)).max() > 1e-5
        np.testing.assert_allclose(found, expected, atol=1e-10)


def test_it_is_the_best_filter_for_noise_as_it_assumes():
    """Drawn by r and R2: no other r does better, and none that is far off does as well."""
    r, rows = 1e-11, 20000
    system = springs()
    A, C = balanced(system.A, system.B, system.C)
    random = np.random.default_rng(3)
    w = np.sqrt(r) * random.standard_normal((rows, len(A)))
    lacking, a = moved(StateSpace(A, np.eye(len(A)), C, 0, period=PERIOD), w)
    z = np.zeros((rows, 3))
    a += NOISE * random.standard_normal((rows, 3))
    error = {
        factor: np.sqrt(
            np.mean((Kalman(system, factor * r).combine({"z": z, "a": a}, PERIOD) - lacking) ** 2)
        )
        for factor in (1e-4, 1e-2, 0.3, 1.0, 3.0, 1e2)
    }
    assert min(error, key=error.__getitem__) == 1.0
    assert error[1.0] < 0.8 * min(error[1e-4], error[1e2])


def test_coordinates_of_the_model_do_not_matter():
    """Nor their units, nor states that nothing moves or nobody sees."""
    system, z = springs(1.05), motion()
    signals = {"z": z, "a": moved(springs(), z)[1]}
    plain = Kalman(system, 1e-11).combine(signals, PERIOD)
    random = np.random.default_rng(5)
    for T in (random.standard_normal((6, 6)), np.diag(10.0 ** np.array([9, -9, 0, 4, -4, 2]))):
        other = changed(
            system, A=T @ system.A @ np.linalg.inv(T), B=T @ system.B, C=system.C @ np.linalg.inv(T)
        )
        np.testing.assert_allclose(Kalman(other, 1e-11).combine(signals, PERIOD), plain, atol=1e-10)
    more = changed(
        system,
        A=block_diag(system.A, 0.5, 0.7),
        B=np.vstack([system.B, np.zeros((1, 3)), np.ones((1, 3))]),
        C=np.hstack([system.C, np.ones((3, 1)), np.zeros((3, 1))]),
    )
    np.testing.assert_allclose(Kalman(more, 1e-11).combine(signals, PERIOD), plain, atol=1e-10)


def test_accelerations_mend_a_model_that_is_off():
    """5 % in frequency: no r is best, and next to none is the model alone."""
    z, off = motion(), springs(1.05)
    true, a = moved(springs(), z)
    a += NOISE * np.random.default_rng(6).standard_normal(z.shape)
    error = {
        r: np.sqrt(np.mean((Kalman(off, r).combine({"z": z, "a": a}, PERIOD) - true) ** 2, axis=0))
        for r in (1e-30, 1e-10, 1e-9, 3e-8)
    }
    np.testing.assert_allclose(
        error[1e-30], np.sqrt(np.mean((off.simulate(z) - true) ** 2, axis=0)), rtol=1e-6
    )
    ends = min(np.linalg.norm(error[1e-30]), np.linalg.norm(error[3e-8]))
    assert all(np.linalg.norm(error[better]) < 0.65 * ends for better in (1e-10, 1e-9))


def test_superposition_and_many_responses():
    random = np.random.default_rng(8)
    z, a = random.standard_normal((2, 60, 3, 2, 4))
    estimator = Kalman(springs(1.05), 1e-11)
    many = estimator.combine({"z": z, "a": a}, PERIOD)
    for i in range(2):
        for j in range(4):
            one = estimator.combine({"z": z[..., i, j], "a": a[..., i, j]}, PERIOD)
            np.testing.assert_allclose(many[..., i, j], one, atol=1e-12)
    weighted = estimator.combine(
        {"z": 2 * z[..., 0] - 3 * z[..., 1], "a": 2 * a[..., 0] - 3 * a[..., 1]}, PERIOD
    )
    np.testing.assert_allclose(weighted, 2 * many[..., 0] - 3 * many[..., 1], atol=1e-10)


def test_axes_that_the_model_lacks_are_those_of_the_kinematics():
    z = motion()
    a = moved(springs(), z)[1]
    whole, flat = (Kalman(springs(axes=axes), 1e-11).combine({"z": z, "a": a}, PERIOD) for axes in (3, 2))
    np.testing.assert_allclose(flat[:, :2], whole[:, :2], atol=1e-10)
    np.testing.assert_array_equal(flat[:, 2], z[:, 2])


def test_runs_tell_where_the_tool_is_and_the_noise():
    kinematics, z = l1_kinematics(), motion()
    true, a = moved(springs(), z)
    random = np.random.default_rng(9)
    noise = np.array([0.05, 0.1, 0.2]) * random.standard_normal(z.shape)
    run = run_of(kinematics, z, a=a + noise + np.array([0.3, -0.3, 9.8]))
    plain = Kalman(springs(), 1e-14)
    # half a micrometre of noise passes, and what is taken for rest ends a little late
    np.testing.assert_allclose(plain.estimate(run, kinematics) - PLACE, true, atol=3e-6)
    told = plain.with_noise_of(run, kinematics)
    # a deviation is known to 1 / sqrt(2 N) = 2 % of itself
    np.testing.assert_allclose(np.sqrt(np.diag(told.noise)), [0.05, 0.1, 0.2], rtol=0.06)
    assert told.r == plain.r
    assert "r=1e-14 m2, noise=[0.05" in repr(told)
    assert told.system is plain.system
    with pytest.raises(ModelError, match=r"Kalman: found a run with measured\.q, expected measured\.a"):
        plain.estimate(run_of(kinematics, z), kinematics)


def rotating(radius):
    """Springs whose second axis does not come to rest."""
    system = springs()
    return changed(system, A=block_diag(system.A[:2, :2], system.A[2:4, 2:4] * radius, system.A[4:, 4:]))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Kalman(cast(Any, "model")), "found system='model', expected a sampled linear one"),
        (lambda: Kalman(springs().continuous()), r"is continuous, expected a sampled one; take system\.discrete"),
        (lambda: Kalman(changed(springs(), C=np.ones((1, 6)), D=0)), "3 inputs and 1 outputs, expected from the kinematic"),
        (lambda: Kalman(changed(springs(), B=np.ones((6, 2)), D=np.zeros((3, 2)))), "2 inputs and 3 outputs"),
        (lambda: Kalman(springs(), 0.0), "found r=0.0, expected a number above 0"),
        (lambda: Kalman(springs(), 1e9), "no stationary filter to rounding.*take a smaller r, or more noise"),
        (lambda: Kalman(springs(), noise=0.0), "found noise=0.0, expected a deviation above zero in m/s2"),
        (lambda: Kalman(springs(), noise=np.ones((3, 3))), "or a covariance .3, 3. in m2/s4, symmetric and positive"),
        (lambda: Kalman(springs(), noise=np.eye(2)), "or a covariance .3, 3."),
        (lambda: Kalman(changed(springs(), A=np.eye(6))), "pole z = 1.*at 0 Hz.*accelerations never show where it is"),
        (lambda: Kalman(rotating(1.02)), r"\|z\| = 1\.0\d*, at 11\.5 Hz.*a motion of it goes on.*without drift"),
        (lambda: Kalman(changed(springs(), B=0.001 * springs().B)), "in x by 0.001 m for 1 m .* expected 1 m"),
        (lambda: Kalman(changed(springs(), C=springs().C[[1, 0, 2]])), "by 0 m for 1 m of kinematics in x|order of axes"),
        (lambda: Kalman(changed(springs(), B=np.zeros((6, 3)), D=np.eye(3))), "without a state that kinematics moves"),
        (lambda: Kalman(springs()).combine(dict.fromkeys("za", np.zeros((9, 3))), 0.002), "0.004 s and a run every 0.002 s"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(call, words):
    with pytest.raises(ModelError, match=words):
        call()
