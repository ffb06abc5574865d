"""Closed loops: linkages against textbook formulas and Newton-Euler by hand, wherever the loop is opened."""

import dataclasses

import numpy as np
import pytest

from gantrytau import Array, Fixed, Model, Parameter, Start, connect, simulate, translate
from gantrytau.mechanics import rotational
from gantrytau.mechanics.multibody import (
    Body,
    CutSensor,
    FixedTranslation,
    PointMass,
    Prismatic,
    Revolute,
    Spherical,
    TwoFrames,
    Universal,
    World,
)
from gantrytau.mechanics.multibody import Fixed as Mount
from tests.families import first_of
from tests.mechanisms.rows import row
from tests.references import four_bar
from tests.references.rotations import turn

# of blocks that are solved after a Newton iteration to 1e-13, with condition numbers up to 1e3
ROUNDING = 1e-9
NORMAL = [0.0, 0.0, 1.0]


class Link(TwoFrames):
    """A bar along x with a body; its joint in frame_a turns about z."""

    L = Parameter(1.0, unit="m", description="length")
    hinge = Revolute(n=NORMAL)
    body = Body()
    bar = FixedTranslation(r=lambda self: [self.L, 0.0, 0.0])

    def equations(self):
        yield from row(self.frame_a, self.hinge, self.body)
        yield from row(self.hinge, self.bar, self.frame_b)


class FourBar(Model):
    """A planar four-bar loop in a tilted plane, with a motor on the crank; the last pin is the rocker's hinge."""

    world = World()
    base = Mount()
    ground = FixedTranslation()
    crank, coupler, rocker = Link(), Link(), Link()
    pin = Revolute(n=NORMAL)
    sensor = CutSensor()
    motor = rotational.Torque()

    def equations(self):
        yield connect(self.base.frame_b, self.ground.frame_a)
        yield from row(self.base, self.crank, self.coupler, self.pin, self.sensor)
        yield connect(self.ground.frame_b, self.rocker.frame_a)
        yield connect(self.motor.flange, self.crank.hinge.axis)
        yield connect(self.sensor.frame_b, self.rocker.frame_b)


class OpenedAtTheCrank(FourBar):
    """The same, with the statements in another order, so that the loop is opened elsewhere."""

    def equations(self):
        yield connect(self.rocker.frame_b, self.sensor.frame_b)
        yield connect(self.sensor.frame_a, self.pin.frame_b)
        yield connect(self.pin.frame_a, self.coupler.frame_b)
        yield connect(self.coupler.frame_a, self.crank.frame_b)
        yield connect(self.rocker.frame_a, self.ground.frame_b)
        yield connect(self.ground.frame_a, self.base.frame_b)
        yield connect(self.crank.hinge.axis, self.motor.flange)
        yield connect(self.crank.frame_a, self.base.frame_b)


def planar(model, bars, theta, w=0.0, plane=(1.0, 0.0, 0.0), angle=np.pi / 2):
    """A four-bar model with the data of the reference, its plane turned by angle about `plane`; and its motion."""
    closed = four_bar.loop(bars, theta)
    phi = closed.angles

    def link(k, angle):
        J = bars.inertias[k] * np.diag([0.4, 0.9, 1.0])
        body = dict(m=bars.masses[k], r_cm=[*bars.centres[k], 0.03 * k], J=J)
        return dict(L=bars.lengths[k], body=body, hinge=dict(phi=Start(angle)))

    links = dict(
        crank=link(0, theta),
        coupler=link(1, phi[1] - phi[0]),
        rocker=link(2, phi[2]),
        pin=dict(phi=phi[2] - phi[1]),
    )
    links["crank"]["hinge"] |= dict(phi=Fixed(theta), w=Fixed(w))
    links["pin"] = dict(phi=Start(phi[2] - phi[1]))
    return model(base=dict(n=plane, phi=angle), ground=dict(r=[bars.ground, 0.0, 0.0]), **links)


def in_plane(rotation, bars):
    """The reference with gravity as it acts in the plane."""
    return dataclasses.replace(bars, gravity=four_bar.gravity_in_plane(rotation))


