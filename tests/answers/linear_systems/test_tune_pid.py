"""Gains of PID controllers: published ones, stated margins, and the same loop built of components."""

from typing import Any, cast

import numpy as np
import pytest

from gantrytau import Model, ModelError, StateSpace, connect, linearize, tune_pid
from gantrytau.blocks import DiscretePid, Pid

THREE_LAGS = StateSpace([[-1, 0, 0], [1, -1, 0], [0, 1, -1]], [1, 0, 0], [0, 0, 1])  # 1 / (s + 1)^3
SERVO = StateSpace([[0, 1, 0], [0, 0, 1], [0, -2, -3]], [0, 0, 1], [2, 0, 0])  # 2 / s (s + 1) (s + 2)


@pytest.mark.parametrize(("M_s", "k", "T_i"), [(1.4, 0.633, 1.95), (2.0, 1.22, 1.78)])
def test_most_integral_gain_is_the_published_one(M_s, k, T_i):
    """Astrom, Panagopoulos, Hagglund, Automatica 34 (1998), 1 / (s + 1)^3."""
    found = tune_pid(THREE_LAGS, M_s=M_s)
    assert (found.k, found.T_i) == (pytest.approx(k, abs=0.005), pytest.approx(T_i, abs=0.005))
    assert found.margins.M_s == pytest.approx(M_s, rel=1e-4)  # the bound is reached


def test_both_bounds_hold_and_a_pid_has_more_integral_gain_than_a_pi():
    sampled = THREE_LAGS.discrete(0.1)
    pi, pid = (tune_pid(sampled, kind, M_s=1.8, M_t=1.05) for kind in ("PI", "PID"))
    for found in (pi, pid):
        assert found.margins.stable
        assert found.margins.M_s <= 1.8 * 1.0001
        assert found.margins.M_t <= 1.05 * 1.0001
    assert pid.k / pid.T_i > 1.5 * pi.k / pi.T_i
    down = tune_pid(StateSpace(sampled.A, -sampled.B, sampled.C, period=0.1), M_s=1.8, M_t=1.05)
    assert (down.k, down.T_i) == (pytest.approx(-pi.k), pytest.approx(pi.T_i))


class Loop(Model):
    """A controller of a servo, sampled if its controller is."""

    controller = Pid()
    plant = SERVO

    def equations(self):
        yield self.controller.u_s == 0
        yield connect(self.controller.u_m, self.plant.y)
        yield connect(self.controller.y, self.plant.u)


@pytest.mark.parametrize("period", [None, 0.05])
@pytest.mark.parametrize(("kind", "crossover"), [("PI", 0.05), ("PD", 0.18), ("PID", 0.15)])
def test_stated_margins_are_met_and_components_make_the_same_loop(kind, crossover, period):
    plant = SERVO if period is None else SERVO.discrete(period)
    found = tune_pid(plant, kind, crossover=crossover, phase_margin=45.0)
    assert found.margins.stable
    assert found.margins.phase == pytest.approx(45.0, abs=1e-6)
    assert found.margins.phase_frequency == pytest.approx(crossover, rel=1e-9)
    controller = (Pid if period is None else DiscretePid)(**found.settings)
    later = {} if period is None else {"controller.began": 1.0}  # at its first instant it has no derivative
    built = linearize(Loop(controller=controller), at=later).poles
    loop = found.loop
    closed = np.linalg.eigvals(loop.A - loop.B @ loop.C / (1 + loop.D))
    gap = np.abs(built[:, None] - closed[None, :])
    assert np.all(gap.min(axis=0) < 1e-6)  # held outputs of components are further poles


@pytest.mark.parametrize(
    ("wrong", "argument"),
    [
        (lambda: tune_pid(cast(Any, 3)), "plant"),
        (lambda: tune_pid(SERVO, cast(Any, "P")), "kind"),
        (lambda: tune_pid(SERVO, crossover=0.1, M_s=1.5), "M_s"),
        (lambda: tune_pid(SERVO, M_t=0.9), "M_t"),
        (lambda: tune_pid(SERVO, crossover=2.0), "crossover"),
        (lambda: tune_pid(SERVO, "PD"), "crossover"),
        (lambda: tune_pid(StateSpace(-1, 1, 1)), "crossover"),
        (lambda: tune_pid(SERVO, phase_margin=50.0), "phase_margin"),
        (lambda: tune_pid(StateSpace([[0, 1], [0, 0]], [0, 1], [1, 0]), M_s=1.5), "M_s"),
        (lambda: tune_pid(StateSpace([[0, 1], [0, 0]], [0, 1], [1, 0]), "PID", M_s=1.6), "crossover"),
    ],
)
def test_what_cannot_be_tuned_is_told_by_its_argument(wrong, argument):
    with pytest.raises(ModelError) as refused:
        wrong()
    assert refused.value.argument == argument
