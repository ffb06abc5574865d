"""Systems that the same data allow, of another order or without a drift, beside the one that was asked for."""

from collections.abc import Iterator

import numpy as np

from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.systems.linear_fit import followed, input_matrices
from gantrytau_optimica.identification.systems.subspace import SharedSpace, shared_space

HALF = 0.5  # of the squares that the system leaves, below which another explains its data better
LINE = 0.05  # of these squares: straight lines of less cannot halve them, and are not looked at

Matrices = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]


def system_of(space: SharedSpace, order: int, u: np.ndarray, y: np.ndarray) -> Matrices:
    """A, B, C, D of an order, for u (N, m) and y (N, p) about their means."""
    A, C = space.system(order)
    B, D = input_matrices(A, C, u, y)
    return A, B, C, D


def others_explain_more(
    system: Matrices, space: SharedSpace, noise: float, u: np.ndarray, y: np.ndarray, block_rows: int
) -> Iterator[Finding]:
    """Kinds "drift" and "order": outputs without their straight lines, and the order at which noise begins."""
    order, none = len(system[0]), np.zeros(0, dtype=int)
    t = np.linspace(-1.0, 1.0, len(u))[:, None]
    slope = np.sum(t * y, axis=0) / np.sum(t * t)
    level = y - t * slope
    drifts = float(np.sum((t * slope) ** 2)) > LINE * _left(system, u, y)
    steady = shared_space(u, level, block_rows) if drifts else None
    if steady is not None and len(steady.correlations) >= order:
        before, after = _left(system, u, level), _left(system_of(steady, order, u, level), u, level)
        if after < HALF * before:
            yield Finding(
                "drift",
                none,
                f"outputs drift by up to {2 * np.max(np.abs(slope)):.3g} of their deviations over the samples: without "
                f"these lines a system of order {order} explains {_share(after, level)} of them, and this one "
                f"{_share(before, level)}; take straight lines out of the outputs, or measure them without drift",
            )
            return
    told = min(int(np.sum(space.correlations > noise)), (block_rows - 1) * y.shape[1])
    if told > order:
        before, after = _left(system, u, y), _left(system_of(space, told, u, y), u, y)
        if after < HALF * before:
            yield Finding(
                "order",
                none,
                f"a system of order {told} explains {_share(after, y)} of the outputs, this one of order {order} "
                f"{_share(before, y)}; take a higher order: look at plot_singular_values()",
            )


def _left(system: Matrices, u: np.ndarray, y: np.ndarray) -> float:
    """Sum of squares that a system leaves of y, simulated."""
    with np.errstate(over="ignore", invalid="ignore"):
        left = float(np.sum((y - followed(system, u, y)) ** 2))
    return left if np.isfinite(left) else np.inf


def _share(left: float, y: np.ndarray) -> str:
    return f"{max(1 - left / float(np.sum((y - y.mean(axis=0)) ** 2)), 0.0):.0%}"
