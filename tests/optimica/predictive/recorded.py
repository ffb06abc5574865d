"""A run of an `Mpc` with all that it measured and gave, sample by sample."""

from typing import Any

import numpy as np

from gantrytau_optimica import Mpc


def recorded_run(mpc: Mpc, **keywords: Any) -> tuple[np.ndarray, np.ndarray]:
    """Measured states (n, x) and inputs (n, u) of `mpc.run(**keywords)`."""
    step, states, inputs = mpc.step, [], []

    def told(measured: dict[str, float], t: float) -> dict[str, float]:
        given = step(measured, t)
        states.append(list(measured.values()))
        inputs.append(list(given.values()))
        return given

    mpc.step = told  # type: ignore[method-assign]
    mpc.run(**keywords)
    mpc.step = step  # type: ignore[method-assign]
    return np.array(states), np.array(inputs)
