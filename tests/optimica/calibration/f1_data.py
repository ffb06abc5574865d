"""Measurements of an F1 made without the package's kinematics: carts and turntables drawn, the plate by Newton."""

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from gantrytau_models import F1GantryTau, prototypes
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure, Orientation, read_arms
from gantrytau_optimica.calibration.links.arm_poses import poses_of
from tests.references import f1

DEVICE = 1e-5  # m, of a laser tracker, per axis
ANGLE = 2e-5  # rad, of a T-Mac, per axis


class Poses(NamedTuple):
    q: np.ndarray
    r: np.ndarray
    R: np.ndarray


def f1_arms(orientation: Orientation = "local", *, name="F1", gains=False) -> tuple[ArmClosure, ...]:
    return read_arms(F1GantryTau(getattr(prototypes, name)), orientation, gains=gains)


def f1_poses(arms: tuple[ArmClosure, ...], count: int, *, seed: int = 0) -> Poses:
    """Poses of the plate below the carts, carts within 0.4 m of each other, plate turned up to 20 degrees either way."""
    # two in a hundred are singular or out of reach
    rng, drawn = (np.random.default_rng(seed), count + count // 20 + 2)
    carts = 0.4 + rng.uniform(-0.2, 0.2, (drawn, 3)) + rng.uniform(-0.35, 0.35, (drawn, 1))
    tilt = np.radians(20.0) * rng.uniform(-1, 1, (drawn, 2))
    q = np.column_stack([carts, tilt[:, 0], -tilt[:, 0], tilt[:, 1]])
    r, R = np.tile(f1.HOME, (drawn, 1)), np.tile(f1.nominal_rotation(prototypes.F1), (drawn, 1, 1))
    for part in np.linspace(0.1, 1.0, 10):  # led there, so that the plate stays on its branch
        on_way = f1.HOME_Q + part * (q - f1.HOME_Q)
        r, turned = poses_of(arms, on_way, r, R, all_of_them=False)
        there = np.isfinite(r).all(axis=1)
        q, r, R = q[there], r[there], np.asarray(turned)[there]
    return Poses(q[:count], r[:count], R[:count])


def measured(poses: Poses, *, seed: int, device: float = DEVICE, angle: float = ANGLE) -> Poses:
    rng = np.random.default_rng(seed)
    turn = Rotation.from_rotvec(angle * rng.standard_normal((len(poses.r), 3))).as_matrix()
    return Poses(poses.q, poses.r + device * rng.standard_normal(poses.r.shape), turn @ poses.R)
