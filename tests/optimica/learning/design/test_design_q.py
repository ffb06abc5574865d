"""Q of learning: below its limit everywhere, with coupled axes, for robots that are not known well."""

from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag

from gantrytau import ModelError, StateSpace
from gantrytau_optimica import Gradient, Learning, ZeroPhase, design_q
from gantrytau_optimica.learning import plot_q, uncertain
from gantrytau_optimica.learning.laws.lifted import pulses

PERIOD = 0.004
WRONGLY: Any = uncertain  # called with what types forbid


def swinging(hz, damping, period=PERIOD):
    """A servo of 0.965 with five samples of delay, and a tool that swings behind it: A, B, C."""
    A = np.zeros((7, 7))
    A[0, 0], A[1:5, 0:4] = 0.965, np.eye(4)
    w = 2 * np.pi * hz * period
    r, c = np.exp(-damping * w), np.cos(w * np.sqrt(1 - damping**2))
    A[5], A[6] = [0, 0, 0, 0, 1 - 2 * r * c + r**2, 2 * r * c, -(r**2)], [0, 0, 0, 0, 0, 1, 0]
    B = np.zeros((7, 1))
    B[0] = 0.035
    C = np.zeros((1, 7))
    C[0, 5] = 1.0
    return A, B, C


def one(hz=8.0, damping=0.04):
    return StateSpace(*swinging(hz, damping), 0, period=PERIOD)


def coupled(strength):
    """Two such axes, each of which sees part of the swing of the other."""
    parts = [swinging(7.4, 0.04), swinging(11.0, 0.05)]
    A, B, C = (block_diag(*each) for each in zip(*parts, strict=True))
    C = np.array([[1, -strength], [strength, 1]]) @ C
    return StateSpace(A, B, C, 0, period=PERIOD)


def sigma(q, system, hz, gain=0.9, shift=5):
    """|diag(q) (I - L T)| over frequencies by the textbook, (F,)."""
    z = np.exp(2j * np.pi * hz * PERIOD)
    T = [system.C @ np.linalg.solve(x * np.eye(len(system.A)) - system.A, system.B) for x in z]
    L = gain * z**shift
    return np.array(
        [
            np.linalg.norm(np.diag(g) @ (np.eye(len(t)) - lead * t), 2)
            for g, lead, t in zip(q.magnitude(hz, PERIOD).T, L, T, strict=True)
        ]
    )


def test_a_plain_filter_fails_where_a_designed_one_converges():
    plain = Learning(q=ZeroPhase.butterworth(2, 10.0)).stability(one(), 800)
    assert plain.sigma > 1.5
    assert plain.diverges
    q = design_q(one())
    found = Learning(q=q).stability(one(), 800)
    assert found.monotone
    assert q.magnitude(np.array([30.0]), PERIOD)[0, 0] > 0.3  # open to 30 Hz
    assert q.magnitude(np.array([1.0]), PERIOD)[0, 0] > 0.97


@pytest.mark.parametrize("damping", [0.04, 0.001])
def test_sigma_is_within_the_margin_at_frequencies_that_were_not_looked_at(damping):
    """The whole family, at 5000 frequencies and around the peaks of narrow resonances."""
    system = one(damping=damping)
    q = design_q(system, margin=0.9)
    for member in uncertain(system):
        peaks = np.abs(np.log(np.linalg.eigvals(member.A).astype(complex) + 1e-300)) / PERIOD / 2 / np.pi
        near = np.concatenate([f * (1 + np.linspace(-0.01, 0.01, 101)) for f in peaks if 5 < f < 12])
        hz = np.concatenate([np.linspace(0.01, 124.9, 5000), near])
        assert sigma(q, member, hz).max() < 0.9 + 0.01


def test_axes_that_move_each_other_count():
    """Filters for each axis alone hold for it, and diverge together."""
    system = coupled(0.6)
    alone = []
    for i in range(2):
        own = StateSpace(system.A, system.B[:, i : i + 1], system.C[i : i + 1], 0, period=PERIOD)
        alone.append(design_q(own))
    split = alone[0].joined(alone[1])
    both = design_q(system)
    hz = np.linspace(0.01, 124.9, 2000)
    assert sigma(split, system, hz).max() > 1
    assert sigma(both, system, hz).max() < 0.96
    judged = Learning(q=both).stability(system, 600)
    assert judged.monotone
    assert 0.84 < judged.sigma < 0.96


