"""Synthetic measurements of the D1: a robot whose guideways bend, whose racks are uneven and whose carts give way.

176 poses in six layers, and 28 points on each guideway, 50 mm apart, as in section 5.3 of Dressler (2012). The sizes of
what is wrong with the robot are chosen such that the five models come out as in Table 5.3.
"""

from dataclasses import dataclass

import numpy as np

from gantrytau_models import prototypes

LINKS = np.array([0, 1, 1, 2, 2, 2])  # the arm of each link
PLACEMENT = 2e-3  # m, by which joints on the plate are off a parallelogram, one standard deviation
BEND = np.array([30e-6, 130e-6, 45e-6])  # m, amplitude of the bends of the guideways
CYCLE = np.array([50e-6, 45e-6, 25e-6])  # m, along the guideway, from the rack
PITCH = 12.3e-3  # m, of the rack
LOAD = np.array([80e-6, 80e-6, 40e-6])  # of a cart, for each metre that the tool is off the middle
STROKE = (-0.65, 0.70)  # m
NOISE, ANGLE_NOISE = 10e-6, 5e-5  # m per axis; rad per axis


@dataclass(frozen=True)
class D1:
    """A D1 of its own: lengths (6,), offsets (6, 3), joints on the plate (6, 3), directions (3, 3), errors of guideways."""

    lengths: np.ndarray
    offsets: np.ndarray
    on_plate: np.ndarray
    directions: np.ndarray
    waves: np.ndarray  # (3, waves, 3): amplitudes, across and along
    phases: np.ndarray
    cycle: np.ndarray  # (3,)
    load: np.ndarray  # (3, 3, 3): shift of a cart by the place of the tool

    def deviation(self, i, q):
        """How far cart i is off its straight guideway at q, (N, 3), without load."""
        waves = np.arange(1, self.waves.shape[1] + 1)
        angle = np.pi * waves * (q[:, None] - STROKE[0]) / (STROKE[1] - STROKE[0]) + self.phases[i]
        rack = CYCLE[i] * np.sin(2 * np.pi * q / PITCH + self.cycle[i])
        return np.sin(angle) @ self.waves[i] + rack[:, None] * self.directions[i]

    def joints(self, q, r):
        """Joints on the carts (N, 6, 3)."""
        A = np.empty((len(q), 6, 3))
        for k, i in enumerate(LINKS):
            A[:, k] = self.offsets[k] + q[:, i, None] * self.directions[i] + self.deviation(i, q[:, i])
            A[:, k] += (r - MIDDLE) @ self.load[i].T
        return A


MIDDLE = np.array([-1.40, -4.45, 0.05])  # m, of the workspace


def make_d1(seed):
    """A D1 with errors of its own."""
    rng = np.random.default_rng(seed)
    record = prototypes.D1
    links = [link for arm in record.arms for link in arm.links]
    directions = np.array([arm.direction for arm in record.arms])
    on_plate = np.array([link.plate_offset for link in links])
    # joints on the carts where a parallelogram has them, then all joints on the plate a little off
    R = np.array(record.plate_rotation)
    R = R @ np.linalg.inv(np.linalg.cholesky(R.T @ R).T)
    single = np.array([record.arms[i].offset for i in LINKS])
    offsets = single + on_plate @ R.T + rng.normal(0, PLACEMENT, (6, 3))
    waves = rng.normal(size=(3, 6, 3)) / np.arange(1, 7)[None, :, None]
    waves *= (BEND / np.linalg.norm(waves, axis=(1, 2)))[:, None, None] * 2.0
    load = rng.normal(size=(3, 3, 3))
    load *= (LOAD / np.linalg.norm(load, axis=(1, 2)))[:, None, None]
    return D1(
        np.array([record.arms[i].length for i in LINKS]) + rng.normal(0, 2e-5, 6),
        offsets,
        on_plate,
        directions,
        waves,
        rng.uniform(0, 2 * np.pi, (3, 6)),
        rng.uniform(0, 2 * np.pi, 3),
        load,
    ), R


def pose_of(robot, q, r, R):
    """Poses (r, R) that the six links allow, by Newton from a guess."""
    for _ in range(12):
        arm = robot.on_plate @ np.swapaxes(R, 1, 2)
        y = r[:, None] + arm - robot.joints(q, r)
        error = ((y**2).sum(-1) - robot.lengths**2) / 2
        step = np.linalg.solve(np.concatenate([y, np.cross(arm, y)], axis=2), error[..., None])[..., 0]
        r = r - step[:, :3]
        R = turned(-step[:, 3:]) @ R
    return r, R


def turned(w):
    """Rotations by small vectors (N, 3), to machine precision after they are made orthogonal."""
    K = np.zeros((len(w), 3, 3))
    K[:, 0, 1], K[:, 0, 2], K[:, 1, 2] = -w[:, 2], w[:, 1], -w[:, 0]
    K -= K.transpose(0, 2, 1)
    left, _, right = np.linalg.svd(np.eye(3) + K)
    return left @ right


def measure(seed, poses=176):
    """q (N, 3), r (N, 3), R (N, 3, 3) and the points of three guideways (28, 4) in a frame of their own."""
    robot, R = make_d1(seed)
    rng = np.random.default_rng(1000 + seed)
    axes = [np.linspace(-0.4, 0.4, 6), np.linspace(-0.5, 0.5, 6), np.linspace(-0.4, 0.4, 5)]
    r = MIDDLE + np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    r = r[np.linspace(0, len(r) - 1, poses).round().astype(int)]
    q = np.empty((len(r), 3))
    for i, arm in enumerate(prototypes.D1.arms):
        d, v = r - np.array(arm.offset), np.array(arm.direction)
        p = d @ v
        q[:, i] = (p - np.sqrt(p * p - v @ v * ((d * d).sum(-1) - arm.length**2))) / (v @ v)
    r, R = pose_of(robot, q, r, np.broadcast_to(R, (len(r), 3, 3)))
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    frame *= np.sign(np.linalg.det(frame))
    along, rails = np.linspace(*STROKE, 28), []
    for i in range(3):
        points = along[:, None] * robot.directions[i] + robot.deviation(i, along)
        points = points @ frame.T + rng.normal(size=3) + rng.normal(0, NOISE, (28, 3))
        rails.append(np.column_stack([along, points]))
    R = turned(rng.normal(0, ANGLE_NOISE, (len(r), 3))) @ R
    return q, r + rng.normal(0, NOISE, r.shape), R, rails
