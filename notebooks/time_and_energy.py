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
# # Time and energy
#
# The thesis of Dressler (2012, section 3.5) carries the tool of the robot L1 from A to B as fast as its motors allow,
# and then asks for a little less haste: the cost is the duration plus a weight w times the energy, the integral of
# the squared motor torques. This notebook repeats its Table 3.1 and its Figures 3.9 and 3.10, and looks at what
# the weight does, what the answers are worth on a machine, and whether there are faster ones.

# %%
import matplotlib.pyplot as plt
import numpy as np
from scipy.integrate import trapezoid

from gantrytau import Input, Parameter, Real, between
from gantrytau.mechanics.translational import LinearFriction
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Free, Optimization, final, initial, optimize, pareto, prepare, sensitivities

# %% [markdown]
# ## The problem
#
# The thesis prints neither the places A and B nor the torque limit. Those below are fitted so that the table comes
# out alike; the masses and frictions of the robot are those of the thesis.

# %%
A, B = np.array([0.0, 2.51, -1.03]), np.array([1.711, 3.46, -0.24])  # m
LIMIT = 6.337  # N.m
MOTORS = range(3)


class FreePath(Optimization):
    """Carry the tool from A to B as fast as the motors allow, more gently for w > 0."""

    robot = GantryTau(prototypes.GT_A)
    weight = Parameter(0.0, unit="1/(N2.m2)", description="weight w of the energy")
    gear = Parameter(190.5, unit="1/m", description="force along the guideway per torque of the motor")
    torque = Input(3, unit="N.m", description="motor torque", min=-LIMIT, max=LIMIT)
    square = Real(unit="N2.m2", description="sum of the squared torques")
    final_time = Free(1.0, unit="s", min=0.1, max=5.0, description="duration of the motion")

    def equations(self):
        for k, cart in enumerate(self.robot.carts):
            yield cart.f == self.gear * self.torque[k]
        yield self.square == sum(self.torque[k] ** 2 for k in MOTORS)

    def objective(self):
        return self.final_time

    def integrand(self):
        return self.weight * self.square

    def constraints(self):
        yield initial(self.robot.tool.r) == A
        yield final(self.robot.tool.r) == B
        yield initial(self.robot.tool.v) == 0
        yield final(self.robot.tool.v) == 0


class OnLine(GantryTau):
    """The robot with its tool on the straight line from A to B."""

    def equations(self):
        yield from super().equations()
        share = (self.tool.r[0] - A[0]) / (B[0] - A[0])
        for k in (1, 2):
            yield self.tool.r[k] == A[k] + share * (B[k] - A[k])


class StraightLine(FreePath):
    """The same along the straight line: the torque of motor 3 is chosen, the other two follow from the line."""

    robot = OnLine(prototypes.GT_A)
    given = ("torque[2]",)


# %% [markdown]
# ## Table 3.1
#
# Four motions on a mesh of 50 elements, beside the four rows of the thesis.

# %%
PROBLEMS = {
    "free path, w = 0": FreePath(),
    "free path, w = 0.001": FreePath(weight=0.001),
    "free path, w = 0.01": FreePath(weight=0.01),
    "straight line, w = 0": StraightLine(),
}
THESIS = [(0.9074, 103.84), (0.9191, 77.00), (0.9968, 50.13), (0.97612, 57.33)]  # s, (N.m)2.s
plain = {title: optimize(problem) for title, problem in PROBLEMS.items()}

print(f"{'':22}{'T [s]':>10}{'energy':>9}{'thesis: T':>12}{'energy':>9}   [(N.m)2.s]")
for (title, motion), (time, energy) in zip(plain.items(), THESIS, strict=True):
    found = motion.final_time, motion.integral("square")
    print(f"{title:22}{found[0]:10.5f}{found[1]:9.2f}{time:12.5f}{energy:9.2f}")
    assert abs(found[0] / time - 1) < 0.025
    assert abs(found[1] / energy - 1) < 0.10  # A, B and limit are fitted; the thesis solved on another mesh

# %% [markdown]
# As in the thesis, the free path saves some 6 % of the time of the straight line, at nearly twice the energy; and a
# weight of 0.001 takes back a third of the energy for less than 1 % of the time.
#
# ## Friction, smoothed piecewise linearly
#
# Coulomb friction has the sign of a speed, which is smoothed: by tanh as a default, in the thesis piecewise linearly (its
# Figure 3.6). `LinearFriction` is that law, and `gantrytau demo --friction linear` takes it. It bends where tanh curves, and
# Ipopt does not mind here: times change by less than 0.05 %, iterations go up or down by some. The demo refines its
# motions, which takes longer with these bends, and its guesses do not find the faster branch then.

