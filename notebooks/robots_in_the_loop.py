# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Robots in the loop
#
# `Mpc` solves a problem of optimal control anew at every sample. Seven mechanisms are held or moved here, each by a
# class of ten to thirty lines: what it costs, and what it may. Loops of links need nothing more, the equations come
# from the components.

# %%
import casadi as ca
import numpy as np

from gantrytau import Bounds, Input, Model, Parameter, Real, animate, between, cos, der, sin, tanh, time
from gantrytau_models import DeltaRobot, FourBar, GantryTau, SixLinkGantryTau, StewartPlatform, prototypes
from gantrytau_optimica import Mpc, Optimization, Path, Way, initial, optimize

# %% [markdown]
# ## A pole swings up and is held
#
# The force is too small to lift the pole at once, so the cart swings it. The first plan comes from `optimize`; the cost
# of holding the pole for ever, `terminal="lqr"`, stands at the end of each horizon.


# %%
class Pole(Model):
    """A pole on a cart, hanging at first, upright at 0; in bare numbers."""

    p, v = Real(start=0.0), Real(start=0.0)
    phi, w = Real(start=np.pi), Real(start=0.0)
    f = Input(min=-10.0, max=10.0)

    def equations(self):
        s, c = sin(self.phi), cos(self.phi)
        yield der(self.p) == self.v
        yield der(self.phi) == self.w
        yield der(self.v) * (1.0 + 0.1 * s**2) == self.f + 0.1 * s * (0.5 * self.w**2 - 9.81 * c)
        yield 0.5 * der(self.w) == 9.81 * s - der(self.v) * c


class SwingUp(Optimization):
    """Stand upright in the middle of a rail of 2 m."""

    pole = Pole()
    final_time = 2.0

    def integrand(self):
        o = self.pole
        return o.p**2 + 10 * (1 - cos(o.phi)) + 0.1 * o.v**2 + 0.05 * o.w**2 + 0.005 * o.f**2

    def constraints(self):
        yield between(-1.0, self.pole.p, 1.0)


class FromBelow(SwingUp):
    """The same from the pole at rest below."""

    def constraints(self):
        yield from super().constraints()
        for one, value in zip(
            (self.pole.p, self.pole.phi, self.pole.v, self.pole.w), (0, np.pi, 0, 0), strict=True
        ):
            yield initial(one) == value


first = optimize(FromBelow, elements=40, points=2)
swing = Mpc(SwingUp, period=0.05, elements=40, terminal="lqr", guess=first).run(stop=5.0)
print(swing)
assert abs(swing["pole.phi"][-1]) < 0.01
assert abs(swing["pole.f"]).max() <= 10.0
swing.plot("pole.phi", "pole.p")

# %% [markdown]
# ## A crane that does not swing
#
# Trolley and hoist bring a load 2 m aside and 1 m up; the rope stays within 0.05 rad. That limit is soft: where no plan
# keeps it, it gives way and the controller names it.


# %%
class Crane(Model):
    """A load on a rope that a hoist shortens, under a trolley."""

    s, v = Real(start=0.0, unit="m"), Real(start=0.0, unit="m/s")
    length, rate = Real(start=4.0, unit="m"), Real(start=0.0, unit="m/s")
    phi, w = Real(start=0.0, unit="rad"), Real(start=0.0, unit="rad/s")
    f = Input(min=-600.0, max=600.0, nominal=100.0, unit="N")
    h = Input(min=0.0, max=2000.0, nominal=1000.0, unit="N")
    trolley, load = Parameter(200.0, unit="kg"), Parameter(120.0, unit="kg")
    g = Parameter(9.81, unit="m/s2")

    def equations(self):
        s, c = sin(self.phi), cos(self.phi)
        yield der(self.s) == self.v
        yield der(self.length) == self.rate
        yield der(self.phi) == self.w
        yield self.trolley * der(self.v) == self.f + self.h * s
        along = der(self.rate) - self.length * self.w**2 + der(self.v) * s - self.g * c
        yield self.load * along == -self.h
        yield self.length * der(self.w) + 2 * self.rate * self.w + der(self.v) * c + self.g * s == 0


