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
# # Hands on the robot
#
# A robot is taught by taking it by the hand: a force sensor in its handle, and a law that makes the handle feel like a mass
# with some damping (Dressler 2012, chapter 8). Here a way is taught so in simulation, with a trembling hand and noisy
# encoders. The recording becomes a path, the path a motion that is as fast as the motors allow, and the robot plays
# it back. At the end the hand puts a match into a hole, which no teaching of positions could do.

# %%
import matplotlib.pyplot as plt
import numpy as np

from gantrytau import Input, Model, Parameter, Samples, between, simulate, white_noise
from gantrytau.kinematics import Kinematics
from gantrytau_models import ControlledRobot, GantryTau, prototypes
from gantrytau_models.leadthrough import (
    Impedance,
    PegInHole,
    VelocityServo,
    peg_disturbances,
    plot_peg_forces,
    plot_peg_orientation,
)
from gantrytau_optimica import Free, Optimization, Path, Way, final, initial, optimize

ROBOT = prototypes.GT_A
PERIOD = 0.004  # s, of the robot's controller

# %% [markdown]
# ## A hand leads the tool
#
# Every 4 ms the force of the hand becomes a velocity, V(k + 1) = V(k) + T (F - D V) / M, and the servos follow it within
# some milliseconds. The hand is a soft spring to where its owner wants to be; nothing else is known to the robot.


# %%
class Teaching(Model):
    """A tool that is led by hand: positions are those from where it begins."""

    c = Parameter(150.0, unit="N/m", description="stiffness of the hand")
    aim = Input(3, unit="m", description="where the hand wants to be")
    tremor = Input(3, unit="N", description="force that the hand does not want")
    impedance = Impedance()
    servo = VelocityServo()

    def equations(self):
        impedance, servo = self.impedance, self.servo
        yield impedance.f == self.c * (self.aim - servo.r) + self.tremor
        yield impedance.v_tool == servo.v
        yield impedance.passed == impedance.v
        yield servo.v_ref == impedance.v


# %% [markdown]
# The operator shows a way through five places, at 12 cm/s, rests in the middle to think, and begins and ends at rest.

# %%
PLACES = [[0.1, 2.6, -1.0], [0.3, 2.6, -0.85], [0.6, 2.75, -0.6], [0.9, 3.0, -0.6], [1.1, 3.1, -0.75]]  # m
shown = Path.through(PLACES)
half = 0.5 * shown.length / 0.12  # s
STOP = 16.0
pauses = np.array([0.0, 1.0, 1.0 + half, 3.0 + half, 3.0 + 2 * half, STOP])
times = np.linspace(0.0, STOP, 801)
places = shown.at(np.interp(times, pauses, shown.length * np.array([0.0, 0.0, 0.5, 0.5, 1.0, 1.0])))

taught = simulate(
    Teaching(),
    stop=STOP,
    points=801,
    inputs={"aim": (times, places - places[0]), "tremor": white_noise(std=0.5, period=0.02)},
    seed=1,
)
tool = places[0] + taught["servo.r"]
lag = np.linalg.norm(
    tool - shown.at(np.interp(taught.time, pauses, shown.length * np.r_[0, 0, 0.5, 0.5, 1, 1])), axis=1
)
print(f"taught in {pauses[-2]:.1f} s; the tool lags at most {1e3 * lag.max():.0f} mm behind the hand")
assert lag.max() < 0.05  # m: it does as the hand wants: D v / c = 32 mm behind it

# %% [markdown]
# ## What is recorded
#
# The robot knows where its carts are, to 50 micrometres; its kinematics say where the tool is.

# %%
kinematics = Kinematics(GantryTau(ROBOT))
carts = kinematics.ik(tool) + np.random.default_rng(0).normal(0.0, 5e-5, (len(tool), 3))
recorded, _ = kinematics.fk(carts)
follows = Path.recorded(recorded)
path = Path.recorded(recorded, tolerance=2e-3)
for name, one in (("as close as the noise suggests", follows), ("within 2 mm of every point", path)):
    bends = one.curvature(np.linspace(0.0, one.length, 2000)).max()
    print(f"{name}: {one}, curvature up to {bends:.1f} 1/m")
assert path.deviation is not None
assert path.deviation.largest < 2e-3
assert abs(path.length - shown.length) < 0.01 * shown.length

# %% [markdown]
# The first path keeps every tremor of the hand, and bends where it did; the second has a few pieces.

# %%
figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
axes[0].plot(*recorded[:, :2].T, ".", ms=2, color="0.6", label="recorded")
axes[0].plot(*path.at(np.linspace(0, path.length, 400))[:, :2].T, label="path")
axes[0].set(xlabel="x [m]", ylabel="y [m]")
for one, label in ((follows, "by the noise"), (path, "within 2 mm")):
    s = np.linspace(0.0, one.length, 2000)
    axes[1].semilogy(s, np.maximum(one.curvature(s), 1e-2), lw=0.9, label=label)
axes[1].set(xlabel="s [m]", ylabel="curvature [1/m]")
for one in axes:
    one.grid(alpha=0.3)
    one.legend()

# %% [markdown]
# ## As fast as the motors allow
#
# The tool stays on the path; how it moves along it is free. A fifth of the forces is left to the controller that is to
# play the motion back.

