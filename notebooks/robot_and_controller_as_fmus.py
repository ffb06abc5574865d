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
# # Robot and controller as FMUs
#
# A robot and its controller are often not written in one tool, nor run in one. Here each becomes an FMU, a file that other
# tools simulate, too, and the two are simulated together. The robot is the three-link Gantry-Tau GT_A; its controller
# gives forces to three carts every 4 ms. We look at what feedforward is worth, at what a plate costs that is heavier
# than the controller believes, and at what it costs to cut the loop into two files.

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from gantrytau import Real, simulate
from gantrytau_fmu import Master, cosimulate, export_fmu, read_fmu
from gantrytau_models import (
    CircularReference,
    ControlledRobot,
    MeasuredGantryTau,
    TrackingController,
    prototypes,
)

START = [0.5, 2.8, -0.8]  # m, the tool at the start
CIRCLE = CircularReference(start=START, radius=0.1, period=1.0)
folder = Path(tempfile.mkdtemp())

# %% [markdown]
# ## Two models
#
# The plant has the forces of its actuators as inputs, and what encoders would measure as outputs. The controller has two
# parts. `feedforward` leads a robot of its own along the reference, behind filters of third order, and so knows which
# forces that takes (Dressler 2012, Figure 3.2). `control` is a cascade on each axis, P for the position around PI for
# the speed. The circle is a part of the controller, so that it needs nothing from outside.

# %%
robot = MeasuredGantryTau(prototypes.GT_A, tool=dict(r=dict(start=START)))


class Circling(TrackingController):
    """A controller that leads the tool along a circle."""

    r_ref = Real(3, unit="m", description="reference of the tool position")
    circle = CIRCLE

    def equations(self):
        yield from super().equations()
        yield self.r_ref == self.circle.r


controller = Circling(prototypes.GT_A, start=START)

# %% [markdown]
# ## Two files
#
# `find` names the outputs. Parameters stay parameters of the file: the mass of the plate and the share of the
# feedforward can be set where the file is used.

# %%
files = {"robot": folder / "robot.fmu", "controller": folder / "controller.fmu"}
export_fmu(robot, files["robot"], find=["tool.r", "q", "v"])
export_fmu(controller, files["controller"], find=["f", "feedforward.r"])
for path in files.values():
    print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")
    assert path.stat().st_size < 200_000
print(read_fmu(files["robot"]))

# %% [markdown]
# ## One system
#
# Names of vectors connect all their elements. The controller samples and holds, so it goes first in each step: it takes what
# the robot measures at the instant, and the robot then moves under the forces that follow.

# %%
WIRES = [
    ("robot.q", "controller.q"),
    ("robot.v", "controller.v"),
    *((f"controller.f[{k}]", f"robot.carts[{k}].f") for k in range(3)),
]
CASES = {
    "feedforward": {},
    "without feedforward": {"controller.feedforward_share": 0.0},
    "feedforward, heavier plate": {"robot.plate_mass": 12.0},  # kg; the controller knows of 9.13
    "without, heavier plate": {"robot.plate_mass": 12.0, "controller.feedforward_share": 0.0},
}
runs = {
    title: cosimulate(files, WIRES, stop=2.0, step=0.001, start=settings) for title, settings in CASES.items()
}


def error(run):
    """How far the tool is from its reference behind the filters, in m."""
    return np.linalg.norm(run["controller.feedforward.r"] - run["robot.tool.r"], axis=1)


largest = {title: error(run).max() for title, run in runs.items()}
for title, far in largest.items():
    print(f"{title:28}{1e3 * far:8.2f} mm at most")

# %%
figure, (path_axis, error_axis) = plt.subplots(1, 2, figsize=(12, 4.5), layout="constrained")
reference = runs["feedforward"]["controller.feedforward.r"]
path_axis.plot(*reference[:, :2].T, "k", linewidth=0.8, label="reference")
for colour, title in enumerate(CASES):
    run = runs[title]
    style = dict(color=f"C{colour}", label=title)
    ten_fold = reference + 10 * (run["robot.tool.r"] - reference) if "heavier" not in title else None
    if ten_fold is not None:
        path_axis.plot(*ten_fold[:, :2].T, **style)
    error_axis.semilogy(run.time, 1e3 * np.maximum(error(run), 1e-6), **style)
path_axis.set(
    xlabel="x [m]", ylabel="y [m]", title="path of the tool, its errors ten times as large", aspect="equal"
)
error_axis.set(xlabel="time [s]", ylabel="error [mm]", title="distance from the reference", ylim=(1e-3, 100))
path_axis.set_xlim(0.15, 0.85)
path_axis.legend(loc="center", fontsize="small")
error_axis.legend(loc="lower right")
plt.show()

# %% [markdown]
# With the right model the feedforward leaves a fiftieth of the error. The controller then only has to make up for
# forces that are held for 4 ms; where a cart turns round, friction changes faster than that. With a plate that is a third
# heavier than it believes, feedforward is still worth a factor of twelve: much of the force is friction.

# %%
assert largest["feedforward"] < 0.3e-3  # m
assert largest["without feedforward"] > 30 * largest["feedforward"]
assert largest["without, heavier plate"] > 8 * largest["feedforward, heavier plate"]

# %% [markdown]
# ## The forces
#
# What the motors do is nearly the same in all cases, as the robot follows nearly the same path. The difference is when: the
# controller alone finds the forces late, after an error has built up.

# %%
figure, axes = plt.subplots(3, sharex=True, figsize=(9, 6), layout="constrained")
for k, axis in enumerate(axes):
    for title in ("feedforward", "without feedforward"):
        axis.step(runs[title].time, runs[title][f"controller.f[{k}]"], where="post", label=title, linewidth=1)
    axis.set(ylabel=f"cart {k + 1} [N]")
axes[0].legend(loc="upper right")
axes[-1].set_xlabel("time [s]")
plt.show()

# %% [markdown]
# ## The same as one model
#
# In one model there is nothing to exchange. The integrator stops at each instant at which the controller samples, and
# goes on.


# %%
class Whole(ControlledRobot):
    """Robot, controller and circle as one model."""

    r_ref = Real(3, unit="m", description="reference of the tool position")
    circle = CIRCLE

    def equations(self):
        yield from super().equations()
        yield self.r_ref == self.circle.r


whole = simulate(Whole(prototypes.GT_A, start=START), stop=2.0, points=2001)
print(f"{'step':>8}{'controller first':>22}{'both at once':>18}")
apart = {}
for step in (0.004, 0.002, 0.001):
    for order in ("gauss-seidel", "jacobi"):
        run = cosimulate(files, WIRES, stop=2.0, step=step, master=Master(order=order))
        there = whole["r"][:: round(step / 0.001)]
        apart[step, order] = np.linalg.norm(run["robot.tool.r"] - there, axis=1).max()
    gauss_seidel, jacobi = apart[step, "gauss-seidel"], apart[step, "jacobi"]
    print(f"{1e3 * step:5.0f} ms{1e3 * gauss_seidel:19.6f} mm{1e3 * jacobi:15.3f} mm")

# %% [markdown]
# With the controller first the cut costs nothing: the forces change only when the controller samples, and the robot sees
# them at once. With both at once each of them sees the other a step late, and the error is proportional to the step.

# %%
assert apart[0.001, "gauss-seidel"] < 0.05e-3  # m
assert max(apart[step, "gauss-seidel"] for step in (0.004, 0.002, 0.001)) < 1e-6
assert abs(apart[0.004, "jacobi"] / apart[0.001, "jacobi"] - 4) < 0.5  # first order
