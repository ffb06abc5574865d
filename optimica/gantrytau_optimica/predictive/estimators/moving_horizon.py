"""`MovingHorizon`: states and parameters of a model that suit the last samples best, anew at every sample.

    min  1/2 |L^-1 (x_0 - m)|^2 + sum_k 1/2 |v_k|^2 + sum_k 1/2 |(y_k - h(x_k)) / r|^2
    x_(k+1) = F(x_k, u_k) + q v_k,   lower <= x_k <= upper,   k = 0 ... n

The arrival cost, m and L L' = P, holds what samples before the horizon said: mean and covariance before y_0, carried along
by the extended Kalman filter linearised at the estimate (Kuehl et al., 2011). In the program of `Mpc` it is a stage of its
own, x_0 = m + L v, so that P may be singular.
"""

import math
from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from gantrytau.border.checks import whole
from gantrytau_optimica.predictive.estimators.state_estimator import (
    GATE,
    EstimateStatus,
    StateEstimator,
    corrected,
)
from gantrytau_optimica.predictive.horizon_qp import FAR, HorizonProgram, Stage
from gantrytau_optimica.predictive.stages import Linear

STANDS = 1e-7  # changes of states over their deviations by which iterations are done
MOST = 30


class MovingHorizon(StateEstimator):
    """A moving-horizon estimator of states, slow parameters and disturbances, within their limits.

    problem: an Optimization or a Model, class or instance; its `Free` parameters are estimated, too. period: s.
    samples: the last ones that are looked at whole; measured, noise, parameters, disturbance, prior, start, gate: as of
    `ExtendedKalman`, which carries along what the samples before said.
    iterations: of Gauss-Newton's method at a step, or "converged".
    Raises ModelError for wrong names, and for what the samples cannot determine, by name.
    """

    def __init__(
        self,
        problem: Any,
        *,
        period: float,
        measured: Mapping[str, Any],
        samples: int = 10,
        noise: Mapping[str, Any] | None = None,
        parameters: Mapping[str, Any] | None = None,
        disturbance: Mapping[str, Any] | None = None,
        prior: Mapping[str, Any] | None = None,
        start: Mapping[str, Any] | None = None,
        iterations: int | Literal["converged"] = "converged",
        gate: float = GATE,
    ):
        self.samples = whole("MovingHorizon", "samples", samples, least=1)
        self._converged = iterations == "converged"
        self.iterations = whole(
            "MovingHorizon", "iterations", MOST if self._converged else iterations, least=1
        )
        self._programs: dict[int, HorizonProgram] = {}
        super().__init__(
            problem, period=period, measured=measured, noise=noise, parameters=parameters, disturbance=disturbance,
            prior=prior, start=start, gate=gate,
        )  # fmt: skip

    def reset(self) -> None:
        """Forget all samples: the next step is the first."""
        super().reset()
        one = self.observed
        self._mean, self._P = one.x0, np.diag(one.p**2)
        self._bounded = np.flatnonzero(np.isfinite(one.bounds).any(axis=0))

    def _begin(self, u: np.ndarray, t: float) -> None:
        super()._begin(u, t)
        one, stages = self.observed, self.observed.stages
        z = one.shown.settled(one.x0, one.z0, u, t)
        self._x, self._z, self._y = one.x0[None], z[None], np.full((1, len(one.outputs)), np.nan)
        self._w, self._held = np.zeros((0, stages.nw)), u[None]  # inputs before each node
        self._times = np.array([t])

    def _advance(self, u: np.ndarray) -> None:
        stages, x, z, t = self.observed.stages, self._x[-1], self._z[-1], float(self._times[-1])
        w = stages.moved(x, np.tile(np.append(x, z), 2), u, t)
        self._x, self._z = np.vstack([self._x, w[stages.last]]), np.vstack([self._z, w[stages.last.stop :]])
        self._w, self._held = np.vstack([self._w, w]), np.vstack([self._held, u])
        self._y = np.vstack([self._y, np.full(self._y.shape[1], np.nan)])
        self._t = t + self.period
        self._times = np.append(self._times, self._t)
        if len(self._x) > self.samples:
            self._leave()

    def _leave(self) -> None:
        """The first node leaves the horizon: its sample and the stage after it become arrival cost of the next node."""
        self._mean, self._P = self._carried(self._mean, self._P, 0)
        self._x, self._z, self._y, self._w, self._held, self._times = (
            part[1:] for part in (self._x, self._z, self._y, self._w, self._held, self._times)
        )

    def _carried(self, m: np.ndarray, P: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Mean and covariance before sample k + 1 from those before sample k, linearised at the estimate."""
        m, P = self._taken(m, P, k)
        x, some = self._x[k], slice(k, k + 1)
        linear = self.observed.stages.linear(
            x[None], self._w[some], self._held[k + 1][None], self._times[some]
        )
        A = linear.A[0]
        return linear.b[0] + A @ (m - x), A @ P @ A.T + np.diag(self.observed.q**2)

    def _taken(self, m: np.ndarray, P: np.ndarray, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Mean and covariance after sample k."""
        some, one = slice(k, k + 1), self.observed
        h, C, _ = one.shown.at(self._x[some], self._z[some], self._held[some], self._times[some])
        return corrected(m, P, self._y[k] - h[0] - C[0] @ (m - self._x[k]), C[0], one.r)

    def _correct(self, y: np.ndarray) -> EstimateStatus:
        self._y[-1] = y
        change = math.inf
        for _ in range(self.iterations):
            change = self._iterated()
            if not change >= STANDS:
                break
        if not np.isfinite(change):
            return "failed"
        return "not converged" if self._converged and change >= STANDS else "estimated"

    def _iterated(self) -> float:
        """A step of Gauss-Newton's method; the largest change, NaN where the program has no solution."""
        one, stages, n = self.observed, self.observed.stages, len(self._w)
        h, C, algebraic = one.shown.at(self._x, self._z, self._held, self._times)
        taken = np.isfinite(self._y)
        C = np.where(taken[..., None], C / one.r[:, None], 0.0)
        e = np.where(taken, (self._y - h) / one.r, 0.0)
        H, g = C.swapaxes(1, 2) @ C, -np.einsum("kyx,ky->kx", C, e)
        linear = stages.linear(self._x[:-1], self._w, self._held[1:], self._times[:-1]) if n else None
        stage = self._stage(H[:-1], g[:-1], linear)
        if n not in self._programs:
            rows = self._bounded.size
            finite = np.isfinite(one.bounds[:, self._bounded])
            self._programs[n] = HorizonProgram(
                n + 1, stages.nx, stages.nx, np.full(rows, -1), finite, 1.0, ridge=0.0
            )
        D = self._spread()
        self._programs[n].load(stage, D[:, None] * H[-1] * D, D * g[-1])
        found = self._programs[n].solve(np.zeros(stages.nx))
        if not found.solved:
            return math.nan
        dx = found.x[1:] * D
        if linear is not None:
            v = np.concatenate([np.ones((n, 1)), dx[:-1]], axis=1)
            self._w = self._w + np.einsum("kij,kj->ki", linear.w[:, :, : 1 + stages.nx], v)
        self._z = self._z + algebraic[..., 0] + np.einsum("kij,kj->ki", algebraic[..., 1:], dx)
        self._x = np.clip(self._x + dx, *one.bounds)
        return float(np.abs(found.x[1:]).max())

    def _stage(self, H: np.ndarray, g: np.ndarray, linear: Linear | None) -> Stage:
        """The program's stages: the arrival cost, then one for each period, nodes over `_spread`, and noises."""
        one, n, nx = self.observed, len(self._w), self.observed.stages.nx
        values, vectors = np.linalg.eigh(self._P)
        A, B, b = np.zeros((n + 1, nx, nx)), np.tile(np.diag(one.q), (n + 1, 1, 1)), np.zeros((n + 1, nx))
        B[0], b[0] = vectors * np.sqrt(np.maximum(values, 0.0)), self._mean - self._x[0]
        if linear is not None:
            A[1:], b[1:] = linear.A, linear.b - self._x[1:]
        curved, slope = np.zeros((n + 1, 2 * nx, 2 * nx)), np.zeros((n + 1, 2 * nx))
        curved[:, nx:, nx:] = np.eye(nx)
        D = self._spread()
        A, B, b = A * D / D[:, None], B / D[:, None], b / D
        curved[1:, :nx, :nx], slope[1:, :nx] = D[:, None] * H * D, D * g
        some, far = self._bounded, np.full((n + 1, nx), FAR)
        lower, upper = (((ends - self._x) / D - b)[:, some] for ends in one.bounds)
        return Stage(curved, slope, A, B, b, A[:, some], B[:, some], lower, upper, -far, far)

    def _spread(self) -> np.ndarray:
        """How far states may stray over the horizon, by deviations; 1 for those that are known, (nx,)."""
        found = np.sqrt(np.diag(self._P) + len(self._x) * self.observed.q**2)
        return np.where(found > 0.0, found, 1.0)

    def _state(self) -> np.ndarray:
        return self._x[-1]

    def _foretold(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        return self._x[-1], self._z[-1], self._held[-1], float(self._times[-1])

    def _carried_through(self) -> tuple[np.ndarray, np.ndarray]:
        m, P = self._mean, self._P
        for k in range(len(self._w)):
            m, P = self._carried(m, P, k)
        return m, P

    def _before(self) -> np.ndarray:
        return self._carried_through()[1]

    def _covariance(self) -> np.ndarray:
        return self._taken(*self._carried_through(), len(self._w))[1]
