# What is used of scipy.optimize: without it the type checker reads SciPy's own code, for minutes.
from typing import Any

import numpy as np

class OptimizeResult:
    x: np.ndarray
    fun: Any
    jac: Any
    cost: float
    success: bool
    status: int
    message: str
    nfev: int

def brentq(
    f: Any, a: Any, b: Any, args: tuple[Any, ...] = ..., xtol: float = ..., rtol: float = ...
) -> float: ...
def lsq_linear(A: Any, b: Any, bounds: Any = ..., method: str = ...) -> OptimizeResult: ...
def least_squares(fun: Any, x0: Any, jac: Any = ..., **options: Any) -> OptimizeResult: ...
def minimize(fun: Any, x0: Any, **options: Any) -> OptimizeResult: ...
def root(fun: Any, x0: Any, **options: Any) -> OptimizeResult: ...
