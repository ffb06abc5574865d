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
# # Six links in minimum time
#
# A Gantry-Tau robot holds its plate by six rods on three carts. No closed form gives the plate's pose from the carts, so
# the equations of its loops are unknowns of the optimisation like the motion itself. This notebook carries the plate of
# the robot D1 as fast as its carts can, looks at the arcs that the answer is made of, at other ways to the same
# place, and at what friction does to it.

# %%
from dataclasses import replace

import matplotlib.pyplot as plt

from gantrytau import between
from gantrytau_models import SixLinkGantryTau, prototypes
from gantrytau_optimica import Free, Optimization, final, initial, optimize

# %% [markdown]
# ## The problem
#
# From rest to rest; the carts push with up to 1200 N. A guess of the duration is all that is given.

# %%
A, B = [-0.381, -4.235, -0.014], [0.318, -4.682, 0.154]  # m
FORCE = 1200.0  # N
CARTS = range(3)


class Carried(Optimization):
    """Carry the plate from A to B as fast as the carts allow."""

    robot = SixLinkGantryTau(prototypes.D1)
    final_time = Free(1.0, unit="s", min=0.05, max=5.0, description="duration of the motion")

    def objective(self):
        return self.final_time

    def constraints(self):
        for cart in self.robot.carts:
            yield between(-FORCE, cart.f, FORCE)
        yield initial(self.robot.tool.r) == A
        yield final(self.robot.tool.r) == B
        for end in (initial, final):
            yield end(self.robot.tool.v) == 0


plain = optimize(Carried, elements=20)
print(plain.final_time, "s after", plain.iterations, "iterations")
print(plain.report().splitlines()[1])
assert (
    abs(plain.final_time - 0.4160) < 3e-4
)  # by Lagrange's equations and the tensions of the rods, written by hand

# %% [markdown]
# The equations were solved for the forces that accelerations need, inverse dynamics, and not for accelerations: fewer
# unknowns have to be found together then.
#
# ## Arcs
#
# Twenty elements do not stand where the carts switch. `refine=` finds the arcs of the first answer, makes their borders
# unknowns and solves again: all three carts push as hard as they can all the time, and change sides five times.

# %%
optimum = optimize(Carried, elements=20, refine=1e-4)
print(*optimum.arcs, sep="\n")
print(optimum.refinement)
assert {arc.side for arc in optimum.arcs} == {"min", "max"}
assert len(optimum.refinement.switches) == 5
missed = [abs(d.amount) for d in optimum.playback.defects if "tool.r" in d.name]
assert max(missed) < 1e-4  # m, when the model is driven by these forces

# %%
played = optimum.playback
figure, (above, forces) = plt.subplots(
    1, 2, figsize=(10.0, 3.6), width_ratios=(1.0, 1.6), layout="constrained"
)
r = played["robot.tool.r"]
above.plot(r[:, 0], r[:, 1])
above.annotate("A", A[:2], textcoords="offset points", xytext=(6, 2))
above.annotate("B", B[:2], textcoords="offset points", xytext=(-2, 8))
above.set(xlabel="x [m]", ylabel="y [m]", title="the plate from above", aspect="equal")
for k in CARTS:
    forces.plot(played.result.time, played[f"robot.carts[{k}].f"], label=f"cart {k + 1}")
forces.set(xlabel="time [s]", ylabel="force [N]", title="forces as played back")
forces.legend(loc="lower center", ncols=3, bbox_to_anchor=(0.5, 0.42))
for axis in (above, forces):
    axis.grid(alpha=0.3)

# %% [markdown]
# ## Branches
#
# A minimum is one among its neighbours only. Several first guesses, bent to all sides, tell whether there are other ways.

# %%
searched = optimize(Carried, elements=20, starts=3)
print(searched.search)
assert searched.final_time <= plain.final_time * (1 + 1e-3)  # on its coarser mesh

# %% [markdown]
# ## What friction does
#
# The carts' Coulomb friction takes 130 to 195 N of the 1200, their viscous friction up to 390 N per m/s. Without both the
# motion takes a quarter less time; and as friction no longer brakes for them, the carts must do so for longer.


# %%
class Frictionless(Carried):
    """The same robot on air."""

    robot = SixLinkGantryTau(replace(prototypes.D1, coulomb=(0.0,) * 3, viscous=(0.0,) * 3))


smooth = optimize(Frictionless, elements=20)
print(f"{plain.final_time:.4f} s with friction, {smooth.final_time:.4f} s without")
braking = {
    name: 1 - max(o.time[o["robot.carts[2].f"] > 0]) / o.final_time
    for name, o in (("with", plain), ("without", smooth))
}
print({name: f"the last cart brakes during {share:.0%} of the time" for name, share in braking.items()})
assert smooth.final_time < 0.8 * plain.final_time
assert braking["with"] < braking["without"]
