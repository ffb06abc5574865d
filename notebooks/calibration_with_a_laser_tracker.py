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
# # Calibration with a laser tracker
#
# A robot was put together with a tape measure. How well does it go where it is told, what makes it better, and how many
# measurements does that take? The robot is the L1 of Dressler (2012, chapter 5). Its measurements are synthetic: so
# the truth is known, and every claim can be held against it.

# %%
import json
import tempfile
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.spatial.transform import Rotation

from gantrytau import simulate
from gantrytau.kinematics import Cylinder, Kinematics
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import (
    CalibrationError,
    LaserTracker,
    Measurements,
    calibrate,
    identifiability,
    predict,
    select_poses,
)
from gantrytau_optimica.calibration import enough_poses, error_map, linearity

ARMS = range(3)
NOISE = 10e-6  # m, of each measured coordinate


def mean_length(vectors):
    """In um, of vectors (N, 3) in m."""
    return 1e6 * np.linalg.norm(vectors, axis=1).mean()


# %% [markdown]
# ## The robot as it was drawn, and as it is
#
# On the drawing the guideways are parallel. In truth the second rises by 0.1 degrees and the third runs off to the side
# by as much, 1.7 mm for each metre. The guideways bend, too, by 0.7 times what Table 4.1 says of the L1, and every
# tooth of their racks repeats an error.

# %%
SLOPE = np.radians(0.1)
DIRECTIONS = np.array([[1.0, 0.0, 0.0], [1.0, 0.0, SLOPE], [1.0, SLOPE, 0.0]])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
LENGTHS = np.array([arm.length for arm in prototypes.L1.arms])
OFFSETS = np.array([arm.offset for arm in prototypes.L1.arms])


def three_links(lengths, offsets, directions):
    """An L1 with these lengths (3,), offsets (3, 3) in m, and directions of the guideways (3, 3)."""
    arms = [
        replace(arm, length=float(L), offset=tuple(A), direction=tuple(v))
        for arm, L, A, v in zip(prototypes.L1.arms, lengths, offsets, directions, strict=True)
    ]
    return GantryTau(replace(prototypes.L1, arms=arms))


tape = np.random.default_rng(5).uniform(
    -0.01, 0.01, (3, 4)
)  # m; where exactly are the centres of ball joints?
TAPED = (LENGTHS + tape[:, 0]).round(3), (OFFSETS + tape[:, 1:]).round(3)
drawn = three_links(*TAPED, [[1.0, 0.0, 0.0]] * 3)
straight = Kinematics(three_links(LENGTHS, OFFSETS, DIRECTIONS))

random = np.random.default_rng(3)
PITCH, RACK = 12.3e-3, np.array([20e-6, 15e-6, 20e-6])  # m
BENT = 0.7 * np.array([163e-6, 76e-6, 116e-6])  # m, root mean square
WAVES = np.arange(1, 5)
bends = random.standard_normal((3, 4, 3)) / WAVES[:, None]
bends *= (BENT / np.sqrt((bends**2).sum(axis=(1, 2)) / 2))[:, None, None]
phases = random.uniform(0.0, 2 * np.pi, (3, 4))


def carts(q):
    """Where the carts really are, (N, 3, 3) in m."""
    bent = np.einsum("nik,ikd->nid", np.sin(np.pi * WAVES * q[:, :, None] / 2.7 + phases), bends)
    rack = RACK * np.sin(2 * np.pi * q / PITCH)
    return OFFSETS + (q + rack)[:, :, None] * DIRECTIONS + bent


def tool(q):
    """Where the tool really is: at the length of each link from its cart, (N, 3) in m."""
    r, _ = straight.fk(q)
    for _ in range(4):  # Newton from the robot with straight guideways, less than a millimetre away
        links = r[:, None] - carts(q)
        r = r - np.linalg.solve(links, ((links**2).sum(axis=2) - LENGTHS**2)[:, :, None])[:, :, 0] / 2
    return r