@pytest.mark.parametrize(
    ("model", "plane", "angle"),
    first_of(
        [
            (FourBar, (1.0, 0.0, 0.0), np.pi / 2),
            (OpenedAtTheCrank, (1.0, -0.5, 0.3), 1.1),
            (FourBar, (1.0, -0.5, 0.3), 1.1),
            (OpenedAtTheCrank, (1.0, 0.0, 0.0), np.pi / 2),
        ],
        2,
    ),
)
def test_four_bar_moves_as_lagrange_says(model, plane, angle):
    rotation = turn(angle * np.array(plane) / np.linalg.norm(plane))
    bars = in_plane(rotation, four_bar.example())
    for theta, w, torque in [(0.7, 0.0, 0.0), (1.9, 2.0, 0.4), (-1.0, -3.0, 1.5)]:
        dae = translate(planar(model, bars, theta, w, plane, angle))
        assert len(dae.states) == 2
        assert len(dae.redundant) == 3  # Grübler in space counts -2
        at = dae.evaluate({"motor.tau": torque})
        expected = four_bar.accelerations(bars, theta, w, torque)
        speeds = w * four_bar.loop(bars, theta).slopes
        for name, rate, gain in zip(("crank", "coupler", "rocker"), speeds, expected, strict=True):
            np.testing.assert_allclose(
                at[f"{name}.body.w"], rotation[:, 2] * rate, rtol=ROUNDING, atol=ROUNDING
            )
            np.testing.assert_allclose(
                at[f"der({name}.body.w)"],
                rotation[:, 2] * gain,
                rtol=ROUNDING,
                atol=ROUNDING * abs(gain).max(),
            )