# %%
LAWS = {
    "free path": (FreePath(), FreePath(robot=GantryTau(prototypes.GT_A, friction=LinearFriction))),
    "straight line": (StraightLine(), StraightLine(robot=OnLine(prototypes.GT_A, friction=LinearFriction))),
}
for title, problems in LAWS.items():
    by_tanh, by_lines = (optimize(problem) for problem in problems)
    for law, motion in (("tanh", by_tanh), ("piecewise linear", by_lines)):
        print(f"{title}, {law}: {motion.final_time:.5f} s in {motion.iterations} iterations")
    assert abs(by_lines.final_time / by_tanh.final_time - 1) < 5e-4

# %% [markdown]
# ## An answer must be played back
#
# The solver knows 150 instants. Between them the torques are polynomials, and nobody looked there. `playback` drives the
# model anew by these torques, with a small error of its own, and looks everywhere.

# %%
hasty = plain["free path, w = 0"]
print(hasty.playback)


def miss(motion):
    """How far from B the tool ends when the motion is played back, in m."""
    return np.linalg.norm(motion.playback["robot.tool.r"][-1] - B)


peak = np.abs(hasty.playback["torque"]).max()
print(
    f"\ntorques up to {peak:.1f} N.m, where {LIMIT} N.m are allowed; the tool ends {1e3 * miss(hasty):.1f} mm from B"
)
assert peak > 1.5 * LIMIT
assert 1e-3 < miss(hasty) < 0.05

# %% [markdown]
# With `refine`, the torques are straight lines in every element, which keep to limits between their ends; the
# motion is solved and played back again, on a mesh with borders where torques switch, until it holds to the
# wanted accuracy. For the motion without weight we are content with 2e-5: it takes seconds instead of a minute.

# %%
accuracy = {title: 2e-5 if title == "free path, w = 0" else 1e-6 for title in PROBLEMS}
motions = {title: optimize(problem, refine=accuracy[title]) for title, problem in PROBLEMS.items()}

for title, motion in motions.items():
    above, off, elements = motion.playback.violation, miss(motion), motion.refinement.rounds[-1].elements
    print(f"{title:22}{motion.final_time:10.6f} s, {elements:3} elements, ", end="")
    print(f"limits passed by {above:.0e} of their range, B missed by {1e6 * off:5.2f} µm")
    assert motion.refinement.reached
    assert above < 1e-6
    assert off < 1e-4 if accuracy[title] == 2e-5 else off < 1e-6

line, fastest = motions["straight line, w = 0"], motions["free path, w = 0"]
assert abs(line.final_time - 0.973782) < 1e-6  # s, exact: the line has one freedom, and a phase plane
assert abs(fastest.final_time - 0.91313) < 1e-4  # s, the limit of ever finer meshes

# %% [markdown]
# ## Paths and speeds: Figure 3.9
#
# On the line one motor is at its limit and the other two have force to spare. In a hurry the tool swings far out, and all
# three are at their limits most of the time. With more weight on energy it comes back towards the line.

# %%