# %% [markdown]
# ## Measuring
#
# The robot is sent through a grid, as well as it knows its own geometry. The tracker stands beside it, turned by 120
# degrees, and gives positions in its own frame; where the frame of the robot is nobody knows, and nobody needs to.
# From behind a column the tracker sees nothing. It also follows each cart along its guideway.

# %%
turned = Rotation.from_euler("z", 120, degrees=True).as_matrix()
noise = dict(
    range_noise=NOISE, range_noise_per_metre=0.0, transverse_noise=NOISE, transverse_noise_per_metre=0.0
)
column = Cylinder([0.6, 1.0, -3.0], [0.6, 1.0, 1.0], 0.03)
tracker = LaserTracker([1.0, -1.5, 0.3], turned, **noise, obstacles=[column])

axes = np.linspace(0.0, 1.3, 12), np.linspace(2.42, 3.58, 9), np.linspace(-1.3, 0.0, 7)  # m
q = Kinematics(drawn).ik(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3))
q = q[np.isfinite(q).all(axis=1)]
truth = (tool(q) - tracker.r) @ tracker.R  # in the frame of the tracker
measured = tracker.measure(tool(q), seed=1, frame="device")

along = np.arange(-0.3, 2.8, 0.005)
rails = []
for i in ARMS:
    cart = carts(np.where(np.arange(3) == i, along[:, None], 0.0))[:, i]
    rails.append(np.column_stack([along, tracker.measure(cart, seed=10 + i, frame="device").r]))
rails = [rail[np.isfinite(rail).all(axis=1)] for rail in rails]

# %% [markdown]
# ## Look first
#
# `Measurements` says what is doubtful about the numbers themselves, whatever the robot.

# %%
data = Measurements(q, measured.r, rails=rails)
print(data)
print(*data.findings, sep="\n")
assert [finding.kind for finding in data.findings] == ["nan"]

# %% [markdown]
# And are the guideways straight? `linearity` takes the points of one guideway apart into a smooth bend, the waves of
# the rack and noise. All were put in above, and are found again.

# %%
guideways = [linearity(rail[:, 0], rail[:, 1:], pitch=PITCH) for rail in rails]
for i, guideway in enumerate(guideways):
    print(f"{i + 1}: {guideway}")
    assert abs(guideway.cyclic.amplitude[0, 0] - RACK[i]) < 4 * guideway.cyclic.amplitude_error[0, 0]
    assert np.abs(guideway.noise / NOISE - 1).max() < 0.15
guideways[0].plot()

# %% [markdown]
# ## Three models of one robot
#
# All are fitted to every second pose and judged by the others: guideways parallel as they were drawn, a direction for
# each guideway, and guideways as they were measured. Of the parallel ones there are two: parallel to the first
# guideway, whose direction was just measured, or to the direction that suits all poses best.

# %%
lengths, offsets = TAPED
placed = three_links(lengths, (offsets - tracker.r) @ tracker.R, [guideways[0].direction] * 3)
found = {
    "parallel to the first": calibrate(placed, data, model="parallel"),
    "parallel, best direction": calibrate(drawn, data, model="parallel"),
    "a direction for each": calibrate(drawn, data),
    "measured guideways": calibrate(drawn, data, model=2),
}
parallel, free, each, rail_wise = found.values()
for title, fit in found.items():
    print(
        f"{title:26}{len(fit.names):3} numbers, {1e6 * fit.error:4.0f} um in the mean of {len(fit.held_out)} poses"
    )

print(f"\n{each.findings[1]}")
assert 0.5e-3 < parallel.error < 1.0e-3
assert each.error < free.error / 4 < parallel.error / 4  # 0.4 would do
assert rail_wise.error < 0.65 * each.error

# %% [markdown]
# The robot was found in the frame of the tracker, to which nobody had led it.
#
# No pose more and no better tracker helps the parallel ones: most of their errors stand along one axis, and
# neighbours err alike. A map shows it, here in the axes of the robot, x along its guideways.


