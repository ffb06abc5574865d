"""What sensors read of a run, with noise."""

from collections.abc import Mapping

import numpy as np

from gantrytau import Result
from gantrytau_optimica.learning.run_variation import Scatter


def with_readings(
    run: Result, true: Mapping[str, np.ndarray], unit: str, noise: Scatter, random: np.random.Generator
) -> Result:
    """A run with `measured.q`, `.r`, `.a` and `.f`, of those letters that are known truly, (N, n) each; unit: of q."""
    values = {name: run[name] for name in run.names}
    units = {name: run.unit(name) for name in run.names}
    deviations = {"q": noise.encoder, "r": noise.gauge, "a": noise.accelerometer, "f": 0.0}
    for letter, exact in true.items():
        read = exact + deviations[letter] * random.standard_normal(exact.shape)
        values |= {f"measured.{letter}[{k}]": column for k, column in enumerate(read.T)}
        force = "N" if unit == "m" else "N.m"
        units[f"measured.{letter}"] = {"q": unit, "r": "m", "a": "m/s2", "f": force}[letter]
    return Result(run.time, values, units=units, title=run.title)


def period_means(before: np.ndarray, behind: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Means (N,) around samples, of values before and behind each and half a period later, (N,) each.

    q(t + h) - 2 q(t) + q(t - h) is h^2 times the mean of q'' that falls to both sides linearly, over h: so weighed, a force
    that jumps with the samples goes with sampled positions, and no other mean does. Simpson's rule on either side.
    """
    later, earlier = (behind + 2 * half) / 3, (before[1:] + 2 * half[:-1]) / 3
    means = np.append(later[:1], earlier)
    means[1:-1] = (means[1:-1] + later[1:-1]) / 2
    return means
