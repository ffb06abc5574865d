"""Laws of learning control against their lifted form, and the numbers of Dressler (2012), section 7.2."""

import numpy as np
import pytest
from scipy.linalg import block_diag, toeplitz
from scipy.signal import butter, lfilter, lfilter_zi
from scipy.signal.windows import tukey

from gantrytau import ModelError, StateSpace
from gantrytau_optimica.learning.filters.tukey import Tukey
from gantrytau_optimica.learning.filters.zero_phase import ZeroPhase
from gantrytau_optimica.learning.laws.correction_laws import Gradient, NormOptimal
from gantrytau_optimica.learning.laws.learning import Learning
from gantrytau_optimica.learning.laws.lifted import lifted

PERIOD = 0.004
PRINTED = [(0.03527, 0.9647), (0.03425, 0.9656), (0.02748, 0.9728)]  # b and a of (6.11)


def servo(b, a, delay=5):
    """q^-delay b / (1 - a q^-1)."""
    A = np.eye(delay, k=-1)
    A[0, 0] = a
    return StateSpace(A, b * np.eye(delay)[:, :1], np.eye(delay)[-1:], 0, period=PERIOD)


def coupled():
    """Two axes that swing and move each other."""
    A = block_diag(0.97 * np.array([[0.9, -0.3], [0.3, 0.9]]), [[0.9]])
    A[2, 0] = 0.05
    return StateSpace(A, [[0.1, 0.0], [0.0, 0.02], [0.0, 0.1]], [[1, 0, 0], [0.1, 0, 1]], 0, period=PERIOD)


@pytest.mark.parametrize(
    ("samples", "window"), [(825, Tukey()), (1200, Tukey(1.2, 4.5)), (1425, Tukey(1.2, 4.5))]
)
def test_printed_servos_learn_as_printed(samples, window):
    """(7.28), whatever is around the window."""
    found = Learning(window=window).stability([servo(*each) for each in PRINTED], samples)
    np.testing.assert_allclose(found.diagonal, [0.9040, 0.9070, 0.9296], atol=5e-5)
    assert found.sigma == max(found.diagonal)
    assert found.rho == pytest.approx(0.8933, abs=5e-5)
    assert found.monotone
    assert "monotone: each run leaves at most 93%" in str(found)