def show_paths(curves):
    """Paths of the tool from above and from the side, and its speed; curves: (motion, label, colour, line style)."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 4), layout="constrained")
    for motion, label, colour, line_style in curves:
        style = dict(color=colour, linestyle=line_style, label=f"{label}: {motion.final_time:.3f} s")
        x, y, z = motion.playback["robot.tool.r"].T
        axes[0].plot(x, y, **style)
        axes[1].plot(x, z, **style)
        speed = np.linalg.norm(motion.playback["robot.tool.v"], axis=1)
        axes[2].plot(motion.playback.result.time, speed, **style)
    for axis, k, title in zip(axes, (1, 2), ("path of the tool, from above", "from the side"), strict=False):
        axis.plot([A[0], B[0]], [A[k], B[k]], "ko", markersize=4)
        axis.annotate("A", A[[0, k]], (8, -4), textcoords="offset points")
        axis.annotate("B", B[[0, k]], (2, -14), textcoords="offset points")
        axis.set(xlabel="x [m]", ylabel=f"{'xyz'[k]} [m]", title=title, aspect="equal")
        axis.margins(0.1)
    axes[2].set(xlabel="time [s]", ylabel="speed [m/s]", title="speed of the tool", ylim=(0, None))
    figure.legend(*axes[2].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    plt.show()


styles = (("C0", "-"), ("C1", "-"), ("C2", "-"), ("k", "--"))
show_paths([(motion, title, *style) for (title, motion), style in zip(motions.items(), styles, strict=True)])

# %% [markdown]
# ## Torques: Figure 3.10

# %%
figure, axes = plt.subplots(4, sharex=True, sharey=True, figsize=(9, 8), layout="constrained")
for axis, (title, motion) in zip(axes, motions.items(), strict=True):
    for k in MOTORS:
        axis.plot(motion.playback.result.time, motion.playback[f"torque[{k}]"], label=f"motor {k + 1}")
    for bound in (-LIMIT, LIMIT):
        axis.axhline(bound, color="k", linewidth=0.8, linestyle=":")
    axis.set(title=f"{title}: {motion.final_time:.3f} s", ylabel="torque [N.m]")
axes[-1].set_xlabel("time [s]")
figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
plt.show()

# %% [markdown]
# ## Why minimum time is bang-bang
#
# Accelerations are linear in the torques, and the time that is left is worth something for every speed and place.
# So each instant is a linear problem: each motor has a number, its *switching function*, which says what a newton-metre
# more is worth, and only its sign matters. Where it is positive the torque stands at one limit, where it is
# negative at the other. That is bang-bang.
#
# Motor 3 moves the heaviest cart with the most friction. It pushes with all it has, switches once and brakes with
# all it has. On the straight line it is the only motor that matters, and the others do what the line asks of them.

# %%
for motion in (fastest, line):
    (switch,) = (s for s in motion.refinement.switches if s.name == "torque[2]")
    print(f"{motion.name}: motor 3 goes from {switch.before} to {switch.after} limit ", end="")
    print(f"at {switch.share * motion.final_time:.4f} s of {motion.final_time:.4f} s")
    assert (switch.before, switch.after) == ("upper", "lower")

# %% [markdown]
# ## A singular arc
#
# Motor 1 leaves its limit from 0.34 s to 0.60 s. There its switching function is not zero for an instant but
# stays zero: a newton-metre more or less costs nothing to first order. This is a *singular arc*. The torque is still not
# arbitrary, as only one course keeps the function at zero, but the cost hardly feels it.
#
# Hence the plain answer looks wild there. It jumps at every point to make the same mean, at nearly the same cost, and
# its energy depends on the mesh in the first digits. An answer like that is not wrong about the time; it is no
# trajectory for a motor.

# %%
figure, axes = plt.subplots(figsize=(9, 3.2), layout="constrained")
played = hasty.playback
axes.plot(
    played.result.time,
    played["torque[0]"],
    color="0.75",
    linewidth=1,
    label="50 elements, between the points",
)
axes.plot(hasty.time[1:], hasty["torque[0]"][1:], ".", color="0.4", label="50 elements, at the points")
played = fastest.playback
axes.plot(played.result.time, played["torque[0]"], color="C0", label="refined")
for bound in (-LIMIT, LIMIT):
    axes.axhline(bound, color="k", linewidth=0.8, linestyle=":")
axes.set(xlabel="time [s]", ylabel="torque of motor 1 [N.m]", title="free path, w = 0")
figure.legend(loc="outside lower center", ncols=3)
plt.show()


def mean(motion, begin, end):
    """The mean torque of motor 1 from begin to end in s, as played back, in N.m."""
    time, torque = motion.playback.result.time, motion.playback["torque[0]"]
    inside = (time >= begin) & (time <= end)
    return trapezoid(torque[inside], time[inside]) / np.ptp(time[inside])


on_arc = fastest.signal("torque[0]")(np.linspace(0.36, 0.56, 101))
print(f"on the arc motor 1 gives {on_arc.min():.2f} to {on_arc.max():.2f} N.m; its mean there is ", end="")
print(f"{mean(fastest, 0.36, 0.56):.2f} N.m, and {mean(hasty, 0.36, 0.56):.2f} N.m in the plain answer")
assert 0 < on_arc.min() < on_arc.max() < 0.75 * LIMIT
assert np.sum(np.abs(np.diff(on_arc))) < 1.01 * np.ptp(on_arc)  # it rises without teeth
assert abs(mean(fastest, 0.36, 0.56) - mean(hasty, 0.36, 0.56)) < 0.5  # N.m

# %% [markdown]
# ## What the weight does
#
# With a weight, each instant becomes a quadratic problem: switching function times torque plus w times its square. The
# best torque is then proportional to the switching function and cut off at the limits. It is continuous where the
# switching function is, and determined everywhere: no jumps, no singular arcs. The step that is left at 0.34 s, for
# w = 0.001, is Coulomb friction: there cart 1 turns round.
#
# Why is that cheap? Along the family of motions a little more weight trades time for energy at the rate w, since the
# sum is at its minimum: dT = -w dE. At w = 0 the first energy saved costs nothing. `pareto` solves for one weight after
# the other, each from the one before.

# %%
gentle = motions["free path, w = 0.001"]
turning = np.interp(0.0, gentle["robot.carts[0].v"][1:-1], gentle.time[1:-1])
print(f"cart 1 turns round at {turning:.3f} s\n")
assert abs(turning - 0.34) < 0.01

weights = [0.0003, 0.0006, 0.001, 0.002, 0.003, 0.006, 0.01, 0.02, 0.03]
trade = pareto(FreePath, "weight", weights, along={"duration": "final_time", "energy": "integral(square)"})
print(trade.report())
figure = trade.plot()
figure.axes[0].plot(line.integral("square"), line.final_time, "kx", label="straight line, w = 0")
figure.axes[0].plot(fastest.integral("square"), fastest.final_time, "C3s", label="free path, w = 0")
figure.axes[0].legend()
figure

# %% [markdown]
# The slope between two neighbours must lie between their weights. The knee is what one would run: at w = 0.003 the
# robot is 3 % faster than on the line for a few per cent more energy. The line itself lies above the curve: there are
# motions that take less of both.

# %%
slopes = -np.diff(trade["duration"]) / np.diff(trade["energy"])
print("time per energy saved:", slopes.round(5), "1/(N.m)2")
assert np.all((slopes > weights[:-1]) & (slopes < weights[1:]))

knee = weights.index(0.003)
assert abs(1 - trade["duration"][knee] / line.final_time - 0.03) < 0.01
assert 1.0 < trade["energy"][knee] / line.integral("square") < 1.08
assert np.interp(line.final_time, trade["duration"], trade["energy"]) < line.integral("square")

longer = gentle.final_time / fastest.final_time - 1
saved = 1 - gentle.integral("square") / fastest.integral("square")
print(f"w = 0.001 against w = 0: {longer:.1%} more time, {saved:.0%} less energy (thesis: 1.3 %, 26 %)")
assert longer < 0.01
assert 0.25 < saved < 0.32

# %% [markdown]
# ## What a kilogram on the plate costs
#
# An optimum knows its own derivatives: the solver's multipliers say how the cost changes with each parameter, without
# solving again. We ask for the weight, the mass of the plate, the strength of the motors, and the friction of cart 3.

# %%
asked = ["weight", "robot.plate_mass", "gear", "robot.carts[2].law.f_v"]
problem = prepare(FreePath, parameters=asked)
base = problem.solve({"weight": 0.01})
slope = sensitivities(base)
print(slope.report())
per_kilogram = slope.free["final_time", "robot.plate_mass"]
print(
    f"\na kilogram on the plate makes the motion {1e3 * per_kilogram:.1f} ms longer, of {base.final_time:.3f} s"
)

plate = prototypes.GT_A.plate_mass
ends = [
    problem.solve({"weight": 0.01, "robot.plate_mass": plate + more}, guess=base).final_time
    for more in (-0.5, 0.5)  # kg
]
print(f"solved again with half a kilogram less and more: {1e3 * np.diff(ends)[0]:.1f} ms")
assert abs(np.diff(ends)[0] / per_kilogram - 1) < 0.02
assert abs(slope.objective["weight"] / base.integral("square") - 1) < 1e-6  # d(T + w E)/dw is E

# %% [markdown]
# One percent more force is worth more than anything else: it shortens the motion by about as much as a kilogram
# lengthens it. And the slope in the weight is the energy itself, which is the reason for dT = -w dE.
#
# ## Is there a faster one?
#
# A solver finds the best motion around its first guess, here the straight line. With `starts` it begins from other
# guesses, too, bent to both sides of it, and reports the branches. One limit is added, a speed of 8 m/s for the carts.
# Without it a guess may end in a motion that drives cart 1 at more than 20 m/s right up to the pose in which its arm stands
# across the guideway. That is singular: played back, such an answer ends more than a metre from B.


# %%
class SpeedLimited(FreePath):
    """From A to B with a limit to the speed of the carts."""

    def constraints(self):
        yield from super().constraints()
        for cart in self.robot.carts:
            yield between(-8.0, cart.v, 8.0)  # m/s


other = optimize(SpeedLimited, elements=30, starts=4, refine=1e-3)
print(other.search)
print(f"refined: {other.final_time:.4f} s, {1 - other.final_time / fastest.final_time:.1%} faster; ", end="")
print(f"played back it misses B by {1e3 * miss(other):.2f} mm")
assert other.final_time < 0.95 * 0.9131  # s, of the motion found from the straight line
assert other.playback.violation < 1e-3
assert miss(other) < 5e-3

# %% [markdown]
# The best branch is refined, here to what is needed to compare. On the new one the
# tool swings to the other side, first down, not up. Cart 1 races forward to 0.3 m behind the pose in which its arm, 2 m
# long, stands across the guideway, turns round, and comes back. Whether one wants that of a robot is another question;
# who does not adds a limit, and searches again.

# %%
show_paths([(fastest, "from the straight line", "C0", "-"), (other, "the other branch", "C3", "-")])

arm = prototypes.GT_A.arms[0]
ahead = other.playback["robot.tool.r"][:, 0] - arm.offset[0] - other.playback["robot.carts[0].s"]
print(f"the tool stays {ahead.min():.2f} m or more ahead of cart 1")
assert 0.2 < ahead.min() < 0.4
