"""The search for Q: its slopes, and families of any kind, size and period."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.linalg import block_diag

from gantrytau import ModelError, StateSpace
from gantrytau_optimica import Learning, Tukey, ZeroPhase, design_q
from gantrytau_optimica.learning import uncertain
from gantrytau_optimica.learning.design.q_search import QProblem

PERIOD = 0.004
BELOW = np.linspace(0, 30, 1001)


def response(hz, peak, damping):
    """Of a servo with a bandwidth of 1.4 Hz and 20 ms of delay, behind which a tool swings: a formula, no system."""
    s = 2j * np.pi * np.asarray(hz)
    w, servo = 2 * np.pi * peak, np.exp(-0.02 * s) / (1 + s / 8.75)
    return (servo * w**2 / (s**2 + 2 * damping * w * s + w**2))[None, None]


@dataclass
class Formula:
    """As a response over frequencies, finite up to an end."""

    peak: float = 8.0
    damping: float = 0.04
    period: float = PERIOD
    end: float = np.inf

    def response(self, frequencies):
        return np.where(frequencies <= self.end, response(frequencies, self.peak, self.damping), np.nan)


def sampled(peaks, period=PERIOD, delay=5):
    """The same as systems, one axis beside the other."""
    parts = []
    for peak, damping in peaks:
        w = 2 * np.pi * peak
        swing = StateSpace([[0, 1], [-(w**2), -2 * damping * w]], [[0], [w**2]], [[1, 0]], 0).discrete(period)
        servo = np.eye(delay, k=-1)
        servo[0, 0] = np.exp(-8.75 * period)
        A = np.asarray(block_diag(servo, swing.A))
        A[delay:, delay - 1] = swing.B[:, 0]
        B = np.zeros((delay + 2, 1))
        B[0] = 1 - servo[0, 0]
        parts.append((A, B, np.eye(delay + 2)[delay : delay + 1]))
    A, B, C = (np.asarray(block_diag(*each)) for each in zip(*parts, strict=True))
    return StateSpace(A, B, C, 0, period=period)


def size(q, member, hz, shift=5):
    """|Q (I - L T)| of one axis, (K,)."""
    E = 1 - 0.9 * np.exp(2j * np.pi * hz * member.period * shift) * member.response(hz)[0, 0]
    return q.magnitude(hz, member.period)[0] * np.abs(E)


def test_filters_are_as_open_as_is_known_to_be_possible():
    """0.838 is where slopes lead from notches at peaks, and from those of differential evolution; 0.58 by the cut-off."""
    q = design_q(uncertain(sampled([(11.5, 0.05)]), damping=(0.6, 1.6)))
    assert q.magnitude(BELOW, PERIOD).mean() > 0.8


@pytest.mark.parametrize("damping", [0.04, 0.001])
def test_what_only_has_a_response_over_frequencies_is_held_between_those_that_were_looked_at(damping):
    family = [Formula(8.0 * f, damping) for f in (0.92, 1.0, 1.08)]
    q = design_q(family)
    peaks = np.outer([0.92, 1.0, 1.08], 8.0 * (1 + np.linspace(-0.02, 0.02, 201)))
    hz = np.sort(np.concatenate([np.random.default_rng(1).uniform(0, 125, 2000), peaks.ravel()]))
    assert max(size(q, member, hz).max() for member in family) < 0.95 * 1.005
    assert q.magnitude(BELOW, PERIOD).mean() > 0.2


def test_named_resonances_are_shut():
    q = design_q([Formula()], at=20.0)
    assert q.magnitude(np.linspace(18.5, 21.5, 50), PERIOD).max() < 0.15 * 1.001
    assert design_q([Formula()]).magnitude([20.0], PERIOD)[0, 0] > 0.3


def test_a_millisecond_and_three_axes():
    fast = sampled([(8.0, 0.04)], period=0.001, delay=20)
    law = Learning(shift=20, window=Tukey(lead=0.1))
    q = design_q(fast, learning=law)
    hz = np.random.default_rng(2).uniform(0, 500, 2000)
    assert max(size(q, member, hz, 20).max() for member in uncertain(fast)) < 0.951
    three = sampled([(7.4, 0.04), (11.5, 0.05), (17.0, 0.05)])
    many = design_q(three, notches=1)
    assert len(many.axes) == 3
    assert Learning(q=many).stability(three, 400).monotone


def test_a_low_pass_alone_cuts_as_high_as_the_margin_allows():
    """Without notches there is one number, and 2 % more of it is too much."""
    member = Formula()
    q = design_q([member], notches=0)
    hz = np.linspace(0, 125, 20001)
    assert size(q, member, hz).max() < 0.9501
    assert size(ZeroPhase.butterworth(2, 1.02 * q.axes[0][0].hz), member, hz).max() > 0.95


def test_slopes_are_those_of_differences():
    rng = np.random.default_rng(3)
    hz = np.linspace(0, 125, 200)
    problem = QProblem(hz, np.ones((1, 200, 1, 1)), np.full((1, 200), np.inf), PERIOD, 30.0, 0.95, 2)
    p = np.log([31.0, 7.0, 0.3, 0.2, 40.0, 0.5, 0.6]) + 0.1 * rng.standard_normal(7)
    by_differences = [(problem.gains(p + d) - problem.gains(p - d))[0] / 2e-6 for d in 1e-6 * np.eye(7)]
    assert problem.slopes(p)[0] == pytest.approx(np.array(by_differences), abs=1e-7)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: design_q([Formula(end=50.0)]), "not finite at 50.* Hz, expected numbers"),
        (lambda: design_q([Formula(), Formula(period=0.001)]), r"periods of \[0.001, 0.004\] s"),
        (lambda: design_q([Formula()], at=200.0), "at=200.0, expected Hz below 125 for each of 1 axes"),
        (lambda: design_q([Formula()], at=(7.0, 8.0)), r"at=\(7.0, 8.0\), expected Hz below 125 for each of 1 axes"),
        (lambda: design_q([Formula()], margin=0.0), "margin=0.0"),
        (lambda: design_q([Formula()], margin=1.5), "margin=1.5"),
        (lambda: design_q([StateSpace(0.5, [[1, 1]], 1, [[0, 0]], period=PERIOD)]), "from 2 corrections to 1 positions"),
    ],
)  # fmt: skip
def test_what_cannot_be_designed_for_is_told(call, words):
    with pytest.raises(ModelError, match=words):
        call()
