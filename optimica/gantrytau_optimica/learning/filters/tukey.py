"""The part of a run that is learnt: windows that fade in and out."""

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import number
from gantrytau.results.figures import check_suffix, finished

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Tukey:
    """Weights over a run that are zero, rise, are one, fall and are zero: Dressler (2012), (7.12), (7.14).

    start, stop: s, where weights begin and end to be above zero, of the run if None; lead: s of each flank; alpha: share
    of the flanks that is a cosine, as in a Tukey window of twice their samples.
    """

    start: float | None = None
    stop: float | None = None
    lead: float = 0.4
    alpha: float = 0.95

    def __post_init__(self):
        for name in ("start", "stop"):
            if getattr(self, name) is not None:
                number("Tukey", name, getattr(self, name), least=0.0)
        number("Tukey", "lead", self.lead, least=0.0)
        number("Tukey", "alpha", self.alpha, least=0.0, most=1.0)

    def weights(self, samples: int, period: float) -> np.ndarray:
        """Weights (N,) of samples every period s from zero. Raises ModelError for a window that does not fit the run."""
        from scipy.signal.windows import tukey

        first = 0 if self.start is None else round(self.start / period)
        last = samples if self.stop is None else round(self.stop / period)
        flank = round(self.lead / period)
        if not (0 <= first < last <= samples):
            raise ModelError(
                f"Tukey: found a window from {first * period:g} to {last * period:g} s, expected one within the run of "
                f"{samples * period:g} s"
            )
        if not 2 * flank <= last - first:
            raise ModelError(
                f"Tukey: found flanks of {flank * period:g} s in a window of {(last - first) * period:g} s, expected both "
                "to fit; take a shorter lead"
            )
        found = np.zeros(samples)
        shape = tukey(2 * flank, self.alpha)
        found[first:last] = 1.0
        found[first : first + flank] = shape[:flank]
        found[last - flank : last] = shape[flank:]
        return found

    def plot(self, samples: int, period: float, *, file: str | os.PathLike[str] | None = None) -> "Figure":
        """Weights over time: Dressler (2012), Figure 7.4. Raises ModelError as `weights` does."""
        import matplotlib.pyplot as plt

        if file is not None:
            check_suffix(file)
        weights = self.weights(samples, period)
        figure, axis = plt.subplots(figsize=(6.4, 2.8), layout="constrained")
        axis.plot(period * np.arange(samples), weights)
        axis.set(xlabel="time [s]", ylabel="weight of corrections")
        axis.grid(alpha=0.3)
        return finished(figure, file)

    def full(self, samples: int, period: float) -> np.ndarray:
        """Where weights are one, (N,): the part by which errors are judged, (7.25)."""
        return self.weights(samples, period) == 1.0
