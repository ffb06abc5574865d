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
# Bodies, joints and rods are connected as they are bolted together. Where they close a loop, nothing is to be
# said: no cut joint, no special joint for planar loops, no choice of states. We begin with a loop in the plane,
# build a robot with six rods, take its kinematics, dynamics and equations out of the one model, and drive
# another robot into a singular pose.

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
# that is left. It also says that the crank's angle leaves two ways to join coupler and rocker. The start of
# the rocker chose one; another start chooses the other.

# %%
assert linkage.mobility == 1
assert len(linkage.redundant) == 3
(loop,), (assembly,) = linkage.loops, linkage.assemblies
crossed_angle = assembly.others[0]["rocker.hinge.phi"]

swing = simulate(FourBar(), stop=5.0, tolerance=1e-9)
crossed = simulate(FourBar(rocker=dict(hinge=dict(phi=Start(crossed_angle)))), stop=5.0, tolerance=1e-9)
for motion in (swing, crossed):
    energy = sum(motion[f"{bar}.energy"] for bar in ("crank", "coupler", "rocker"))
    gap = np.abs(motion[f"{loop.a}.r"] - motion[f"{loop.b}.r"]).max()
    print(f"energy {energy[0]:.3f} J, off by {np.ptp(energy):.1e} J; the loop is open by {gap:.1e} m")
    assert np.ptp(energy) < 1e-5  # J: ten thousand times the integrator's tolerance, over five seconds
    assert gap < 1e-11  # m: the projection stops at 1e-12 of the terms

figure, axes = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
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
axes[1].legend()
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
    on_plate = multibody.FixedTranslation(r=lambda self: [0.05, self.side, 0.0])

    def equations(self):
        yield connect(self.frame_a, self.on_cart.frame_a)
        yield connect(self.on_cart.frame_b, self.rod.frame_a)
        yield connect(self.rod.frame_b, self.on_plate.frame_b)
        yield connect(self.on_plate.frame_a, self.frame_b)


class Leg(multibody.TwoFrames):
    """A motor moves a cart on an upright rail; two rods lead from the cart to the plate, in frame_b."""

    angle = Parameter(0.0, unit="rad", description="direction of the rail, about the vertical")
    s = Real(unit="m", description="height of the cart", start=0.4)
    f = Input(unit="N", description="force of the motor on the cart, upwards", start=0.0)
    outwards = multibody.FixedRotation(n=[0.0, 0.0, 1.0], phi=angle)
    foot = multibody.FixedTranslation(r=[0.35, 0.0, 0.0])
    rail = multibody.Prismatic(n=[0.0, 0.0, 1.0])
    motor = translational.Force()
    cart = multibody.PointMass(m=2.0)
    rods = Array(Rod, [dict(side=0.08), dict(side=-0.08)])
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
        yield self.s == self.rail.s
        yield self.f == self.motor.f


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
# stays level. It follows from the rods, and is found by iteration, in the blocks named above.
#
# ### Kinematics in both directions
#
# What is given and what is wanted are named, and the causality follows. Here the inverse kinematics can be
# written by hand, too: a cart stands above its joint on the plate by the height that is left of its rod.

# %%
carts = [f"legs[{k}].s" for k in range(3)]
forces = [f"legs[{k}].f" for k in range(3)]
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
    errors = np.ravel(q) - by_hand, back - place, R.reshape(3, 3) - np.eye(3)
    worst = np.maximum(worst, [np.abs(error).max() for error in errors])
print("carts against the formula {:.1e} m, there and back {:.1e} m, plate turned by {:.1e}".format(*worst))
assert worst.max() < 1e-11  # iterations stop at 1e-13
