"""Modes and their transitions against closed forms: on events, at instants, by priority, in arrays."""

from typing import Any

import numpy as np
import pytest

from gantrytau import (
    Array,
    Discrete,
    Fixed,
    Mode,
    Model,
    ModelError,
    Parameter,
    Real,
    SolveError,
    Start,
    between,
    check,
    der,
    logic_or,
    pre,
    reinit,
    simulate,
    sin,
    time,
    transition,
    translate,
)

TOLERANCE = 1e-10
NEAR = 1e-7  # of instants and values at them: errors of a run at this tolerance


class Thermostat(Model):
    """Heats a room between two temperatures."""

    tau = Parameter(100.0, unit="s", description="time constant of the room")
    outside = Parameter(283.0, unit="K", description="temperature outside")
    power = Parameter(20.0, unit="K", description="what the heater adds in the end")
    low = Parameter(293.0, unit="K", description="heats below")
    high = Parameter(296.0, unit="K", description="rests above")
    T = Real(unit="K", description="temperature", start=295.0, fixed=True)
    mode = Mode("off", "on", description="heater")

    def equations(self):
        yield self.tau * der(self.T) == self.outside - self.T + self.mode.choose(off=0.0, on=1.0) * self.power
        yield transition(self.mode, "off", "on", self.T <= self.low, period=self.period)
        yield transition(self.mode, "on", "off", self.T >= self.high, period=self.period)

    period = None


class Clocked(Thermostat):
    """A thermostat that looks at the temperature every second."""

    period = 1.0


class Wall(Model):
    """A mass that flies against a spring with a damper, which cannot pull it."""

    m = Parameter(2.0, unit="kg", description="mass")
    c = Parameter(800.0, unit="N/m", description="stiffness")
    d = Parameter(0.0, unit="N.s/m", description="damping")
    s = Real(unit="m", description="position, the wall at zero", start=-1.0, fixed=True)
    v = Real(unit="m/s", description="velocity", start=4.0, fixed=True)
    f = Real(unit="N", description="force of the wall")
    bounces = Discrete(0.0, description="number of contacts")
    mode = Mode("approach", "contact", "release", description="where it is")

    def equations(self):
        wall = -self.c * self.s - self.d * self.v
        yield der(self.s) == self.v
        yield self.m * der(self.v) == self.f
        yield self.f == self.mode.choose(approach=0.0, contact=wall, release=0.0)
        yield transition(self.mode, "approach", "contact", self.s >= 0, self.bounces == pre(self.bounces) + 1)
        yield transition(self.mode, "contact", "release", wall >= 0, priority=1)


def instants(found, name="mode") -> np.ndarray:
    """Times at which a mode changes, s."""
    return found.time[1:][np.diff(found[name]) != 0]


@pytest.mark.parametrize("points", [2, 501])
def test_a_hysteresis_follows_its_closed_form(points):
    found = simulate(Thermostat(), stop=300.0, points=points, tolerance=TOLERANCE)
    cooling, heating = 100 * np.log(13 / 10), 100 * np.log((303 - 293) / (303 - 296))
    first = 100 * np.log((295 - 283) / (293 - 283))
    steps = np.append(first, np.tile([heating, cooling], 5))
    expected = np.cumsum(steps)
    expected = expected[expected < 300]
    np.testing.assert_allclose(instants(found), expected, atol=100 * NEAR)
    assert set(found.mode("mode")) == {"off", "on"}
    assert found.mode("mode")[0] == "off"
    assert found["T"].min() > 293 - NEAR
    assert found["T"].max() < 296 + NEAR


def test_a_guard_that_holds_at_the_start_acts_there():
    found = simulate(Thermostat(T=Fixed(290.0)), stop=10.0, tolerance=TOLERANCE)
    assert list(found.mode("mode")[:2]) == ["off", "on"]
    np.testing.assert_array_equal(found.time[:2], 0.0)
    np.testing.assert_allclose(found["T"], 303 - 13 * np.exp(-found.time / 100), atol=NEAR)


