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
# # A robot that learns
#
# A robot that runs the same motion again and again makes the same error again and again. Iterative learning control
# corrects the reference of the next run by the error of the last one. Here the L1 of Dressler (2012, chapter 7) learns a
# square of 10 mm: first by its actuators alone, which makes these nearly perfect and leaves the tool where it was, then by
# what is known of the tool. The thesis prints no filter, no model and no gain of a servo, so that curves cannot be compared.
# What of its Table 7.2 is an input here the record of the robot says.

# %%
from dataclasses import replace

import numpy as np

from gantrytau_models import FlexibleGantryTau, GantryTau, PreslidingFriction, cart_servos, prototypes
from gantrytau_optimica import (
    Complementary,
    Gradient,
    Kalman,
    Learning,
    Measured,
    NormOptimal,
    Rig,
    Tukey,
    ZeroPhase,
    design_q,
    learn,
    square_reference,
)
from gantrytau_optimica.learning import (
    Actuators,
    LearningError,
    Scatter,
    arm_model,
    estimated_response,
    plot_learning,
    plot_q,
)

RECORD = prototypes.L1_flexible
PERIOD = 0.004  # s, of references
RUNS = 6  # after the first

# %% [markdown]
# ## A robot, its servos, and what differs from run to run
#
# The robot gives way: its frame sways, its arms are springs, and gauges see the tool at the wrist. Servos take references
# every 4 ms and act on them 12 ms later. Friction and where it rests are drawn for each run, so that not everything repeats.

# %%
rig = Rig(
    FlexibleGantryTau(RECORD, friction=PreslidingFriction),
    cart_servos(RECORD),
    period=PERIOD,
    noise=Scatter(),
    stiff=GantryTau(RECORD),  # whose kinematics the controller goes by
)
square = square_reference(0.010)
window = Tukey(1.2, 4.5)  # s, in which corrections are learnt, fading in and out
print(rig, square, RECORD.fitted, sep="\n")

# %% [markdown]
# ## Learning by the actuators
#
# Each actuator learns from its own error, five samples ahead, through a filter that lets 10 Hz pass and shifts nothing.
# Before the first run `learn` excites the robot and identifies what corrections do: so it can say whether errors will fall.

# %%
by_actuators = learn(rig, square, Learning(window=window), Actuators(), iterations=RUNS, seed=1)
print(by_actuators)
assert np.all(by_actuators.relative[5] < 4)
assert np.all(np.abs(by_actuators.tool_relative[5:, :2].mean(axis=0) / [13.3, 36.1] - 1) < 0.1)
by_actuators.plot("errors")

# %%
by_actuators.plot("path")

# %% [markdown]
# Actuators end at 2.5 %. The tool keeps more than a third of its error across the arms: it swings on them, and no encoder
# sees it. So the error must be that of the tool.
#
# ## Learning by gauges, and why a plain filter will not do
#
# Above the resonances the tool moves against its reference: what is learnt there has the wrong sign, and errors grow from
# run to run. That is told before anything moves.

# %%
response = estimated_response(rig, square, Measured())
try:
    learn(rig, square, Learning(window=window), Measured(), response=response)
    raise AssertionError("this should have been refused")
except LearningError as error:
    print(error)

# %% [markdown]
# `force=True` shows that it is true, and how little one gains by calling it a warning.

# %%
forced = learn(
    rig, square, Learning(window=window), Measured(), iterations=5, seed=1, response=response, force=True
)
print(np.round(forced.relative, 0))
assert forced.relative[5].max() > 500

# %% [markdown]
# ## A filter that is open where it may be
#
# `design_q` makes the filter as open as possible up to 30 Hz while learning converges for a whole family of robots: their
# resonances lie 8 % lower or higher and are damped more or less. Both axes count together, as filters that are good enough
# for each axis alone diverge where one moves the other.

# %%
q = design_q(response)
print(q.magnitude(np.array([2.0, 7.4, 11.0, 20.0]), PERIOD).round(2))
plot_q(q, response, limit=40.0)

# %%
by_gauges = learn(
    rig, square, Learning(q=q, window=window), Measured(), iterations=RUNS, seed=1, response=response
)
print(by_gauges)
assert by_gauges.stability.monotone
assert by_gauges.tool_relative[5, 1] < by_actuators.tool_relative[5, 1] - 8

# %% [markdown]
# ## Without gauges
#
# In production there are no gauges. An accelerometer on the plate is cheap: twice integrated it knows fast motion, and
# kinematics knows slow motion; complementary filters join both (case 2A). A model of the arms knows more: the Kalman filter
# uses it, and the accelerometer only where the model is wrong (case 2B). Here the model is that of another robot, whose
# arms are 10 % stiffer, as a model of the very same robot would prove nothing.

