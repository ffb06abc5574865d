"""The error models of Table 5.2, as links that share numbers.

| model | links | guideways | numbers |
|---|---|---|---|
| "parallel" | of the robot | straight, one direction for all, held at its nominal value | 12 |
| None | of the robot | straight, a direction for each cart | 21 or 51 |
| 1 | one on each arm | straight | 21 |
| 2 | one on each arm | measured points, in a frame that is found | 21 |
| 3 | all six | straight, a direction for each link, as carts turn a little on their way | 60 |
| 4 | all six | measured points, turned as in model 2 | 42 |
| 5 | all six | arms 1 and 3 as in model 3, arm 2 as in model 4 | 54 |

Dressler (2012), section 5.3.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gantrytau import ModelError
from gantrytau.kinematics.rotations import mean_rotation, of_vector, turning
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.rods.closure import Chain
from gantrytau_optimica.calibration.rods.groups import Group
from gantrytau_optimica.calibration.rods.guideway_points import between, straight
from gantrytau_optimica.calibration.rods.linear_start import linear_start
from gantrytau_optimica.calibration.rods.nominal_geometry import Geometry

MODELS = (None, "parallel", 1, 2, 3, 4, 5)
ROLLS = 12  # trials for how a measured guideway lies about its own axis
TURNS = 0.02  # rad; a plate that turns less than this does not hold B without a start value


@dataclass(frozen=True)
class Link:
    """One link of a model: its poses, the names of its numbers, start values, and which of them are identified."""

    arm: int
    chain: Chain
    names: tuple[str, ...]
    start: np.ndarray
    free: np.ndarray


def needs_rails(model: object) -> bool:
    """Whether a model needs measured guideways."""
    return model in (2, 4, 5)


def six_links(model: object, geometry: Geometry) -> bool:
    """Whether a model has six links and a plate that turns."""
    return geometry.kind == "six" if model in (None, "parallel") else model in (3, 4, 5)


def check_model(model: object, geometry: Geometry, measurements: Measurements) -> None:
    """ModelError if there is no such model, or the robot or the measurements lack what it needs."""
    if isinstance(model, bool) or model not in MODELS:
        raise ModelError(
            f"calibrate: found model={model!r}, expected model=None, 'parallel', or 1 to 5",
            argument="model",
        )
    if geometry.kind == "turning" and model is not None:
        raise ModelError(
            f"calibrate: found model={model!r} for {geometry.name}, expected model=None; those models have no turntables",
            argument="model",
        )
    if model in (3, 4, 5) and geometry.kind != "six":
        raise ModelError(
            f"calibrate: found {geometry.name} for model={model}, expected a robot with all six links; take "
            "SixLinkGantryTau, or model=1",
            argument="model",
        )
    if (six_links(model, geometry) or geometry.kind == "turning") and measurements.R is None:
        raise ModelError(
            "calibrate: found measurements without R for six links, expected orientations of the plate; measure poses, or "
            "take model=1",
            argument="model",
        )
    if needs_rails(model) and (measurements.rails is None or len(measurements.rails) != len(geometry.arms)):
        found = "no rails" if measurements.rails is None else f"{len(measurements.rails)} rails"
        raise ModelError(
            f"calibrate: found measurements with {found} for model={model}, expected measured points of all "
            f"{len(geometry.arms)} guideways; give rails=[...] in Measurements, or take "
            f"model={1 if model == 2 else 3}",
            argument="model",
        )


def nominal_links(geometry: Geometry, data: Measurements, all_links: bool) -> list[Link]:
    """Links with straight guideways that start from nominal values, a direction for each arm.

    Where the robot has six links and the model takes one on each arm, joints on the plate move to the tool (4.7), by
    the mean measured orientation.
    """
    found = []
    for i, arm in enumerate(geometry.arms):
        if all_links or geometry.kind == "three":
            for link in arm.links:
                start = np.concatenate([[link.length], link.offset, arm.direction, link.plate_offset])
                found.append(_straight(i, link.name, f"arms[{i}].direction", start, data, all_links))
            continue
        turn = np.eye(3) if data.R is None else mean_rotation(data.R)
        offset = np.mean([link.offset - turn @ link.plate_offset for link in arm.links], axis=0)
        length = float(np.mean([link.length for link in arm.links]))
        start = np.concatenate([[length], offset, arm.direction])
        found.append(_straight(i, f"arms[{i}]", f"arms[{i}].direction", start, data, False))
    return found


def _straight(i: int, name: str, direction: str, start: np.ndarray, data: Measurements, plate: bool) -> Link:
    names = [f"{name}.length", *elements(f"{name}.offset"), *elements(direction)]
    names += elements(f"{name}.plate_offset") if plate else []
    chain = Chain(name, data.q[:, i], data.r, data.R if plate else None)
    return Link(i, chain, tuple(names), start[: len(names)], np.ones(len(names), dtype=bool))


def elements(name: str) -> list[str]:
    """Names of the elements of a vector of three."""
    return [f"{name}[{k}]" for k in range(3)]


def started_linear(links: Sequence[Link]) -> list[Link]:
    """The same links with start values from their poses alone; directions of one arm are averaged.

    A plate that hardly turns does not show where its joints are: they keep their nominal places on it.
    """
    starts = []
    for link in links:
        R = link.chain.R
        if R is not None and _turn(R) < TURNS:
            start = linear_start(replace(link.chain, R=None))
            start[1:4] += mean_rotation(R) @ link.start[7:10]
            starts.append(np.concatenate([start, link.start[7:10]]))
        else:
            starts.append(linear_start(link.chain))
    found = []
    for link, start in zip(links, starts, strict=True):
        same = [other for k, other in zip(links, starts, strict=True) if k.names[4:7] == link.names[4:7]]
        along = np.mean([other[4:7] for other in same], axis=0)
        found.append(replace(link, start=np.concatenate([start[:4], along, start[7:]])))
    return found


def moved(links: Sequence[Link], turn: np.ndarray, shift: np.ndarray) -> list[Link]:
    """The same links in another frame: T' = turn T + shift."""
    found = []
    for link in links:
        start = link.start.copy()
        start[1:4], start[4:7] = turn @ start[1:4] + shift, turn @ start[4:7]
        found.append(replace(link, start=start))
    return found


