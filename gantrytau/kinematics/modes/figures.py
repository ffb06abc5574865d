"""Figures of assembly modes: how many there are, and the robot in each of them. Dressler (2012), Figures 4.17 and 4.18."""

import os
from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau.kinematics.modes.assembly_modes import AssemblyModes
from gantrytau.kinematics.rods.rod_geometry import RodGeometry
from gantrytau.language.self_description.appearance import Ball, Cuboid, Shape, Stick
from gantrytau.results.figures import check_suffix, finished
from gantrytau.results.result import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FileName = str | os.PathLike[str]
_COLUMNS = 4  # pictures in a row
_BINS = 20
_SHOWN = 1.0  # s that a mode is seen
_CHANGE = 1e-6  # s from one mode to the next
_ARMS = ("tab:blue", "tab:green", "tab:purple")


def draw_histogram(
    counts: np.ndarray, feasible: np.ndarray, nearest: np.ndarray, file: FileName | None
) -> "Figure":
    """How many poses have so many modes, and how far apart their two nearest ones are; see `AssemblyStudy.plot`."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import MaxNLocator

    if file is not None:
        check_suffix(file)
    apart = nearest[np.isfinite(nearest)]
    figure, axes = plt.subplots(
        1,
        2 if apart.size else 1,
        squeeze=False,
        figsize=(4.6 * (2 if apart.size else 1), 3.4),
        layout="constrained",
    )
    most = int(counts.max())
    numbers = np.arange(most + 1)
    left = axes[0, 0]
    for shift, values, colour, label in (
        (-0.2, counts, "tab:blue", "real"),
        (0.2, feasible, "tab:orange", "without crossed links"),
    ):
        poses = np.bincount(values, minlength=most + 1)
        left.bar(numbers[poses > 0] + shift, poses[poses > 0], 0.4, color=colour, label=label)
    left.set_xlabel("assembly modes of a pose")
    left.set_ylabel("poses")
    left.xaxis.set_major_locator(MaxNLocator(integer=True))
    left.yaxis.set_major_locator(MaxNLocator(integer=True))
    left.set_title(
        f"{counts.min()} to {most} real, {counts.mean():.3g} in the mean of {len(counts)}", fontsize="medium"
    )
    left.legend(fontsize="small")
    if apart.size:
        right = axes[0, 1]
        right.hist(apart, bins=min(_BINS, max(5, apart.size // 3)), color="tab:blue", edgecolor="white")
        right.set_xlabel("distance of the two nearest modes [m]")
        right.set_ylabel("poses")
        right.yaxis.set_major_locator(MaxNLocator(integer=True))
        right.set_title(f"{apart.min():.3g} to {apart.max():.3g} m", fontsize="medium")
    return finished(figure, file)


def draw_modes(
    geometry: RodGeometry, q: np.ndarray, modes: AssemblyModes, captions: Sequence[str], file: FileName | None
) -> "Figure":
    """The robot in each real mode, one picture each, under its caption; see `AssemblyStudy.plot_modes`."""
    import matplotlib.pyplot as plt

    if file is not None:
        check_suffix(file)
    A, B = _joints(geometry, q, modes)
    rails = _rails(geometry, q, A, B)
    every = np.concatenate([A, B.reshape(-1, 3), rails.reshape(-1, 3)])
    low, high = every.min(axis=0), every.max(axis=0)
    columns = min(_COLUMNS, len(B))
    rows = -(-len(B) // columns)
    shape = np.clip((high - low)[2] / max(np.linalg.norm((high - low)[:2]), 1e-9), 0.5, 1.5)
    figure = plt.figure(figsize=(3.0 * columns, (1.4 + 2.6 * shape) * rows), layout="constrained")
    engine: Any = figure.get_layout_engine()
    engine.set(h_pad=0.1, rect=(0.0, 0.02, 1.0, 0.96))  # labels in space have no room of their own
    for k, ends in enumerate(B):
        axis: Any = figure.add_subplot(rows, columns, k + 1, projection="3d")
        _draw_robot(axis, geometry, A, ends, rails, {link for pair in modes.crossed[k] for link in pair})
        for name, least, most in zip("xyz", low, high, strict=True):
            getattr(axis, f"set_{name}lim")(least, most)
            getattr(axis, f"set_{name}label")(f"{name} [m]", fontsize="xx-small", labelpad=-6)
        axis.set_box_aspect(np.maximum(high - low, 0.15 * (high - low).max()), zoom=0.9)
        axis.tick_params(labelsize="xx-small", pad=-2)
        axis.locator_params(nbins=4)
        pairs = ", ".join(f"{i}-{j}" for i, j in modes.crossed[k])
        axis.set_title(
            f"{captions[k]}\n{f'crossed {pairs}' if pairs else 'no links crossed'}", fontsize="small"
        )
    return finished(figure, file)


def _draw_robot(
    axis: Any, geometry: RodGeometry, A: np.ndarray, B: np.ndarray, rails: np.ndarray, crossed: set[int]
) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    for rail in rails:
        axis.plot(*rail.T, color="0.6", linewidth=2.5, solid_capstyle="round")
    for arm in geometry.arms:
        links = geometry.links_of(arm)
        for link in links:
            colour = "tab:red" if link in crossed else _ARMS[arm % len(_ARMS)]
            axis.plot(*np.stack([A[link], B[link]]).T, color=colour, linewidth=1.3)
        axis.plot(*A[links].T, "s", color="0.25", markersize=2.5)
    faces = _faces(B)
    axis.add_collection3d(
        Poly3DCollection(B[faces], facecolor="tab:orange", edgecolor="0.3", linewidth=0.4, alpha=0.5)
    )


def mode_scene(geometry: RodGeometry, q: np.ndarray, modes: AssemblyModes, name: str) -> Result:
    """The robot in its real modes one after the other as a result, mode k from k s on, with shapes."""
    A, B = _joints(geometry, q, modes)
    starts = _SHOWN * np.arange(len(B))
    time = np.stack([starts, starts + _SHOWN - _CHANGE], axis=1).ravel()
    values = {f"plate[{j}].r[{x}]": np.repeat(B[:, j, x], 2) for j in range(B.shape[1]) for x in range(3)}
    return Result(time, values, title=f"{len(B)} assembly modes of {name}", shapes=_shapes(geometry, q, A, B))


def _shapes(geometry: RodGeometry, q: np.ndarray, A: np.ndarray, B: np.ndarray) -> list[Shape]:
    rails = _rails(geometry, q, A, B)
    thick = 0.006 * float(np.linalg.norm(np.ptp(A, axis=0)))
    shapes: list[Shape] = [Stick(a=rail[0], b=rail[1], radius=thick) for rail in rails]
    carts = geometry.offset + q[: len(geometry.offset), None] * geometry.direction
    shapes += [Cuboid(at=cart, size=6.0) for cart in carts]
    for j, joint in enumerate(A):
        shapes += [Stick(a=carts[geometry.arm[j]], b=joint), Ball(at=joint), Ball(at=f"plate[{j}].r")]
        shapes.append(Stick(a=joint, b=f"plate[{j}].r", radius=thick))
    edges = {
        tuple(sorted((int(a), int(b))))
        for face in _faces(B[0])
        for a, b in zip(face, np.roll(face, 1), strict=True)
    }
    shapes += [Stick(a=f"plate[{i}].r", b=f"plate[{j}].r") for i, j in sorted(edges)]
    return shapes


def _joints(geometry: RodGeometry, q: np.ndarray, modes: AssemblyModes) -> tuple[np.ndarray, np.ndarray]:
    """Joints on the carts (m, 3), and on the plate in each real mode, (k, m, 3)."""
    r, R = modes.poses
    return geometry.cart_joints(q[None])[0], geometry.plate_joints(r, R)


def _rails(geometry: RodGeometry, q: np.ndarray, A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """The ends of the guideways, (arms, 2, 3): around the carts, as long as the robot is wide."""
    carts = geometry.offset + q[: len(geometry.offset), None] * geometry.direction
    unit = geometry.direction / np.linalg.norm(geometry.direction, axis=1, keepdims=True)
    size = max(float(np.ptp(np.concatenate([A, B.reshape(-1, 3)]), axis=0).max()), 1e-9)
    return carts[:, None] + np.array([-0.3, 0.3])[:, None] * size * unit[:, None]


def _faces(joints: np.ndarray) -> np.ndarray:
    """Triangles between joints of the plate (m, 3): of their convex hull, or of their plane, (t, 3) numbers of joints."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(joints).simplices
    except QhullError:
        pass
    middle = joints.mean(axis=0)
    flat = (joints - middle) @ np.linalg.svd(joints - middle)[2][:2].T
    ring = ConvexHull(flat).vertices
    return np.array([[ring[0], a, b] for a, b in pairwise(ring[1:])])