# %%
LIMIT = 0.8 * 1207.0  # N


def fastest(along: Path) -> type[Optimization]:
    """Along a path, from rest to rest, in the least time."""

    class Fastest(Optimization):
        robot = GantryTau(ROBOT)
        way = Way(along)
        final_time = Free(1.0, unit="s", min=0.1, max=10.0, description="duration of the motion")
        given = ("way.a",)

        def equations(self):
            yield self.robot.tool.r == self.way.r

        def objective(self):
            return self.final_time

        def constraints(self):
            for cart in self.robot.carts:
                yield between(-LIMIT, cart.f, LIMIT)
            for end, s in ((initial, 0.0), (final, along.length)):
                yield end(self.way.s) == s
                yield end(self.way.v) == 0

    return Fastest


move, trembling = (optimize(fastest(one)) for one in (path, follows))
largest = np.max([np.abs(move[f"robot.carts[{k}].f"]) for k in range(3)], axis=0)
print(f"{move.final_time:.3f} s instead of {pauses[-2] - 1.0:.1f} s, with forces up to {largest.max():.0f} N")
assert 0.7 < move.final_time < 0.9
assert np.mean(largest > 0.99 * LIMIT) > 0.9  # one cart is at its limit nearly always

# %% [markdown]
# Limits hold at the points of the mesh. Driven by the forces that were found, the model says what happens in between: some
# newtons, for which there is room. Along the path that keeps every tremor these are hundreds, and the motion takes longer.

# %%
print(move.playback)
between_points = [max(v.amount for v in one.playback.violations) for one in (move, trembling)]
print(f"beyond their limits: {between_points[0]:.0f} N, along the trembling path {between_points[1]:.0f} N")
print(f"which takes {trembling.final_time:.3f} s")
assert between_points[0] < 0.05 * LIMIT < between_points[1]
assert trembling.final_time > 1.03 * move.final_time

# %% [markdown]
# ## Played back
#
# The references go to the robot's own controller, a sample every 4 ms: feedforward from a model, position and speed control.

# %%
grid = np.arange(0.0, move.final_time + PERIOD, PERIOD)
reference = move.signal("robot.tool.r")(np.minimum(grid, move.final_time))
end = grid[-1] + 0.5
course = Samples(np.append(grid, end), np.vstack([reference, reference[-1:]]), kind="linear")
played = simulate(
    ControlledRobot(ROBOT, start=reference[0].tolist()), stop=end, inputs={"r_ref": course}, points=601
)

dense = path.at(np.linspace(0.0, path.length, 20001))
off = np.array([np.linalg.norm(dense - r, axis=1).min() for r in played["r"]])
used = max(np.abs(played[f"robot.carts[{k}].f"]).max() for k in range(3))
print(
    f"at most {1e3 * off.max():.1f} mm off the taught path, {1e3 * np.abs(played['error']).max():.2f} from its reference"
)
print(f"the largest force is {used:.0f} N of 1207 N")
assert off.max() < 4e-3  # m, the filter of the references cuts its corners
assert np.abs(played["error"]).max() < 1e-3
assert used < 1207.0
assert np.linalg.norm(played.final("r") - recorded[-1]) < 3e-3

# %%
figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.4), layout="constrained")
for k, letter in enumerate("xyz"):
    axes[0].plot(taught.time / STOP, tool[:, k] - tool[0, k], color=f"C{k}", lw=0.8, ls="--")
    axes[0].plot(played.time / end, played["r"][:, k] - played["r"][0, k], color=f"C{k}", label=letter)
    axes[1].plot(played.time, played[f"robot.carts[{k}].f"], label=f"cart {k + 1}")
axes[0].set(xlabel="part of the time", ylabel="taught (dashed), played [m]")
axes[1].set(xlabel="time [s]", ylabel="force [N]")
for one in axes:
    one.grid(alpha=0.3)
    one.legend()

# %% [markdown]
# ## What cannot be taught by places
#
# A match goes into a hole that it fits by three tenths of a millimetre, held 6 degrees askew. The hand pushes it, and the
# robot adds what the hand cannot feel: it turns the tool after the torque about the tip of the match, until nothing presses.

# %%
seeds = peg_disturbances()
helped = simulate(PegInHole(), stop=85.0, inputs=seeds, seed=0, points=851, tolerance=1e-6)
alone = simulate(
    PegInHole(control=dict(tool=dict(K_tau=[0.0] * 3))),
    stop=85.0,
    inputs=seeds,
    seed=0,
    points=851,
    tolerance=1e-6,
)
for name, run in (("with torque control", helped), ("without", alone)):
    depth = -1e3 * run["tool.r"][:, 2].min()
    print(f"{name}: {np.degrees(run.at(79.0, 'tool.angle')):.2f} deg, {depth:.1f} mm deep")
assert np.degrees(helped.at(79.0, "tool.angle")) < 2.2
assert -helped["tool.r"][:, 2].min() > 0.028
assert np.degrees(alone.at(79.0, "tool.angle")) > 5.9
assert -alone["tool.r"][:, 2].min() < 0.02

# %%
plot_peg_orientation(helped)

# %%
plot_peg_forces(helped)

# %% [markdown]
# The tilt goes within half a minute. The angles alpha and gamma run about at its end, as they are singular where a tool
# points down; their difference, the rotation about the match, hardly moves.
