"""What jumps or bends and is differentiated throws the states: against momentum, charge and energy by hand."""

import math
from typing import Any

import numpy as np
import pytest

from gantrytau import (
    Discrete,
    Fixed,
    Mode,
    Model,
    Parameter,
    Real,
    SolveError,
    connect,
    cos,
    der,
    fabs,
    fmax,
    fmin,
    if_else,
    limit,
    simulate,
    sin,
    table,
    time,
    transition,
    translate,
    when,
)
from gantrytau.blocks import Ramp, Step
from gantrytau.electrical import Capacitor, CurrentSource, Ground, Inductor, Resistor, VoltageSource
from gantrytau.mechanics import multibody as mb
from gantrytau.mechanics import rotational, translational
from gantrytau.mechanics.gears import RackAndPinion
from tests.families import first_of
from tests.mechanisms.rows import in_a_row, row

LENGTH, G = 0.5, 9.81  # m, of the load's rope; m/s2


class Load(Model):
    """A trolley of 1 kg and below it a load on a rope: L w' + cos(phi) s'' = -g sin(phi)."""

    flange = translational.Flange()
    phi, w = Real(start=0.1, fixed=True, unit="rad"), Real(start=0.0, fixed=True, unit="rad/s")
    g, m, rope = Parameter(G, unit="m/s2"), Parameter(1.0, unit="kg"), Parameter(LENGTH, unit="m")

    def equations(self) -> Any:
        a = der(der(self.flange.s))
        yield der(self.phi) == self.w
        yield self.rope * der(self.w) + cos(self.phi) * a == -self.g * sin(self.phi)
        yield self.flange.f == self.m * a


class ByPosition(Model):
    hinge, drive, v = Load(), translational.Position(), Parameter(1.0, unit="m/s")

    def equations(self) -> Any:
        yield connect(self.drive.flange, self.hinge.flange)


class BySpeed(Model):
    hinge, drive = Load(), translational.Speed(s=Fixed(0.0))

    def equations(self) -> Any:
        yield connect(self.drive.flange, self.hinge.flange)


class Crane(Model):
    """The same of components in space."""

    world, slide, drive = mb.World(), mb.Prismatic(n=[1, 0, 0]), translational.Position()
    hinge = mb.Revolute(n=[0, 1, 0], phi=Fixed(0.1), w=Fixed(0.0))
    rod, load = mb.FixedTranslation(r=[0, 0, -LENGTH]), mb.PointMass(m=1.0)

    def equations(self) -> Any:
        yield from row(self.world, self.slide, self.hinge, self.rod, self.load)
        yield connect(self.drive.flange, self.slide.axis)


def prescribed(write: Any) -> type[Model]:
    """The trolley by an equation in the model."""

    class Prescribed(ByPosition):
        def equations(self) -> Any:
            yield from super().equations()
            yield self.drive.s == self.v * write(time)

    return Prescribed


class ByBlock(ByPosition):
    source = Ramp()

    def equations(self) -> Any:
        yield from super().equations()
        yield self.drive.s == self.source.y


class ByStep(BySpeed):
    source = Step(start_time=1.0, height=-1.0, offset=1.0)

    def equations(self) -> Any:
        yield from super().equations()
        yield self.drive.v == self.source.y


class ByMode(ByPosition):
    mode = Mode("rolls", "stands")

    def equations(self) -> Any:
        yield from super().equations()
        yield self.drive.s == self.v * self.mode.choose(rolls=time, stands=time * 0.0 + 1.0)
        yield transition(self.mode, "rolls", "stands", time >= 1)


def stops(t: Any) -> Any:
    """m, at 1 m/s until 1 s."""
    return fmin(t, 1.0)


WAYS: dict[str, Any] = {
    "in space": lambda: (Crane(), {"drive.s": stops}),
    "position, input": lambda: (ByPosition(), {"drive.s": stops}),
    "speed, input": lambda: (BySpeed(), {"drive.v": lambda t: if_else(t < 1, 1.0, 0.0)}),
    "given": lambda: (translate(ByPosition(), given=["drive.s"]), {"drive.s": stops}),
    "Step": lambda: (ByStep(), {}),
    "Ramp": lambda: (ByBlock(), {}),
    "limit": lambda: (prescribed(lambda t: limit(t, -1.0, 1.0))(), {}),
    "if_else": lambda: (prescribed(lambda t: if_else(t < 1, t, 1.0))(), {}),
    "table": lambda: (prescribed(lambda t: table(t, [0, 1, 2], [0, 1, 1]))(), {}),
    "spline": lambda: (
        prescribed(lambda t: table(t, [0, 0.5, 1], [0, 0.5, 1], kind="spline", outside="hold"))(),
        {},
    ),
    "Mode": lambda: (ByMode(), {}),
}


