"""Systems that the same data allow, of another order or without a drift, beside the one that was asked for."""

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
) -> list[Finding]:
    """Kinds "drift" and "order": outputs without their straight lines, and the order at which noise begins."""
    order = len(system[0])
    t = np.linspace(-1.0, 1.0, len(u))[:, None]
    slope = np.sum(t * y, axis=0) / np.sum(t * t)
    level = y - t * slope
    drifts = float(np.sum((t * slope) ** 2)) > LINE * _left(system, u, y)
    told = min(int(np.sum(space.correlations > noise)), (block_rows - 1) * y.shape[1])
    trials = [("drift", shared_space(u, level, block_rows), order, level)] if drifts else []
    for kind, other, n, values in [*trials, ("order", space, told, y)]:
        if len(other.correlations) < n or (kind == "order" and told <= order):
            continue
        before, after = _left(system, u, values), _left(system_of(other, n, u, values), u, values)
        if after < HALF * before:
            by, to = _share(after, values), _share(before, values)
            words = {
                "drift": f"outputs drift by up to {2 * np.max(np.abs(slope)):.3g} of their deviations over the samples: "
                f"without these lines a system of order {n} explains {by} of them, and this one {to}; take straight lines "
                "out of the outputs, or measure them without drift",
                "order": f"a system of order {n} explains {by} of the outputs, this one of order {order} {to}; take a "
                "higher order: look at plot_singular_values()",
            }
            return [Finding(kind, np.zeros(0, dtype=int), words[kind])]
    return []


def _left(system: Matrices, u: np.ndarray, y: np.ndarray) -> float:
    """Sum of squares that a system leaves of y, simulated."""
    with np.errstate(over="ignore", invalid="ignore"):
        left = float(np.sum((y - followed(system, u, y)) ** 2))
    return left if np.isfinite(left) else np.inf


def _share(left: float, y: np.ndarray) -> str:
    return f"{max(1 - left / float(np.sum((y - y.mean(axis=0)) ** 2)), 0.0):.0%}"
