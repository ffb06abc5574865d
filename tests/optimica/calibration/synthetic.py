"""Synthetic measurements of the L1: poses on a grid, noise of a laser tracker."""

from dataclasses import replace

import numpy as np

from gantrytau_models import GantryTau, prototypes

GRID = ((0.0, 1.3, 12), (2.42, 3.58, 9), (-1.3, 0.0, 8))  # m, m, points along x, y, z
NOISE = 10e-6  # m, per axis


def three_links(prototype):
    """Lengths (3,), offsets (3, 3) and directions (3, 3) of a record."""
    return (
        np.array([arm.length for arm in prototype.arms]),
        np.array([arm.offset for arm in prototype.arms]),
        np.array([arm.direction for arm in prototype.arms]),
    )


def inverse(prototype, r):
    """Cart positions of three links (4.9), carts behind the tool; NaN out of reach."""
    L, A, v = three_links(prototype)
    d = r[:, None] - A
    p, n = (d * v).sum(-1), (v * v).sum(-1)
    with np.errstate(invalid="ignore"):
        return (p - np.sqrt(p * p - n * ((d * d).sum(-1) - L**2))) / n


def grid(prototype, count=779):
    """Tool positions on a grid within reach, and their cart positions."""
    axes = [np.linspace(low, high, n) for low, high, n in GRID]
    r = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    q = inverse(prototype, r)
    good = np.flatnonzero(np.isfinite(q).all(axis=1))
    rows = good[np.linspace(0, len(good) - 1, count).round().astype(int)]
    return q[rows], r[rows]


def disturbed(prototype, size, seed=1):
    """A record whose lengths and offsets are off by `size` m, directions by a tenth of it, as by tape measure."""
    noise = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(prototype.arms), 7))
    arms = [
        replace(
            arm,
            length=arm.length + size * n[0],
            offset=tuple(np.add(arm.offset, size * n[1:4])),
            direction=tuple(np.add(arm.direction, 0.1 * size * n[4:])),
        )
        for arm, n in zip(prototype.arms, noise, strict=True)
    ]
    return replace(prototype, arms=tuple(arms))


def nominal(size=0.01, seed=1):
    """An L1 as measured by tape."""
    return GantryTau(disturbed(prototypes.L1, size, seed))
