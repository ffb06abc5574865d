"""A minimum-time motion as an engineer writes it down, and what became of it; all peers transcribe the same one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import casadi as ca
import numpy as np

Columns = tuple[np.ndarray, np.ndarray, np.ndarray]  # x, z and u at n places, each (k, n)

IPOPT = {
    "print_level": 0,
    "sb": "yes",
    "mu_strategy": "adaptive",
    "linear_solver": "mumps",
    "mumps_pivot_order": 6,  # with MUMPS' own the six links are not solved on 50 elements
    "max_wall_time": 120.0,
}


@dataclass(frozen=True, eq=False)
class Motion:
    """From `start` to `end` as fast as `limits` and `path_limits` allow.

    x' = ode(x, z, u),  0 = residual(x, z, u),  lower <= path(x, z, u) <= upper

    limits: lower and upper of x, z and u, each a pair of columns; ramps: u is a straight line in each element,
    otherwise it is free at every collocation point. guess: x, z and u at shares of the motion.
    """

    x: ca.SX
    z: ca.SX
    u: ca.SX
    ode: ca.SX
    residual: ca.SX
    path: ca.SX
    path_limits: tuple[float, float]
    limits: tuple[np.ndarray, np.ndarray]  # (nx + nz + nu,)
    start: np.ndarray
    end: np.ndarray
    guess: Callable[[np.ndarray], Columns]
    guessed_time: float
    times: tuple[float, float] = (0.1, 10.0)  # s, between which the duration lies
    ramps: bool = False

    def point(self) -> ca.Function:
        """(x, z, u) -> slopes, residuals, path."""
        outputs = [self.ode, self.residual, self.path]
        return ca.Function("point", [self.x, self.z, self.u], outputs, {"cse": True})

    def parts(self, values: np.ndarray) -> list[np.ndarray]:
        """A column of limits as those of x, z and u."""
        return np.split(values, np.cumsum([self.x.numel(), self.z.numel()]))


@dataclass(frozen=True)
class Outcome:
    """What a run found, and how much of a processor it took."""

    time: float  # s, duration of the motion
    iterations: int
    build: float  # s
    solve: float  # s
    success: bool
    variables: int

    @property
    def total(self) -> float:
        """Build and solve, s."""
        return self.build + self.solve