@pytest.mark.parametrize("way", first_of(WAYS, 5))
def test_the_load_swings_on_where_its_trolley_stops(way):
    model, inputs = WAYS[way]()
    found = simulate(model, stop=1.5, inputs=inputs, points=2, outputs=["hinge.w", "hinge.phi"])
    before, behind = np.flatnonzero(np.isclose(found.time, 1.0))
    w, phi = found["hinge.w"], found["hinge.phi"]
    assert phi[before] == phi[behind]
    assert abs(w[behind] - w[before]) == pytest.approx(np.cos(phi[before]) / LENGTH, rel=1e-9)
    # its energy behind the stop is kept: w^2 L / 2 - g cos(phi)
    energy = w**2 * LENGTH / 2 - G * np.cos(phi)
    assert energy[-1] == pytest.approx(energy[behind], abs=1e-6)


def test_a_corner_of_a_speed_is_no_impulse():
    found = simulate(BySpeed(), stop=1.0 + 1e-9, inputs={"drive.v": lambda t: 1 + fmin(t, 1.0)})
    w = found["hinge.w"][np.isclose(found.time, 1.0, atol=1e-12, rtol=0)]
    assert np.ptp(w) < 1e-9


class Divider(Model):
    """Two capacitors in series, a resistor across the second."""

    s, g = VoltageSource(), Ground()
    C, D, R = Capacitor(C=1e-3), Capacitor(C=3e-3), Resistor(R=1e3)

    def equations(self) -> Any:
        yield from row(self.s.pin_a, self.C, self.D, self.s.pin_b)
        yield connect(self.s.pin_b, self.g.pin)
        yield connect(self.R.pin_a, self.D.pin_a)
        yield connect(self.R.pin_b, self.g.pin)


@pytest.mark.parametrize("fixed", ["C", "D"])
@pytest.mark.parametrize("write", first_of([lambda t: t >= 1, lambda t: t > 1]))
def test_a_step_of_voltage_divides_by_the_capacities(fixed, write):
    step = {"s.v": lambda t: if_else(write(t), 8.0, 0.0)}
    found = simulate(Divider(**{fixed: dict(v=Fixed(0.0))}), stop=2.0, inputs=step)
    assert found.at(1.0, "D.v") == pytest.approx(2.0, rel=1e-9)
    assert found.final("D.v") == pytest.approx(2.0 * math.exp(-1 / 4), rel=1e-6)


class Stepped(Divider):
    """Rises by a rate and jumps at 1 s, both told by Discretes."""

    begin = Discrete(0.0, unit="s", description="begin of the rise")
    level = Discrete(0.0, unit="V", description="what has jumped so far")
    rate = Parameter(0.0, unit="V/s", description="rate of the rise")

    def equations(self) -> Any:
        yield from super().equations()
        yield when(time >= 1.0, self.level == 8, self.begin == time)
        yield self.s.v == self.level + self.rate * (time - self.begin)


def test_a_step_by_a_discrete_divides_as_one_by_a_condition():
    final = simulate(Stepped(D=dict(v=Fixed(0.0))), stop=2.0).final("D.v")
    assert final == pytest.approx(2.0 * math.exp(-1 / 4), rel=1e-6)


def test_what_goes_on_where_a_discrete_takes_a_new_value_throws_nothing():
    steady = simulate(Divider(D=dict(v=Fixed(0.0))), stop=2.0, inputs={"s.v": lambda t: 8 * t}).final("D.v")
    assert simulate(Stepped(D=dict(v=Fixed(0.0)), rate=8.0), stop=2.0).final("D.v") == pytest.approx(steady)