# %%
def of_robot(fit):
    """The errors of the poses that were held out, with axes of the robot."""
    r, vectors = fit.measurements.r[fit.held_out], fit.error_vectors
    return error_map(r @ tracker.R.T + tracker.r, vectors @ tracker.R.T)


maps = {title: of_robot(fit) for title, fit in found.items()}
for title, of_model in maps.items():
    print(f"{title}: {of_model}\n")
assert maps["parallel to the first"].systematic > 0.85
assert maps["measured guideways"].systematic < 0.1
maps["parallel to the first"].plot("xy", layers=3)

# %% [markdown]
# ## Why
#
# Somewhere in the middle all is well. With each centimetre from there the second cart is a little higher and the third
# a little further to the side than the model believes, and lengths of links cannot make up for what changes along the
# way. So the error of the tool grows from the middle to both ends. With a direction for each guideway it does not.

# %%


def computed_less_true(fit, i):
    """How far cart i is computed from where it is, less the mean, in the axes of the robot, (N, 3) in m."""
    line = fit.parameters[f"arms[{i}].offset"] + along[:, None] * fit.parameters[f"arms[{i}].direction"]
    really = carts(np.where(np.arange(3) == i, along[:, None], 0.0))[:, i]
    off = line @ tracker.R.T + tracker.r - really
    return off - off.mean(axis=0)


figure, panels = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
for k, axis, name in zip((2, 1), panels, ("upwards", "to the side"), strict=False):
    for i in ARMS:
        axis.plot(
            along, 1e3 * computed_less_true(parallel, i)[:, k], f"C{i}", label=f"cart {i + 1}, parallel"
        )
        style = dict(linestyle="--", label=f"cart {i + 1}, a direction for each")
        axis.plot(along, 1e3 * computed_less_true(each, i)[:, k], f"C{i}", **style)
    axis.set(xlabel="position of the cart [m]", ylabel="computed less true [mm]", title=f"carts, {name}")
for title, colour in (("parallel to the first", "C3"), ("a direction for each", "C4")):
    panels[2].plot(maps[title].r[:, 0], 1e3 * maps[title].size, ".", color=colour, markersize=3, label=title)
panels[2].set(xlabel="x of the tool [m]", ylabel="error [mm]", title="tool")
panels[2].legend(loc="upper center")
figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
plt.show()

x, size = maps["parallel to the first"].r[:, 0], maps["parallel to the first"].size
middle, ends = np.abs(x - 0.65) < 0.2, np.abs(x - 0.65) > 0.45
print(f"in the middle {1e6 * size[middle].mean():.0f} um, at both ends {1e6 * size[ends].mean():.0f} um")
assert size[ends].mean() > 3 * size[middle].mean()
slopes = [np.polyfit(along, computed_less_true(parallel, i), 1)[0] for i in ARMS]
assert abs(slopes[0][2] - slopes[1][2] - SLOPE) < 0.1 * SLOPE  # nothing gives way to the parallel model
assert abs(slopes[0][1] - slopes[2][1] - SLOPE) < 0.1 * SLOPE

# %% [markdown]
# How bad it is depends on where the guideways point, not only on how far they are apart. Here they are straight, and 0.1
# degrees off to other sides; a direction for each leaves the noise alone.

# %%
for up, side in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
    directions = {"arms[1].direction": [1, 0, up * SLOPE], "arms[2].direction": [1, side * SLOPE, 0]}
    r, _ = straight.replaced(directions).fk(q)
    own = Measurements(q, tracker.measure(r, seed=2, frame="device").r)
    off = [1e6 * calibrate(drawn, own, model=model).error for model in ("parallel", None)]
    print(
        f"second {'up' if up > 0 else 'down'}, third to {'one' if side > 0 else 'the other'} side: ", end=""
    )
    print(f"parallel {off[0]:.0f} um, a direction for each {off[1]:.1f} um")
    assert (
        14 < off[1] < 18 < 0.4 * off[0]
    )  # um; a position is off by 16 um in the mean with 10 um in each coordinate

