"""Poses of robots with linear guideways, their carts by the quadratic equation of each arm; SI units."""

import numpy as np

from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica.calibration.design.identifiability import PoseArrays
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure, read_arms
from gantrytau_optimica.calibration.links.arm_poses import poses_of


def carts(arms: tuple[ArmClosure, ...], r: np.ndarray, R: np.ndarray) -> np.ndarray:
    """The carts behind the tool that close the first link of each arm, (N, 3)."""
    q = np.empty((len(r), 3))
    for i, arm in enumerate(arms):
        link = arm.links[0]
        on_plate = R @ arm.values.get(f"{link}.plate_offset", np.zeros(3))
        d, v = r + on_plate - arm.values[f"{link}.offset"], arm.values[f"{arm.name}.direction"]
        squares = (d**2).sum(axis=1) - arm.values[f"{link}.length"] ** 2
        q[:, i] = (d @ v - np.sqrt((d @ v) ** 2 - v @ v * squares)) / (v @ v)
    return q


def three_link_poses(count: int, *, seed: int = 0) -> PoseArrays:
    """In a box of 1.6 x 0.8 x 0.6 m before an L1."""
    r = np.array([0.5, 2.8, -0.8]) + np.random.default_rng(seed).uniform(-1, 1, (count, 3)) * [0.8, 0.4, 0.3]
    return PoseArrays(
        carts(read_arms(GantryTau(prototypes.L1)), r, np.tile(np.eye(3), (count, 1, 1))), r, None
    )


def six_link_poses(count: int, *, seed: int = 0) -> PoseArrays:
    """In a box of 1.2 x 0.8 x 0.8 m before a D1, in its nominal orientation but for what its links add."""
    arms = read_arms(SixLinkGantryTau(prototypes.D1))
    r = np.array([-0.4, -4.5, 0.1]) + np.random.default_rng(seed).uniform(-1, 1, (count, 3)) * [0.6, 0.4, 0.4]
    R = np.tile(np.array(prototypes.D1.plate_rotation), (count, 1, 1))
    q = carts(arms, r, R)
    return PoseArrays(q, *poses_of(arms, q, r, R))