def test_more_notches_and_wider_margins_leave_filters_more_open():
    hz = np.linspace(0.1, 30, 300)
    opened = [design_q(one(), notches=n).magnitude(hz, PERIOD).mean() for n in (0, 1, 2)]
    assert opened[0] < opened[1] <= opened[2] + 0.01
    assert opened[0] < 0.6 * opened[2]
    tight = design_q(one(), margin=0.8).magnitude(hz, PERIOD).mean()
    assert tight < opened[2]


def test_a_filter_for_an_estimate_that_misses_a_swing_suits_the_tool_too():
    estimate, hz = one(hz=60.0, damping=0.9), np.linspace(7.5, 8.5, 50)  # stiff: no swing at 8 Hz
    assert sigma(design_q(estimate), one(), hz).max() > 1.2
    q = design_q(estimate, tool=one())
    for system in (estimate, *uncertain(one())):
        assert sigma(q, system, np.linspace(0.1, 120, 2000)).max() < 0.96


def test_families_move_resonances_and_keep_the_static_gain():
    system = coupled(0.3)
    family = uncertain(system, frequencies=(0.9, 1.1), damping=(0.5, 2.0))
    assert len(family) == 4
    for member, (f, d) in zip(family, [(0.9, 0.5), (0.9, 2), (1.1, 0.5), (1.1, 2)], strict=True):
        assert member.response(np.zeros(1)) == pytest.approx(system.response(np.zeros(1)), abs=1e-9)
        s = np.log(np.linalg.eigvals(member.A).astype(complex) + 1e-300) / PERIOD
        swings = s[(s.imag > 1) & (-s.real < 0.3 * np.abs(s))]
        assert np.sort(np.abs(swings) / 2 / np.pi) == pytest.approx([7.4 * f, 11.0 * f], rel=1e-6)
        ratios = (-swings.real / np.abs(swings))[np.argsort(np.abs(swings))]
        assert ratios == pytest.approx([0.04 * d, 0.05 * d], rel=1e-6)
    same = uncertain(system, (1.0,), (1.0,))[0]
    hz = np.linspace(0, 120, 50)
    assert same.response(hz) == pytest.approx(system.response(hz), abs=1e-9)


def test_moved_resonances_begin_no_earlier():
    late = pulses(one(), 200)[:, 0, 0]
    first = np.argmax(np.abs(late) > 1e-12)
    assert first == 6  # five samples of delay and one of the servo; C sees the tool at once
    for member in uncertain(one()):
        moved = pulses(member, 200)[:, 0, 0]
        assert np.all(moved[:first] == 0)
        assert abs(moved[first]) > 0.1 * abs(late[first])
    for unmoved in uncertain(one(), (1.0,), (1.0,)):
        assert pulses(unmoved, 200)[:, 0, 0] == pytest.approx(late, abs=1e-12)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (lambda: design_q(one(), limit=200.0), "limit=200.0, expected a number below 125"),
        (lambda: design_q([]), "responses of another kind"),
        (lambda: design_q([one(), coupled(0.1)]), r"\[1, 2\] axes, expected one of both"),
        (lambda: design_q(StateSpace(-1, 1, 1)), "a continuous response, expected a period, one of all"),
        (lambda: design_q(one(), learning=Learning(law=Gradient(one()))), "the law Gradient, expected a"),
        (lambda: uncertain(one(), frequencies=(0.0,)), r"frequencies=\(0.0,\), expected numbers above zero"),
        (lambda: uncertain(one(), damping=(50.0,)), "damping ratio 2, expected one below half"),
        (lambda: uncertain(one(), frequencies=(20.0,)), "becomes 160 Hz"),
        (lambda: uncertain(StateSpace(-1, 1, 1)), "found a continuous system, expected one that is sampled"),
        (lambda: design_q(StateSpace(0.5, -0.5, 1, period=PERIOD)), r"sigma 1.\d* at 0 Hz however far"),
    ],
)
def test_what_does_not_fit_is_told(wrong, words):
    with pytest.raises(ModelError, match=words):
        wrong()


def test_filters_are_drawn_below_what_they_may_be():
    system = coupled(0.3)
    figure = plot_q(design_q(system), system)
    first, second, both = figure.axes
    for axis in (first, second):
        q, allowed = (np.asarray(line.get_ydata()) for line in axis.lines)
        assert np.all(q <= allowed)
    assert 0.8 < np.max(np.asarray(both.lines[0].get_ydata())) <= 0.96
