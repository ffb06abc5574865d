"""The program of a first plan, where full steps of Gauss-Newton's method do not converge: the same horizon, solved by Ipopt.

min  sum of stage costs + moves + penalty (e + e^2 / 2) + what follows the end
X_i = x + h sum_j a_ij f_j,  0 = g_i,  x_next = X_2,  lower - e <= rows_i <= upper + e,  e >= 0,  limits of inputs and moves
"""

from typing import Any

import casadi as ca
import numpy as np

from gantrytau_optimica.predictive.moves import Moves
from gantrytau_optimica.predictive.plan import PlannedMotion
from gantrytau_optimica.predictive.stages import MATRIX, NODES, WEIGHTS, HorizonStages
from gantrytau_optimica.predictive.terminal import Terminal

MOST = 300  # iterations of Ipopt
OPTIONS = {
    "print_time": False, "error_on_fail": False,
    "ipopt": {"print_level": 0, "sb": "yes", "max_iter": MOST, "bound_relax_factor": 0.0, "mu_strategy": "adaptive"},
}  # fmt: skip


class FirstPlan:
    """The program of a horizon of N stages. soft (rows,): which slack a limit has, -1 for none; penalty: of slacks."""

    def __init__(
        self,
        stages: HorizonStages,
        elements: int,
        soft: np.ndarray,
        penalty: float,
        moves: Moves,
        terminal: Terminal,
    ):
        self.stages, self.elements = stages, elements
        n, nx, nu, each = elements, stages.nx, stages.nu, stages.nx + stages.nz
        self._slacks = int(soft.max(initial=-1)) + 1
        shapes = (("x", nx, n + 1), ("w", stages.nw, n), ("u", nu, n), ("e", self._slacks, n))
        x, w, u, e = (ca.MX.sym(*one) for one in shapes)
        courses = len(stages.phase.courses)
        sizes = ((nx, 1), (2, n), (2 * courses, n), (nu, 1), (nx, nx), (nx, 1))
        given = [ca.MX.sym(f"given_{k}", *size) for k, size in enumerate(sizes)]
        x0, t, known, before, P, rest = given
        point, parts = stages.merits.map(n), []
        for i in range(2):
            y = ca.vertcat(w[i * each : (i + 1) * each, :], u)
            parts.append((y, t[i, :], known[i * courses : (i + 1) * courses, :]))
        found = [point(*part) for part in parts]
        cost = sum(stages.step * WEIGHTS[i] * ca.sum2(found[i][1]) for i in range(2))
        equal = [x[:, 0] - x0, ca.vec(x[:, 1:] - w[each : each + nx, :])]
        for i in range(2):
            slopes = sum(MATRIX[i, j] * found[j][0][:nx, :] for j in range(2))
            equal += [
                ca.vec(w[i * each : i * each + nx, :] - x[:, :-1] - slopes),
                ca.vec(found[i][0][nx:, :]),
            ]
        rows = ca.vertcat(found[0][2], found[1][2])
        slack = ca.DM((soft[:, None] == np.arange(self._slacks)).astype(float)) @ e
        limits = [ca.vec(rows + slack), ca.vec(rows - slack)]
        lower, upper = (np.tile(end, n) for end in stages.rows)
        step = u - ca.horzcat(before, u[:, :-1])
        chosen = np.tile(moves.chosen, (nu, 1))
        cost += ca.sum1(ca.sum2(chosen * moves.weights[:, None] * step**2))
        cost += penalty * ca.sum1(ca.vec(e + e**2 / 2))
        cost += ca.mtimes([(x[:, -1] - rest).T, P, x[:, -1] - rest]) / 2
        if terminal.there:
            cost += terminal.cost(*(part[:, -1] for part in parts[1]))
        zeros = np.zeros(sum(one.numel() for one in equal))
        low = np.where(chosen, moves.lower[:, None], 0.0).ravel("F")
        high = np.where(chosen, moves.upper[:, None], 0.0).ravel("F")
        endless = np.full(lower.size, np.inf)
        self._lower = np.concatenate([zeros, lower, -endless, low])
        self._upper = np.concatenate([zeros, endless, upper, high])
        free = np.full(x.numel() + w.numel(), np.inf)
        self._low = np.concatenate([-free, np.tile(stages.lower_u, n), np.zeros(e.numel())])
        self._high = np.concatenate([free, np.tile(stages.upper_u, n), np.full(e.numel(), np.inf)])
        program = {
            "x": ca.veccat(x, w, u, e), "p": ca.veccat(*given), "f": cost,
            "g": ca.vertcat(*equal, *limits, ca.vec(step)),
        }  # fmt: skip
        self._solver: Any = ca.nlpsol("first_plan", "ipopt", program, OPTIONS)

    def solved(self, plan: PlannedMotion, x: np.ndarray, before: np.ndarray, P: np.ndarray, rest: np.ndarray):
        """The plan from a state (nx,), from a guess on, its largest slacks (N,), and whether it is one.

        before: inputs applied now; P, rest: cost of a distance from a state at the end.
        """
        n, stages = self.elements, self.stages
        t = plan.t + stages.step * (NODES[:, None] + np.arange(n))
        known = stages.course_values(t.ravel()).reshape(-1, 2, n).swapaxes(0, 1).reshape(-1, n)
        start = np.concatenate([part.ravel() for part in (plan.x, plan.w, plan.u)])
        given = np.concatenate([part.ravel("F") for part in (x, t, known, before, P, rest)])
        found = self._solver(
            x0=np.append(start, np.zeros(self._slacks * n)),
            p=given,
            lbx=self._low,
            ubx=self._high,
            lbg=self._lower,
            ubg=self._upper,
        )
        v, sizes = np.asarray(found["x"]).ravel(), (plan.x.size, plan.w.size, plan.u.size)
        xs, w, u, slack = np.split(v, np.cumsum(sizes))
        made = PlannedMotion(
            xs.reshape(plan.x.shape), w.reshape(plan.w.shape), u.reshape(plan.u.shape), plan.t
        )
        slack = slack.reshape(n, self._slacks).max(axis=1, initial=0.0)
        return made, slack, bool(self._solver.stats()["success"])
