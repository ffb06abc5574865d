"""What follows the horizon: the problem's own objective at its end, and the cost of holding a state of rest for ever."""

from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
from scipy.linalg import solve_discrete_are

from gantrytau import ModelError
from gantrytau_optimica.predictive.stages import HorizonStages, Linear, convex

if TYPE_CHECKING:
    from gantrytau_optimica.predictive.plan import PlannedMotion

TURNS = 50
SETTLED = 1e-10


class Terminal:
    """The objective of values at the end, `objective()` of `final(...)`, as a part of the last stage."""

    def __init__(self, stages: HorizonStages):
        problem, phase = stages.problem, stages.phase
        ends = [p for p in phase.points if isinstance(p.time, str) and p.time == "final"]
        known = {e.element_hash() for p in ends for e in p.symbol.elements()}
        first = [p for p in phase.points if isinstance(p.time, str) and p.time == "initial"]
        measured = {e.element_hash() for p in first for e in p.symbol.elements()}
        for limit in problem.boundary:
            if any(leaf.element_hash() not in measured for leaf in ca.symvar(limit.expression)):
                raise ModelError(
                    f"`{limit.name}` is a condition on the end or on a time between, expected a cost of the end: write "
                    "objective(), as 100 * final(...)**2, or take terminal='lqr'",
                    place=problem.name,
                )
        if any(leaf.element_hash() not in known for leaf in ca.symvar(problem.objective)):
            raise ModelError(
                "the objective holds values at other times than the end, expected final(...) alone: a receding horizon "
                "knows its begin by measurement, and has no fixed times between",
                place=problem.name,
            )
        y, t, courses = stages.symbols
        old = ca.vertcat(ca.SX(0, 1), *(p.symbol for p in ends))
        new = stages.at_point(ca.vertcat(ca.SX(0, 1), *(p.expression for p in ends)))
        cost = ca.substitute(problem.objective, old, new) if ends else ca.SX(0.0)
        self.there = not ca.SX(cost).is_constant()
        self.stages = stages
        if self.there:
            self.cost = ca.Function("cost", [y, t, courses], [cost])
            hessian, gradient = ca.hessian(cost, y)
            self.derivatives = ca.Function(
                "end", [y, t, courses], [ca.densify(gradient), ca.densify(hessian)]
            )

    def added(self, linear: Linear, plan: "PlannedMotion") -> tuple[np.ndarray, np.ndarray]:
        """Hessians and gradients of all stages, with what the end adds to the last one."""
        if not self.there:
            return linear.H, linear.g
        stages = self.stages
        t = np.array([plan.t + len(plan.u) * stages.step])
        nx, nz, nu = stages.nx, stages.nz, stages.nu
        found = self.derivatives(stages.points(plan.w[-1:], plan.u[-1:])[0, 1], t, stages.course_values(t))
        gradient, hessian = (np.asarray(one) for one in found)
        T = np.zeros((nx + nz + nu, 1 + nx + nu))  # signals at the end by (1, x, u) of the last stage
        T[: nx + nz], T[nx + nz :, 1 + nx :] = linear.w[-1, nx + nz :], np.eye(nu)
        H, g = linear.H.copy(), linear.g.copy()
        H[-1] = convex(H[-1:] + T[:, 1:].T @ hessian @ T[:, 1:])[0]
        g[-1] += T[:, 1:].T @ (gradient[:, 0] + hessian @ T[:, 0])
        return H, g


class SteadyState:
    """The state of rest that costs least at a time, and what it costs to come back to it for ever, 1/2 x' P x (Riccati)."""

    def __init__(self, stages: HorizonStages):
        self.stages = stages
        nz = stages.nz
        start = np.array([s.guess(np.zeros(1))[0] for s in stages.phase.states]) / stages.sizes_x
        z = np.array([s.guess(np.zeros(1))[0] for s in stages.phase.algebraics]).reshape(nz) / stages.sizes_z
        self._x, self._w, self._u = start, np.tile(np.append(start, z), 2), np.zeros(stages.nu)
        self._known: tuple[np.ndarray, np.ndarray] | None = None
        own = ca.vertcat(stages.problem.time, *(c.symbol for c in stages.phase.courses))
        about = ca.vertcat(stages.phase.integrand, stages.phase.ode, stages.phase.residuals)
        self.changes = bool(ca.depends_on(about, own))

    def at(self, t: float, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """P (nx, nx) and the state of rest (nx,), scaled, at a time in s, looked for from the model's start and from `near`.

        ModelError where there is none.
        """
        if self._known is None or self.changes:
            self._known = self._found(t, near)
        return self._known

    def _found(self, t: float, near: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        stages, nx = self.stages, self.stages.nx
        begins = [
            (near, np.tile(np.append(near, self._w[nx : nx + stages.nz]), 2), self._u),
            (self._x, self._w, self._u),
        ]
        rests = [one for one in (self._rest(t, *begin) for begin in begins) if one is not None]
        if not rests:
            raise ModelError(
                "terminal='lqr' found no state of rest that costs least; give the end a cost by objective() instead",
                place=stages.problem.name,
            )
        _, x, w, u, linear = min(rests, key=lambda one: one[0])
        A, B = linear.A[0], linear.B[0]
        self._x, self._w, self._u = x, w, u
        H = linear.H[0]
        try:
            P = solve_discrete_are(A, B, H[:nx, :nx], H[nx:, nx:], s=H[:nx, nx:])
        except (np.linalg.LinAlgError, ValueError):
            raise ModelError(
                "terminal='lqr': the state of rest cannot be held, or costs nothing along a motion that does not end; let "
                "the objective hold all states and inputs, or leave terminal= out",
                place=stages.problem.name,
            ) from None
        return P, x

    def _rest(self, t: float, x: np.ndarray, w: np.ndarray, u: np.ndarray):
        """Cost, state, unknowns, input and linearised stage at a state of rest near x at which the cost does not change."""
        stages, nx, nu = self.stages, self.stages.nx, self.stages.nu
        for _ in range(TURNS):
            linear = stages.linear(x[None], w[None], u[None], np.array([t]))
            E = np.hstack([linear.A[0] - np.eye(nx), linear.B[0]])
            K = np.block([[linear.H[0], E.T], [E, np.zeros((nx, nx))]])
            right = -np.concatenate([linear.g[0], linear.b[0] - x])
            if not np.isfinite(K).all():
                return None
            v = np.linalg.lstsq(K, right, rcond=None)[0][: nx + nu]
            w = w + linear.w[0] @ np.append(1.0, v)
            x, u = x + v[:nx], u + v[nx:]
            if np.abs(v).max() < SETTLED:
                return stages.spent(w, u, t), x, w, u, linear
        return None
