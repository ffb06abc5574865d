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
# # A parallel robot from components
#
# Bodies, joints and rods are connected as they are bolted together. Where they close a loop, nothing has to be
# said: no cut joint, and no special joint for planar loops. We begin with a loop in the plane, build a robot with
# six rods, take its kinematics, dynamics and equations out of the one model, and drive another robot into a
# singular pose.

# %%
import matplotlib.pyplot as plt
import numpy as np

from gantrytau import (
    Array,
    Fixed,
    Input,
    Model,
    Parameter,
    Real,
    SolveError,
    Start,
    StateSelect,
    c_source,
    check,
    connect,
    dot,
    extract_mechanism,
    outer,
    simulate,
    translate,
)
from gantrytau.mechanics import multibody, translational

# %% [markdown]
# ## A loop in the plane
#
# A bar is a body between two offsets, with a hinge at its near end. It tells its energy, by which we shall know
# whether the motion is right.


# %%
class Bar(multibody.TwoFrames):
    """A slender bar along x, with a hinge at its near end."""

    L = Parameter(1.0, unit="m", description="from hinge to hinge")
    m = Parameter(1.0, unit="kg", description="mass")
    J = Parameter(lambda self: self.m * self.L**2 / 12, unit="kg.m2", description="inertia across the bar")
    energy = Real(unit="J", description="kinetic and potential energy")
    world = outer(multibody.World)
    hinge = multibody.Revolute(n=[0.0, -1.0, 0.0])
    near = multibody.FixedTranslation(r=lambda self: [self.L / 2, 0.0, 0.0])
    body = multibody.Body(m=m, J=lambda self: self.J * np.diag([0.0, 1.0, 1.0]))
    far = multibody.FixedTranslation(r=lambda self: [self.L / 2, 0.0, 0.0])

    def equations(self):
        yield connect(self.frame_a, self.hinge.frame_a)
        yield connect(self.hinge.frame_b, self.near.frame_a)
        yield connect(self.near.frame_b, self.body.frame_a)
        yield connect(self.near.frame_b, self.far.frame_a)
        yield connect(self.far.frame_b, self.frame_b)
        r, v, w = self.body.r, self.body.v, self.body.w
        kinetic = (self.m * dot(v, v) + self.J * dot(w, w)) / 2
        yield self.energy == kinetic - self.m * dot(self.world.gravity, r)


class FourBar(Model):
    """Three bars and the ground in the x-z plane; four plain hinges with parallel axes."""

    world = multibody.World()
    ground = multibody.FixedTranslation(r=[1.0, 0.0, 0.0])
    crank = Bar(L=0.3, hinge=dict(phi=dict(start=1.0, fixed=True, prefer=StateSelect.ALWAYS), w=Fixed(0.0)))
    coupler = Bar(L=0.9)
    rocker = Bar(L=0.6, hinge=dict(phi=Start(1.5)))
    pin = multibody.Revolute(n=[0.0, -1.0, 0.0])

    def equations(self):
        yield connect(self.world.frame_b, self.crank.frame_a)
        yield connect(self.crank.frame_b, self.coupler.frame_a)
        yield connect(self.world.frame_b, self.ground.frame_a)
        yield connect(self.ground.frame_b, self.rocker.frame_a)
        yield connect(self.coupler.frame_b, self.pin.frame_a)
        yield connect(self.pin.frame_b, self.rocker.frame_b)


linkage = check(FourBar())
print(linkage)

# %% [markdown]
# Four revolutes in space are two too many: Grübler's formula counts a mobility of 6 * 3 - 5 * 4 = -2. The
# diagnosis finds the three conditions that repeat others because the axes are parallel, and the one way to move
# that is left. It also says that the crank's angle, which the model asks for as a state, leaves two ways to join
# coupler and rocker. The start of the rocker chose one; another start chooses the other.

# %%
assert linkage.mobility == 1
assert len(linkage.redundant) == 3
(loop,), (assembly,) = linkage.loops, linkage.assemblies
crossed_angle = assembly.others[0]["rocker.hinge.phi"]

