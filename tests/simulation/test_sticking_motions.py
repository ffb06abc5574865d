"""Friction that sticks exactly in simulations: exact motions, equilibria, energy, and what sets it loose."""

import numpy as np
import pytest

from gantrytau import (
    Fixed,
    Input,
    Model,
    ModelError,
    Parameter,
    Real,
    StructureError,
    connect,
    der,
    if_else,
    linearize,
    pre,
    reinit,
    sampled,
    simulate,
    sin,
    stick_slip,
    time,
    translate,
    when,
)
from gantrytau.mechanics import multibody, translational
from gantrytau.mechanics.translational import StickSlipFriction
from gantrytau_models import GantryTau, prototypes
from tests.mechanisms.rows import in_a_row, row
from tests.references.sticking import M, OnSpring, Shaken, on_spring, shaken

TOLERANCE = 1e-10
NEAR = 1e2 * TOLERANCE  # errors of steps add up, and what an event takes over from them


@pytest.mark.parametrize(("model", "truth"), [(OnSpring, on_spring), (Shaken, shaken)])
@pytest.mark.parametrize("points", [2, 11, 501])
def test_it_locks_and_breaks_away_at_the_exact_instants(model, truth, points):
    run = simulate(model(), stop=1.0, tolerance=TOLERANCE, points=points)
    np.testing.assert_allclose(run["mass.s"], truth(run.time), atol=NEAR)
    stuck = run["floor.mode"] == 0
    assert np.array_equal(run["mass.v"][stuck], np.zeros(np.count_nonzero(stuck)))  # held, not nearly


def test_the_error_falls_with_the_tolerance():
    errors = []
    for tolerance in (1e-5, 1e-7, 1e-9):
        run = simulate(Shaken(), stop=1.0, tolerance=tolerance)
        errors.append(np.abs(run["mass.s"] - shaken(run.time)).max() / tolerance)
    assert max(errors) < 10  # of a few events


class Belt(Model):
    """A mass on a spring, carried along by a belt."""

    sign = Parameter(1.0, unit="1", description="1 or -1, which way the slip counts", evaluate=True)
    c = Parameter(800.0, unit="N/m", description="stiffness")
    m = Parameter(2.0, unit="kg", description="mass")
    belt = Parameter(0.06, unit="m/s", description="speed of the belt")
    f_c = Parameter(6.0, unit="N", description="Coulomb friction")
    f_s = Parameter(9.0, unit="N", description="breakaway force")
    s = Real(unit="m", description="position", start=0.0, fixed=True)
    w = Real(unit="m/s", description="speed", start=0.06, fixed=True)
    slip = Real(unit="m/s", description="speed against the belt")
    f = Real(unit="N", description="friction")

    def equations(self):
        yield self.w == der(self.s)
        yield self.m * der(self.w) == -self.c * self.s - self.sign * self.f
        yield self.slip == self.sign * (self.w - self.belt)
        yield stick_slip(self.f, self.slip, coulomb=self.f_c, smooth=0.0, breakaway=self.f_s)


