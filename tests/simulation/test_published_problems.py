"""Published problems of index one and three, from components or equations (test set for IVP solvers, Bari)."""

import numpy as np
import pytest

from gantrytau import Fixed, Model, Real, Start, connect, der, exp, simulate, sin, sqrt, time
from gantrytau.mechanics import multibody, rotational, translational
from tests.mechanisms.rows import row


class CarAxis(Model):
    """A column of the constraints is zero at the start, and again and again."""

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


AXIS = {
    "p": [0.0493455784275402809, 0.496989460230171154, 1.04174252488542152, 0.373911027265361257],
    "v": [-0.0770583684040972358, 0.00744686658723778553, 0.0175568157537232222, 0.770341043779251976],
}


class Amplifier(Model):
    """Eight equations of index one, with a singular mass matrix."""

    y = Real(8, start=[0.0, 3.0, 3.0, 6.0, 3.0, 3.0, 6.0, 0.0])

    def equations(self):
        y, r = [None, *(self.y[i] for i in range(8))], 9000.0
        c1, c2, c3, c4, c5 = (k * 1e-6 for k in range(1, 6))
        rate = [None, *(der(self.y)[i] for i in range(8))]
        one, two = (1e-6 * (exp((y[i] - y[i + 1]) / 0.026) - 1) for i in (2, 5))
        yield -c1 * (rate[1] - rate[2]) == (y[1] - 0.1 * sin(200 * np.pi * time)) / 1000
        yield c1 * (rate[1] - rate[2]) == y[2] / r + (y[2] - 6) / r + 0.01 * one
        yield -c2 * rate[3] == y[3] / r - one
        yield -c3 * (rate[4] - rate[5]) == (y[4] - 6) / r + 0.99 * one
        yield c3 * (rate[4] - rate[5]) == y[5] / r + (y[5] - 6) / r + 0.01 * two
        yield -c4 * rate[6] == y[6] / r - two
        yield -c5 * (rate[7] - rate[8]) == (y[7] - 6) / r + 0.99 * two
        yield c5 * (rate[7] - rate[8]) == y[8] / r


VOLTAGES = [-0.5562145012262709e-2, 3.006522471903042, 2.849958788608128, 2.926422536206241]
VOLTAGES += [2.704617865010554, 2.761837778393145, 4.770927631616772, 1.236995868091548]


def check_ends(found, ends, tolerance):
    """Global errors are at most ten tolerances, relative to the largest element on the way."""
    for name, exact in ends.items():
        largest = np.max(np.abs(found[name]))
        np.testing.assert_allclose(found.final(name), exact, rtol=0, atol=10 * tolerance * largest)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize(
    ("model", "stop", "ends"),
    [(CarAxis, 3.0, AXIS), (Amplifier, 0.2, {"y": VOLTAGES})],
    ids=["axis", "amplifier"],
)
def test_global_errors_are_at_most_ten_tolerances(model, stop, ends, tolerance):
    check_ends(simulate(model(), stop=stop, tolerance=tolerance), ends, tolerance)


Z = [0.0, 0.0, 1.0]
# angle, speed after 0.03 s, by DOP853 at 3e-14 on the index-one form; published speeds are 5e-8 of themselves away
SQUEEZER = {
    "beta": (15.810771195154, 1139.9203022591),
    "theta": (-15.756371058412, -1424.3792951776),
    "gamma": (0.040822240119649, 11.032911910704),
    "phi": (-0.534730116342075, 19.293374105181),
    "delta": (0.524409965879954, 0.573569914833926),
    "omega": (0.534730116342075, -19.293374105181),
    "eps": (1.04808074104194, 0.323179149251643),
}


def hinge(start: float) -> multibody.Revolute:
    return multibody.Revolute(n=Z, phi=Start(start))


def rod(x: float, y: float) -> multibody.FixedTranslation:
    return multibody.FixedTranslation(r=[x, y, 0.0])


def body(m: float, x: float, y: float, inertia: float) -> multibody.Body:
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


@pytest.mark.nightly
@pytest.mark.parametrize("tolerance", [1e-6, 1e-8, 1e-10])
def test_squeezer(tolerance):
    """Seconds, to translate three loops."""
    ends = {
        f"{n}.{k}": end for n, both in SQUEEZER.items() for k, end in zip(("phi", "w"), both, strict=True)
    }
    check_ends(simulate(Squeezer(), stop=0.03, tolerance=tolerance), ends, tolerance)