@pytest.mark.parametrize("write", [lambda t: t >= 0, lambda t: t > 0])
def test_at_the_start_what_is_fixed_holds_behind_what_turns(write):
    step = {"s.v": lambda t: if_else(write(t), 8.0, 0.0)}
    found = simulate(Divider(D=dict(v=Fixed(1.0))), stop=1.0, inputs=step)
    assert found.final("D.v") == pytest.approx(math.exp(-1 / 4), rel=1e-6)
    assert found.final("C.v") == pytest.approx(8 - math.exp(-1 / 4), rel=1e-6)


class TwoInductors(Model):
    s, g = CurrentSource(), Ground()
    a, b = Inductor(L=1e-3), Inductor(L=3e-3)

    def equations(self) -> Any:
        for pin in ("pin_a", "pin_b"):
            for coil in (self.a, self.b):
                yield connect(getattr(self.s, pin), getattr(coil, pin))
        yield connect(self.s.pin_b, self.g.pin)


@pytest.mark.parametrize("fixed", ["a", "b"])
def test_a_step_of_current_divides_by_the_inverse_inductances(fixed):
    step = {"s.i": lambda t: if_else(t > 1, 8.0, 0.0)}
    found = simulate(TwoInductors(**{fixed: dict(i=Fixed(0.0))}), stop=2.0, inputs=step)
    assert (found.final("a.i"), found.final("b.i")) == pytest.approx((6.0, 2.0), rel=1e-12)


class ChargedByVoltage(Model):
    """Two capacitors in series whose charges are q = v + v^3 and q = 2 v, on a source that steps."""

    height = Parameter(3.0)
    v, u, i = Real(start=0.0, fixed=True), Real(), Real()

    def equations(self) -> Any:
        yield (1 + 3 * self.v**2) * der(self.v) == self.i
        yield 2 * der(self.u) == self.i
        yield self.v + self.u == if_else(time > 1, self.height, 0.0)


def test_charge_is_kept_where_the_capacity_changes_with_the_voltage():
    found = simulate(ChargedByVoltage(), stop=2.0)
    v, u = found.final("v"), found.final("u")
    assert v + v**3 == pytest.approx(2 * u, rel=1e-9)
    assert v + u == pytest.approx(3.0, rel=1e-12)


class Cam(Model):
    """A cam y = fmax(0, x - 1) that takes 3 kg along."""

    x, v = Real(start=0.0, fixed=True), Real(start=1.0, fixed=True)
    y, w, f = Real(), Real(), Real()

    def equations(self) -> Any:
        yield der(self.x) == self.v
        yield der(self.y) == self.w
        yield self.y == fmax(0, self.x - 1)
        yield 1.0 * der(self.v) == -self.f * if_else(self.x > 1, 1.0, 0.0)
        yield 3.0 * der(self.w) == self.f


def test_a_cam_shares_its_momentum_with_what_it_takes_along():
    found = simulate(Cam(), stop=2.0)
    assert (found.final("v"), found.final("w")) == pytest.approx((0.25, 0.25), rel=1e-12)
    assert found.final("x") == pytest.approx(1.25, abs=1e-9)


class Bead(Model):
    """A bead of 1 kg on y = k |x|."""

    k = Parameter(1.0)
    x, v = Real(start=-1.0, fixed=True), Real(start=1.0, fixed=True)
    y, w, n = Real(), Real(), Real()

    def equations(self) -> Any:
        yield der(self.x) == self.v
        yield der(self.y) == self.w
        yield self.y == self.k * fabs(self.x)
        yield der(self.v) == -self.n * if_else(self.x > 0, self.k, -self.k)
        yield der(self.w) == self.n


@pytest.mark.parametrize("k", [0.5, 1.0])
def test_a_bead_loses_what_points_into_the_corner(k):
    behind = (1 - k**2) / (1 + k**2)  # of (1, -k) along (1, k)
    found = simulate(Bead(k=k), stop=2.0)
    assert found.final("v") == pytest.approx(behind, abs=1e-12)
    assert found.final("w") == pytest.approx(k * behind, abs=1e-12)


def test_a_bead_that_a_sharp_corner_throws_back_and_forth_gains_nothing_and_is_refused():
    with pytest.raises(SolveError, match="no side of the condition on x agrees") as refused:
        simulate(Bead(k=2.0), stop=2.0)
    assert refused.value.result is not None
    energy = refused.value.result["v"] ** 2 + refused.value.result["w"] ** 2
    assert np.all(np.diff(energy) < 1e-9)


