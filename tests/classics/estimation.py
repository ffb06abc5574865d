"""Estimation of rates from published data, beside least squares over another integrator."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from gantrytau_optimica import Optimization, optimize
from tests.classics import methanol
from tests.classics.lines import lines_of
from tests.classics.row import Row
from tests.optimica.known_answers.test_estimation import GAS_OIL, GasOilFit, PineneFit, pinene_by_exponentials

WANTED = 1e-4  # of the objective


@dataclass(frozen=True)
class Estimation:
    """A fit, its source, the sum of squares printed there, and the same sum by other means."""

    fit: type[Optimization]
    source: str
    printed: float
    converged: Callable[[], float]
    note: str = ""

    @property
    def name(self) -> str:
        """That of its fit."""
        return self.fit.__name__


def by_least_squares(
    rates: Callable[..., Sequence[float]], data: np.ndarray, start: Any, guess: Any
) -> float:
    """The least sum of squares of the states less data, rows of time and states."""

    def residuals(k: np.ndarray) -> np.ndarray:
        span, times = (0.0, data[-1, 0]), data[:, 0]
        found = solve_ivp(lambda t, z: rates(k, z), span, start, "LSODA", times, rtol=1e-11, atol=1e-12)
        return (found.y.T - data[:, 1:]).ravel()

    found: Any = least_squares(residuals, guess, bounds=(0.0, np.inf), xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return 2 * float(found.cost)


def _cracking(k: np.ndarray, z: np.ndarray) -> list[float]:
    return [-(k[0] + k[2]) * z[0] ** 2, k[0] * z[0] ** 2 - k[1] * z[1]]


PROBLEMS = (
    Estimation(
        methanol.MethanolFit,
        "COPS 3, problem 5",
        9.02229e-3,
        lambda: by_least_squares(methanol.rates, np.array(methanol.DATA), [1.0, 0.0, 0.0], np.ones(5)),
        "the fifth rate ends at its limit 0",
    ),
    Estimation(PineneFit, "COPS 3, problem 4", 19.8721, lambda: pinene_by_exponentials()[0]),
    Estimation(
        GasOilFit,
        "COPS 3, problem 3",
        5.23664e-3,
        lambda: by_least_squares(_cracking, GAS_OIL, [1.0, 0.0], [10.0, 8.0, 1.0]),
        "data lie inside of elements, whose values are less exact than those of their ends: `elements=38` gives 5.23664e-3",
    ),
)


def run(estimation: Estimation) -> Row:
    """The fit with all defaults, and the same sum by other means."""
    begin = time.process_time()
    found = optimize(estimation.fit)
    seconds = time.process_time() - begin
    converged = estimation.converged()
    error = abs(found.objective / converged - 1)
    return {
        "source": estimation.source,
        "lines": lines_of(estimation.fit),
        "objective": f"{found.objective:.7g}",
        "converged": f"{converged:.7g}",
        "error": error,
        "printed": f"{estimation.printed:.6g}",
        "iterations": found.iterations,
        "seconds": round(seconds, 3),
        "note": estimation.note,
        "held": bool(found.success and error <= WANTED),
    }