# %% [markdown]
# ## A start without nominal values
#
# The equation of a link is linear in combinations of its parameters. `start="linear"` solves for these first, and needs
# to know no more than that there are three links: here it is given the D1, another robot with other links.

# %%
from_nothing = calibrate(GantryTau(prototypes.D1), data, start="linear")
apart = max(np.abs(from_nothing.parameters[name] - each.parameters[name]).max() for name in each.parameters)
print(
    f"{from_nothing}; parameters apart from those above by {apart:.0e} m after {from_nothing.iterations} steps"
)
assert apart < 1e-9

# %% [markdown]
# ## The same by Ipopt
#
# Gauss-Newton is the default. `method="ipopt"` hands the same least squares to CasADi and Ipopt, by other derivatives and
# other steps: a check, and what limits among the parameters need.

# %%
by_ipopt = calibrate(drawn, data, method="ipopt")
apart = max(np.abs(by_ipopt.parameters[name] - each.parameters[name]).max() for name in each.parameters)
print(
    f"{each.iterations} steps of Gauss-Newton, {by_ipopt.iterations} of Ipopt; parameters apart by {apart:.0e} m"
)
assert apart < 1e-8

# %% [markdown]
# ## What the data hold
#
# Each arm has seven parameters, and these poses determine all of them. Places in one plane do not, and that is said.

# %%
print(identifiability(each.robot, (q, truth)))
plane = truth * [1, 1, 0]
in_plane = identifiability(each.robot, (each.kinematics.ik(plane), plane))
print(f"\nin a plane:\n{in_plane}")
assert [arm.rank for arm in in_plane.arms] != [7, 7, 7]

# %% [markdown]
# How sure are the parameters? `covariance` says it from one measurement. To see whether it is right we measure a robot
# with straight guideways 100 times.

# %%
names = list(each.names)
clean, _ = each.kinematics.fk(q)  # what the calibrated robot would do
repeated = [
    calibrate(
        each.robot, Measurements(q, clean + NOISE * np.random.default_rng(seed).standard_normal(clean.shape))
    )
    for seed in range(100)
]
spread = np.std([[fit.parameters[name] for name in names] for fit in repeated], axis=0, ddof=1)
told = np.mean([np.sqrt(np.diag(fit.covariance(names))) for fit in repeated], axis=0)
print(f"{'':26}told [um]  spread [um]   found less true [um]")
for i in ARMS:
    k = names.index(f"arms[{i}].length")
    off = each.parameters[names[k]] - LENGTHS[i]
    print(f"{names[k]:26}{1e6 * told[k]:9.1f}{1e6 * spread[k]:13.1f}{1e6 * off:23.1f}")
assert np.abs(told / spread - 1).max() < 0.25  # 100 repetitions leave 7 %, the most of 21 numbers 0.21

# %% [markdown]
# The last column belongs to the robot with bent guideways: some of its lengths are off by many deviations, as a
# covariance knows of noise, not of bends.
#
# ## How many poses are enough?
#
# That can be told before anything is measured. `predict` says what error the tool will have all over the workspace,
# `select_poses` chooses the poses that make it small, `enough_poses` says how many it takes.

# %%
seen = measured.seen
candidates = each.kinematics.ik(truth[seen]), truth[seen]
enough = enough_poses(each.robot, candidates, 10e-6, noise=NOISE)
print(f"{len(enough)} well chosen poses leave 10 um, if noise is all that errs")
assert len(enough) < 25

COUNTS = [8, 12, 20, 40, 100, 300]
METHODS = "d-optimal", "random"
chosen = {
    (method, n): select_poses(each.robot, candidates, n, method=method, seed=1)
    for method in METHODS
    for n in COUNTS
}
predicted = {key: predict(each.robot, candidates, rows, noise=NOISE).error for key, rows in chosen.items()}

# %% [markdown]
# Beside the prediction stands what happens: the poses are measured, the robot is calibrated, and its tool is compared
# with the truth in all places; for a robot with straight guideways, and for ours.

# %%


