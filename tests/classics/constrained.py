"""Constrained motions of the test set for IVP solvers (Mazzia and Magherini, Bari), from equations or components."""

import numpy as np

from gantrytau import Array, Fixed, Model, Real, Start, connect, der, sin, sqrt, time
from gantrytau.mechanics import multibody, rotational, translational
from tests.mechanisms.rows import row


class CarAxis(Model):
    """Schneider (1989), index 3: a column of the constraints is zero at the start, and again and again."""

    p = Real(4, start=[0.0, 0.5, 1.0, 0.5])
    v = Real(4, start=[-0.5, 0.0, -0.5, 0.0])
    f = Real(2, start=[0.0, 0.0])

    def equations(self):
        k, y_b = 10 * 0.01**2 / 2, 0.1 * sin(10 * time)
        x_b = sqrt(1 - y_b**2)
        x_l, y_l, x_r, y_r = (self.p[i] for i in range(4))
        left, right = sqrt(x_l**2 + y_l**2), sqrt((x_r - x_b) ** 2 + (y_r - y_b) ** 2)
        one, two = self.f[0], 2 * self.f[1]
        forces = (
            (0.5 - left) * x_l / left + one * x_b + two * (x_l - x_r),
            (0.5 - left) * y_l / left + one * y_b + two * (y_l - y_r) - k,
            (0.5 - right) * (x_r - x_b) / right - two * (x_l - x_r),
            (0.5 - right) * (y_r - y_b) / right - two * (y_l - y_r) - k,
        )
        yield der(self.p) == self.v
        for i, force in enumerate(forces):
            yield k * der(self.v)[i] == force
        yield x_b * x_l + y_b * y_l == 0
        yield (x_l - x_r) ** 2 + (y_l - y_r) ** 2 == 1


Z = [0.0, 0.0, 1.0]


def hinge(start: float) -> multibody.Revolute:
    """A joint in the plane, and where it may start."""
    return multibody.Revolute(n=Z, phi=Start(start))


def rod(x: float, y: float) -> multibody.FixedTranslation:
    """A massless bar in the plane."""
    return multibody.FixedTranslation(r=[x, y, 0.0])


def body(m: float, x: float, y: float, inertia: float) -> multibody.Body:
    """A mass in the plane."""
    return multibody.Body(m=m, r_cm=[x, y, 0.0], J=(inertia * np.eye(3)).tolist())


class Squeezer(Model):
    """Andrews' squeezer mechanism: seven bodies, three loops, from the problem's own start, at which theta is 0."""

    world = multibody.World(gravity=[0.0, 0.0, 0.0])
    A = multibody.Fixed(r=[-0.06934, -0.00227, 0.0])
    B = multibody.Fixed(r=[-0.03635, 0.03273, 0.0])
    C = multibody.Fixed(r=[0.014, 0.072, 0.0])
    beta = multibody.Revolute(n=Z, phi=Fixed(-0.0617138900142764496), w=Fixed(0.0))
    theta, gamma, phi = hinge(0.0), hinge(0.455279819163070380), hinge(0.222668390165885885)
    delta, omega, eps = hinge(0.487364979543842550), hinge(-0.222668390165885885), hinge(1.23054744454982119)
    k1, k2 = body(0.04325, 0.00092, 0.0, 2.194e-6), body(0.00365, -0.0115, 0.0, 4.410e-7)
    k3, k4 = body(0.02373, 0.01043, -0.01874, 5.255e-6), body(0.00706, 0.0, -0.00579, 5.667e-7)
    k5, k6 = body(0.07050, 0.02308, -0.00916, 1.169e-5), body(0.00706, 0.00579, 0.0, 5.667e-7)
    k7 = body(0.05498, 0.00449, -0.01228, 1.912e-5)
    r1, r2, r3, r4 = rod(0.007, 0.0), rod(-0.028, 0.0), rod(0.0, -0.035), rod(0.0, -0.02)
    r5, r6, r7, tip = rod(0.04, 0.0), rod(0.02, 0.0), rod(0.0, -0.04), rod(0.02, -0.018)
    p3, p4, p6 = multibody.Revolute(n=Z), multibody.Revolute(n=Z), multibody.Revolute(n=Z)
    drive = rotational.Torque()
    line, spring = multibody.LineForce(s=Start(0.09)), translational.Spring(c=4530.0, s_rel0=0.07785)

    def equations(self):
        yield self.drive.tau == 0.033
        yield connect(self.drive.flange, self.beta.axis)
        chains = (
            (self.world.frame_b, self.beta, self.k1, self.r1),
            (self.r1.frame_b, self.theta, self.k2, self.r2),
            (self.B.frame_b, self.gamma, self.k3, self.r3),
            (self.A.frame_b, self.delta, self.k5, self.r5),
            (self.r5.frame_b, self.phi, self.k4, self.r4),
            (self.A.frame_b, self.eps, self.k7, self.r7),
            (self.r7.frame_b, self.omega, self.k6, self.r6),
        )
        for before, joint, one, arm in chains:
            yield from row(before, joint, one)
            yield connect(joint.frame_b, arm.frame_a)
        yield from row(self.gamma, self.tip, self.line, self.C)
        yield connect(self.line.flange_a, self.spring.flange_a)
        yield connect(self.line.flange_b, self.spring.flange_b)
        for pin, arm in ((self.p3, self.r3), (self.p4, self.r4), (self.p6, self.r6)):
            yield from row(self.r2, pin, arm.frame_b)


class SphereParticle(Model):
    """A particle in honey on the unit sphere; others push it."""

    r, v, push = Real(3, start=[0.0, 0.0, 1.0]), Real(3, start=0.0), Real(3)
    force = Real(start=-4.75, description="of the sphere, by radius")

    def equations(self):
        yield der(self.r) == self.v
        yield from (
            der(self.v)[k] == self.push[k] - 0.5 * self.v[k] + 2 * self.force * self.r[k] for k in range(3)
        )
        yield self.r[0] ** 2 + self.r[1] ** 2 + self.r[2] ** 2 == 1


def rings() -> list[list[float]]:
    """Where the twenty particles start: on four circles of latitude."""
    circles = ((3, 1, 1 / 13, 3 / 8), (7, 1, 1 / 29, 1 / 8), (6, 1, 1 / 7, -2 / 15), (4, 0, 1 / 17, -3 / 10))
    found = []
    for count, first, turn, height in circles:  # angles of the problem in units of pi
        for k in range(first, first + count):
            along, up = np.pi * (2 * k / count + turn), np.pi * height
            found.append([np.cos(along) * np.cos(up), np.sin(along) * np.cos(up), np.sin(up)])
    return found


class Fekete(Model):
    """Smale (1998), Pardalos: twenty points that repel each other by 1 / distance come to rest on a sphere; index 3."""

    points = Array(SphereParticle, [dict(r=Start(r)) for r in rings()])

    def equations(self):
        for one in self.points:
            push = [0.0, 0.0, 0.0]
            for other in self.points:
                if other is not one:
                    away = [one.r[k] - other.r[k] for k in range(3)]
                    square = sum(part**2 for part in away)
                    push = [p + part / square for p, part in zip(push, away, strict=True)]
            yield from (one.push[k] == push[k] for k in range(3))
