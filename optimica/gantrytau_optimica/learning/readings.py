"""What sensors read of a run, with noise."""

from collections.abc import Mapping

import numpy as np

from gantrytau import Result
from gantrytau_optimica.learning.scatter import Scatter


def with_readings(
    run: Result, true: Mapping[str, np.ndarray], unit: str, noise: Scatter, random: np.random.Generator
) -> Result:
    """A run with `measured.q`, `.r` and `.a`, of those letters that are known truly, (N, n) each; unit: of q."""
    values = {name: run[name] for name in run.names}
    units = {name: run.unit(name) for name in run.names}
    deviations = {"q": noise.encoder, "r": noise.gauge, "a": noise.accelerometer}
    for letter, exact in true.items():
        read = exact + deviations[letter] * random.standard_normal(exact.shape)
        values |= {f"measured.{letter}[{k}]": column for k, column in enumerate(read.T)}
        units[f"measured.{letter}"] = {"q": unit, "r": "m", "a": "m/s2"}[letter]
    return Result(run.time, values, units=units, title=run.title)