# %%
stiffer = replace(
    RECORD,
    arm_stiffness=tuple(1.1 * c for c in RECORD.arm_stiffness),
    frame_stiffness=1.1 * RECORD.frame_stiffness,
)
other = Rig(
    FlexibleGantryTau(stiffer, friction=PreslidingFriction),
    cart_servos(RECORD),
    period=PERIOD,
    noise=Scatter(),
    stiff=GantryTau(RECORD),
)
kalman = Kalman(arm_model(other, square))
histories = {"1, actuators": by_actuators}
for name, estimator in (("2A, accelerometer", Complementary()), ("2B, Kalman", kalman)):
    seen = estimated_response(rig, square, estimator)
    learning = Learning(q=design_q(seen), window=window)
    histories[name] = learn(rig, square, learning, estimator, iterations=RUNS, seed=1, response=seen)
histories["3, gauges"] = by_gauges
print(f"{'case':20s} sigma   x     y     (printed: 13.3 36.1, 12.6 23.9, 13.3 25.2, 10.3 24.9)")
for name, history in histories.items():
    tool = history.tool_relative[5:].mean(axis=0)
    print(f"{name:20s} {history.stability.sigma:.3f} {tool[0]:5.1f} {tool[1]:5.1f}")
    assert name.startswith("1") or (
        tool[1] < by_actuators.tool_relative[5:, 1].mean() - 8 and 0.84 < history.stability.sigma < 0.96
    )
assert np.all(np.abs(histories["3, gauges"].tool_relative[5:, :2].mean(axis=0) / [10.3, 24.9] - 1) < 1 / 3)
plot_learning(histories)

# %% [markdown]
# Case 1 was an input. Case 2A is predicted within 2 points. With the Kalman filter, and with gauges across the arms, the
# simulated robot is better than the real one by 8 points: those predictions fail.
#
# ## What the tool does
#
# Why is case 2B better by half along x than gauges, which see the tool itself? Its filter is open at the resonance of the
# frame. The estimate goes by a model, which shows little of that resonance and nothing of how it differs from robot to
# robot: so it costs nothing. Let the filter suit the tool, too, of which gauges told once.

# %%
frame = np.array([7.4])  # Hz
suits = design_q(seen, tool=response)  # seen: the response by the Kalman filter, case 2B
for title, filters in (("estimate", design_q(seen)), ("estimate and tool", suits), ("gauges", q)):
    print(f"Q at 7.4 Hz along x, by the {title}: {filters.magnitude(frame, PERIOD)[0, 0]:.2f}")
learning = Learning(q=suits, window=window)
careful = learn(rig, square, learning, kalman, iterations=RUNS, seed=1, response=seen)
print(careful.tool_relative[5:].mean(axis=0).round(1)[:2], "% of x and y, printed 13.3 and 25.2")
# by the estimate alone 5 % along x
assert np.all(np.abs(careful.tool_relative[5:, :2].mean(axis=0) / [13.3, 25.2] - 1) < 1 / 3)

# %% [markdown]
# Now cases 2A, 2B and 3 are all within a third of the printed errors. What the thesis reached, a robot that is not known
# too well reaches; what the filter by the estimate promises, only a robot that is as its model.
#
# ## Other laws
#
# A shift needs no model, and so it has the wrong sign where the tool moves against its reference: there the filter must be
# closed. Gradient and norm-optimal learning go by the response that was measured, and have the right sign everywhere. The
# first moves down the slope of the error, in small steps, as one gain must suit the resonance and all else; the second takes
# the correction that leaves the least error for its effort. All are held to the same statement.

# %%
compared = {"shift": by_gauges}
for name, law in (("gradient", Gradient(gain=1.8)), ("norm-optimal", NormOptimal())):
    learning = Learning(law=law, q=ZeroPhase.butterworth(2, 25.0), window=window)
    compared[name] = learn(rig, square, learning, Measured(), iterations=RUNS, seed=1, response=response)
for name, history in compared.items():
    print(f"{name}: {history.stability}\n    x, y: {history.relative[RUNS].round(1)} %")
assert all(history.stability.monotone for history in compared.values())
assert np.all(compared["norm-optimal"].relative[RUNS] < 0.5 * by_gauges.relative[RUNS])
plot_learning(compared)

# %% [markdown]
# With the response of the robot at hand, norm-optimal learning leaves less than half of what the shift leaves, though its
# filter is a plain one: what is learnt above the resonances has the right sign. It trusts the response that it measured,
# so measure it again where the robot works elsewhere.
