"""What a correction makes of an error: L in u + L eps, as a filter over time and as a lifted matrix.

    Shifted       (L eps)[t] = gain eps[t + shift]                             Dressler (2012), (7.10)
    Gradient      L = gain T' / |T|^2                                           Owens, Hatonen, Daley (2009)
    NormOptimal   L = (T' T + w |T|^2 I)^-1 T'                                  Amann, Owens, Rogers (1996)

T is the response from corrections to what is learnt from, |T| its largest singular value.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import number, whole
from gantrytau.describing.record import Record
from gantrytau_optimica.learning.laws.lifted import Response, axes_of, lifted, norm


class CorrectionLaw(Protocol):
    """A linear law from errors to corrections."""

    def corrections(self, error: np.ndarray) -> np.ndarray:
        """Corrections (N, m) for errors (N, m) of N samples and m axes, or of many runs, (N, m, K)."""
        ...


@dataclass(frozen=True)
class Shifted:
    """Each axis by its own error some samples later; behind the end the last error holds."""

    gain: float = 0.9
    shift: int = 5

    def __post_init__(self):
        number("Learning", "gain", self.gain)
        whole("Learning", "shift", self.shift, least=0)

    def corrections(self, error: np.ndarray) -> np.ndarray:
        return self.gain * error[np.minimum(np.arange(len(error)) + self.shift, len(error) - 1)]


@dataclass(frozen=True, eq=False)
class Gradient(Record):
    """Down the slope of the squared error by the response of a model: gains below 2 are safe, small answers slow."""

    response: Response | None = None  # measured by `learn` if None
    gain: float = 1.0

    def corrections(self, error: np.ndarray) -> np.ndarray:
        T = _model(self.response, error)
        return _apart(self.gain / norm(T) ** 2 * (T.T @ _stacked(error)), error)


@dataclass(frozen=True, eq=False)
class NormOptimal(Record):
    """The correction of least error and effort by the response of a model; weight: of effort, relative."""

    response: Response | None = None  # measured by `learn` if None
    weight: float = 1e-2

    def __post_init__(self):
        number("NormOptimal", "weight", self.weight, above=0.0)

    def corrections(self, error: np.ndarray) -> np.ndarray:
        from scipy.linalg import cho_factor, cho_solve

        T = _model(self.response, error)
        square = T.T @ T
        square[np.diag_indices_from(square)] += self.weight * norm(T) ** 2
        return _apart(cho_solve(cho_factor(square), T.T @ _stacked(error)), error)


def _model(response: Response | None, error: np.ndarray) -> np.ndarray:
    """T (m N, m N) for errors (N, m, ...)."""
    if response is None:
        raise ModelError(
            "Learning: found a law without a response, expected one such as Gradient(response); `learn` measures it",
            argument="law",
        )
    samples, axes = error.shape[:2]
    if axes_of(response) != axes:
        raise ModelError(
            f"Learning: found a model of {axes_of(response)} axes and errors of {axes}, expected as many of both",
            argument="law",
        )
    return lifted(response, samples)


def _stacked(error: np.ndarray) -> np.ndarray:
    """(N, m, ...) axis by axis in one vector, (m N, ...)."""
    return np.concatenate([error[:, i] for i in range(error.shape[1])])


def _apart(stacked: np.ndarray, like: np.ndarray) -> np.ndarray:
    """(m N, ...) as (N, m, ...)."""
    return np.stack(np.split(stacked, like.shape[1]), axis=1)