def test_a_start_by_name_and_by_number():
    for start in (Start("on"), Start(1)):
        found = simulate(Thermostat(mode=start), stop=10.0, tolerance=TOLERANCE)
        np.testing.assert_allclose(found["T"], 303 - 8 * np.exp(-found.time / 100), atol=NEAR)
    for wrong, words in (
        ("onn", "did you mean 'on'"),
        (2, "expected one of the modes off, on"),
        (0.5, "the start 0.5"),
    ):
        with pytest.raises(ModelError, match=words):
            simulate(Thermostat(mode=Start(wrong)), stop=10.0)
        with pytest.raises(ModelError, match=f"starts: mode: .*{words}"):
            simulate(Thermostat(), stop=10.0, starts={"mode": wrong})
    dae = translate(Thermostat(), events=True)
    found = simulate(dae, stop=10.0, starts={"mode": "on"}, tolerance=TOLERANCE)
    np.testing.assert_allclose(found["T"], 303 - 8 * np.exp(-found.time / 100), atol=NEAR)
    with pytest.raises(ModelError, match=r"mode: found the value 'on' for a Mode"):
        simulate(Thermostat(mode="on"), stop=10.0)


@pytest.mark.parametrize("d", [0.0, 10.0])
def test_a_mass_at_a_spring_wall(d):
    found = simulate(Wall(d=d), stop=1.0, tolerance=TOLERANCE)
    m, c, v = 2.0, 800.0, 4.0
    decay = d / (2 * m)
    w = np.sqrt(c / m - decay**2)
    # s = v / w e^(-decay t) sin(w t), and the force is zero where tan(w t) = -d w / (c - d decay)
    lasts = (np.pi - np.arctan(d * w / (c - d * decay))) / w
    np.testing.assert_allclose(instants(found), [0.25, 0.25 + lasts], atol=NEAR)
    leaves = v * np.exp(-decay * lasts) * (np.cos(w * lasts) - decay / w * np.sin(w * lasts))
    assert found.final("v") == pytest.approx(leaves, abs=10 * NEAR)
    assert found.final("bounces") == 1
    assert list(dict.fromkeys(found.mode("mode"))) == ["approach", "contact", "release"]
    assert found["f"].max() < NEAR  # never pulls


def test_guards_with_a_period_act_at_its_instants():
    found = simulate(Clocked(), stop=300.0, points=2, tolerance=TOLERANCE)
    at = instants(found)
    np.testing.assert_allclose(at, np.round(at), atol=1e-12)
    # from instant to instant the solution is exact
    T, on, changes = 295.0, False, []
    for k in range(301):
        if (T <= 293 and not on) or (T >= 296 and on):
            on = not on
            changes.append(k)
        end = 303.0 if on else 283.0
        T = end + (T - end) * np.exp(-1 / 100)
    np.testing.assert_array_equal(np.round(at), [k for k in changes if k])
    assert len(changes) > 5


class Doors(Model):
    """What was due in another mode is not due in this one."""

    mode = Mode("shut", "open")
    opened = Discrete(0.0)

    def equations(self):
        yield transition(
            self.mode, "shut", "open", between(0.35, time, 0.39), self.opened == pre(self.opened) + 1
        )
        yield transition(self.mode, "open", "shut", time > 0.1, period=0.2)


def test_a_guard_with_a_period_waits_for_the_next_instant():
    found = simulate(Doors(), stop=1.0, points=2)
    np.testing.assert_allclose(instants(found), [0.35, 0.4], atol=1e-12)
    assert found.final("opened") == 1


class Fork(Model):
    """Two ways out of one mode, both open from 0.5 s on."""

    first = Parameter(1.0, unit="s", description="rest of the first guard")
    left = right = None
    x = Real(unit="s", description="time passed", start=0.0, fixed=True)
    mode = Mode("way", "west", "east")

    def equations(self):
        yield der(self.x) == 1.0
        yield transition(self.mode, "way", "west", self.x >= 0.5, priority=self.left)
        yield transition(self.mode, "way", "east", self.x + self.first >= 1.5, priority=self.right)


class West(Fork):
    """The first way is the more important."""

    left, right = 1, 2


class East(Fork):
    """The second is."""

    left, right = 2, 1.5


