"""Least squares of many small blocks of unknowns that share a few others: Levenberg and Marquardt by Schur complements.

BlockRows of block b know its own unknowns y_b and the shared x, no other block:

    H_b = A_b' A_b      W_b = A_b' C_b      V = sum C_b' C_b + C_0' C_0
    (V - sum W_b' H_b^-1 W_b) dx = -(g - sum W_b' H_b^-1 g_b),    dy_b = -H_b^-1 (g_b + W_b dx)

so that its cost grows with the number of blocks and not with its cube (Triggs et al., Bundle Adjustment, 2000, section 6).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from gantrytau.kinematics.rotations import cross

Array = np.ndarray
ROUNDS = 100
FIRST, MOST = 1e-9, 1e12  # damping, of the diagonal, once a step without it was in vain
EASED = 0.1  # damping after a step that gained, and its inverse after one in vain
ROUNDING = 1e-12  # of the cost
GAIN = 1e-10  # of the cost, or of one standard deviation: what a last step may still gain
State = TypeVar("State")


@dataclass(frozen=True, eq=False)
class BlockRows:
    """Errors (B, m) and derivatives, by_own (B, m, d), by_shared (B, m, S); those of shared unknowns alone, (k,), (k, S)."""

    error: Array
    by_own: Array
    by_shared: Array
    error_0: Array
    by_shared_0: Array

    @property
    def cost(self) -> float:
        """Sum of squares."""
        return float(np.sum(self.error**2) + np.sum(self.error_0**2))


@dataclass(frozen=True, eq=False)
class WithoutOwn:
    """Normal equations without own unknowns: H^-1 (B, d, d), H^-1 W (B, d, S), H^-1 g (B, d), what these alone gain,
    complement (S, S) and right side (S,) of the shared ones.
    """

    own: Array
    coupling: Array
    alone: Array
    gain: float
    complement: Array
    right: Array


def reduced(rows: BlockRows, damping: float = 0.0) -> WithoutOwn:
    """The normal equations of rows; LinAlgError where a block does not determine its own unknowns."""
    turned = rows.by_own.transpose(0, 2, 1)
    H, W, g = turned @ rows.by_own, turned @ rows.by_shared, turned @ rows.error[..., None]
    flat = np.concatenate(
        [rows.by_shared.reshape(rows.error.size, rows.by_shared.shape[-1]), rows.by_shared_0]
    )
    V, right = flat.T @ flat, flat.T @ np.concatenate([rows.error.ravel(), rows.error_0])
    if damping:
        H = H * (1 + damping * np.eye(H.shape[-1]))
        V = V * (1 + damping * np.eye(len(V)))
    own = _inverse(H)
    coupling, alone = own @ W, (own @ g)[..., 0]
    wide = W.reshape(alone.size, len(V))
    complement = V - wide.T @ coupling.reshape(wide.shape)
    gain = float(np.sum(alone[..., None] * g))
    return WithoutOwn(own, coupling, alone, gain, complement, right - wide.T @ alone.ravel())


def minimised(
    state: State, rows_of: Callable[[State], BlockRows], moved: Callable[[State, Array, Array], State]
) -> tuple[State, BlockRows, int]:
    """The state of least squares from one near to it, its rows, and how many steps it took.

    moved: the state after steps (S,) of shared unknowns and (B, d) of own ones.
    """
    rows, damping = rows_of(state), 0.0
    for step in range(1, ROUNDS + 1):
        shared, own, gain = _step(rows, damping)
        if np.isfinite(gain):
            trial = moved(state, shared, own)
            after = rows_of(trial)
            if after.cost <= rows.cost * (1 + ROUNDING):
                state, rows = trial, after
                if gain <= GAIN * max(rows.cost, 1.0):
                    return state, rows, step
                damping = EASED * damping if damping > FIRST else 0.0
                continue
        damping = max(damping / EASED, FIRST)
        if damping > MOST:
            return state, rows, step
    return state, rows, ROUNDS


def _step(rows: BlockRows, damping: float) -> tuple[Array, Array, float]:
    """Steps of shared and own unknowns, and what they should gain of the cost; NaN where rows do not determine them."""
    try:
        equations = reduced(rows, damping)
        shared = -np.linalg.solve(equations.complement, equations.right)
    except np.linalg.LinAlgError:
        return np.zeros(0), np.zeros(0), np.nan
    own = -equations.alone - equations.coupling @ shared
    return shared, own, equations.gain - float(equations.right @ shared)


def _inverse(H: Array) -> Array:
    """Inverses of symmetric (B, d, d); of three by three by cofactors, which is five times as quick for many."""
    if H.shape[-1] != 3:
        return np.linalg.inv(H)
    rows = cross(H[:, [1, 2, 0]], H[:, [2, 0, 1]])
    determinant = np.sum(H[:, 0] * rows[:, 0], axis=-1)
    if not np.all(determinant > 0):
        raise np.linalg.LinAlgError("blocks without an inverse")
    return rows / determinant[:, None, None]