def happened(rows, q, model=None, repeated=5):
    """Calibrate from some of the candidates, with the carts there at q; the error of the tool over all of them, m."""
    squares = np.zeros(len(q))
    for seed in range(repeated):
        r = candidates[1][rows] + NOISE * np.random.default_rng(seed).standard_normal((len(rows), 3))
        fit = calibrate(each.robot, Measurements(q[rows], r, rails=rails), model=model, holdout=None)
        robot = (
            fit.kinematics if model else each.kinematics.replaced(fit.parameters)
        )  # at once, with no new model
        squares += ((robot.fk(q, near=candidates[1])[0] - candidates[1]) ** 2).sum(axis=1)
    return np.sqrt(squares / repeated).mean()


happened_straight = {key: happened(rows, candidates[0]) for key, rows in chosen.items()}
happened_bent = {n: happened(chosen["d-optimal", n], q[seen]) for n in COUNTS}
happened_on_rails = {n: happened(chosen["d-optimal", n], q[seen], 2, repeated=1) for n in (20, 300)}

figure, axis = plt.subplots(figsize=(9, 4.2), layout="constrained")
for method, colour in zip(METHODS, ("C0", "C1"), strict=True):
    axis.plot(COUNTS, [1e6 * predicted[method, n] for n in COUNTS], colour, label=f"{method}: predicted")
    points = [1e6 * happened_straight[method, n] for n in COUNTS]
    axis.plot(COUNTS, points, colour + "o", label=f"{method}: straight guideways")
for run, style, label in (
    (happened_bent, "C3s--", "d-optimal: bent guideways"),
    (happened_on_rails, "C2^--", "d-optimal: bent guideways, measured"),
):
    axis.plot(run.keys(), [1e6 * error for error in run.values()], style, linewidth=0.8, label=label)
axis.set(xscale="log", yscale="log", xlabel="poses measured", ylabel="error of the tool [µm]")
axis.set_xticks(COUNTS, COUNTS)
axis.set_yticks([2, 5, 10, 20, 50, 100], [2, 5, 10, 20, 50, 100])
axis.minorticks_off()
axis.grid(alpha=0.3)
figure.legend(loc="outside right upper")
plt.show()

ratios = np.array([happened_straight[key] / predicted[key] for key in chosen])
print("happened / predicted:", ratios.round(2))
assert np.abs(ratios[[n >= 12 for _, n in chosen]] - 1).max() < 0.35  # 5 repetitions of 21 numbers
assert predicted["random", 20] > 1.3 * predicted["d-optimal", 20]
assert predicted["random", 40] > 0.9 * predicted["d-optimal", 20]

# %% [markdown]
# Twenty chosen poses are worth forty random ones, if guideways are straight. For ours, noise no longer counts after ten
# poses: what is left are bends of 0.1 mm. More poses change little; measuring the guideways does more.

# %%
print({n: f"{1e6 * error:.0f} um" for n, error in happened_bent.items()})
assert happened_bent[300] > 0.8 * happened_bent[20] > 4 * predicted["d-optimal", 20]
assert happened_on_rails[20] < 0.6 * happened_bent[300]

# %% [markdown]
# ## The report
#
# One page, complete in itself, for whoever measures next, and the same numbers as JSON.

# %%
with tempfile.TemporaryDirectory() as folder:
    page = each.report(Path(folder) / "calibration.html")
    numbers = json.loads(page.with_suffix(".json").read_text())
    print(f"{page.name}: {page.stat().st_size / 1000:.0f} kB; among the numbers: {', '.join(numbers)}")
assert numbers["error_m"]["mean"] == each.error

# %% [markdown]
# Its residual tests see the bends, too: along two guideways closure errors are not what chance would make them.

# %%
for test in numbers["residual_tests"]:
    print(f"{test['link']:10}{test['test']:28}{test['value']:8.3f}, by chance {test['probability']:.1e}")
along_them = [t["probability"] for t in numbers["residual_tests"] if t["test"] == "along the guideway"]
assert min(along_them) < 1e-6