swing = simulate(FourBar(), stop=5.0, tolerance=1e-9)
crossed = simulate(FourBar(rocker=dict(hinge=dict(phi=Start(crossed_angle)))), stop=5.0, tolerance=1e-9)
for motion in (swing, crossed):
    energy = np.sum([motion[f"{bar}.energy"] for bar in ("crank", "coupler", "rocker")], axis=0)
    gap = np.abs(motion[f"{loop.a}.r"] - motion[f"{loop.b}.r"]).max()
    print(f"energy {energy[0]:.3f} J, off by {np.ptp(energy):.1e} J; the loop is open by {gap:.1e} m")
    assert np.ptp(energy) < 1e-5  # J: ten thousand times the integrator's tolerance, over five seconds
    assert gap < 1e-11  # m: the projection stops at 1e-12 of the terms

figure, axes = plt.subplots(1, 2, figsize=(9, 3), width_ratios=[2, 1], layout="constrained")
for motion, title, style in ((swing, "open", "-"), (crossed, "crossed", "--")):
    axes[0].plot(motion.time, motion["rocker.hinge.w"], style, label=title)
    pins = [
        np.zeros(3),
        *(motion[f"{end}.r"][0] for end in ("crank.frame_b", "pin.frame_a", "ground.frame_b")),
    ]
    x, _, z = np.transpose(pins)
    axes[1].plot(x, z, "o" + style, label=title)
axes[0].set(xlabel="time [s]", ylabel="speed of the rocker [rad/s]", title="swinging under gravity")
axes[1].set(xlabel="x [m]", ylabel="z [m]", title="how they start", aspect="equal")
axes[1].legend(loc="lower left")
plt.show()

# %% [markdown]
# ## A robot with six rods
#
# Three carts on upright rails carry a plate; two parallel rods lead from each cart to it (a linear Delta robot).
# A leg is written once, in axes that point outwards, and turned about the vertical. The plate is a rigid body
# that only the rods hold.


# %%
class Rod(multibody.TwoFrames):
    """A rod with ball joints, beside the middle of its leg."""

    side = Parameter(0.0, unit="m", description="place beside the middle, on cart and plate")
    on_cart = multibody.FixedTranslation(r=lambda self: [0.0, self.side, 0.0])
    rod = multibody.SphericalSpherical(L=0.5, m=0.4)
    on_plate = multibody.FixedTranslation(r=lambda self: [0.1, self.side, 0.0])

    def equations(self):
        yield connect(self.frame_a, self.on_cart.frame_a)
        yield connect(self.on_cart.frame_b, self.rod.frame_a)
        yield connect(self.rod.frame_b, self.on_plate.frame_b)
        yield connect(self.on_plate.frame_a, self.frame_b)


class Leg(multibody.TwoFrames):
    """A motor moves a cart on an upright rail; two rods lead from the cart to the plate, in frame_b."""

    angle = Parameter(0.0, unit="rad", description="direction of the rail, about the vertical")
    outwards = multibody.FixedRotation(n=[0.0, 0.0, 1.0], phi=angle)
    foot = multibody.FixedTranslation(r=[0.4, 0.0, 0.0])
    rail = multibody.Prismatic(n=[0.0, 0.0, 1.0], s=Start(0.4))
    motor = translational.Force()
    cart = multibody.PointMass(m=2.0)
    rods = Array(Rod, [dict(side=0.05), dict(side=-0.05)])
    outwards_on_plate = multibody.FixedRotation(n=[0.0, 0.0, 1.0], phi=angle)

    def equations(self):
        yield connect(self.frame_a, self.outwards.frame_a)
        yield connect(self.outwards.frame_b, self.foot.frame_a)
        yield connect(self.foot.frame_b, self.rail.frame_a)
        yield connect(self.rail.frame_b, self.cart.frame_a)
        yield connect(self.rail.axis, self.motor.flange)
        for rod in self.rods:
            yield connect(self.rail.frame_b, rod.frame_a)
            yield connect(rod.frame_b, self.outwards_on_plate.frame_b)
        yield connect(self.outwards_on_plate.frame_a, self.frame_b)


class Tripod(Model):
    """Three legs move a plate, whose place is `plate.r`."""

    world = multibody.World()
    legs = Array(Leg, [dict(angle=2 * np.pi / 3 * k) for k in range(3)])
    plate = multibody.Body(m=1.5, J=np.diag([0.01, 0.01, 0.02]), r=Start([0.0, 0.0, 0.0]))

    def equations(self):
        for leg in self.legs:
            yield connect(self.world.frame_b, leg.frame_a)
            yield connect(leg.frame_b, self.plate.frame_a)


