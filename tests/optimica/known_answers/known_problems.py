"""Independent computations to which known answers are compared: roots, motions, free minima."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize, root


def zero(function: Callable[[float], Any], low: float, high: float) -> float:
    """The number between low and high at which the function is zero, to rounding."""
    found: Any = brentq(function, low, high, xtol=1e-14)
    return float(found)


def zeros(function: Callable[[np.ndarray], Any], guess: Sequence[float]) -> np.ndarray:
    """The vector near the guess at which all functions are zero, (n,); asserts that they are."""
    found: Any = root(function, np.asarray(guess, dtype=float), tol=1e-13)
    assert np.max(np.abs(function(found.x))) < 1e-9
    return np.asarray(found.x)


def least(function: Callable[[np.ndarray], Any], guess: Sequence[float]) -> float:
    """The least value near the guess, by a search without derivatives, started again where it ends."""
    found: Any = None
    for _ in range(3):
        start = np.asarray(guess, dtype=float) if found is None else found.x
        found = minimize(
            function,
            start,
            method="Nelder-Mead",
            options={"xatol": 1e-10, "fatol": 1e-14, "maxiter": 20000, "maxfev": 20000},
        )
    return float(found.fun)


def motion(
    rates: Callable[[float, Any], Any],
    start: Sequence[float],
    stop: float,
    until: Callable[[float, Any], Any] | None = None,
) -> tuple[float, np.ndarray]:
    """Time and state at stop, or earlier where `until` becomes zero, by Runge-Kutta of order 8 to 1e-11."""
    if until is not None:
        until.terminal = True  # pyright: ignore[reportFunctionMemberAccess]
    found = solve_ivp(rates, (0.0, stop), start, method="DOP853", events=until, rtol=1e-11, atol=1e-12)
    assert found.success
    assert until is None or found.status == 1
    return float(found.t[-1]), np.asarray(found.y[:, -1])