# %% [markdown]
# ## Bad data
#
# What went wrong while measuring is said with its rows, and no robot comes out.

# %%
MISTAKES = {
    "millimetres": Measurements(q, 1000 * data.r),
    "q1 and q2 exchanged": Measurements(q[:, [1, 0, 2]], data.r),
    "poses in a plane": Measurements(each.kinematics.ik(plane), plane),
}
concerned = {}
for title, mistaken in MISTAKES.items():
    try:
        calibrate(drawn, mistaken)
    except CalibrationError as refusal:
        print(f"{title}: {refusal}\n")
        concerned[title] = len(refusal.rows)
assert concerned == {title: int(mistaken.finite.sum()) for title, mistaken in MISTAKES.items()}

# %% [markdown]
# Exchanged columns are told though the frame of the robot is not known. Single rows that are wrong are named, and
# a robust loss leaves them without weight.

# %%
moved = data.r.copy()
moved[[17, 404]] += [0.0, 0.0, 0.02]  # m; somebody leant on the robot
off = {}
for loss in ("linear", "robust"):
    fit = calibrate(drawn, Measurements(q, moved), loss=loss)
    (outliers,) = (finding for finding in fit.findings if finding.kind == "outliers")
    off[loss] = mean_length(each.kinematics.replaced(fit.parameters).fk(q)[0] - truth)
    print(f"{outliers}\nwith loss='{loss}' the tool is then {off[loss]:.0f} um off in the mean")
    assert set(outliers.rows) == {17, 404}
assert off["robust"] < 0.6 * off["linear"]

# %% [markdown]
# ## The calibrated robot at work
#
# `fit.kinematics` turns places in the frame of the tracker into positions of the carts. We send the robot to 500 places
# it was never measured at, with each of its models, and look where it really goes. The robot that was measured by tape is
# allowed the best frame that it can have.

# %%
inside = np.random.default_rng(7).uniform([0.1, 2.5, -1.2], [1.2, 3.5, -0.1], (500, 3))
orders = (inside - tracker.r) @ tracker.R


def arrived(kinematics, places):
    """Where the tool really is, in the frame of the tracker, after it was sent to places there."""
    return (tool(kinematics.ik(places)) - tracker.r) @ tracker.R


by_tape = (tool(Kinematics(drawn).ik(inside)) - tracker.r) @ tracker.R
best, _ = Rotation.align_vectors(by_tape - by_tape.mean(axis=0), orders - orders.mean(axis=0))
missed = {"tape measure": by_tape - by_tape.mean(axis=0) - best.apply(orders - orders.mean(axis=0))}
missed |= {title: arrived(fit.kinematics, orders) - orders for title, fit in found.items()}
for title, vectors in missed.items():
    largest = 1e6 * np.linalg.norm(vectors, axis=1).max()
    print(f"{title:26}{mean_length(vectors):6.0f} um in the mean, {largest:6.0f} um at most")
assert mean_length(missed["tape measure"]) > 5 * mean_length(missed["parallel to the first"])
assert mean_length(missed["parallel to the first"]) > 5 * mean_length(missed["a direction for each"])
assert mean_length(missed["measured guideways"]) < 40

# %% [markdown]
# `fit.robot` is a model like any other, with the parameters that were found: it can be simulated, exported and
# optimised. Here its motors let go.

# %%
fall = simulate(each.robot, stop=0.1)
for i in ARMS:
    cart = (
        each.parameters[f"arms[{i}].offset"]
        + fall[f"carts[{i}].s"][:, None] * each.parameters[f"arms[{i}].direction"]
    )
    length = np.linalg.norm(fall["tool.r"] - cart, axis=1)
    assert (
        np.abs(length - each.parameters[f"arms[{i}].length"]).max() < 1e-9
    )  # m: the links that were found hold
print(f"the tool falls by {1e3 * (fall['tool.r'][0, 2] - fall['tool.r'][-1, 2]):.1f} mm in 0.1 s")
