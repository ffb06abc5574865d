"""The record of every calibration: covariance of its numbers, residual diagnostics, errors of poses held out."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from gantrytau import ModelError
from gantrytau.border.refusal import did_you_mean
from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.links.error_models import shared_name
from gantrytau_optimica.fitting.diagnostics import Diagnostics, ResidualSeries, diagnose
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.fitting.least_squares import Minimum

REMEDIES = {
    "trend": "a parameter that is not named, a bent guideway, an eccentric axis or a gear; name more parameters",
    "not white": "poses that follow each other err alike: a parameter that is not named, or the device drifts",
    "noise larger": "the model lacks something, or the covariance of positions is told too small",
    "noise smaller": "the covariance of positions is told too large, or poses share a part of it, as by lenses or a scale, "
    "which moves the calibrated tool unseen",
}


@dataclass(frozen=True, eq=False, kw_only=True)
class FittedNumbers(Record):
    """Numbers of a robot that were fitted to measured poses.

    rows: those of the measurements that were fitted; held_out: those that validate; loss, frame, method: as they were asked
    for; findings: what was noticed on the way.
    """

    measurements: Measurements
    rows: np.ndarray
    held_out: np.ndarray
    loss: str
    frame: str = "fitted"
    method: str = "gauss-newton"
    model: Any = None
    findings: tuple[Finding, ...] = ()

    def __repr__(self) -> str:
        model = "" if self.model is None else f", model {self.model}"
        return (
            f"<Calibration of {self.robot_name}{model}: {len(self.names)} numbers from {len(self.rows)} poses, "
            f"{self.error * 1e6:.3g} um in the mean of {len(self.held_out)} held out>"
        )

    @property
    @abstractmethod
    def robot_name(self) -> str:
        """Name of the robot."""

    @property
    @abstractmethod
    def names(self) -> tuple[str, ...]:
        """Names of the identified numbers, scalars."""

    @cached_property
    @abstractmethod
    def parameters(self) -> Mapping[str, Any]:
        """Values by name."""

    @property
    @abstractmethod
    def minima(self) -> tuple[Minimum, ...]:
        """Where least squares ended, one for all numbers that are fitted together."""

    @cached_property
    @abstractmethod
    def undetermined(self) -> tuple[str, ...]:
        """Names of numbers that data do not hold: they stayed near their start values."""

    @property
    @abstractmethod
    def advice(self) -> str:
        """Remedy for undetermined parameters."""

    @cached_property
    @abstractmethod
    def stray_rows(self) -> np.ndarray:
        """Rows, fitted or held out, that are off by more than noise explains."""

    @cached_property
    @abstractmethod
    def error_vectors(self) -> np.ndarray:
        """Measured less predicted positions of the held-out poses, (N, 3) in m."""

    @cached_property
    @abstractmethod
    def angle_errors(self) -> np.ndarray:
        """Angles between measured and predicted orientations of the held-out poses, (N,) in rad; NaN without R."""

    @cached_property
    @abstractmethod
    def _covariance(self) -> np.ndarray: ...

    @abstractmethod
    def residual_series(self) -> list[ResidualSeries]:
        """Residuals of the fitted poses, in their order."""

    @property
    def rank(self) -> int:
        """Rank: the number of determined combinations of the identified parameters."""
        return sum(minimum.rank for minimum in self.minima)

    @property
    def success(self) -> bool:
        """Whether the last step of each minimum was negligible."""
        return all(minimum.success for minimum in self.minima)

    @property
    def iterations(self) -> int:
        """Steps, the most of any minimum."""
        return max(minimum.iterations for minimum in self.minima)

    def covariance(self, names: Sequence[str] | None = None) -> np.ndarray:
        """Covariance (k, k) of parameters in their order; a vector's name stands for its elements.

        names: default all that data hold. Errors of a pose move all numbers, so that those of different arms vary together.
        Raises ModelError for unknown names and for numbers that data do not hold.
        """
        if isinstance(names, str):
            raise ModelError(f"covariance: found '{names}', expected a list of names; write ['{names}']")
        wanted = [n for n in self.names if n not in self.undetermined] if names is None else names
        places = [k for name in wanted for k in self._places(name)]
        return self._covariance[np.ix_(places, places)]

    def _places(self, name: str) -> list[int]:
        for alias in (name, shared_name(name)):
            those = [k for k, n in enumerate(self.names) if alias in (n, n.rpartition("[")[0])]
            if lost := [self.names[k] for k in those if self.names[k] in self.undetermined]:
                raise ModelError(
                    f"covariance: data do not hold {', '.join(lost)}, which stayed near the start value; {self.advice}"
                )
            if those:
                return those
        if name in ("frame.R", "frame.t") and name in self.parameters:
            raise ModelError(f"covariance: {name} follows from nominal values alone; leave it out")
        if name in self.parameters:
            raise ModelError(f"covariance: {name} was not identified but held at its value; leave it out")
        raise ModelError(f"covariance: there is no parameter '{name}'{did_you_mean(name, self.parameters)}")

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of the identified numbers by name; inf for what data do not hold."""
        found, lost = np.sqrt(np.diag(self._covariance)), set(self.undetermined)
        return {n: float("inf") if n in lost else float(d) for n, d in zip(self.names, found, strict=True)}

    @cached_property
    def errors(self) -> np.ndarray:
        """Distances of measured and predicted positions of the held-out poses (5.5), (N,) in m."""
        return np.linalg.norm(self.error_vectors, axis=1)

    @property
    def left_out(self) -> np.ndarray:
        """Rows that a robust loss leaves without weight, as findings say: `.error` and `.angle_error` leave them out too."""
        return self.stray_rows if self.loss == "robust" else self.held_out[:0]

    @property
    def error(self) -> np.float64:
        """Mean of `errors`, m, without `left_out`: the error to expect of a pose that was not fitted. Poses that were told
        to be surer count by the squares of their certainty.
        """
        return self._mean(self.errors)

    @property
    def angle_error(self) -> np.float64:
        """Mean of `angle_errors`, rad, without `left_out`; NaN where no orientations were measured."""
        return self._mean(self.angle_errors)

    def _mean(self, values: np.ndarray) -> np.float64:
        good = ~np.isin(self.held_out, self.left_out)
        return mean_by_worth(values[good], self.measurements.select(self.held_out[good]).certainty)

    @cached_property
    def diagnostics(self) -> Diagnostics:
        """Residual diagnostics without stray poses: explained share, size by told noise, correlation, trends, groups."""
        good = ~np.isin(self.rows, self.stray_rows)
        series = [replace(s, left=np.where(good, s.left, np.nan)) for s in self.residual_series()]
        return diagnose(series, remedies=REMEDIES)

    def with_findings(self, findings: Sequence[Finding]) -> Self:
        """This calibration with other findings, without a new fit."""
        return self._kept(replace(self, findings=tuple(findings)), "findings")

    def _kept(self, found: Self, *others: str) -> Self:
        """What was worked out already, but for some names, is that of another record too."""
        found.__dict__.update({name: value for name, value in self.__dict__.items() if name not in others})
        return found


def mean_by_worth(values: np.ndarray, certainty: np.ndarray | None) -> np.float64:
    """The mean of what is finite, NaN of nothing, by the squares of the certainty of each where it is known."""
    finite = np.isfinite(values)
    if not finite.any():
        return np.float64(np.nan)
    if certainty is None:
        return np.float64(values[finite].mean())
    return np.float64(np.average(values[finite], weights=certainty[finite] ** 2))
