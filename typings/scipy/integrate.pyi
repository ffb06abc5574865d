from typing import Any

import numpy as np

class OdeResult:
    t: np.ndarray
    y: np.ndarray
    sol: Any
    t_events: Any
    y_events: Any
    nfev: int
    status: int
    message: str
    success: bool

class BvpResult:
    sol: Any
    p: Any
    x: np.ndarray
    y: np.ndarray
    status: int
    message: str
    success: bool

def solve_ivp(
    fun: Any, t_span: Any, y0: Any, method: Any = ..., t_eval: Any = ..., **options: Any
) -> OdeResult: ...
def solve_bvp(fun: Any, bc: Any, x: Any, y: Any, p: Any = ..., **options: Any) -> BvpResult: ...
def quad(func: Any, a: float, b: float, **options: Any) -> tuple[float, float]: ...
def trapezoid(y: Any, x: Any = ..., dx: float = ..., axis: int = ...) -> Any: ...
