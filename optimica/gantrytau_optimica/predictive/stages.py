"""One stage of a receding horizon: the motion over a period with its input held, and what it costs.

    X_i = x + h sum_j a_ij f(t + c_j h, X_j, z_j, u),   0 = g(t + c_i h, X_i, z_i, u),   i = 1, 2

The method of Radau with two points, of third order, whose last point is the end of the stage. Its unknowns w, the X_i and
z_i, are kept from one iteration to the next and eliminated after linearisation (lifted Newton: Albersmeyer and Diehl, 2010),
so that loops and stiff equations cost one small linear system a stage.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau.simulation.events.at_places import AtPlaces
from gantrytau_optimica.control.control_problem import ControlProblem, Limit
from gantrytau_optimica.control.limits import bare_limit, signal_limits

NODES = np.array([1 / 3, 1.0])
MATRIX = np.array([[5 / 12, -1 / 12], [3 / 4, 1 / 4]])
WEIGHTS = MATRIX[1]
TURNS = 12  # of Newton's method for the unknowns of a stage
SETTLED = 1e-10  # of their sizes


@dataclass(frozen=True, eq=False)
class Linear:
    """A horizon of N stages linearised: x_(k+1) = A x + B u + b, cost 1/2 v' H v + g' v with v = (x, u), rows C x + D u + r.

    All in changes of scaled variables; w (N, nw, 1 + v): how the unknowns of the stages follow from (1, v).
    """

    A: np.ndarray
    B: np.ndarray
    b: np.ndarray
    H: np.ndarray
    g: np.ndarray
    C: np.ndarray
    D: np.ndarray
    r: np.ndarray
    w: np.ndarray


class HorizonStages:
    """The functions of a phase over N stages of length h, in variables scaled by their nominal sizes."""

    def __init__(self, problem: ControlProblem, step: float):
        (phase,) = problem.phases
        self.problem, self.phase, self.step = problem, phase, step
        nx, nz, nu = len(phase.states), len(phase.algebraics), len(phase.inputs)
        self.nx, self.nz, self.nu = nx, nz, nu
        self.sizes_x, self.sizes_z, self.sizes_u = (
            np.array([s.nominal for s in part], dtype=float)
            for part in (phase.states, phase.algebraics, phase.inputs)
        )
        self.nw = 2 * (nx + nz)
        self.size_w = np.tile(np.append(self.sizes_x, self.sizes_z), 2)
        bounds = signal_limits(phase, problem.name)
        ends = np.array([bounds[s.name] for s in phase.inputs], dtype=float).reshape(nu, 2)
        self.lower_u, self.upper_u = ends.T / self.sizes_u
        inputs = {s.name for s in phase.inputs}
        self.path = [limit for limit in phase.path_limits if not self._of_input(limit, inputs)]

    @property
    def last(self) -> slice:
        """Where the state at the end of a stage stands in its unknowns."""
        return slice(self.nx + self.nz, 2 * self.nx + self.nz)

    @cached_property
    def _slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives of the integrand at the guess, and second ones by the signals that it has curvature in."""
        x = np.array([s.guess(np.zeros(1))[0] for s in self.phase.states]) / self.sizes_x
        z = np.array([s.guess(np.zeros(1))[0] for s in self.phase.algebraics]).reshape(self.nz) / self.sizes_z
        zero = np.zeros(1)
        found = self.point(np.concatenate([x, z, np.zeros(self.nu)]), 0.0, self.course_values(zero))
        return np.asarray(found[2]), np.asarray(found[3])

    @property
    def input_curvatures(self) -> np.ndarray:
        """Second derivatives of the integrand by each input (nu,), scaled, at the guess."""
        found = np.zeros(self.nx + self.nz + self.nu)
        found[self.costly] = np.diag(self._slopes[1])
        return found[self.nx + self.nz :]

    @property
    def curvature(self) -> float:
        """The largest curvature of the cost of a stage at the guess, or slope of one without, or 1."""
        slope, curved = (self.step * float(np.abs(one).max(initial=0.0)) for one in self._slopes)
        return next((one for one in (curved, slope) if 0.0 < one < np.inf), 1.0)

    def _of_input(self, limit: Limit, inputs: set[str]) -> bool:
        found = bare_limit(limit, self.phase)
        return found is not None and found[0] in inputs

    @cached_property
    def symbols(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Scaled signals (x, z, u) at a point of a stage, the time there, and values of the courses."""
        return (
            ca.SX.sym("y", self.nx + self.nz + self.nu),
            ca.SX.sym("t"),
            ca.SX.sym("courses", len(self.phase.courses)),
        )

    def at_point(self, expressions: ca.SX) -> ca.SX:
        """Expressions of the phase, in the symbols of a point."""
        phase, (y, t, courses) = self.phase, self.symbols
        own = ca.vertcat(
            *(s.symbol for s in phase.signals), self.problem.time, *(c.symbol for c in phase.courses)
        )
        sizes = ca.DM(np.concatenate([self.sizes_x, self.sizes_z, self.sizes_u]))
        return ca.substitute(ca.densify(ca.SX(expressions)), own, ca.vertcat(y * sizes, t, courses))

    @cached_property
    def equations(self) -> ca.SX:
        """Slopes by period and residuals, each by its size, (nx + nz,)."""
        phase = self.phase
        sizes = np.array(phase.residual_sizes or np.ones(self.nz), dtype=float)
        slopes = self.at_point(phase.ode) * self.step / ca.DM(self.sizes_x)
        return ca.vertcat(slopes, self.at_point(phase.residuals) / ca.DM(sizes))

    @cached_property
    def limits(self) -> ca.SX:
        """Limited expressions along the path, each by its size, (path,)."""
        if not self.path:
            return ca.SX(0, 1)
        column = ca.vertcat(*(limit.expression for limit in self.path))
        return self.at_point(column) / ca.DM([limit.size for limit in self.path])

    @cached_property
    def rows(self) -> tuple[np.ndarray, np.ndarray]:
        """Lower and upper ends of the limits along the path at both points, each by its size."""
        sizes = np.array([limit.size for limit in self.path], dtype=float)
        ends = [
            np.array([getattr(limit, end) for limit in self.path], dtype=float) / sizes
            for end in ("lower", "upper")
        ]
        return np.tile(ends[0], 2), np.tile(ends[1], 2)

    @cached_property
    def row_names(self) -> list[str]:
        """What the rows mean, by the model's words."""
        return [limit.name for limit in self.path] * 2

    @cached_property
    def costly(self) -> np.ndarray:
        """Which signals the integrand has curvature in."""
        y, *_ = self.symbols
        hessian = ca.hessian(self.at_point(self.phase.integrand), y)[0]
        return np.unique(np.concatenate([hessian.sparsity().row(), np.zeros(0, int)]).astype(int))

    @cached_property
    def point(self) -> ca.Function:
        """All that linearisation needs of one point: equations, integrand, limits, and derivatives by (x, z, u)."""
        y, t, courses = self.symbols
        cost = self.at_point(self.phase.integrand)
        hessian, gradient = ca.hessian(cost, y)
        some = self.costly.tolist()
        out = [
            self.equations,
            ca.jacobian(self.equations, y),
            gradient,
            hessian[some, some],
            self.limits,
            ca.jacobian(self.limits, y),
        ]
        return ca.Function("point", [y, t, courses], [ca.densify(one) for one in out])

    def course_values(self, times: np.ndarray) -> np.ndarray:
        """Values of the known courses at times (n,): (courses, n)."""
        return np.array([course.value(times) for course in self.phase.courses]).reshape(-1, times.size)

    def points(self, w: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Signals (N, 2, x + z + u) at both points of stages, from their unknowns (N, nw) and inputs (N, nu)."""
        n = len(u)
        return np.concatenate([w.reshape(n, 2, -1), np.repeat(u[:, None], 2, axis=1)], axis=2)

    def beyond(self, w: np.ndarray, u: np.ndarray, begin: float) -> np.ndarray:
        """By how much a motion from some time on passes limits along the path at most, (path,), each by its size."""
        t = begin + self.step * (np.arange(len(u))[:, None] + NODES).ravel()
        y = self.points(w, u).reshape(2 * len(u), -1)
        rows = self._at_points(y, t, self.course_values(t).T)[4].reshape(len(u), -1)
        lower, upper = self.rows
        return np.maximum(lower - rows, rows - upper).reshape(2 * len(u), -1).max(axis=0)

    def linear(self, x: np.ndarray, w: np.ndarray, u: np.ndarray, times: np.ndarray) -> Linear:
        """The horizon linearised at scaled x (N, nx), w (N, nw), u (N, nu); stages begin at times (N,) in s."""
        n, nx, nz, nu = len(u), self.nx, self.nz, self.nu
        y, t = self.points(w, u), times[:, None] + self.step * NODES
        found = self._at_points(y.reshape(2 * n, -1), t.ravel(), self.course_values(t.ravel()).T)
        shapes = [self.point.size_out(k) for k in range(self.point.n_out())]
        # CasADi writes column after column
        e, J, gradient, curved, rows, R = (
            one.reshape(n, 2, columns, count).swapaxes(2, 3)
            for one, (count, columns) in zip(found, shapes, strict=True)
        )
        # algebraics by (1, x, u) of their point
        z = np.zeros((n, 2, nz, 1 + nx + nu))
        if nz:
            right = np.concatenate([e[..., nx:, :], J[..., nx:, :nx], J[..., nx:, nx + nz :]], axis=3)
            z = -np.linalg.solve(J[..., nx:, nx : nx + nz], right)
        along = J[..., :nx, nx : nx + nz] @ z
        f0 = e[..., :nx, 0] + along[..., 0]
        fx, fu = J[..., :nx, :nx] + along[..., 1 : 1 + nx], J[..., :nx, nx + nz :] + along[..., 1 + nx :]
        # the states of both points by (1, x, u) of the stage
        left = np.tile(np.eye(2 * nx), (n, 1, 1))
        moved = np.zeros((n, 2 * nx, 1 + nx + nu))
        for i in range(2):
            mine = slice(i * nx, (i + 1) * nx)
            moved[:, mine, 0] = x - y[:, i, :nx] + np.einsum("j,njk->nk", MATRIX[i], f0)
            moved[:, mine, 1 : 1 + nx] = np.eye(nx)
            moved[:, mine, 1 + nx :] = np.einsum("j,njkl->nkl", MATRIX[i], fu)
            for j in range(2):
                left[:, mine, j * nx : (j + 1) * nx] -= MATRIX[i, j] * fx[:, j]
        states = np.linalg.solve(left, moved).reshape(n, 2, nx, -1)
        T = np.zeros((n, 2, nx + nz + nu, 1 + nx + nu))  # signals of a point by (1, x, u) of the stage
        T[:, :, :nx], T[:, :, nx + nz :, 1 + nx :] = states, np.eye(nu)
        T[:, :, nx : nx + nz] = z[..., 1 : 1 + nx] @ states
        T[:, :, nx : nx + nz, 0] += z[..., 0]
        T[:, :, nx : nx + nz, 1 + nx :] += z[..., 1 + nx :]
        H, g = self._costs(T, gradient, curved)
        limits = (R @ T).reshape(n, 2 * len(self.path), 1 + nx + nu)
        limits[..., 0] += rows.reshape(n, 2 * len(self.path))
        return Linear(
            A=T[:, 1, :nx, 1 : 1 + nx], B=T[:, 1, :nx, 1 + nx :], b=y[:, 1, :nx] + T[:, 1, :nx, 0],
            H=H, g=g, C=limits[..., 1 : 1 + nx], D=limits[..., 1 + nx :], r=limits[..., 0],
            w=T[:, :, : nx + nz].reshape(n, self.nw, -1),
        )  # fmt: skip

    def _costs(
        self, T: np.ndarray, gradient: np.ndarray, curved: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Hessians (N, v, v) and gradients (N, v) of the costs of stages by v = (x, u), convex."""
        weights = WEIGHTS * self.step
        some = T[:, :, self.costly]
        bent = curved @ some
        slope = np.einsum("p,npiv,npi->nv", weights, T[..., 1:], gradient[..., 0])
        slope += np.einsum("p,npiv,npi->nv", weights, some[..., 1:], bent[..., 0])
        H = np.einsum("p,npiv,npiw->nvw", weights, some[..., 1:], bent[..., 1:])
        return convex(H), slope

    @cached_property
    def merits(self) -> ca.Function:
        """Equations, integrand and limits at a point, of its scaled signals, its time and courses."""
        parts = [self.equations, self.at_point(self.phase.integrand), self.limits]
        return ca.Function("merits", list(self.symbols), [ca.densify(one) for one in parts])

    @cached_property
    def _at_points(self) -> AtPlaces:
        return AtPlaces(self.point)

    def finite(self, x: np.ndarray, w: np.ndarray, u: np.ndarray, times: np.ndarray) -> Linear | None:
        """As `linear`; None where a number is not finite, or equations are singular."""
        try:
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                found = self.linear(x, w, u, times)
        except np.linalg.LinAlgError:
            return None
        numbers = (found.w, found.H, found.g, found.C, found.D, found.r)
        return found if all(np.isfinite(one).all() for one in numbers) else None

    def compiled(self) -> bool:
        """Wait until what linearises is machine code; whether it is."""
        return self._at_points.compiled()

    def moved(self, x: np.ndarray, w: np.ndarray, u: np.ndarray, t: float) -> np.ndarray:
        """The unknowns of one stage (nw,) that solve its equations, from a guess; ModelError where there are none."""
        times = np.array([t])
        for _ in range(TURNS):
            linear = self.finite(x[None], w[None], u[None], times)
            if linear is None:
                break
            change = linear.w[0, :, 0]
            w = w + change
            if np.max(np.abs(change), initial=0.0) < SETTLED:
                return w
        raise ModelError(
            f"the motion over {self.step:g} s from t = {t:g} s has no solution near the plan",
            place=self.problem.name,
        )

    def spent(self, w: np.ndarray, u: np.ndarray, t: float) -> float:
        """The integral over a stage whose unknowns are known."""
        y, times = self.points(w[None], u[None])[0], t + self.step * NODES
        (values,) = self._spending(y, times, self.course_values(times).T)
        return float(self.step * (values[:, 0] @ WEIGHTS))

    @cached_property
    def _spending(self) -> AtPlaces:
        return AtPlaces(ca.Function("spent", list(self.symbols), [self.at_point(self.phase.integrand)]))


def convex(H: np.ndarray) -> np.ndarray:
    """Symmetric matrices (N, v, v) with their negative eigenvalues at zero."""
    try:
        np.linalg.cholesky(H + 1e-12 * np.abs(H).max(initial=1e-300) * np.eye(H.shape[-1]))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(H)
        return (vectors * np.maximum(values, 0.0)[:, None, :]) @ vectors.transpose(0, 2, 1)
    return H