@pytest.mark.parametrize("model", [FourBar, OpenedAtTheCrank])
def test_forces_in_the_pins_balance_the_bars(model):
    rotation = turn(np.array([np.pi / 2, 0.0, 0.0]))
    bars = in_plane(rotation, four_bar.example())
    theta, w, torque = 0.9, 2.5, 0.6
    at = translate(planar(model, bars, theta, w)).evaluate({"motor.tau": torque})
    _, pins = four_bar.accelerations_with_reactions(bars, theta, w, torque)
    places = ("crank.hinge.frame_b.f", "coupler.hinge.frame_b.f", "pin.frame_b.f", "rocker.hinge.frame_b.f")
    for name, expected in zip(places, pins, strict=True):
        # cut forces are positive into the joint: against what acts on the bar
        np.testing.assert_allclose((-rotation.T @ at[name])[:2], expected, rtol=ROUNDING, atol=1e-8)
    # the rocker's axes are turned by psi in the plane
    psi = four_bar.loop(bars, theta).angles[2]
    np.testing.assert_allclose(at["sensor.f"][:2], four_bar.turned(psi).T @ pins[2], rtol=ROUNDING, atol=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_random_four_bars(seed):
    rng = np.random.default_rng(seed)
    bars = four_bar.FourBar(
        ground=1.0,
        lengths=np.array([rng.uniform(0.2, 0.4), rng.uniform(0.7, 1.0), rng.uniform(0.7, 1.0)]),
        masses=rng.uniform(0.5, 3.0, 3),
        centres=rng.uniform(-0.3, 0.5, (3, 2)),
        inertias=rng.uniform(0.01, 0.2, 3),
        gravity=np.array([0.0, -9.81]),
    )
    theta, w, torque = rng.uniform(-3, 3), rng.normal() * 3, rng.normal()
    at = translate(planar(FourBar, bars, theta, w)).evaluate({"motor.tau": torque})
    found = [at[f"der({name}.body.w)"][1] for name in ("crank", "coupler", "rocker")]
    # the normal of the plane is -y
    expected = -four_bar.accelerations(bars, theta, w, torque)
    np.testing.assert_allclose(found, expected, rtol=ROUNDING, atol=ROUNDING * np.abs(expected).max())


def test_symmetric_four_bar_keeps_its_energy_over_many_turns():
    bars = dataclasses.replace(four_bar.example(), lengths=np.array([0.3, 0.9, 0.9]))
    turning = simulate(planar(FourBar, bars, 0.4, 9.0), stop=5.0, tolerance=1e-9, points=51)
    theta, w = turning["crank.hinge.phi"], turning["crank.hinge.w"]
    assert np.ptp(theta) > 4 * np.pi
    energy = [four_bar.energy(bars, a, b) for a, b in zip(theta, w, strict=True)]
    assert np.ptp(energy) < 1e-6 * energy[0]  # a thousand times the integrator's tolerance
    for name in ("r", "R"):
        # where the loop is opened
        gap = turning[f"rocker.bar.frame_b.{name}"] - turning[f"rocker.frame_b.{name}"]
        assert np.abs(gap).max() < 1e-11  # the projection stops at 1e-12 of the terms


class Carried(Model):
    """A four-bar whose plane turns with a table about the vertical."""

    world = World()
    table = Revolute(n=[0.0, 0.0, 1.0], phi=Fixed(0.0), w=Fixed(2.0))
    plate = Body(m=1.0)
    ground = FixedTranslation(r=[1.0, 0.0, 0.0])
    hinges = Array(Revolute, 4, n=[0.0, -1.0, 0.0])
    bars = Array(
        FixedTranslation, [dict(r=[0.3, 0.0, 0.0]), dict(r=[0.8, 0.0, 0.0]), dict(r=[0.7, 0.0, 0.0])]
    )
    bodies = Array(Body, 3, m=1.2, r_cm=[0.2, 0.0, 0.05], J=np.diag([0.01, 0.02, 0.02]))

    def equations(self):
        crank, coupler, rocker, pin = self.hinges
        yield from row(self.world, self.table, self.plate)
        yield connect(self.table.frame_b, self.ground.frame_a)
        for before, hinge, bar, body in zip(
            (self.table.frame_b, self.bars[0].frame_b, self.ground.frame_b),
            (crank, coupler, rocker),
            self.bars,
            self.bodies,
            strict=True,
        ):
            yield from row(before, hinge, bar)
            yield connect(hinge.frame_b, body.frame_a)
        yield from row(self.bars[2], pin, self.bars[1].frame_b)


BARS = four_bar.FourBar(
    ground=1.0,
    lengths=np.array([0.3, 0.8, 0.7]),
    masses=np.full(3, 1.2),
    centres=np.tile([0.2, 0.05], (3, 1)),
    inertias=np.full(3, 0.02),
    gravity=np.array([0.0, -9.81]),
)


def carried(theta=0.7, turned=0.0, w=2.0):
    """The four-bar on a table that is turned and turns with w; the plane's x and y are x and z of the table."""
    angles = four_bar.loop(BARS, theta).angles
    starts = [Fixed(theta), Start(angles[1] - angles[0]), Start(angles[2]), Start(angles[1] - angles[2])]
    hinges: list[dict] = [dict(phi=start) for start in starts]
    hinges[0] |= dict(w=Fixed(0.0))
    return Carried(table=dict(phi=Fixed(turned), w=Fixed(w)), hinges=hinges)


def moments_and_gap(motion):
    """Angular momentum about the vertical, energy, and the largest gap in the loop, over time."""
    parts = [("plate", 1.0, np.zeros(3), 0.1 * np.eye(3))]
    J = np.diag([0.01, 0.02, 0.02])
    parts += [(f"bodies[{k}]", 1.2, np.array([0.2, 0.0, 0.05]), J) for k in range(3)]
    spin, energy = 0.0, 0.0
    for name, m, centre, inertia in parts:
        R, w = motion[f"{name}.frame_a.R"], motion[f"{name}.w"]
        r, v = motion[f"{name}.r"] + R @ centre, motion[f"{name}.v"] + np.cross(w, R @ centre)
        own = np.einsum("tij,jk,tlk,tl->ti", R, inertia, R, w)
        spin = spin + (own + np.cross(r, m * v))[:, 2]
        energy = energy + (m * v**2).sum(axis=1) / 2 + (own * w).sum(axis=1) / 2 + m * 9.81 * r[:, 2]
    gap = np.abs(motion["hinges[3].frame_b.r"] - motion["bars[1].frame_b.r"]).max()
    return spin, energy, gap


def test_four_bar_on_a_table_before_a_quarter_turn():
    motion = simulate(carried(), stop=0.4, tolerance=1e-10, points=21)
    assert motion.final("table.phi") < 1.4
    spin, energy, gap = moments_and_gap(motion)
    # a thousand times the tolerance
    assert np.ptp(spin) < 1e-7
    assert np.ptp(energy) < 1e-7
    assert gap < 1e-11


def test_four_bar_on_a_table_for_whole_turns():
    motion = simulate(carried(), stop=5.0, tolerance=1e-9, points=101)
    assert np.ptp(motion["table.phi"]) > 2 * np.pi
    spin, energy, gap = moments_and_gap(motion)
    assert gap < 1e-9  # the loop stays closed
    assert np.ptp(spin) < 1e-6
    assert np.ptp(energy) < 1e-5


@pytest.mark.parametrize("turned", [0.3, 0.5 * np.pi])
def test_the_place_of_the_table_does_not_matter(turned):
    one, other = (translate(carried(1.1, angle)).evaluate() for angle in (0.0, turned))
    for name in ("der(table.w)", "der(hinges[0].w)", "der(hinges[2].w)", "hinges[1].tau"):
        assert other[name] == pytest.approx(one[name], rel=ROUNDING, abs=1e-10)


def test_speeds_without_a_start_are_zero_wherever_the_table_stands():
    model = Carried(table=dict(phi=Fixed(0.3), w=Fixed(2.0)), hinges=[dict(phi=Fixed(1.1)), {}, {}, {}])
    assert translate(model).evaluate()["hinges[0].w"] == pytest.approx(0.0, abs=1e-9)


def test_one_translation_serves_every_place_of_the_table():
    dae = translate(carried(1.1))
    one, other = (dae.evaluate({"table.phi": angle}) for angle in (0.0, np.pi / 2))
    assert other["der(hinges[0].w)"] == pytest.approx(one["der(hinges[0].w)"], rel=ROUNDING)
    gap = np.abs(other["hinges[3].frame_b.r"] - other["bars[1].frame_b.r"]).max()
    assert gap < 1e-9


def test_force_in_the_closing_connection_is_equal_and_opposite():
    dae = translate(carried())
    (loop,) = dae.flat.loops
    at = dae.evaluate()
    R = np.array([[at[f"{loop.a}.R[{i},{j}]"] for j in range(3)] for i in range(3)])
    for flow in ("f", "t"):
        passed = R @ at[f"loops[0].{flow}"]  # resolved in the first of the two frames
        np.testing.assert_allclose(at[f"{loop.a}.{flow}"], -passed, atol=1e-10)
        np.testing.assert_allclose(at[f"{loop.b}.{flow}"], passed, atol=1e-10)
    assert np.linalg.norm(at["loops[0].f"]) > 0.1


class SliderCrank(Model):
    """A crank, a rod and a piston on a rail; the loop has three redundant constraints."""

    world = World()
    crank, knee, wrist = Revolute(n=[0.0, 1.0, 0.0]), Revolute(n=[0.0, 1.0, 0.0]), Revolute(n=[0.0, 1.0, 0.0])
    arm, rod = FixedTranslation(r=[0.2, 0.0, 0.0]), FixedTranslation(r=[0.6, 0.0, 0.0])
    wheel = Body(m=1.0, J=np.diag([0.05, 0.05, 0.05]))
    bar = Body(m=0.8, r_cm=[0.25, 0.0, 0.0], J=np.diag([0.001, 0.03, 0.03]))
    rail = Prismatic(n=[1.0, 0.0, 0.0])
    piston = PointMass(m=2.0)

    def equations(self):
        yield from row(self.world, self.crank, self.wheel)
        yield from row(self.crank, self.arm, self.knee, self.bar)
        yield from row(self.knee, self.rod, self.wrist, self.rail.frame_b)
        yield connect(self.rail.frame_b, self.piston.frame_a)
        yield connect(self.rail.frame_a, self.world.frame_b)


class LooseSliderCrank(SliderCrank):
    """The same without redundancy: the wrist is a ball, the knee a universal joint."""

    knee = Universal(n_a=[0.0, 1.0, 0.0], n_b=[0.0, 0.0, 1.0])
    wrist = Spherical()


def crank_acceleration(phi, w):
    """The slider-crank by Lagrange with the crank angle; positive about y lowers the pin."""

    def centres(angle):
        p = -np.arcsin(0.2 * np.sin(angle) / 0.6)
        x = 0.2 * np.cos(angle) + 0.6 * np.cos(p)
        return np.array(
            [x, 0.2 * np.cos(angle) + 0.25 * np.cos(p), -0.2 * np.sin(angle) - 0.25 * np.sin(p), p]
        )

    h = 1e-4  # central differences: an error of h^4 times 1e2
    steps = [centres(phi + k * h) for k in (-2, -1, 0, 1, 2)]
    slope = (steps[0] - 8 * steps[1] + 8 * steps[3] - steps[4]) / (12 * h)
    curve = (-steps[0] + 16 * steps[1] - 30 * steps[2] + 16 * steps[3] - steps[4]) / (12 * h**2)
    weights = np.array([2.0, 0.8, 0.8, 0.03])
    inertia = 0.05 + weights @ slope**2
    return (-(weights @ (slope * curve)) * w**2 - 0.8 * 9.81 * slope[2]) / inertia


@pytest.mark.parametrize(("model", "redundant"), [(SliderCrank, 3), (LooseSliderCrank, 0)])
def test_slider_crank_with_and_without_redundant_constraints(model, redundant):
    for phi, w in [(0.6, 0.0), (2.0, 5.0), (-1.2, -8.0)]:
        p = -np.arcsin(0.2 * np.sin(phi) / 0.6)
        knee = "phi" if model is SliderCrank else "phi_a"
        guess = dict(
            crank=dict(phi=Fixed(phi), w=Fixed(w)),
            knee={knee: Start(p - phi)},
            rail=dict(s=Start(0.2 * np.cos(phi) + 0.6 * np.cos(p))),
        )
        if model is SliderCrank:
            guess["wrist"] = dict(phi=Start(-p))
        dae = translate(model(**guess))
        assert dae.diagnosis.mobility == 1
        assert len(dae.diagnosis.redundant) == redundant
        # differences of the second derivative leave 1e-8
        assert dae.evaluate()["der(crank.w)"] == pytest.approx(crank_acceleration(phi, w), rel=1e-6)
