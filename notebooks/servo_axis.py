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
# # A servo axis, from the winding to the carriage
#
# A DC motor turns a ball screw, the screw moves a carriage, and the carriage rubs on its guideway: it sticks, then it slips.
# A controller that samples holds the axis on its reference. We build the axis from components, design the speed loop on a
# Bode plot, look at what sampling takes from it, creep slowly enough to see the carriage stick, and ask over several seeds
# what the noise of the speed sensor does to all that.

# %%
import matplotlib.pyplot as plt
import numpy as np

from gantrytau import Input, Model, connect, linearize, simulate, study, white_noise
from gantrytau.blocks import DiscretePid, Gain, Pid, Ramp
from gantrytau.electrical import DcMotor, Ground, VoltageSource
from gantrytau.mechanics import gears, translational

LEAD = 0.01  # m, travel of the carriage for one turn of the screw
PERIOD = 2e-3  # s, of the controller

# %% [markdown]
# ## The axis
#
# The winding has resistance and inductance; what it does to the shaft and the shaft to it is one constant, k. The guideway
# holds the carriage up to 35 N, and brakes it with 20 N once it moves.


# %%
class Axis(Model):
    """Source, motor, ball screw and carriage; the friction may be replaced."""

    source, ground = VoltageSource(), Ground()
    motor = DcMotor(R=0.8, L=2e-3, k=0.06, J=1.5e-4)
    screw = gears.BallScrew(lead=LEAD)
    carriage = translational.Mass(m=12.0)
    friction: translational.Friction = translational.StickSlipFriction(f_c=20.0, f_s=35.0, f_v=40.0)

    def equations(self):
        yield connect(self.source.pin_a, self.motor.pin_a)
        yield connect(self.source.pin_b, self.motor.pin_b)
        yield connect(self.source.pin_b, self.ground.pin)
        yield connect(self.motor.flange, self.screw.flange_a)
        yield connect(self.screw.flange_b, self.carriage.flange)
        yield connect(self.carriage.flange, self.friction.flange)


# %% [markdown]
# A design starts from what is linear: the same axis with viscous friction alone, seen from the voltage to the speed of the
# rotor. It has two poles besides the integral of the position, that of the winding, near R / L, and that of the rotor with
# the carriage on it, near k^2 / (R J).

# %%
LINEAR = translational.TanhFriction(f_v=40.0)
plant = linearize(Axis(friction=LINEAR), inputs=["source.v"], outputs=["motor.rotor.w"])
slow, fast = np.sort(np.abs(plant.poles[np.abs(plant.poles) > 1e-6]))
inertia = 1.5e-4 + 12.0 * (LEAD / (2 * np.pi)) ** 2
print(f"inertia on the shaft {inertia:.3g} kg.m2, of which the carriage {1 - 1.5e-4 / inertia:.0%}")
print(
    f"poles at {slow:.1f} and {fast:.0f} rad/s; k^2 / (R J) = {0.06**2 / (0.8 * inertia):.1f}, R / L = {0.8 / 2e-3:.0f}"
)
damping = 40.0 * (LEAD / (2 * np.pi)) ** 2
expected = np.roots([2e-3 * inertia, 0.8 * inertia + 2e-3 * damping, 0.8 * damping + 0.06**2])
np.testing.assert_allclose([slow, fast], np.sort(np.abs(expected)), rtol=1e-9)

# %% [markdown]
# ## A speed loop on a Bode plot
#
# A PI controller shall cross over at 100 rad/s, 16 Hz. Its gain is the inverse of the plant's there, and its integral time
# costs 14 degrees: arctan(1 / (100 T_i)).

# %%
CROSSOVER, T_I = 100.0, 0.04  # rad/s, s
gain = 1 / np.abs(plant.response([CROSSOVER / (2 * np.pi)])[0, 0, 0])


class OpenLoop(Model):
    """The controller in front of the plant, the loop cut open."""

    controller = Pid(kind="PI", k=float(gain), T_i=T_I)
    axis = Axis(friction=LINEAR)

    def equations(self):
        yield self.controller.u_m == 0
        yield connect(self.controller.y, self.axis.source.v)


