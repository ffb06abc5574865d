"""Mechanisms of the IFToMM benchmark library (Gonzalez and others, 2006; lim.ii.udc.es/mbsbenchmark), from components."""

from typing import Any

import numpy as np

from gantrytau import Array, Fixed, Model, Start, connect
from gantrytau.mechanics import multibody, translational
from tests.mechanisms.rows import row

X, Y, Z = ([float(k == axis) for k in range(3)] for axis in range(3))


def bar(r: list[float], thick: float = 0.0, m: float = 1.0) -> dict[str, Any]:
    """What makes a body a uniform bar of square section, from its frame to r along an axis of it."""
    size = np.where(r, np.abs(r), thick) ** 2
    return dict(m=m, r_cm=[x / 2 for x in r], J=np.diag(m * (size.sum() - size) / 12).tolist())


class SimplePendulum(Model):
    """A01: a point of 1 kg on a massless bar of 1 m, released from the horizontal."""

    world = multibody.World(gravity=[0.0, -9.81, 0.0])
    hinge = multibody.Revolute(n=Z, phi=Fixed(0.0), w=Fixed(0.0))
    rod, mass = multibody.FixedTranslation(r=X), multibody.PointMass(m=1.0)

    def equations(self):
        yield from row(self.world, self.hinge, self.rod, self.mass)


def windows(count: int) -> type[Model]:
    """A02: four-bars side by side, slender rods of 1 kg and 1 m; upright, the couplers move at 1 m/s along x."""
    feet = [dict(r=[float(k), 0.0, 0.0]) for k in range(count + 1)]
    starts = [dict(phi=Fixed(0.0), w=Fixed(-1.0)), *(dict(phi=Start(0.0)) for _ in range(count))]

    class NFourBar(Model):
        world = multibody.World(gravity=[0.0, -9.81, 0.0])
        grounds = Array(multibody.Fixed, feet)
        hinges = Array(multibody.Revolute, starts, n=Z)
        uprights, couplers = (
            Array(multibody.Body, count + 1, **bar(Y)),
            Array(multibody.Body, count, **bar(X)),
        )
        up, across = (
            Array(multibody.FixedTranslation, count + 1, r=Y),
            Array(multibody.FixedTranslation, count, r=X),
        )
        left, right = (Array(multibody.Revolute, [dict(phi=Start(0.0))] * count, n=Z) for _ in range(2))

        def equations(self):
            for ground, hinge, body, rod in zip(
                self.grounds, self.hinges, self.uprights, self.up, strict=True
            ):
                yield from row(ground, hinge, body)
                yield connect(hinge.frame_b, rod.frame_a)
            for k, (body, rod) in enumerate(zip(self.couplers, self.across, strict=True)):
                yield from row(self.up[k], self.left[k], body)
                yield from row(self.left[k], rod, self.right[k], self.up[k + 1].frame_b)

    return NFourBar


class Bricard(Model):
    """A04: five square rods in space and six hinges, one motion although the count of constraints leaves none."""

    world = multibody.World(gravity=[0.0, -9.81, 0.0])
    ground = multibody.Fixed(r=Z)
    first = multibody.Revolute(n=Y, phi=Fixed(0.0), w=Fixed(0.0))
    second, third, fourth = multibody.Revolute(n=Z), multibody.Revolute(n=X), multibody.Revolute(n=Y)
    fifth, sixth = multibody.Revolute(n=Z), multibody.Revolute(n=X)
    ways = ([1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    rods = Array(multibody.FixedTranslation, [dict(r=way) for way in ways])
    bodies = Array(multibody.Body, [bar(way, 0.1) for way in ways])

    def equations(self):
        joints = (self.first, self.second, self.third, self.fourth, self.fifth)
        place = self.world.frame_b
        for joint, body, rod in zip(joints, self.bodies, self.rods, strict=True):
            yield from row(place, joint, body)
            yield connect(joint.frame_b, rod.frame_a)
            place = rod.frame_b
        yield from row(place, self.sixth, self.ground)


class FlyballGovernor(Model):
    """A05: a shaft turns with two arms and their balls, which pull a slider up by stiff springs with dampers."""

    world = multibody.World()
    bearing = multibody.Revolute(n=Z, phi=Fixed(0.0), w=Fixed(2 * np.pi))
    slide = multibody.Prismatic(n=Z, s=Fixed(0.5), v=Fixed(0.0))
    shaft = multibody.Body(**bar(Z, 0.01, m=0.3))
    slider = multibody.Body(m=3.0, J=np.diag([0.005] * 3).tolist())
    sides = (1.0, -1.0)
    shoulders = Array(multibody.FixedTranslation, [dict(r=[0.05 * side, 0.0, 1.0]) for side in sides])
    hips = Array(multibody.FixedTranslation, [dict(r=[0.05 * side, 0.0, 0.0]) for side in sides])
    pins = Array(
        multibody.Revolute, [dict(n=[0.0, -side, 0.0], phi=Fixed(np.pi / 3), w=Fixed(0.0)) for side in sides]
    )
    arms = Array(
        multibody.Body, 2, m=0.3, r_cm=[0.0, 0.0, -0.5], J=np.diag([0.0250025, 0.0250025, 5e-6]).tolist()
    )
    halves, wholes = (Array(multibody.FixedTranslation, 2, r=[0.0, 0.0, -length]) for length in (0.5, 1.0))
    balls = Array(multibody.PointMass, 2, m=5.0)
    lines = Array(multibody.LineForce, 2, s=Start(0.5))
    springs = Array(translational.SpringDamper, 2, c=8e5, d=4e4, s_rel0=0.5)

    def equations(self):
        yield from row(self.world, self.bearing, self.shaft)
        yield from row(self.bearing, self.slide, self.slider)
        for k in range(2):
            yield from row(self.bearing, self.shoulders[k], self.pins[k], self.arms[k])
            yield from row(self.pins[k], self.wholes[k], self.balls[k])
            yield from row(self.slide, self.hips[k], self.lines[k])
            yield from row(self.pins[k], self.halves[k], self.lines[k].frame_b)
            yield connect(self.lines[k].flange_a, self.springs[k].flange_a)
            yield connect(self.lines[k].flange_b, self.springs[k].flange_b)
