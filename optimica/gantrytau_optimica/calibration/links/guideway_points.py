"""Measured guideways: cart positions between measured points (5.6), (5.7)."""

import numpy as np


def between(rail: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Points on a guideway, (N, 3) in m, along straight lines between measured points; ends go on straight.

    rail: (k, 4) the columns q, x, y, z, rising; q: (N,).
    """
    k = np.clip(np.searchsorted(rail[:, 0], q) - 1, 0, len(rail) - 2)
    return rail[k, 1:] + (q - rail[k, 0])[:, None] * slope(rail, q)


def slope(rail: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Derivatives of `between` by q, (N, 3)."""
    k = np.clip(np.searchsorted(rail[:, 0], q) - 1, 0, len(rail) - 2)
    return (rail[k + 1, 1:] - rail[k, 1:]) / (rail[k + 1, 0] - rail[k, 0])[:, None]


def straight(rail: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The straight guideway nearest to measured points: its point at q = 0 and its direction, (3,) each."""
    design = np.column_stack([np.ones(len(rail)), rail[:, 0]])
    found = np.linalg.lstsq(design, rail[:, 1:], rcond=None)[0]
    return found[0], found[1]