class Hoisted(Optimization):
    """The load 2 m aside, 3 m below the trolley."""

    crane = Crane()

    def integrand(self):
        o = self.crane
        away = (o.s - 2.0) ** 2 + (o.length - 3.0) ** 2 + 10 * o.phi**2
        return away + 0.1 * (o.v**2 + o.rate**2 + o.w**2) + 1e-6 * (o.f**2 + (o.h - 120.0 * 9.81) ** 2)

    def constraints(self):
        yield between(-0.05, self.crane.phi, 0.05)


crane = Mpc(Hoisted, period=0.1, elements=40).run(stop=9.0)
print(crane)
assert abs(crane["crane.phi"]).max() < 0.05 + 1e-4
assert np.hypot(crane["crane.s"][-1] - 2.0, crane["crane.length"][-1] - 3.0) < 0.02
crane.plot("crane.s", "crane.phi", "crane.f")

# %% [markdown]
# ## A four-bar linkage with friction
#
# The crank shall turn evenly, though coupler and rocker do not. The controller knows of friction, but the mechanism in
# the loop rubs half as much again: it turns a little slower than it should, by what that force changes in a period.


# %%
class WithFriction(Model):
    """A four-bar linkage whose crank rubs."""

    bars = FourBar()
    motor = Input(unit="N.m", min=-30.0, max=30.0)
    coulomb = Parameter(2.0, unit="N.m")
    slow = Parameter(0.1, unit="rad/s")

    def equations(self):
        yield self.bars.torque == self.motor - self.coulomb * tanh(self.bars.crank.w / self.slow)


class Even(Optimization):
    """Turn once in two seconds, evenly."""

    linkage = WithFriction()

    def integrand(self):
        return (self.linkage.bars.crank.w - np.pi) ** 2 + 1e-4 * self.linkage.motor**2


even = Mpc(Even, period=0.02, elements=20).run(Even(linkage=dict(coulomb=3.0)), stop=2.5)
print(even)
speed = even["linkage.bars.crank.w"]
assert -0.3 < (speed[10:] - np.pi).min() < (speed[10:] - np.pi).max() < 0.0
even.plot("linkage.bars.crank.w", "linkage.bars.rocker.phi", "linkage.motor")

# %% [markdown]
# ## A Gantry-Tau along a path, its forces limited
#
# The controller chooses its own progress along the way, a state of which it may push the acceleration: as fast as 0.5 m/s
# where the carts allow it. It pays for errors across the path and along it, and is paid for speed.


# %%
START = np.array([0.923, 2.9325, -0.4181])
PATH = Path.of(lambda u: ca.DM(START) + ca.vertcat(0.4 * u, 0.08 * sin(6 * u), 0.04 * (1 - cos(6 * u))))


class AlongPath(Optimization):
    """Follow the path within a millimetre, at 0.5 m/s if it may be."""

    robot = GantryTau(prototypes.L1)
    way = Way(PATH, s=dict(start=0.0), v=Bounds(0.0, 0.5))
    given = ("way.a", "robot.carts[0].f", "robot.carts[1].f", "robot.carts[2].f")

    def integrand(self):
        contour, lag = self.way.errors(self.robot.tool.r)
        return 1e5 * (ca.sumsqr(contour) + lag**2) - 5 * self.way.v + 1e-3 * self.way.a**2

    def constraints(self):
        for cart in self.robot.carts:
            yield between(-600.0, cart.f, 600.0)


path = Mpc(AlongPath, period=0.02, elements=20).run(stop=1.6)
print(path)
off = np.linalg.norm(path["robot.tool.r"] - PATH.at(path["way.s"]), axis=1)
print(f"off the path by {1e3 * off.max():.2f} mm, {path['way.s'][-1]:.3f} of {PATH.length:.3f} m")
assert off.max() < 1e-3
assert max(abs(path[f"robot.carts[{k}].f"]).max() for k in range(3)) <= 600.0 + 1e-3
path.plot("way.s", "way.v", "robot.carts[0].f", "robot.carts[1].f", "robot.carts[2].f")

