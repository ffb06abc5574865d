"""`ExtendedKalman`: the extended Kalman filter of a sampled model."""

import numpy as np

from gantrytau_optimica.predictive.estimators.state_estimator import EstimateStatus, StateEstimator, corrected


class ExtendedKalman(StateEstimator):
    """An extended Kalman filter of states, slow parameters and disturbances; limits of these are not respected.

    problem: an Optimization or a Model, class or instance; its `Free` parameters are estimated, too. period: s.
    measured: name -> standard deviation of its samples, any variables of the model.
    noise: name -> standard deviation by which a state strays from the model in a second, or a parameter from a constant.
    parameters: name -> standard deviation of the value in the model; disturbance: input or measured output -> standard
    deviation of the change of its disturbance in a second, estimated as `disturbance(name)`.
    prior: name -> standard deviation of the start of a state, default its typical size; start: name -> start value.
    gate: standard deviations of a sample from what was foretold beyond which it is an outlier, and counts as lost.
    Raises ModelError for wrong names, and for what the samples cannot determine, by name.
    """

    def reset(self) -> None:
        """Forget all samples: the next step is the first."""
        super().reset()
        self._x, self._z = self.observed.x0, self.observed.z0
        self._P = np.diag(self.observed.p**2)

    def _advance(self, u: np.ndarray) -> None:
        stages, t = self.observed.stages, np.array([self._t], dtype=float)
        guess = np.tile(np.append(self._x, self._z), 2)
        w = stages.moved(self._x, guess, u, float(t[0]))
        A = stages.linear(self._x[None], w[None], u[None], t).A[0]
        self._x, self._z = w[stages.last], w[stages.last.stop :]
        self._P = A @ self._P @ A.T + np.diag(self.observed.q**2)
        self._t, self._u = float(t[0]) + self.period, u

    def _begin(self, u: np.ndarray, t: float) -> None:
        super()._begin(u, t)
        self._u = u

    def _correct(self, y: np.ndarray) -> EstimateStatus:
        one, t = self.observed, float(self._t or 0.0)
        self._z = one.shown.settled(self._x, self._z, self._u, t)
        h, C, _ = one.shown.at(self._x[None], self._z[None], self._u[None], np.array([t]))
        self._x, self._P = corrected(self._x, self._P, y - h[0], C[0], one.r)
        return "estimated"

    def _foretold(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        return self._x, self._z, self._u, float(self._t or 0.0)

    def _before(self) -> np.ndarray:
        return self._P

    def _state(self) -> np.ndarray:
        return self._x

    def _covariance(self) -> np.ndarray:
        return self._P
