"""Sums in which terms cancel are written without them, and have the same values."""

import casadi as ca
import numpy as np

from gantrytau.commands.demo.motion_problems import FreePath
from gantrytau_optimica import prepare
from gantrytau_optimica.control.cancellation import without_cancelled


def test_what_cancels_is_no_dependence_and_values_stay():
    x, a, w = symbols = ca.SX.sym("x"), ca.SX.sym("a"), ca.SX.sym("w")
    reach = x - (a + ((2 * (x - a)) / 2 - w)) + 0.3 - 0.3
    before = ca.vertcat(a / reach, ca.sin(reach) * x, x - x)
    (after,) = without_cancelled([before])
    assert ca.jacobian_sparsity(after, ca.vertcat(*symbols)).nnz() == 4  # of a, w; of w, x; of none
    both = ca.Function("both", [ca.vertcat(*symbols)], [before, after])
    found = [np.array(one) for one in both(np.array([0.7, -0.4, 1.3]))]
    assert np.abs(found[0] - found[1]).max() < 1e-14  # rounding


def test_forces_of_a_parallel_robot_do_not_depend_on_where_it_is_along_its_guideways():
    (phase,) = prepare(FreePath, elements=2).built.problem.phases
    along = next(s.symbol for s in phase.states if s.name == "robot.tool.r[0]")
    assert not ca.depends_on(phase.residuals, along)