def on_belt(t, c=800.0, m=2.0, belt=0.06, f_c=6.0, f_s=9.0):
    """Carried along until the spring pulls it loose; then a swing about f_c / c until it is as fast as the belt again."""
    w = np.sqrt(c / m)
    loose, centre = f_s / c, f_c / c
    a, b = loose - centre, belt / w  # s - centre = a cos(w t) + b sin(w t)
    sliding = (2 * np.pi - 2 * np.arctan2(a, b)) / w  # speed and distance from the centre mirrored in time
    again = centre + a * np.cos(w * sliding) + b * np.sin(w * sliding)
    first = loose / belt
    carried = (loose - again) / belt
    found = np.where(t < first, belt * t, 0.0)
    since = np.mod(t - first, sliding + carried)
    turned = np.where(
        since < sliding,
        centre + a * np.cos(w * since) + b * np.sin(w * since),
        again + belt * (since - sliding),
    )
    return np.where(t < first, found, turned)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_oscillator_on_a_belt_sticks_and_slips_as_its_phases_say(sign):
    run = simulate(Belt(sign=sign), stop=3.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(run["s"], on_belt(run.time), atol=NEAR)
    stuck = run["mode"] == 0
    assert 0.2 < np.mean(stuck) < 0.9
    assert np.abs(run["slip"][stuck]).max() < 1e-16
    # while it sticks the friction is the force of the spring, which the belt does work against
    np.testing.assert_allclose(run["f"][stuck], -sign * 800.0 * run["s"][stuck], rtol=1e-9)


def test_a_belt_whose_speed_is_an_input_carries_it_along():
    class Driven(Belt):
        """The speed of the belt comes from outside."""

        drive = Input(unit="m/s", description="speed of the belt", start=0.06)

        def equations(self):
            yield self.w == der(self.s)
            yield self.m * der(self.w) == -self.c * self.s - self.f
            yield self.slip == self.w - self.drive
            yield stick_slip(self.f, self.slip, coulomb=self.f_c, smooth=0.0, breakaway=self.f_s)

    run = simulate(Driven(), stop=3.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(run["s"], on_belt(run.time), atol=NEAR)
    run = simulate(
        Driven(w=Fixed(0.0)), stop=0.2, tolerance=TOLERANCE, inputs={"drive": lambda t: 0.02 * sin(9 * t)}
    )
    # it sticks all the way
    np.testing.assert_allclose(run["s"], 0.02 / 9 * (1 - np.cos(9 * run.time)), atol=NEAR)


class Incline(Model):
    """A block on a slope of 30 degrees."""

    world = multibody.World()
    ground = multibody.Fixed(n=[0, 1, 0], phi=np.pi / 6)
    slide = multibody.Prismatic(n=[1, 0, 0], s=Fixed(0.0), v=Fixed(0.0))
    block = multibody.Body(m=2.0, J=np.zeros((3, 3)))
    floor = StickSlipFriction(f_c=8.0, f_s=10.0)

    def equations(self):
        yield from row(self.ground, self.slide, self.block)
        yield connect(self.slide.axis, self.floor.flange)


WEIGHT = 2.0 * 9.81 * 0.5


def test_a_block_on_a_slope_stays_or_slides():
    run = simulate(Incline(), stop=5.0)
    assert np.array_equal(run["slide.s"], np.zeros_like(run.time))
    np.testing.assert_allclose(run["floor.f"], WEIGHT, rtol=1e-13)
    run = simulate(Incline(floor=dict(f_s=9.8)), stop=1.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(run["slide.s"], (WEIGHT - 8.0) / 4.0 * run.time**2, atol=NEAR)
    # thrown uphill it comes to rest and stays, or turns back at once
    for limit, after in ((10.0, 0.0), (9.8, (WEIGHT - 8.0) / 2.0)):
        run = simulate(
            Incline(slide=dict(v=Fixed(-1.0)), floor=dict(f_s=limit)), stop=1.0, tolerance=TOLERANCE
        )
        turn = 2.0 / (WEIGHT + 8.0)
        assert run.final("slide.v") == pytest.approx(after * (1.0 - turn), abs=NEAR)
        top = -0.5 * turn
        assert run.final("slide.s") == pytest.approx(top + after * (1.0 - turn) ** 2 / 2, abs=NEAR)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_sliding_block_stops_where_its_energy_ends(size):
    # A mass on a floor.
    Sliding = in_a_row("Sliding", mass=translational.Mass(m=2.0), floor=StickSlipFriction(f_c=4.0 * size))

    start = dict(s=Fixed(0.0), v=Fixed(size))
    near = dict(s=dict(nominal=size), v=dict(nominal=size))
    mass = {name: dict(start=size if name == "v" else 0.0, fixed=True, **near[name]) for name in start}
    run = simulate(Sliding(mass=mass), stop=1.0, tolerance=TOLERANCE)
    assert run.final("mass.s") == pytest.approx(0.25 * size, rel=NEAR)
    assert run.final("mass.v") == 0.0
    back = simulate(Sliding(mass=mass), stop=1.0, tolerance=TOLERANCE, starts={"mass.v": -size})
    assert back.final("mass.s") == pytest.approx(-0.25 * size, rel=NEAR)


def lawful(run, friction, speed, coulomb, breakaway):
    """Whether a friction keeps its law at all points of a motion."""
    mode, f, v = run[f"{friction}.mode"], run[f"{friction}.f"], run[speed]
    stuck = mode == 0
    return (
        np.all(np.abs(v[stuck]) < 1e-15)
        and np.all(np.abs(f[stuck]) <= breakaway * (1 + 1e-8))
        and np.all(np.abs(f[~stuck] - mode[~stuck] * coulomb) <= 1e-12 * breakaway)
        and np.all(mode[~stuck] * v[~stuck] >= -1e-12)
    )


def test_it_turns_back_without_sticking_and_the_force_jumps():
    class Flung(Model):
        """A mass against a wind stronger than friction."""

        mass = translational.Mass(m=2.0, s=Fixed(0.0), v=Fixed(1.0))
        wind = translational.Force()
        floor = StickSlipFriction(f_c=4.0, f_s=5.0)

        def equations(self):
            yield connect(self.mass.flange, self.wind.flange)
            yield connect(self.mass.flange, self.floor.flange)

    run = simulate(Flung(), stop=1.0, tolerance=TOLERANCE, inputs={"wind.f": -8.0})
    turn = 1.0 / 6.0
    assert run.final("mass.v") == pytest.approx(-2.0 * (1.0 - turn), abs=NEAR)
    k = int(np.flatnonzero(np.diff(run.time) == 0)[0])
    assert run.time[k] == pytest.approx(turn, abs=NEAR)
    assert (run["floor.f"][k], run["floor.f"][k + 1]) == pytest.approx((4.0, -4.0))
    assert set(np.unique(run["floor.mode"])) == {-1.0, 1.0}


def test_translated_models_and_parameters_run_as_models_do():
    plain = simulate(Shaken(), stop=1.0)
    dae = translate(Shaken(), events=True)
    for run in (simulate(dae, stop=1.0), simulate(dae, stop=1.0)):
        np.testing.assert_array_equal(run["mass.s"], plain["mass.s"])
    run = simulate(dae, stop=1.0, parameters={"amplitude": 8.0})
    assert np.array_equal(run["mass.s"], np.zeros_like(run.time))
    some = simulate(dae, stop=1.0, outputs=["floor.f", "der(mass.v)"])
    np.testing.assert_allclose(
        M * some["der(mass.v)"], 10 * np.sin(8 * some.time) - some["floor.f"], atol=1e-9
    )


def test_a_sampled_force_pushes_it_loose_at_the_start():
    class Controlled(Model):
        """A block that a controller begins to push at once."""

        mass = translational.Mass(m=2.0, s=Fixed(0.0), v=Fixed(0.0))
        push = translational.Force()
        floor = StickSlipFriction(f_c=6.0, f_s=9.0)
        command = Real(unit="N", description="sampled push", start=0.0)
        step = Input(unit="N", description="what is sampled", start=16.0)

        def equations(self):
            yield connect(self.mass.flange, self.push.flange)
            yield connect(self.mass.flange, self.floor.flange)
            yield sampled(self.command, self.step, period=0.1)
            yield self.push.f == self.command

    run = simulate(Controlled(), stop=1.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(run["mass.s"], 2.5 * run.time**2, atol=NEAR)


def test_a_kick_sets_it_in_motion_either_way():
    class Kicked(Model):
        """A block that gets a speed at 0.1 s, and the opposite one at 0.2 s, while it slides."""

        mass = translational.Mass(m=2.0, s=Fixed(0.0), v=Fixed(0.0))
        floor = StickSlipFriction(f_c=6.0, f_s=9.0)

        def equations(self):
            yield connect(self.mass.flange, self.floor.flange)
            kick = when(time > 0.1, reinit(self.mass.v, 1.0))
            yield kick.elsewhen(time > 0.2, reinit(self.mass.v, -pre(self.mass.v)))

    run = simulate(Kicked(), stop=1.0, tolerance=TOLERANCE)
    way = 0.1 - 3.0 * 0.1**2 / 2
    assert run.at(0.2, "mass.s") == pytest.approx(way, abs=NEAR)
    assert run.final("mass.s") == pytest.approx(way - 0.7**2 / 2 / 3.0, abs=NEAR)
    assert run.final("mass.v") == 0.0


def test_a_belt_that_is_changed_over_slips():
    class Switched(Belt):
        """The belt goes at another speed from 0.1 s on."""

        def equations(self):
            yield self.w == der(self.s)
            yield self.m * der(self.w) == -self.f
            yield self.slip == self.w - if_else(time < 0.1, self.belt, 2 * self.belt)
            yield stick_slip(self.f, self.slip, coulomb=self.f_c, smooth=0.0, breakaway=self.f_s)

    run = simulate(Switched(), stop=0.3, tolerance=TOLERANCE)
    # no speed jumps: friction of 6 N takes 0.02 s to bring 2 kg from 0.06 to 0.12 m/s
    np.testing.assert_allclose(run["w"], 0.06 + 3.0 * np.clip(run.time - 0.1, 0.0, 0.02), atol=NEAR)


def test_who_cannot_let_it_stick_still_says_so():
    with pytest.raises(ModelError, match="found friction that sticks"):
        linearize(Shaken())
    robot = GantryTau(prototypes.L1, friction=StickSlipFriction)
    turned = translate(robot, given=["tool.r"], events=True)
    with pytest.raises(StructureError, match="one friction for each motion"):
        simulate(turned, stop=1.0, inputs={"tool.r": lambda t: [0.5, 2.8, -0.8]})