tripod = translate(Tripod(), states=["plate.r", "plate.v"])
print(tripod.diagnosis)
assert tripod.diagnosis.mobility == 3
assert not tripod.diagnosis.moved

# %% [markdown]
# Six rods leave a plate no freedom against its carts, and three carts move: mobility three. Nobody said that the plate
# stays level. It follows from the rods, and is found by iteration, in the blocks named above. The states are a wish;
# without it the compiler takes the carts.
#
# ### Kinematics in both directions
#
# What is given and what is wanted are named, and the causality follows. Here the inverse kinematics can be
# written by hand, too: a cart stands above its joint on the plate by the height that is left of its rod.

# %%
carts = [f"legs[{k}].rail.s" for k in range(3)]
forces = [f"legs[{k}].motor.f" for k in range(3)]
inverse_kinematics = tripod.function(["plate.r"], [*carts, "plate.frame_a.R"])
forward_kinematics = tripod.function(carts, ["plate.r"])

random = np.random.default_rng(1)
places = random.uniform([-0.12, -0.12, -0.3], [0.12, 0.12, 0.3], (20, 3))  # m
outwards = np.array([[np.cos(a), np.sin(a)] for a in 2 * np.pi / 3 * np.arange(3)])
worst = np.zeros(3)
for place in places:
    *q, R = (np.array(found) for found in inverse_kinematics(place))
    by_hand = place[2] + np.sqrt(0.5**2 - ((0.3 * outwards - place[:2]) ** 2).sum(axis=1))
    back = np.array(forward_kinematics(*q)).ravel()
    errors = np.ravel(q) - by_hand, back - place, R.reshape(3, 3, order="F") - np.eye(3)
    worst = np.maximum(worst, [np.abs(error).max() for error in errors])
print("carts against the formula {:.1e} m, there and back {:.1e} m, plate turned by {:.1e}".format(*worst))
assert worst.max() < 1e-11  # iterations stop at 1e-13

# %%
pose = tripod.evaluate({"plate.r": [0.08, 0.05, -0.05]})
figure = plt.figure(figsize=(6, 4.5), layout="constrained")
axes = figure.add_subplot(projection="3d")
corners = []
for leg in ("legs[0]", "legs[1]", "legs[2]"):
    x, y, _ = pose[f"{leg}.rail.frame_a.r"]
    axes.plot([x, x], [y, y], [-0.2, 0.7], color="0.7", linewidth=4)
    axes.scatter(*pose[f"{leg}.cart.frame_a.r"], color="k", s=60)
    for rod in (f"{leg}.rods[0].rod", f"{leg}.rods[1].rod"):
        ends = np.transpose([pose[f"{rod}.frame_a.r"], pose[f"{rod}.frame_b.r"]])
        axes.plot(*ends, "o-", color="C0", markersize=3)
    corners += [pose[f"{leg}.rods[{k}].rod.frame_b.r"] for k in (1, 0)]
axes.plot(*np.transpose([*corners, corners[0]]), color="C3", linewidth=2)
axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]", title="rails, carts, rods and plate")
axes.set(xlim=(-0.45, 0.45), ylim=(-0.45, 0.45), zlim=(-0.2, 0.7), box_aspect=(1, 1, 1))
axes.locator_params(nbins=4)
axes.view_init(elev=30, azim=-50)
plt.show()

# %% [markdown]
# ### Speeds and forces
#
# The same call with other names. Speeds of the carts are compared with differences of the inverse kinematics, and the
# accelerations under the forces of the inverse dynamics with the ones that were asked for.

# %%
place, speed, acceleration = np.array([0.08, 0.05, -0.05]), np.array([0.3, -0.6, 0.2]), [2.0, 1.0, -3.0]
speeds = [f"der({name})" for name in carts]
inverse_speeds = tripod.function(["plate.r", "plate.v"], speeds)
inverse_dynamics = tripod.function(["plate.r", "plate.v", "der(plate.v)"], forces)
forward_dynamics = tripod.function(["plate.r", "plate.v", *forces], ["der(plate.v)", "plate.w"])


def numbers(found):
    """Results of a function as one array."""
    return np.concatenate([np.array(part).ravel() for part in found])