@pytest.mark.parametrize(("model", "end"), [(West, "west"), (East, "east")])
def test_of_two_guards_the_lower_priority_acts(model, end):
    found = simulate(model(), stop=1.0)
    assert found.mode("mode")[-1] == end
    np.testing.assert_allclose(instants(found), [0.5], atol=1e-12)


def test_two_guards_at_once_without_priorities_end_the_simulation():
    with pytest.raises(SolveError) as caught:
        simulate(Fork(), stop=1.0)
    words = str(caught.value)
    assert words.startswith(
        "Fork: at t = 0.5 s two transitions of mode out of way may act at once, to west (the model (Fork)"
    )
    assert "equation 2: (0.5<=x)) and to east (the model (Fork), equation 3: " in words
    assert "give both, as priority=1 and priority=2, of which the lower acts, or guards that exclude" in words
    assert caught.value.time == pytest.approx(0.5, abs=1e-12)
    assert caught.value.result.final("x") == pytest.approx(0.5, abs=1e-9)
    # one that opens later does not matter
    assert simulate(Fork(first=0.9), stop=1.0).mode("mode")[-1] == "west"


class Chain(Model):
    """From a to c at one instant, as the guard of b is true when b is entered; with a push."""

    x = Real(unit="m", description="position", start=0.0, fixed=True)
    v = Real(unit="m/s", description="speed", start=1.0, fixed=True)
    mode = Mode("a", "b", "c")

    def equations(self):
        yield der(self.x) == self.v
        yield der(self.v) == 0.0
        yield transition(self.mode, "a", "b", self.x >= 0.5, reinit(self.v, 2 * self.v))
        yield transition(self.mode, "b", "c", self.x >= 0.2, reinit(self.v, self.v + 1))


def test_a_guard_that_is_true_as_its_mode_is_entered_acts_at_once():
    found = simulate(Chain(), stop=1.0, tolerance=TOLERANCE)
    assert set(found.mode("mode")) == {"a", "c"}
    assert found.final("x") == pytest.approx(0.5 + 3 * 0.5, abs=NEAR)


class Flicker(Model):
    """Two modes that lead to each other at once."""

    mode = Mode("a", "b")

    def equations(self):
        yield transition(self.mode, "a", "b", time >= 0.5)
        yield transition(self.mode, "b", "a", time >= 0.2)


def test_modes_without_end_are_told_by_their_names():
    with pytest.raises(SolveError, match=r"t = 0\.5 s .*transition of mode from . to .* again and again at"):
        simulate(Flicker(), stop=1.0)


class Rooms(Model):
    """Rooms, each with a thermostat of its own."""

    rooms = Array(Thermostat, [dict(T=Fixed(295.0)), dict(T=Fixed(290.0)), dict(mode=Start("on"))])

    def equations(self):
        yield from ()


def test_modes_in_arrays():
    found = simulate(Rooms(), stop=100.0, points=11, tolerance=TOLERANCE)
    alone = simulate(Thermostat(), stop=100.0, points=11, tolerance=TOLERANCE)
    assert found.final("rooms[0].T") == pytest.approx(alone.final("T"), abs=100 * NEAR)
    assert set(found.modes) == {f"rooms[{k}].mode" for k in range(3)}
    starts = [found.mode(f"rooms[{k}].mode")[found.time == 0][-1] for k in range(3)]
    assert starts == ["off", "on", "on"]
    assert found.select(["rooms[1].mode"]).mode("rooms[1].mode")[-1] in ("off", "on")


class Supervised(Model):
    """A room whose owner switches the heater off for good at 20 s."""

    room = Thermostat(T=Fixed(290.0))

    def equations(self):
        yield transition(self.room.mode, "on", "off", time >= 20.0, priority=1)


class Resting(Supervised):
    """The same with a room that never heats itself again."""

    room = Thermostat(T=Fixed(290.0), low=100.0, mode=Start("on"))


def test_a_model_changes_the_mode_of_a_part():
    with pytest.raises(SolveError, match=r"two transitions of room\.mode out of on may act at once"):
        simulate(Supervised(room=dict(high=290.0)), start=30.0, stop=40.0)
    found = simulate(Resting(), stop=40.0, tolerance=TOLERANCE)
    np.testing.assert_allclose(instants(found, "room.mode"), [20.0], atol=1e-12)
    warm = 303 - 13 * np.exp(-0.2)
    assert found.final("room.T") == pytest.approx(283 + (warm - 283) * np.exp(-0.2), abs=NEAR)