def _turn(R: np.ndarray) -> float:
    """How far orientations are from their mean, root mean square in rad."""
    return float(np.sqrt(np.mean(np.sum((R - mean_rotation(R)) ** 2, axis=(1, 2))) / 2))


def parallel(links: Sequence[Link], free: bool) -> list[Link]:
    """All links along one direction, the mean of what they start with, which is identified or held."""
    along = np.mean([link.start[4:7] for link in links], axis=0)
    found = []
    for link in links:
        names = (*link.names[:4], *elements("direction"), *link.names[7:])
        start = np.concatenate([link.start[:4], along, link.start[7:]])
        kept = link.free.copy()
        kept[4:7] = free
        found.append(replace(link, names=names, start=start, free=kept))
    return found


def own_directions(link: Link) -> Link:
    """The link with a direction of its own (model 3)."""
    return replace(link, names=(*link.names[:4], *elements(f"{link.chain.name}.direction"), *link.names[7:]))


def on_rail(link: Link, rail: np.ndarray, turned: np.ndarray | None = None) -> list[Link]:
    """The link on a measured guideway, placed along its straight one; several trials of how that is rolled.

    turned: the rotation from the axes of the guideway's measurement, if known; then it is held.
    """
    points = between(rail, link.chain.q)
    at_zero, along = straight(rail)
    names = (
        *(n.replace(".offset[", ".frame_offset[") for n in link.names[:4]),
        *elements(f"arms[{link.arm}].frame_rotation"),
        *link.names[7:],
    )
    free = link.free.copy()
    if turned is not None:
        trials, free[4:7] = [turned], False
    else:
        first, axis = turning(along, link.start[4:7]), link.start[4:7] / np.linalg.norm(link.start[4:7])
        trials = [of_vector(angle * axis) @ first for angle in 2 * np.pi * np.arange(ROLLS) / ROLLS]
    found = []
    for Q in trials:
        chain = replace(link.chain, points=points, turned=Q)
        start = np.concatenate([link.start[:1], link.start[1:4] - Q @ at_zero, np.zeros(3), link.start[7:]])
        found.append(Link(link.arm, chain, names, start, free))
    return found


def grouped(links: Sequence[Link]) -> list[Group]:
    """Links that share names of identified numbers become one group, in the order of their first link."""
    left, groups = list(links), []
    while left:
        members, shared = [left.pop(0)], set()
        while True:
            shared |= {n for m in members for n, free in zip(m.names, m.free, strict=True) if free}
            more = [m for m in left if shared & {n for n, free in zip(m.names, m.free, strict=True) if free}]
            if not more:
                break
            members += more
            left = [m for m in left if not any(m is other for other in more)]
        groups.append(_group(members))
    return groups


def _group(links: Sequence[Link]) -> Group:
    values: dict[str, tuple[float, bool]] = {}
    for link in links:
        for name, value, free in zip(link.names, link.start, link.free, strict=True):
            values.setdefault(name, (float(value), bool(free)))
    names = tuple(values)
    places = tuple(np.array([names.index(n) for n in link.names]) for link in links)
    x, free = (np.array([values[n][k] for n in names]) for k in (0, 1))
    return Group(tuple(link.chain for link in links), places, names, x, free.astype(bool))