loop = linearize(OpenLoop(), inputs=["controller.u_s"], outputs=["axis.motor.rotor.w"])
hertz = np.geomspace(0.5, 250.0, 400)
response = loop.response(hertz)[0, 0]
crossing = np.interp(0.0, -np.log(np.abs(response)), np.log(hertz))
phase = np.degrees(np.interp(crossing, np.log(hertz), np.unwrap(np.angle(response))))
margin = 180 + phase
held = np.degrees(
    2 * np.pi * np.exp(crossing) * 1.5 * PERIOD
)  # a period until the sample, and half of one of holding
print(
    f"gain {gain:.3f} V.s/rad, crossover {2 * np.pi * np.exp(crossing):.0f} rad/s, phase margin {margin:.0f} degrees"
)
print(f"sampling every {PERIOD * 1e3:g} ms takes about {held:.0f} degrees of it")
assert abs(2 * np.pi * np.exp(crossing) / CROSSOVER - 1) < 0.05
assert 60 < margin < 80
loop.plot_bode(hertz)

# %% [markdown]
# ## The controller that samples
#
# The speed controller works every 2 ms, within 24 V; a gain around it makes a position loop of 25 1/s. `white` is the noise
# of the speed sensor, zero until a study says otherwise.


# %%
class Servo(Model):
    """The axis with its position and speed loops."""

    white = Input(unit="rad/s", description="noise of the speed sensor", start=0.0)
    reference = Ramp(height=1e-4, duration=0.8, start_time=0.1, unit="m")
    position = Gain(k=25.0 * 2 * np.pi / LEAD, unit=("m", "rad/s"))
    speed = DiscretePid(kind="PI", k=float(gain), T_i=T_I, period=PERIOD, limits=(-24.0, 24.0))
    axis = Axis()

    def equations(self):
        yield self.position.u == self.reference.y - self.axis.carriage.s
        yield connect(self.position.y, self.speed.u_s)
        yield self.speed.u_m == self.axis.motor.rotor.w + self.white
        yield connect(self.speed.y, self.axis.source.v)


# %% [markdown]
# From sample to sample the loops are a discrete system, with the friction linear as before. All of its poles lie within the
# unit circle. The slowest two are the position loop and the integral of the controller, each meant for 25 1/s.

# %%
sampled = linearize(
    Servo(axis=dict(friction=LINEAR)), inputs=["white"], outputs=["axis.carriage.v"], period=PERIOD
)
print(sampled)
rates = np.sort(-np.log(np.abs(sampled.poles)) / PERIOD)  # 1/s
print(f"the loops die away with {rates[0]:.0f} 1/s and more")
assert 25.0 < rates[0] < 35.0

# %% [markdown]
# ## Creeping: stick and slip
#
# The reference moves by 0.1 mm in 0.8 s. The carriage sticks: the integral of the controller has to wind up until the motor
# pushes with 35 N. Then 20 N are left to brake it, it jumps past the reference, and sticks again. Sticking is exact: the
# speed is zero, not small, and the force of the friction is whatever holds it.

# %%
creep = simulate(Servo(), stop=1.2, points=1201)
stuck = np.abs(creep["axis.carriage.v"]) < 1e-9  # m/s; between two jumps it is zero but for rounding
jumps = np.flatnonzero(np.diff(stuck.astype(int)) == -1)
travel = np.diff([0.0, *(creep.at(t + 0.15, "axis.carriage.s") for t in creep.time[jumps])])
print(f"the carriage rests {np.mean(stuck):.0%} of the time and goes in jumps of {travel * 1e6} um")
print(f"largest friction {np.max(creep['axis.friction.f']):.2f} N")
assert len(jumps) == 2
assert np.all(np.abs(travel - 50e-6) < 10e-6)
assert abs(np.max(creep["axis.friction.f"]) - 35.0) < 0.5  # the points lie 1 ms apart
slipping = creep["axis.carriage.v"] > 1e-6
np.testing.assert_allclose(
    creep["axis.friction.f"][slipping], 20.0 + 40.0 * creep["axis.carriage.v"][slipping], rtol=1e-6
)

