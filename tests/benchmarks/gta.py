"""GT-A: carry the tool of the L1 robot from A to B, the task that the thesis' Table 3.1 resembles.

Motor torques (N.m) act through a gear: gear * torque = f is the actuator force before friction. Cost: the
time plus `weight` times the sum of the integrals of the squared torques.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tests.benchmarks.closed_form import GT_A, ThreeLink


@dataclass(frozen=True)
class Task:
    """A motion from rest to rest and what limits it."""

    robot: ThreeLink = GT_A
    start: tuple[float, float, float] = (0.0, 2.51, -1.03)  # m
    end: tuple[float, float, float] = (1.711, 3.46, -0.24)  # m
    torque_limit: float = 6.337  # N.m
    gear: float = 190.5  # N per N.m
    weight: float = 0.0  # s per (N.m)^2.s
    line: bool = False  # along the straight line
    guessed_time: float = 1.0  # s
    least_reach: float = 0.0  # m by which the tool stays ahead of each cart


ROWS = {  # 50 elements, 3 Radau points, tanh friction: time in s, energy in (N.m)^2.s
    "free path, w = 0": (Task(), 0.91351, 106.2),
    "free path, w = 0.001": (Task(weight=0.001), 0.92103, 72.4),
    "free path, w = 0.01": (Task(weight=0.01), 0.97598, 54.5),
    "straight line, w = 0": (Task(line=True), 0.97406, 57.18),
}


def trapezoid(fraction: np.ndarray, ramp: float = 0.3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, speed and acceleration on [0, 1] of a motion from 0 to 1 with trapezoidal speed.

    ramp: fraction of the time spent on speeding up, and again on slowing down.
    """
    top = 1 / (1 - ramp)
    fraction = np.asarray(fraction, dtype=float)
    left = np.minimum(fraction, 1 - fraction)  # the motion is symmetric about its middle
    speed = top * np.minimum(left / ramp, 1.0)
    half = np.where(left < ramp, top * left**2 / (2 * ramp), top * (left - ramp / 2))
    position = np.where(fraction < 0.5, half, 1 - half)
    acceleration = np.where(left < ramp, np.sign(0.5 - fraction) * top / ramp, 0.0)
    return position, speed, acceleration


def reaches(robot: ThreeLink, tool: np.ndarray) -> np.ndarray:
    """dX_i (m) of tool positions (n, 3): how far the tool is ahead of each cart, (n, 3); NaN out of reach."""
    across = tool[:, None, 1:] - np.array(robot.offsets)[None, :, 1:]
    with np.errstate(invalid="ignore"):
        return np.sqrt(np.array(robot.lengths) ** 2 - (across**2).sum(axis=2))
