"""A wheelset that hunts on a straight track: test set for IVP solvers (Mazzia and Magherini, Bari), index 2."""

from typing import Any

from gantrytau import Model, Real, cos, der, if_else, sin, sqrt, tan, tanh

CONE, GAUGE, NOMINAL, RAIL = (
    0.0262,
    0.1506,
    0.1,
    0.06,
)  # rad; half of the track, radii of wheel and rail head, m
MASS, ROLL, TURN, GRAVITY = (
    16.08,
    0.0605,
    0.366,
    9.81,
)  # kg; inertia about the axle and across it, kg.m2; m/s2
SPEED, SPRING, ARM = 30.0, 6400.0, 0.19  # m/s; N/m of the suspension, along and across; m
FRICTION, SHEAR, POISSON = 0.12, 7.92e10, 0.28  # G, Pa
HERTZ_E, HERTZ_G = 1.3537956, 0.7115218  # of the ellipse of contact
KALKER = 4.72772197, 4.27526987, 1.97203505
PI = 3.1415926  # as the source has it

Vector = list[Any]


def dot(one: Vector, other: Vector) -> Any:
    """Inner product."""
    return sum(a * b for a, b in zip(one, other, strict=True))


def axes(theta: Any, phi: Any) -> list[Vector]:
    """Axes of a set that is turned by theta about the vertical, then rolled by phi; the first is the axle."""
    s, c, sp, cp = sin(theta), cos(theta), sin(phi), cos(phi)
    return [[c * cp, sp, -s * cp], [-c * sp, cp, s * sp], [s, 0, c]]


def combined(parts: Vector, vectors: list[Vector]) -> Vector:
    """Sum of vectors, each times its part."""
    return [dot(parts, list(column)) for column in zip(*vectors, strict=True)]


class Wheelset(Model):
    """Simeon, Fuehrer and Rentrop (1991): conical wheels on round rails, creep forces by Kalker and Jaschinski.

    x points to the right, y upwards, z along the track. A wheel touches its rail `xi` along the axle from the middle, and
    `psi` ahead of the lowest line; `f` is the multiplier of its constraint, 10 kN, `beta` the spin beside that of rolling.
    """

    p = Real(5, start=[0.14941e-02, 0.40089e-06, 0.11241e-05, -0.28573e-03, 0.26459e-03], nominal=1e-2)
    v, beta = Real(5, start=0.0, nominal=0.1), Real(start=0.0, nominal=0.1)
    psi = Real(2, start=[-7.4122380357667139e-06, 7.5634406395172940e-06])
    xi = Real(2, start=[-0.1521364296121248, 0.1490635714733819])
    f = Real(2, start=[-7.4144e-3, -8.3593e-3])

    def equations(self):
        x, z, theta, phi = self.p[0], self.p[2], self.p[3], self.p[4]
        turning, rolling, spin = self.v[3], self.v[4], SPEED / NOMINAL + self.beta
        force, torque = [-2 * SPRING * x, -MASS * GRAVITY, -2 * SPRING * z], [0, 0, 0]
        stiff, held = -2 * ARM**2 * SPRING * theta, [0, 0]
        for k, side in enumerate((-1, 1)):
            load, creep, row, place = yield from self.contact(k, side, spin)
            yield dot(row, [self.v[i] for i in range(5)]) == 0
            force = [a + b + load * c for a, b, c in zip(force, creep, row[:3], strict=True)]
            held = [a + load * b for a, b in zip(held, row[3:], strict=True)]
            local = [dot(axis, creep) for axis in axes(theta, phi)]
            (a, b, c), (d, e, g) = place, local
            torque = [
                t + m for t, m in zip(torque, (b * g - c * e, c * d - a * g, a * e - b * d), strict=True)
            ]
        yield der(self.p) == self.v
        yield from (MASS * der(self.v)[i] == force[i] for i in range(3))
        s, c = sin(phi), cos(phi)
        lean = (ROLL - TURN) * turning * s
        yield TURN * (c * der(self.v)[3] - turning * rolling * s) == (
            -(ROLL * spin + lean) * rolling + torque[1] + c * stiff + held[0]
        )
        yield TURN * der(self.v)[4] == (ROLL * spin + lean) * turning * c + torque[2] + held[1]
        yield ROLL * (s * der(self.v)[3] + der(self.beta) + turning * rolling * c) == torque[0] + s * stiff

    def contact(self, k: int, side: int, spin: Any):
        """Yields where the wheel touches; returns multiplier, N, creep force, constraint's row and place on the axle."""
        x, theta, phi = self.p[0], self.p[3], self.p[4]
        slope, radius = -side * tan(CONE), NOMINAL + tan(CONE) * (GAUGE - side * self.xi[k])
        place = [self.xi[k], -radius * cos(self.psi[k]), -radius * sin(self.psi[k])]
        along = side * (x + combined(place, axes(theta, phi))[0]) - GAUGE - RAIL * sin(CONE)
        height = sqrt(RAIL**2 - along**2)
        tilt = -side * along / height  # of the rail
        normal = combined([slope, cos(self.psi[k]), sin(self.psi[k])], axes(theta, phi))  # of the wheel
        yield tilt * normal[1] + normal[0] == 0
        yield normal[2] == 0
        by_theta, by_phi, _ = self.motions(place, theta)
        row = [tilt, -1, 0, tilt * by_theta[0], tilt * by_phi[0] - by_phi[1]]
        # the contact plane leans by -atan(tilt)
        level = 1 / sqrt(1 + tilt**2)
        rising = -tilt * level
        load = 1e4 * self.f[k]
        pressed = -load / level
        centre = [self.v[0], self.v[1], SPEED + self.v[2]]
        own = combined([self.v[3], self.v[4], spin], self.motions(place, theta / level))
        slip = [a + b for a, b in zip(centre, own, strict=True)]
        rolled = sqrt(sum((b - a) ** 2 for a, b in zip(centre, own, strict=True))) / 2
        s, c = sin(theta / level), cos(theta / level)
        ahead, across = [s, 0, c], [c * level, -rising, -s * level]
        curved = 0.5 / (radius * sqrt(1 + slope**2)) + 0.5 * RAIL**2 / height**3 * level**3
        size = (3 * pressed * (1 - POISSON) * HERTZ_E / (2 * PI * curved * SHEAR * sqrt(HERTZ_G))) ** (1 / 3)
        most, stiff = FRICTION * pressed, SHEAR * size**2 / rolled
        drill = rising * spin + level * self.v[3]
        one = tanh(stiff * KALKER[0] * dot(ahead, slip) / most)
        two = tanh(stiff * (KALKER[1] * dot(across, slip) + KALKER[2] * size * drill) / most)
        both = one**2 + two**2
        limit = most / sqrt(if_else(both > 1, both, 1, smooth=True))
        creep = [-limit * (one * a + two * b) for a, b in zip(ahead, across, strict=True)]
        return load, creep, row, place

    def motions(self, place: Vector, theta: Any) -> list[Vector]:
        """Velocity of a place on the wheel by unit speeds of theta, phi and spin."""
        axle, up, ahead = axes(theta, self.p[4])
        a, b, c = place
        x, _, z = combined(place, [axle, up, ahead])
        return [[z, 0, -x], combined([a, -b], [up, axle]), combined([b, -c], [ahead, up])]
