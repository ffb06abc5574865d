"""A plate that drives turn and carry, and synthetic logs of it with turns as small or as large as asked."""

from functools import cache

import casadi as ca
import numpy as np

from gantrytau import Array, Input, Model, Real, connect, translate
from gantrytau.mechanics.multibody import Body, Prismatic, Revolute, World
from gantrytau.mechanics.rotational import Torque
from gantrytau.mechanics.translational import Force
from gantrytau_optimica import MotionLog

RATE, DURATION = 100.0, 20.0  # Hz, s
NOISE = (60.0, 6.0)  # N, N.m
MASS, CENTRE = 9.0, (0.03, -0.02, 0.05)
INERTIA = np.array([[0.25, 0.01, 0.0], [0.01, 0.2, -0.02], [0.0, -0.02, 0.3]])


class Slide(Model):
    """A driven joint that slides along n."""

    def __init__(self, n=(1.0, 0.0, 0.0), **modifications):
        super().__init__(dict(joint=dict(n=list(n))), **modifications)

    s = Real(unit="m", description="coordinate")
    f = Input(unit="N", description="force of the drive", start=0.0)
    joint = Prismatic()
    motor = Force()

    def equations(self):
        yield connect(self.motor.flange, self.joint.axis)
        yield self.s == self.joint.s
        yield self.f == self.motor.f


class Turn(Model):
    """A driven joint that turns about n."""

    def __init__(self, n=(1.0, 0.0, 0.0), **modifications):
        super().__init__(dict(joint=dict(n=list(n))), **modifications)

    phi = Real(unit="rad", description="angle")
    tau = Input(unit="N.m", description="torque of the drive", start=0.0)
    joint = Revolute()
    motor = Torque()

    def equations(self):
        yield connect(self.motor.flange, self.joint.axis)
        yield self.phi == self.joint.phi
        yield self.tau == self.motor.tau


class Carried(Model):
    """A plate on three slides and three turns in a row, each driven."""

    world = World()
    slides = Array(Slide, [Slide(n=n) for n in np.eye(3)])
    turns = Array(Turn, [Turn(n=n) for n in np.eye(3)])
    tool = Body(m=MASS, r_cm=list(CENTRE), J=INERTIA)

    def equations(self):
        frame = self.world.frame_b
        for drive in (*self.slides, *self.turns):
            yield connect(frame, drive.joint.frame_a)
            frame = drive.joint.frame_b
        yield connect(frame, self.tool.frame_a)


JOINTS = [*(f"slides[{i}].s" for i in range(3)), *(f"turns[{i}].phi" for i in range(3))]
DRIVES = [*(f"slides[{i}].f" for i in range(3)), *(f"turns[{i}].tau" for i in range(3))]


@cache
def motion(turn: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """t, q and forces of the plate; turn: amplitude of its angles, rad."""
    t = np.arange(int(RATE * DURATION)) / RATE
    q, v, a = (np.zeros((len(t), 6)) for _ in range(3))
    for i, size in enumerate([0.2] * 3 + [turn] * 3):
        for k, hz in enumerate((0.23 + 0.05 * i, 0.8 + 0.09 * i)):
            w, lag, part = 2 * np.pi * hz, 1.3 * i + k, size / (1 + k)
            q[:, i] += part * np.sin(w * t + lag)
            v[:, i] += part * w * np.cos(w * t + lag)
            a[:, i] -= part * w**2 * np.sin(w * t + lag)
    names = [*JOINTS, *(f"der({n})" for n in JOINTS), *(f"der(der({n}))" for n in JOINTS)]
    f = translate(Carried()).function(given=names, find=DRIVES).map(len(t))(*np.hstack([q, v, a]).T[:, None])
    return t, q, np.asarray(ca.vertcat(*f)).T


def log(turn: float, seed: int, noise: float = 1.0) -> MotionLog:
    """A log with white noise of the forces, in shares of NOISE."""
    t, q, f = motion(turn)
    return MotionLog(
        t, q, f + noise * np.repeat(NOISE, 3) * np.random.default_rng(seed).standard_normal(f.shape)
    )
