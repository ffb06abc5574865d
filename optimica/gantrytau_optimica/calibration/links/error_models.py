"""The error models of Table 5.2, as links that share parameters.

| model | links | guideways | parameters |
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

from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gantrytau import ModelError
from gantrytau.border.refusal import Given
from gantrytau.kinematics.rotations import mean_rotation, of_vector, turning
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.links.arm_closure import ArmClosure
from gantrytau_optimica.calibration.links.arm_factors import NOISE, scales
from gantrytau_optimica.calibration.links.arm_links import ArmLink, links_of
from gantrytau_optimica.calibration.links.closure import Chain
from gantrytau_optimica.calibration.links.groups import Group
from gantrytau_optimica.calibration.links.guideway_points import between, straight
from gantrytau_optimica.calibration.links.linear_start import linear_start
from gantrytau_optimica.calibration.links.nominal_rods import NominalRods

COMMON = "direction"  # of all guideways, by name
ROLLS = 12  # trials for how a measured guideway lies about its own axis
TURNS = 0.02  # rad; a plate that turns less than this does not hold B without a start value


@dataclass(frozen=True)
class ModelLink:
    """One link of a model: path of its arm, its poses, names of its parameters, start values, which of them are
    identified, and what of each moves a joint by a metre.
    """

    arm: str
    chain: Chain | ArmLink
    names: tuple[str, ...]
    start: np.ndarray
    free: np.ndarray
    scale: np.ndarray

    @property
    def cart(self) -> int:
        """The number of its arm, the column of its cart in q."""
        return self.chain.cart


def needs_rails(model: object) -> bool:
    """Whether a model needs measured guideways."""
    return model in (2, 4, 5)


def six_links(model: object, robot: NominalRods) -> bool:
    """Whether a model has all links of a robot without turntables, and a plate that turns."""
    if robot.turntables:
        return False
    return robot.turns if model in (None, "parallel") else model in (3, 4, 5)


def check_model(model: object, robot: NominalRods, measurements: Measurements) -> None:
    """ModelError if the robot or the measurements lack what a model of the table needs."""

    def refused(message: str, *remedy: str | Given) -> ModelError:
        return ModelError(message, *remedy, place="calibrate", found=Given("model", model))

    if robot.turntables and model is not None:
        raise refused(
            f"for {robot.name} expected ", Given("model", None), ": those models have no turntables"
        )
    if model in (1, 2) and len(robot.arms) > 3:
        raise refused(
            f"for {robot.name} expected ",
            Given("model", None),
            " or 3, as its plate turns",
        )
    if model in (3, 4, 5) and not robot.turns:
        message = f"expected a robot with all six links, not {robot.name}; take SixLinkGantryTau, or "
        raise refused(message, Given("model", 1))
    if (six_links(model, robot) or robot.turntables) and measurements.R is None:
        message = "found measurements without R, expected orientations of a plate on six links; measure poses"
        remedy = () if robot.turntables else (", or take ", Given("model", 1))
        raise ModelError(message, *remedy, place="calibrate", argument="measurements")
    rails = 0 if measurements.rails is None else len(measurements.rails)
    if needs_rails(model) and rails != len(robot.arms):
        message = f"expected measured points of all {len(robot.arms)} guideways, not {rails}; give them by "
        raise refused(message, Given("rails"), ", or take ", Given("model", 1 if model == 2 else 3))


def nominal_links(robot: NominalRods, data: Measurements, all_links: bool) -> list[ModelLink]:
    """Links with straight guideways that start from nominal values, a direction for each arm.

    Where the robot has six links and the model takes one on each arm, joints on the plate move to the tool (4.7), by
    the mean measured orientation.
    """
    found = []
    for cart, arm in enumerate(robot.arms):
        along = robot.values[arm.direction]
        if all_links or not robot.turns:
            for rod in arm.rods:
                on_plate = robot.vector(rod.plate_offset)
                start = np.concatenate([[robot.values[rod.length]], robot.joint(arm, rod), along, on_plate])
                offset = rod.offset or arm.offset or f"{rod.name}.offset"
                names = [rod.length, *elements(offset), *elements(arm.direction)]
                names += elements(rod.plate_offset) if rod.plate_offset else []
                found.append(_straight((arm.name, cart), rod.name, names, start, (data.q, data.r, data.R)))
            continue
        turn = np.eye(3) if data.R is None else mean_rotation(data.R)
        offset = np.mean(
            [robot.joint(arm, k) - turn @ robot.vector(k.plate_offset) for k in arm.rods], axis=0
        )
        start = np.concatenate([[np.mean([robot.values[k.length] for k in arm.rods])], offset, along])
        names = [f"{arm.name}.length", *elements(f"{arm.name}.offset"), *elements(arm.direction)]
        found.append(_straight((arm.name, cart), arm.name, names, start, (data.q, data.r, data.R)))
    return found


def _straight(
    arm: tuple[str, int], name: str, names: list[str], start: np.ndarray, poses: tuple
) -> ModelLink:
    """poses: (q, r, R)."""
    q, r, R = poses
    chain = Chain(name, arm[1], q[:, arm[1]], r, R if len(names) > 7 else None)
    size = len(names)
    return ModelLink(arm[0], chain, tuple(names), start[:size], np.ones(size, dtype=bool), np.ones(size))


def links_of_arms(arms: Sequence[ArmClosure], data: Measurements) -> list[ModelLink]:
    """The links of the arms of a robot with turntables."""
    return [link for arm in arms for link in _carried(arm, data.q, data.r, data.R)]


def links_of_arm(arm: ArmClosure, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> list[ModelLink]:
    """The links of an arm from its own values: as `Chain`, whose poses condense, unless turntables carry them."""
    if arm.turntables or set(arm.free) != {*_numbers(arm)}:
        return _carried(arm, q, r, R)
    found = []
    for rod in arm.said.rods:
        start = [[arm.values[rod.length]], arm.vector_of(arm.said.offset) + arm.vector_of(rod.offset)]
        start += [arm.values[arm.said.direction], arm.vector_of(rod.plate_offset)]
        joint = rod.offset or arm.said.offset or ""
        names = [rod.length, *elements(joint), *elements(arm.said.direction)]
        names += elements(rod.plate_offset) if rod.plate_offset else []
        found.append(_straight((arm.name, arm.cart), rod.name, names, np.concatenate(start), (q, r, R)))
    return found


def _carried(arm: ArmClosure, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> list[ModelLink]:
    names, start, free, scale = arm.names, arm.vector, np.ones(arm.count, dtype=bool), scales(arm)
    return [ModelLink(arm.name, link, names, start, free, scale) for link in links_of(arm, q, r, R)]


def _numbers(arm: ArmClosure) -> Iterator[str | None]:
    """What a link without turntables is made of: one joint for each rod."""
    yield arm.said.direction
    for rod in arm.said.rods:
        yield from (rod.length, rod.offset or arm.said.offset)
        if rod.plate_offset:
            yield rod.plate_offset


def shared_name(name: str, known: Container[str] = ()) -> str:
    """Name under which a number is known; a direction may be shared by all arms."""
    return name if name in known or COMMON not in name else name[name.index(COMMON) :]


def elements(name: str) -> list[str]:
    """Names of the elements of a vector of three."""
    return [f"{name}[{k}]" for k in range(3)]


def started_linear(links: Sequence[ModelLink]) -> list[ModelLink]:
    """The same links with start values from their poses alone; directions of one arm are averaged.

    A plate that hardly turns does not show where its joints are: they keep their nominal places on it.
    """
    starts = []
    for link in links:
        chain, R = link.chain, link.chain.R
        assert isinstance(chain, Chain)  # closure is linear in the parameters of linear guideways only
        if R is not None and _turn(R) < TURNS:
            start = linear_start(replace(chain, R=None))
            start[1:4] += mean_rotation(R) @ link.start[7:10]
            starts.append(np.concatenate([start, link.start[7:10]]))
        else:
            starts.append(linear_start(chain))
    found = []
    for link, start in zip(links, starts, strict=True):
        same = [other for k, other in zip(links, starts, strict=True) if k.names[4:7] == link.names[4:7]]
        along = np.mean([other[4:7] for other in same], axis=0)
        found.append(replace(link, start=np.concatenate([start[:4], along, start[7:]])))
    return found


def moved(links: Sequence[ModelLink], turn: np.ndarray, shift: np.ndarray) -> list[ModelLink]:
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


def parallel(links: Sequence[ModelLink], free: bool) -> list[ModelLink]:
    """All links along one direction, the mean of what they start with, which is identified or held."""
    along = np.mean([link.start[4:7] for link in links], axis=0)
    found = []
    for link in links:
        names = (*link.names[:4], *elements(COMMON), *link.names[7:])
        start = np.concatenate([link.start[:4], along, link.start[7:]])
        kept = link.free.copy()
        kept[4:7] = free
        found.append(replace(link, names=names, start=start, free=kept))
    return found


def own_directions(link: ModelLink) -> ModelLink:
    """The link with a direction of its own (model 3)."""
    return replace(link, names=(*link.names[:4], *elements(f"{link.chain.name}.direction"), *link.names[7:]))


def on_rail(link: ModelLink, rail: np.ndarray, turned: np.ndarray | None = None) -> list[ModelLink]:
    """The link on a measured guideway, placed along its straight one; several trials of how that is rolled.

    turned: the rotation from the axes of the guideway's measurement, if known; then it is held.
    """
    straight_link = link.chain
    assert isinstance(straight_link, Chain)  # models with measured guideways have no turntables
    points = between(rail, straight_link.q)
    at_zero, along = straight(rail)
    names = (
        link.names[0],
        *elements(f"{link.chain.name}.frame_offset"),
        *elements(f"{link.arm}.frame_rotation"),
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
        chain = replace(straight_link, points=points, rail=rail, turned=Q)
        start = np.concatenate([link.start[:1], link.start[1:4] - Q @ at_zero, np.zeros(3), link.start[7:]])
        found.append(replace(link, chain=chain, names=names, start=start, free=free))
    return found


def grouped(links: Sequence[ModelLink]) -> list[Group]:
    """Links that share names of identified parameters become one group, in the order of their first link."""
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


def _group(links: Sequence[ModelLink]) -> Group:
    values: dict[str, tuple[float, bool, float]] = {}
    for link in links:
        for name, *known in zip(link.names, link.start, link.free, link.scale, strict=True):
            values.setdefault(name, (float(known[0]), bool(known[1]), float(known[2])))
    names = tuple(values)
    places = tuple(np.array([names.index(n) for n in link.names]) for link in links)
    x, free, scale = (np.array([values[n][k] for n in names]) for k in range(3))
    # with turntables much is held hardly or not at all: what a laser tracker tells apart decides
    noise = None if all(isinstance(link.chain, Chain) for link in links) else NOISE
    return Group(tuple(link.chain for link in links), places, names, x, free.astype(bool), scale, noise=noise)