h = 1e-4  # s; an error of h^2 times 1e2, the third derivative along the motion
after, before = (numbers(inverse_kinematics(place + side * h * speed))[:3] for side in (1, -1))
found, differences = numbers(inverse_speeds(place, speed)), (after - before) / (2 * h)
print("speeds of the carts", found.round(4), "m/s, differences", differences.round(4), "m/s")
assert np.abs(found - differences).max() < 1e-6

holding = numbers(inverse_dynamics(place, [0, 0, 0], [0, 0, 0]))
weight = 9.81 * (3 * 2.0 + 6 * 0.4 + 1.5)  # N, of carts, rods and plate
print("holding forces", holding.round(3), "N; their sum", holding.sum().round(3), "N is the weight")
assert abs(holding.sum() - weight) < 1e-9

needed = numbers(inverse_dynamics(place, speed, acceleration))
reached, turning = np.split(numbers(forward_dynamics(place, speed, *needed)), 2)
print("forces", needed.round(3), "N give accelerations", reached.round(9), "m/s2")
assert np.abs(reached - acceleration).max() < 1e-9
assert np.abs(turning).max() < 1e-12  # rad/s: the plate stays level in motion, too

# %% [markdown]
# ## The equations
#
# The thesis of Dressler (2012) writes a parallel robot as four systems of equations between the tool T, the driven
# joints q and their forces f: constraints (6.3), speeds (6.5), accelerations (6.6), and the balance of forces
#
# $$M_1 T'' + M_2 q'' + G + b = J^{-T} f \qquad (6.7)$$
#
# with b for friction and products of velocities. They are cut out of the model. Where every step has a closed form,
# they print themselves; so they do for the three-link Gantry-Tau robot GT-A.

# %%
from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes

gantry = translate(GantryTau(prototypes.GT_A, friction=None))
rails, motors = ([f"carts[{k}].{letter}" for k in range(3)] for letter in "sf")
gantry_equations = extract_mechanism(gantry, tool="tool.r", joints=rails, forces=motors)
print(gantry_equations)

# %% [markdown]
# The orientation of our own plate is iterated, so that its systems are functions only. They must balance along any
# motion of the plate, with the forces of the inverse dynamics; and both inertias together, seen from the plate, must
# be a symmetric mass matrix. Whoever lifts the plate lifts everything else as fast.

# %%
own = extract_mechanism(tripod, tool="plate.r", joints=carts, forces=forces)
wanted = [*carts, *speeds, *(f"der(der({name}))" for name in carts), *forces]
motion = tripod.function(["plate.r", "plate.v", "der(plate.v)"], wanted)(place, speed, acceleration)
q, dq, ddq, f = numbers(motion).reshape(4, 3)
M1, M2, inverse_J = (np.array(part(place, q)) for part in (own.M1, own.M2, own.velocity_jacobian))
G, b = numbers([own.G(place, q)]), numbers([own.bias(place, q, speed, dq)])
left = M1 @ acceleration + M2 @ ddq + G + b - inverse_J.T @ f
inertia = M1 + M2 @ inverse_J
print(inertia.round(4), "kg; what is left of the balance:", np.abs(left).max(), "N")
assert np.abs(left).max() < 1e-10 * np.abs(f).max()
assert np.abs(inertia - inertia.T).max() < 1e-10 * inertia.max()
assert abs(inertia[2, 2] - weight / 9.81) < 1e-10  # kg: all move alike when the plate is lifted

# %% [markdown]
# The whole model is written as text, as LaTeX for a report, as one HTML page, or as Base Modelica, and every function
# as C for a controller.

# %%
print(
    {
        format: len(gantry.equations(format).splitlines())
        for format in ("text", "latex", "html", "base-modelica")
    },
    "lines",
)
print(*gantry.equations("latex").splitlines()[:9], sep="\n")
source = c_source(own.velocity_jacobian, name="inverse_jacobian", header="J^-1 of the tripod, SI units")
print(*source.splitlines()[:8], "...", sep="\n")
assert "int inverse_jacobian(const" in source

# %% [markdown]
# ## A singular pose
#
# The six-link Gantry-Tau robot starts at rest under three small forces. Gravity pulls its plate to where the three
# parallel rods of the third arm come into the plane of their joints. There they can be strained against each
# other without any effect, and no tensions follow from the forces any more. The simulation does not step over it.

