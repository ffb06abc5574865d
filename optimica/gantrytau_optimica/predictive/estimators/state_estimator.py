"""What moving-horizon estimators and Kalman filters share: names, samples and inputs in, states out."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from copy import copy
from types import NoneType
from typing import Any, Literal

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.checks import number
from gantrytau.border.refusal import Given
from gantrytau_optimica.estimation.experiments import Experiment
from gantrytau_optimica.predictive.estimators.observability import refuse_undetectable
from gantrytau_optimica.predictive.estimators.observed_model import Noise, ObservedModel
from gantrytau_optimica.predictive.estimators.recorded import recorded_estimates
from gantrytau_optimica.predictive.unknowns import named_values

EstimateStatus = Literal["estimated", "not converged", "outlier", "lost", "failed"]
GATE = 100.0  # deviations between a sample and what was foretold: no model is that wrong, and lines spoil numbers by more
ROW = 3  # samples in a row beyond the gate, of which the last is taken: what goes on is no outlier


class StateEstimator(ABC):
    """States, slow parameters and disturbances of a model from noisy samples; `step` in a loop."""

    def __init__(
        self,
        problem: Any,
        *,
        period: float,
        measured: Mapping[str, Any],
        noise: Mapping[str, Any] | None = None,
        parameters: Mapping[str, Any] | None = None,
        disturbance: Mapping[str, Any] | None = None,
        prior: Mapping[str, Any] | None = None,
        start: Mapping[str, Any] | None = None,
        gate: float = GATE,
    ):
        self.name = type(self).__name__
        self.gate = number(self.name, "gate", gate, above=0.0, most=math.inf)
        self.period = number(self.name, "period", period, unit="s", above=0.0)
        said = Noise(measured, noise or {}, parameters or {}, disturbance or {}, prior or {})
        for argument, one in {
            "measured": measured, "noise": noise, "parameters": parameters, "disturbance": disturbance,
            "prior": prior, "start": start,
        }.items():  # fmt: skip
            if one is not None and not isinstance(one, Mapping):
                raise ModelError("expected {name: number}", place=self.name, found=Given(argument, one))
        self.observed = ObservedModel(self.name, problem, self.period, said, start or {})
        refuse_undetectable(self.observed)
        self.reset()

    def __repr__(self) -> str:
        one = self.observed
        return f"<{self.name} {one.built.problem.name}: {len(one.names)} estimated from {len(one.outputs)} measured>"

    @property
    def states(self) -> tuple[str, ...]:
        """Names of the model's states."""
        return self.observed.model_states

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of estimated parameters and disturbances."""
        return self.observed.names[len(self.states) :]

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs that `step` wants."""
        return self.observed.inputs

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of what is measured."""
        return self.observed.outputs

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of what the last step gave, by name, in their units."""
        return self.observed.in_units(np.sqrt(np.diag(self._covariance())))

    def reset(self) -> None:
        """Forget all samples: the next step is the first."""
        self.status: EstimateStatus | None = None
        self._t: float | None = None
        self._u = np.zeros(self.observed.stages.nu)
        self._beyond = np.zeros(len(self.outputs), dtype=int)  # samples in a row beyond the gate

    @property
    def memory(self) -> dict[str, Any]:
        """What a step takes from those before it."""
        return {
            k: copy(v) for k, v in vars(self).items() if isinstance(v, (np.ndarray, float, str, NoneType))
        }

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Be as with this memory, of the same estimator or one like it."""
        vars(self).update({k: copy(v) for k, v in memory.items()})

    def step(
        self, measured: Mapping[str, Any], inputs: Mapping[str, Any] | None = None, t: float | None = None
    ) -> dict[str, float]:
        """States, parameters and disturbances at time t in s, by name, in their units.

        measured: samples at t, just before the inputs change; NaN is a lost one, and `.status` is "lost" if all are. One
        beyond the gate counts as lost, unless it is the first or the third in a row, and `.status` is "outlier".
        inputs: all inputs as they were held since the step before; only a first step may leave them out.
        t: whole periods after the step before, which is the default of one; samples between were lost.
        Raises ModelError for other names, shapes and times, and for a first step without any sample.
        """
        one = self.observed
        found = named_values(one.flat, self.name, "measured", measured, one.outputs, finite=False)
        missing = [name for name in one.outputs if name not in found]
        if missing:
            words = f"measured lacks {', '.join(missing)}, expected all of {', '.join(one.outputs)}; a lost sample is NaN"
            raise ModelError(words, place=self.name)
        y = np.array([found[name] for name in one.outputs])
        y[~np.isfinite(y)] = np.nan
        lost = bool(np.isnan(y).all())
        if self._t is None and lost:
            raise ModelError(
                "found no finite sample at the first step, expected one at least", place=self.name
            )
        u, count = self._inputs(inputs), self._periods(t)
        begun = self._t is not None
        if not begun:
            self._begin(u, 0.0 if t is None else float(t))
        for _ in range(count):
            self._advance(u)
        outlier = self._outliers(y) if begun else np.zeros(len(y), dtype=bool)
        solved = self._correct(np.where(outlier, np.nan, y))
        self._u = u
        self.status = "lost" if lost else "outlier" if outlier.any() and solved != "failed" else solved
        return one.in_units(self._state())

    def run(self, experiment: Experiment) -> Result:
        """Estimates along what was recorded, from the first sample on, as a result by names.

        experiment: samples at whole periods, of some or all that is measured, and inputs, held over a period as they are in
        its middle. Raises ModelError for other samples.
        """
        return recorded_estimates(self, experiment)

    def _outliers(self, y: np.ndarray) -> np.ndarray:
        """Which samples (ny,) lie beyond the gate, and are not the last of some in a row that do."""
        x, z, u, t = self._foretold()
        h, C, _ = self.observed.shown.at(x[None], z[None], u[None], np.array([t]))
        with np.errstate(over="ignore"):
            e = np.abs(y - h[0]) / self.observed.r
        beyond = e > self.gate
        if beyond.any():
            C = C[0] / self.observed.r[:, None]
            beyond &= e > self.gate * np.sqrt(1.0 + np.einsum("ij,jk,ik->i", C, self._before(), C))
        self._beyond = np.where(beyond, self._beyond + 1, 0)
        self._beyond[self._beyond == ROW] = 0
        return self._beyond > 0

    def _inputs(self, inputs: Mapping[str, Any] | None) -> np.ndarray:
        """Scaled inputs (nu,)."""
        names = self.observed.inputs
        if inputs is None and (self._t is None or not names):
            return self._u
        found = named_values(self.observed.flat, self.name, "inputs", inputs or {}, names)
        missing = [name for name in names if name not in found]
        if missing:
            raise ModelError(
                f"inputs lack {', '.join(missing)}, expected all of {', '.join(names)}", place=self.name
            )
        return np.array([found[name] for name in names]) / self.observed.stages.sizes_u

    def _periods(self, t: float | None) -> int:
        """How many periods lie between the step before and t."""
        if t is not None:
            number(self.name, "t", t, unit="s")
        if self._t is None:
            return 0
        count = 1.0 if t is None else (t - self._t) / self.period
        if round(count) < 1 or abs(count - round(count)) > 1e-6 * max(1.0, count):
            words = f"expected whole periods of {self.period:g} s after the step before, at {self._t:g} s"
            raise ModelError(words, place=self.name, found=Given("t", t))
        return round(count)

    def _begin(self, u: np.ndarray, t: float) -> None:
        """The first sample, at time t."""
        self._t = t

    @abstractmethod
    def _advance(self, u: np.ndarray) -> None:
        """A period later, inputs held."""

    @abstractmethod
    def _correct(self, y: np.ndarray) -> EstimateStatus:
        """Take a sample (ny,), NaN where it was lost."""

    @abstractmethod
    def _foretold(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
        """State, algebraics and inputs before the sample, scaled, and its time in s."""

    @abstractmethod
    def _before(self) -> np.ndarray:
        """The covariance of the state before the sample (nx, nx), scaled."""

    @abstractmethod
    def _state(self) -> np.ndarray:
        """The estimated state (nx,), scaled."""

    @abstractmethod
    def _covariance(self) -> np.ndarray:
        """Its covariance (nx, nx), scaled."""


def corrected(
    x: np.ndarray, P: np.ndarray, residual: np.ndarray, C: np.ndarray, r: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance after a sample: residual (ny,) NaN where it was lost, C (ny, nx), deviations r (ny,); Joseph."""
    some = np.isfinite(residual)
    if not some.any():
        return x, P
    C, e = C[some] / r[some, None], residual[some] / r[some]
    S = C @ P @ C.T + np.eye(len(e))
    K = np.linalg.solve(S, C @ P).T
    left = np.eye(len(x)) - K @ C
    P = left @ P @ left.T + K @ K.T
    return x + K @ e, (P + P.T) / 2
