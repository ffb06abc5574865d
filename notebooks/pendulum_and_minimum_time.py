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
# # From a pendulum to a minimum-time motion
#
# A model here is what it is in Modelica: declarations, then equations, in any order and without saying which
# variable is computed from which. We write a pendulum, look at what the compiler makes of it, and then let
# a parallel robot move as fast as its motors allow.

# %%
import matplotlib.pyplot as plt
import numpy as np

from gantrytau import Model, Parameter, Real, der, simulate, translate

# %% [markdown]
# ## A pendulum in Cartesian coordinates
#
# The rod is a constraint between positions. There is no equation for its tension; it is whatever keeps the
# constraint. Such a model has index three, and an integrator cannot take it as it stands.


# %%
class Pendulum(Model):
    """A point mass on a massless rod, y upwards."""

    L = Parameter(1.0, unit="m", description="length of the rod")
    m = Parameter(1.0, unit="kg", description="mass")
    g = Parameter(9.81, unit="m/s2", description="acceleration of gravity")
    x = Real(unit="m", description="horizontal position", start=0.8)
    y = Real(unit="m", description="vertical position", start=-0.6)
    tension = Real(unit="N/m", description="force of the rod divided by its length")

    def equations(self):
        yield self.m * der(der(self.x)) == -self.tension * self.x
        yield self.m * der(der(self.y)) == -self.tension * self.y - self.m * self.g
        yield self.x**2 + self.y**2 == self.L**2


dae = translate(Pendulum())
print(dae.diagnosis)

# %% [markdown]
# One degree of freedom: the compiler differentiated the constraint twice and chose one coordinate and its speed
# as states. Every block is there to be read, with the equation of the model it comes from.

# %%
print(dae.equations())

# %% [markdown]
# ## A hundred seconds of swinging
#
# The integrator works on all coordinates and is held to the constraint, so nothing drifts, and it does not
# matter that neither x nor y alone is a good coordinate all the way round.

# %%
swing = simulate(dae, stop=100.0, tolerance=1e-8, points=5001)
length = np.hypot(swing["x"], swing["y"])
energy = 0.5 * (swing["der(x)"] ** 2 + swing["der(y)"] ** 2) + 9.81 * swing["y"]
print(f"rod length off by {np.ptp(length):.1e} m, energy by {np.ptp(energy):.1e} J")
assert np.max(np.abs(length - 1.0)) < 1e-10
assert np.ptp(energy) < 1e-4 * abs(energy[0])

figure, axes = plt.subplots(figsize=(8, 2.5), layout="constrained")
axes.plot(swing.time, swing["x"], label="x")
axes.plot(swing.time, swing["y"], label="y")
axes.set(xlabel="time [s]", ylabel="position [m]", xlim=(0, 10))
axes.legend(loc="upper right")
plt.show()

# %% [markdown]
# ## The same for a robot
#
# The Gantry-Tau robot has three carts on guideways and a plate that hangs on rods. It is written from components
# that are connected; `prototypes` holds the parameters that Dressler (2012) identified.

# %%
from gantrytau_models import GantryTau, prototypes

robot = translate(GantryTau(prototypes.GT_A))
print(robot.diagnosis)
assert robot.diagnosis.mobility == 3

# %% [markdown]
# From one translation come functions of every causality. Where are the carts when the tool is at A, and what
# forces hold it there?

# %%
A, B = [0.0, 2.51, -1.03], [1.711, 3.46, -0.24]
carts = [f"carts[{k}].s" for k in range(3)]
forces = [f"carts[{k}].f" for k in range(3)]
inverse_kinematics = robot.function(["tool.r"], carts)
inverse_dynamics = robot.function(["tool.r", "tool.v", "der(tool.v)"], forces)
print("carts at", [f"{float(s):.4f} m" for s in inverse_kinematics(A)])
holding = np.array([float(f) for f in inverse_dynamics(A, [0, 0, 0], [0, 0, 0])])
print("holding forces", holding.round(1), "N")
# gravity does not pull along the guideways: the forces balance each other (thesis, section 6.2)
assert abs(holding.sum()) < 1e-9

# %% [markdown]
# ## As fast as the motors allow
#
# A problem is the model plus objective, constraints, and what is free. It reads in the order of the mathematics.

# %%
from gantrytau_optimica import Free, Optimization, final, initial, optimize

from gantrytau import between  # isort: skip


class FreePath(Optimization):
    """Carry the tool from A to B as fast as the motors allow."""

    robot = GantryTau(prototypes.GT_A)
    final_time = Free(1.0, unit="s", min=0.1, max=5.0, description="duration of the motion")

    def objective(self):
        return self.final_time

    def constraints(self):
        for cart in self.robot.carts:
            yield between(-1207.2, cart.f, 1207.2)  # N: 6.337 N.m of the motor through its gear
        yield initial(self.robot.tool.r) == A
        yield final(self.robot.tool.r) == B
        yield initial(self.robot.tool.v) == 0
        yield final(self.robot.tool.v) == 0


fastest = optimize(FreePath)
print(f"{fastest.final_time:.5f} s after {fastest.iterations} iterations")
assert fastest.final_time < 0.9145  # 0.9134 to 0.9142 s by where 50 elements stand, or the faster branch

# %% [markdown]
# ## Along a line
#
# The same robot with two equations more. Two of the three forces can then not be chosen any more; `given` names
# the one that stays. The compiler finds by itself that two states are left.


# %%
class OnLine(GantryTau):
    """The robot with its tool on the straight line from A to B."""

    def equations(self):
        yield from super().equations()
        share = (self.tool.r[0] - A[0]) / (B[0] - A[0])
        for k in (1, 2):
            yield self.tool.r[k] == A[k] + share * (B[k] - A[k])


class AlongLine(FreePath):
    """The same motion along the straight line."""

    robot = OnLine(prototypes.GT_A)
    given = ("robot.carts[2].f",)


straight = optimize(AlongLine)
print(f"{straight.final_time:.5f} s, states {straight.dae.states}")
assert abs(straight.final_time - 0.974057) < 2e-5
assert len(straight.dae.states) == 2
print(f"the free path saves {1 - fastest.final_time / straight.final_time:.1%} of the time (thesis: 7 %)")

# %%
figure, axes = plt.subplots(1, 2, figsize=(9, 3), sharey=True, layout="constrained")
for axis, motion, title in zip(axes, (fastest, straight), ("free path", "straight line"), strict=True):
    for k in range(3):
        axis.plot(motion.time, motion[f"robot.carts[{k}].f"], label=f"cart {k + 1}")
    axis.set(title=title, xlabel="time [s]")
axes[0].set_ylabel("actuator force [N]")
axes[1].legend()
plt.show()