# %% [markdown]
# ## Six links
#
# The plate of D1 goes aside and comes to rest. Its loops have no closed form, and the plate may turn as the six links
# let it.


# %%
class SixLinks(Optimization):
    """The plate 10 cm aside, the carts within 1200 N."""

    robot = SixLinkGantryTau(prototypes.D1)

    def integrand(self):
        tool, carts = self.robot.tool, self.robot.carts
        away = ca.sumsqr(tool.r - GOAL)
        return 1e3 * away + ca.sumsqr(tool.v) + 1e-6 * sum(cart.f**2 for cart in carts)

    def constraints(self):
        for cart in self.robot.carts:
            yield between(-1200.0, cart.f, 1200.0)


GOAL = np.array([-0.28, -4.33, 0.04])
six = Mpc(SixLinks, period=0.02, elements=15).run(stop=0.8)
print(six)
print(six["robot.tool.r"][[0, -1]])
assert np.linalg.norm(six["robot.tool.r"][-1] - GOAL) < 2e-3
six.plot("robot.tool.r", "robot.carts[0].f", "robot.carts[1].f", "robot.carts[2].f")

# %% [markdown]
# ## A Delta picks from a conveyor that moves
#
# A part comes by at 0.3 m/s. The plate is over it at 0.4 s, goes down to it, stays with it and lifts it again: a
# reference that is a function of time, seen ahead over the horizon.


# %%
class Picks(Optimization):
    """Down to a moving part and up again."""

    robot = DeltaRobot()

    def integrand(self):
        tool, arms = self.robot.tool, self.robot.arms
        down = 0.5 * (tanh((time - 0.45) / 0.06) - tanh((time - 0.75) / 0.06))
        part = ca.vertcat(-0.15 + 0.3 * time, 0.05, -0.68 - 0.08 * down)
        return 1e3 * ca.sumsqr(tool.r - part) + 1e-4 * sum(arm.tau**2 for arm in arms)

    def constraints(self):
        for arm in self.robot.arms:
            yield between(-15.0, arm.tau, 15.0)


pick = Mpc(Picks, period=0.02, elements=15).run(stop=1.1)
print(pick)
r = pick["robot.tool.r"]
held = (pick.time > 0.55) & (pick.time < 0.65)
assert abs(r[held, 0] - (-0.15 + 0.3 * pick.time[held])).max() < 3e-3  # m, over the part
assert abs(r[held, 2] + 0.76).max() < 5e-3
pick.plot("robot.tool.r", "robot.arms[0].tau", "robot.arms[1].tau", "robot.arms[2].tau")

# %%
animate(pick, speed=0.25)

# %% [markdown]
# ## A Stewart platform with a load that nobody told of
#
# The controller knows a platform of 10 kg, the one in the loop weighs 12. It stands low by what the cost allows, as no
# integrator or estimate of the load is there.


# %%
class Platform(Optimization):
    """The platform 5 cm aside and 5 cm up, level."""

    robot = StewartPlatform()

    def integrand(self):
        o, legs = self.robot.platform, self.robot.legs
        away = ca.sumsqr(o.r - np.array([0.05, -0.03, 0.85])) + ca.sumsqr(o.q[1:])
        return 1e3 * away + ca.sumsqr(o.v) + ca.sumsqr(o.w) + 1e-5 * sum(leg.f**2 for leg in legs)

    def constraints(self):
        for leg in self.robot.legs:
            yield between(-300.0, leg.f, 300.0)


loaded = Mpc(Platform, period=0.02, elements=10).run(Platform(robot=dict(platform=dict(m=12.0))), stop=0.8)
print(loaded)
low = 0.85 - loaded["robot.platform.r"][-1, 2]
print(f"{1e3 * low:.1f} mm low")
assert 0.0 < low < 0.01
loaded.plot("robot.platform.r", "robot.legs[0].f", "robot.legs[1].f", "robot.legs[2].f")