# %%
figure, (above, below) = plt.subplots(2, 1, sharex=True, layout="constrained")
above.plot(creep.time, creep["reference.y"] * 1e6, label="reference")
above.plot(creep.time, creep["axis.carriage.s"] * 1e6, label="carriage")
above.set_ylabel("position [um]")
above.legend()
below.plot(creep.time, creep["axis.friction.f"])
below.set_ylabel("friction [N]")
below.set_xlabel("time [s]")
plt.show()

# %% [markdown]
# Twice as fast, it breaks away once and then slides: the speed that the controller finds is above what lets it stick again.

# %%
faster = simulate(Servo(reference=dict(height=2e-4)), stop=1.2, points=1201)
moving = (faster.time > 0.4) & (faster.time < 0.9)
assert np.min(faster["axis.carriage.v"][moving]) > 0.1e-3
print(f"slowest after breaking away: {np.min(faster['axis.carriage.v'][moving]) * 1e3:.2f} mm/s")

# %% [markdown]
# ## What the noise of the sensor does
#
# The speed sensor is noisy, with 0.3 rad/s from sample to sample. `study` runs both motions with two seeds each, on all
# processors. Each seed is another stream of numbers, and gives the same answer whenever it is run again.

# %%
SEEDS = 2
cases = study(
    Servo(),
    stop=1.2,
    over={"reference.height": [1e-4, 2e-4]},
    seeds=SEEDS,
    inputs={"white": white_noise(0.3, PERIOD)},
    outputs=["reference.y", "axis.carriage.s", "axis.carriage.v"],
    points=601,
)
print(cases)
assert not cases.failures
rest, error = np.zeros((2, SEEDS)), np.zeros((2, SEEDS))
for row, height in enumerate((1e-4, 2e-4)):
    for seed in range(SEEDS):
        one = cases.result(**{"reference.height": height, "seed": seed})
        rest[row, seed] = np.mean(np.abs(one["axis.carriage.v"]) < 1e-9)
        error[row, seed] = np.max(np.abs(one["reference.y"] - one["axis.carriage.s"]))
for row, name in enumerate(("slow", "fast")):
    print(
        f"{name}: at rest {np.mean(rest[row]):.0%} of the time ({np.min(rest[row]):.0%} to {np.max(rest[row]):.0%}), "
        f"largest error {np.mean(error[row]) * 1e6:.0f} um"
    )
quiet = np.mean(np.abs(faster["axis.carriage.v"]) < 1e-9)
print(f"fast, without noise: {quiet:.0%}")

# %% [markdown]
# The faster motion has lost what made it good: noise carries its speed through zero now and then, and there it sticks. A
# sensor with less noise, or a friction whose static part is nearer to the sliding one, would be worth more here than a
# higher gain.

# %%
assert np.min(rest[1]) > quiet + 0.1
assert np.max(error) < 100e-6
again = simulate(
    Servo(reference=dict(height=2e-4)),
    stop=1.2,
    inputs={"white": white_noise(0.3, PERIOD)},
    seed=1,
    points=601,
)
same = cases.result(**{"reference.height": 2e-4, "seed": 1})
np.testing.assert_allclose(again["axis.carriage.s"], same["axis.carriage.s"], atol=1e-9)

# %%
figure, axes = plt.subplots(layout="constrained")
for seed in range(SEEDS):
    one = cases.result(**{"reference.height": 2e-4, "seed": seed})
    axes.plot(one.time, one["axis.carriage.s"] * 1e6, label=f"seed {seed}")
axes.plot(faster.time, faster["axis.carriage.s"] * 1e6, "k", label="without noise")
axes.set_xlabel("time [s]")
axes.set_ylabel("position [um]")
axes.legend()
plt.show()