class Shuttle(Model):
    """A belt at 1 m/s that turns round at 0 and 0.5 m, and what it drags: v' = 3 (w - v) + w' / 2."""

    mode = Mode("on", "back")
    y, w = Real(start=0.0, fixed=True), Real()
    v = Real(start=0.0, fixed=True)

    def equations(self) -> Any:
        yield der(self.y) == self.w
        yield self.w == self.mode.choose(on=1.0, back=-1.0)
        yield der(self.v) == 3 * (self.w - self.v) + 0.5 * der(self.w)
        yield transition(self.mode, "on", "back", self.y > 0.5)
        yield transition(self.mode, "back", "on", self.y < 0)


def test_modes_that_turn_to_and_fro_throw_once_each_time():
    found, v, w = simulate(Shuttle(), stop=2.9), 0.0, 1.0
    for length in (0.5, 0.5, 0.5, 0.5, 0.5, 0.4):
        v = w + (v - w) * math.exp(-3 * length)
        v, w = (v - w, -w) if length == 0.5 else (v, w)
    assert found.final("v") == pytest.approx(v, rel=1e-6)


# A wheel of 0.1 m that a rack turns, whose angle is prescribed, with a mass that a damper drags along.
Rack = in_a_row(
    "Rack",
    drive=rotational.Position(),
    gear=RackAndPinion(radius=0.1),
    damper=translational.Damper(d=3.0),
    mass=translational.Mass(m=2.0, s=Fixed(0.0), v=Fixed(0.0)),
)


def test_a_damper_passes_on_a_jump_of_its_end_as_an_impulse():
    found = simulate(Rack(), stop=2.0, inputs={"drive.phi": lambda t: if_else(t > 1, 4.0, 0.0)})
    assert found.at(1.0, "mass.v") == pytest.approx(3.0 * 0.4 / 2.0, rel=1e-9)  # d * jump / m


Held = in_a_row("Held", drive=translational.Position(), mass=translational.Mass(m=1.0))


def test_a_position_that_jumps_on_a_mass_is_refused():
    words = r"at t = 1 s the condition on time turns, and drive.s would jump at once, for which drive.f would be infinite"
    with pytest.raises(SolveError, match=words) as refused:
        simulate(Held(), stop=2.0, inputs={"drive.s": lambda t: if_else(t > 1, 1.0, 0.0)})
    assert refused.value.time == pytest.approx(1.0)


class HeldAtInstants(Model):
    drive, mass = translational.Position(), translational.Mass(m=1.0)
    n, m = (Discrete(0.0, unit="m", description="a part of the place") for _ in range(2))

    def equations(self) -> Any:
        yield from row(self.drive, self.mass)
        yield when(time >= 1.0, self.n == 1, self.m == 2)
        yield self.drive.s == self.n + self.m


def test_a_position_that_a_discrete_lets_jump_is_refused():
    with pytest.raises(SolveError, match=r"at t = 1 s n and m turns, and drive.s would jump at once, for"):
        simulate(HeldAtInstants(), stop=2.0)


class Drag(Model):
    """A damper of f = v^2 whose end jumps."""

    s, x, f = Real(), Real(start=0.0, fixed=True), Real()
    v = Real(start=0.0, fixed=True)

    def equations(self) -> Any:
        yield self.s == if_else(time > 1, 1.0, 0.0)
        yield der(self.x) == self.v
        yield self.f == (der(self.s) - self.v) ** 2
        yield der(self.v) == self.f


def test_an_impulse_in_a_law_that_is_not_linear_is_refused():
    with pytest.raises(SolveError, match="a law that is not linear in them"):
        simulate(Drag(), stop=2.0)


class Loose(Model):
    """Behind x = 1 nothing has a mass."""

    x, v, y, f = Real(start=0.0, fixed=True), Real(start=1.0, fixed=True), Real(), Real()

    def equations(self) -> Any:
        yield der(self.x) == self.v
        yield self.y == fmax(0, self.x - 1)
        yield der(self.v) == -self.f
        yield if_else(self.x > 1, 0.0, 1.0) * der(der(self.y)) + if_else(self.x > 1, 0.0, 1.0) * self.f == 0


def test_a_jump_that_nothing_determines_is_refused():
    with pytest.raises(SolveError, match="do not determine what jumps"):
        simulate(Loose(), stop=2.0)