def textbook(learning, law, response, samples):
    """W Qbar (I - L T) by matrices alone, (7.9) to (7.16)."""
    n = round(learning.window.lead / PERIOD)
    flanks = tukey(2 * n, 0.95)
    W = np.concatenate([flanks[:n], np.ones(samples - 2 * n), flanks[n:]])
    b, a = butter(2, 10.0, fs=1 / PERIOD)
    causal = np.tril(toeplitz(lfilter(b, a, np.eye(samples)[0])))
    Q = W[:, None] * (causal.T @ causal)
    T = lifted(response, samples)
    return np.kron(np.eye(len(T) // samples), Q) @ (np.eye(len(T)) - law(T) @ T)


def shifted(T, samples=150):
    L = np.zeros((samples, samples))
    L[np.arange(samples), np.minimum(np.arange(samples) + 5, samples - 1)] = 0.9
    return np.kron(np.eye(len(T) // samples), L)


def norm_optimal(T):
    size = np.linalg.norm(T, 2) ** 2
    return np.linalg.solve(T.T @ T + 0.01 * size * np.eye(len(T)), T.T)


@pytest.mark.parametrize(
    ("law", "matrix"),
    [
        (None, shifted),
        (Gradient(coupled()), lambda T: T.T / np.linalg.norm(T, 2) ** 2),
        (NormOptimal(coupled()), norm_optimal),
    ],
)
def test_time_domain_is_the_lifted_form(law, matrix):
    """Runs of a coupled plant, corrected sample by sample, and the powers of one matrix."""
    samples, plant = 150, coupled()
    learning = Learning(window=Tukey(lead=0.1), law=law)
    M = textbook(learning, matrix, plant, samples)
    r = np.random.default_rng(1).standard_normal((samples, 2))
    u = np.zeros((samples, 2))
    start = learning.next(u, r, PERIOD)
    exact = np.zeros(2 * samples)
    for _ in range(5):
        u = learning.next(u, r - plant.simulate(u), PERIOD)
        exact = M @ exact + start.T.ravel()
        np.testing.assert_allclose(u.T.ravel(), exact, atol=1e-10)
    inside = np.flatnonzero(np.tile(learning.window.weights(samples, PERIOD), 2))
    np.testing.assert_allclose(learning.matrix(plant, samples), M[np.ix_(inside, inside)], atol=1e-10)
    found = learning.stability(plant, samples)
    assert found.sigma == pytest.approx(np.linalg.norm(M[:, inside], 2), rel=1e-6)
    assert found.rho == pytest.approx(np.abs(np.linalg.eigvals(M)).max(), rel=1e-6)


def test_laws_with_a_model_are_monotone_where_a_shift_is_not():
    plant = coupled()
    plain = Learning(window=Tukey(lead=0.1), q=ZeroPhase.butterworth(2, 60.0))
    assert not plain.stability(plant, 200).monotone
    for law in (Gradient(plant), Gradient(plant, gain=1.9), NormOptimal(plant)):
        assert Learning(window=Tukey(lead=0.1), q=plain.q, law=law).stability(plant, 200).monotone
    unstable = Learning(window=Tukey(lead=0.1), q=plain.q, law=Gradient(plant, gain=2.5)).stability(
        plant, 200
    )
    assert not unstable.stable
    assert "diverges: after 10 runs" in str(unstable)


def test_filters_shift_nothing_and_have_their_gain():
    hz = np.array([2.0, 10.0, 40.0])
    q = ZeroPhase.butterworth(3, 10.0)
    b, a = butter(3, 10.0, fs=1 / PERIOD)
    x = np.zeros(801)
    x[400] = 1.0
    pulse = q.apply(x, PERIOD)
    np.testing.assert_allclose(pulse, pulse[::-1], atol=1e-12)
    np.testing.assert_allclose(pulse, lfilter(b, a, lfilter(b, a, x)[::-1])[::-1], atol=1e-12)
    assert q.magnitude(hz, PERIOD)[0, 1] == pytest.approx(0.5, abs=1e-12)  # -6 dB
    deep = q.notched(11.5, 0.1, 0.3).magnitude([11.5], PERIOD) / q.magnitude([11.5], PERIOD)
    assert deep[0, 0] == pytest.approx(0.3**2, rel=1e-9)
    assert lfilter_zi(b, a).shape == (3,)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Tukey(1.2, 4.5).weights(900, PERIOD), r"window from 1\.2 to 4\.5 s, expected one within the run of 3\.6 s"),
        (lambda: Tukey(lead=2.0).weights(900, PERIOD), "flanks of 2 s in a window of 3.6 s"),
        (lambda: ZeroPhase.butterworth(2, -1.0), "found hz=-1.0, expected frequencies above zero"),
        (lambda: ZeroPhase.butterworth(2, 130.0).apply(np.zeros(9), PERIOD), "130 Hz beside samples every 0.004 s"),
        (lambda: ZeroPhase.butterworth(2, [1.0, 2.0]).apply(np.zeros((9, 3)), PERIOD), "filters for 2 axes and 3 signals"),
        (lambda: ZeroPhase.butterworth(2, 10.0).notched(7.0, 0.0, 0.5), "found width=0.0"),
        (lambda: Learning(shift=-1), "found shift=-1"),
        (lambda: Learning().next(np.zeros((9, 2)), np.zeros((8, 2)), PERIOD), r"\(9, 2\) and errors of shape \(8, 2\)"),
        (lambda: Learning().next(np.zeros((9, 1)), np.full((9, 1), np.nan), PERIOD), "not finite, first at 0 s"),
        (lambda: Learning().stability([servo(*PRINTED[0]), coupled()], 300), "one of each axis"),
        (lambda: Learning().stability(StateSpace([[-1.0]], [1], [1], 0), 300), r"periods of none \(continuous\)"),
        (lambda: Learning(law=Gradient(coupled())).stability(servo(*PRINTED[0]), 300), "model of 2 axes and errors of 1"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused(call, words):
    with pytest.raises(ModelError, match=words):
        call()