# %%
six_link = SixLinkGantryTau(prototypes.GT_A, friction=None, tool=dict(r=Start([0.9, 2.75, -0.55])))
pushes = {"carts[0].f": 10.0, "carts[1].f": -5.0, "carts[2].f": 5.0}  # N
try:
    simulate(six_link, stop=0.8, inputs=pushes, points=801)
    raise AssertionError("the singular pose was stepped over")
except SolveError as error:
    print(f"stopped at {error.time:.7f} s by", *error.equations, sep="\n  ")
    fall, meeting, culprits = error.result, error.time, error.equations
# s; from the equations by hand and two integrators, in tests/references/test_six_link.py
assert abs(meeting - 0.6756171) < 1e-6
assert [name.startswith("arms[2].links") for name in culprits] == [True] * 3

# %% [markdown]
# Before that the tensions grow as one over the time that is left.

# %%
rods = [f"arms[2].links[{k}].rod" for k in range(3)]
joints = [fall[f"{rod}.frame_b.r"] for rod in rods]
normal = np.cross(joints[1] - joints[0], joints[2] - joints[0])
along = joints[0] - fall[f"{rods[0]}.frame_a.r"]
sine = (along * normal).sum(axis=1) / np.linalg.norm(along, axis=1) / np.linalg.norm(normal, axis=1)
lengths = [link.length for link in prototypes.GT_A.arms[2].links]
tensions = np.array([fall[f"{rod}.tension"] * L for rod, L in zip(rods, lengths, strict=True)])  # N
strengths = np.abs(tensions) * (meeting - fall.time)  # N.s
last = strengths[:, -9:-1]  # 9 ms to 2 ms before, where the next term is a few percent
print("force along each rod times the time that is left:", last[:, -1].round(2), "N.s")
assert np.ptp(last, axis=1).max() < 0.05 * last.max()

figure, axes = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
axes[0].plot(fall.time, np.degrees(np.arcsin(sine)))
axes[0].axhline(0, color="0.7", linewidth=1)
axes[0].set(xlabel="time [s]", ylabel="angle [°]", title="rods of arm 3 against the plane of their joints")
for k, tension in enumerate(tensions):
    axes[1].plot(fall.time, tension, label=f"rod {k + 1}")
for axis in axes:
    axis.axvline(meeting, color="C3", linestyle=":")
axes[1].set(xlabel="time [s]", ylabel="tension [N]", title="rods of arm 3, pulled and pushed")
axes[1].set_yscale("symlog", linthresh=100, linscale=0.5)
axes[1].legend(loc="upper left")
plt.show()

# %% [markdown]
# ## Forces along a sampled path
#
# A path of way points has no derivatives, and inverse dynamics needs two. A filter stands in between, and the model is
# told what is given: the reference. The forces of the motors become unknowns.

# %%
from gantrytau.mechanics.filters import LowPass


class Followed(Model):
    """The plate led along a sampled path."""

    robot = Tripod()
    reference = Input(3, unit="m", description="place of the plate", start=[-0.1, -0.1, -0.1])
    filter = LowPass(order=3, bandwidth=60.0, size=3, unit="m")

    def equations(self):
        yield self.filter.u == self.reference
        yield self.robot.plate.r == self.filter.y


corners = [[-0.1, -0.1, -0.1], [-0.1, -0.1, 0.0], [0.1, 0.1, 0.0], [0.1, 0.1, -0.1], [0.1, 0.1, -0.1]]  # m
samples = ([0.0, 0.15, 0.55, 0.7, 1.0], corners)  # s
led = simulate(translate(Followed(), given=["reference"]), stop=1.0, inputs={"reference": samples})
needed = {name: (led.time, led[f"robot.{name}"]) for name in forces}
free = simulate(Tripod(plate=dict(r=Fixed([-0.1, -0.1, -0.1]), v=Fixed([0, 0, 0]))), stop=1.0, inputs=needed)
apart = np.abs(free["plate.r"] - led["robot.plate.r"]).max()
print(f"the free robot under these forces stays within {apart:.1e} m of the led one")
assert apart < 1e-4  # m: samples every 2 ms, joined by straight lines

figure, axes = plt.subplots(figsize=(8, 2.5), layout="constrained")
for k, name in enumerate(forces):
    axes.plot(led.time, led[f"robot.{name}"], label=f"leg {k + 1}")
axes.set(xlabel="time [s]", ylabel="force of the motor [N]", title="forces along the path")
axes.legend(loc="lower right")
plt.show()