def test_names_of_modes_in_results_and_check():
    found = simulate(Wall(), stop=0.1)
    assert found.description("mode") == "where it is: 0 approach, 1 contact, 2 release"
    with pytest.raises(ModelError, match=r"Wall: found v, which is no mode, expected a mode, mode"):
        found.mode("v")
    with pytest.raises(ModelError, match="did you mean 'mode'"):
        found.mode("mod")
    told = str(check(Wall()))
    assert "transition of mode from approach to contact" in told


def test_modes_are_drawn_as_bands(tmp_path):
    found = simulate(Wall(), stop=1.0)
    figure = found.plot("mode", "s", file=tmp_path / "wall.png")
    bands, line = figure.axes
    legend: Any = bands.get_legend()
    words = [text.get_text() for text in legend.get_texts()]
    assert words == ["approach", "contact", "release"]
    edges = [patch.get_extents().transformed(bands.transData.inverted()).intervalx for patch in bands.patches]
    np.testing.assert_allclose(np.ravel(edges)[1:-1:2], [*instants(found)], atol=1e-9)
    assert len(line.lines) == 1


class Lamp(Model):
    """Is on from 1 s to 3.3 s, and from 5 s; while on it is bright from where a sine is above 0.5 to where it is below -0.5,
    and counts in parallel how often the sine was positive.
    """

    x = Real(unit="1", start=0.0, fixed=True)
    phase = Mode("off", "on")
    light = Mode("dark", "bright", within="phase.on")
    half = Mode("low", "high", within="phase.on", history=True)
    count = Discrete(0.0, unit="1")

    def equations(self):
        wave = sin(2 * np.pi * time)
        yield der(self.x) == self.light.choose(dark=0.0, bright=1.0)
        yield transition(self.phase, "off", "on", self.on())
        yield transition(self.phase, "on", "off", between(3.3, time, 5.0))
        yield transition(self.light, "dark", "bright", wave >= 0.5)
        yield transition(self.light, "bright", "dark", wave <= -0.5)
        yield transition(self.half, "low", "high", wave >= 1e-6, self.count == pre(self.count) + 1)
        yield transition(self.half, "high", "low", wave <= -1e-6)

    def on(self):
        return logic_or(between(1.0, time, 3.3), time > 5.0)


class LampThatRemembers(Lamp):
    """The same, as bright as it was when it comes on."""

    light = Mode("dark", "bright", within="phase.on", history=True)


@pytest.mark.parametrize(("kind", "entered"), [(Lamp, 1 / 12), (LampThatRemembers, 0.0)])
def test_a_mode_within_a_mode_changes_there_alone(kind, entered):
    lamp = simulate(kind(), stop=7.0, tolerance=TOLERANCE)
    left = 2 * 0.5 + 0.3 - 1 / 12  # bright from 1/12 to 7/12 of each period, the third ends at 3.3 s
    outside = 1.7 if kind is LampThatRemembers else 0.0
    assert lamp.at(3.3, "x") == pytest.approx(left, abs=NEAR)
    assert lamp.at(5.9, "x") == pytest.approx(left + outside + 7 / 12 - entered, abs=NEAR)
    assert lamp.final("count") == 4  # at 1, 2, 3 and 6 s; it was left high at 3.3 s and is high at 5 s


def test_the_outer_mode_changes_first():
    class Both(Model):
        x = Real(unit="1", start=0.0, fixed=True)
        count = Discrete(0.0, unit="1")
        phase, step = Mode("on", "off"), Mode("first", "second", within="phase.on")

        def equations(self):
            yield der(self.x) == 1.0
            yield transition(self.step, "first", "second", self.x >= 0.5, self.count == pre(self.count) + 1)
            yield transition(self.phase, "on", "off", self.x >= 0.5)

    found = simulate(Both(), stop=1.0)
    assert (found.final("phase"), found.final("step"), found.final("count")) == (1, 0, 0)
