"""Whether a robot keeps its limits all along a way that is straight in its actuator coordinates.

    P x' + Q q' = 0     x = (r, rotation): the pose; P, Q: slopes of the link lengths; q' constant on a way

At a sample x' is known. Near it, as long as the speed w_j between the ends of each link stays below 3/2 of that (and a
little more), and the rotation W below twice that, unit vectors along links turn by no more than |u_j'| <= |w_j| / L_j, so
that rows of P change by no more than |u_j'| and b (|u_j'| + W) for each unit of time, b the lever of a joint on the
plate. With the inverse of P at the sample, column by column, this gives G, two by two for position and rotation: within h
< 1 / (2 rho(G)) the plate stays held, on its branch, and the second derivative of the closure bounds x'':

    |x''| <= (I - G / (2 rho))^-1 sum_j |inverse of P, column j| (|w_j|^2 / L_j + b W^2 + |A_j''|)

A_j'': of joints on turntables. As far as speeds then stay below what was assumed, no point of plate or links
moves by more than V h + C h^2 / 2. An interval of a way is clear if that is less than what the sample at its middle
leaves; else it is halved, until it is clear, or a sample breaks a limit, or hardly anything moves in it. Nothing that
happens between two samples can be missed; a way that is refused may be free by a hair.

A plate that turns has several poses for the same q, and an iteration may find one to which no motion leads: where two
intervals meet, both must lead to the same pose, and at the ends of a way to that of its places.
"""

from dataclasses import dataclass, fields

import numpy as np

from gantrytau.kinematics.rotations import cross
from gantrytau.kinematics.workspace.pose_limits import Examined
from gantrytau_optimica.procedure.robot_samples import Fleet, Member

FIRST = 4  # intervals that a way begins with, or so many times more where the plate turns
TURNING = 8
LEAST = 2.5e-4  # m, motion within an interval below which it is not halved again
LITTLE = 0.1  # of the speed of the fastest cart, by which motion may differ from twice that at a sample
LEVER = 0.1  # m, to compare rotations with where the plate has no levers
SAME = 1e-6  # m and of a rotation matrix, between poses that are the same
TINY = 1e-12


@dataclass(frozen=True, eq=False)
class _Bounds:
    """What bounds motion about samples, (k,) each.

    reach: as far as which the rest holds; speed, growth: V and C of any point; angles: rate of the angle of any ball joint.
    """

    reach: np.ndarray
    speed: np.ndarray
    growth: np.ndarray
    angles: np.ndarray

    def moved(self, h: np.ndarray) -> np.ndarray:
        """How far any point moves within h, (k,) in m."""
        return self.speed * h + self.growth * h**2 / 2


def clear_ways(fleet: Fleet, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Which of the ways from a (N, n) to b (N, n) all robots of a fleet can go, (N,)."""
    clear = np.ones(len(a), dtype=bool)
    for member in fleet.judges:
        left = np.flatnonzero(clear)
        if left.size:
            clear[left] = _clear_of(member, a[left], b[left])
    return clear


def _clear_of(member: Member, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    clear = np.ones(len(a), dtype=bool)
    ends = member.judged(np.concatenate([a, b]))
    clear[~ends.inside[: len(a)] | ~ends.inside[len(a) :]] = False
    first = FIRST * TURNING if member.turns else FIRST
    way: np.ndarray = np.repeat(np.arange(len(a)), first)
    half: np.ndarray = np.full(len(way), 0.5 / first)
    middle: np.ndarray = np.tile((np.arange(first) + 0.5) / first, len(a))
    pieces: list[_Pieces] = []
    while True:
        kept = clear[way]
        way, middle, half = way[kept], middle[kept], half[kept]
        if not way.size:
            break
        found = member.judged(a[way] + middle[:, None] * (b - a)[way])
        covered, hopeless = _covered(member, found, (b - a)[way], half)
        clear[way[hopeless]] = False
        pieces.append(
            _Pieces(way[covered], middle[covered], half[covered], found.r[covered], found.R[covered])
        )
        way, middle, half = way[~covered], middle[~covered], half[~covered] / 2
        middle = np.concatenate([middle - half, middle + half])
        way, half = np.tile(way, 2), np.tile(half, 2)
    return clear & _continuous(member, a, b, ends, pieces, clear) if member.turns else clear


def _covered(
    member: Member, found: Examined, rate: np.ndarray, half: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Which samples answer for all of their intervals, (k,); and which break a limit or cannot be told, (k,)."""
    covered, hopeless = np.zeros(len(half), dtype=bool), ~found.inside
    rows = np.flatnonzero(found.inside)
    if not rows.size:
        return covered, hopeless
    bounds = _bounds(member, found.q[rows], found.r[rows], found.R[rows], rate[rows])
    h = half[rows]
    both = 2.0 if member.limits.link_radius else 1.0  # links may move towards each other
    near = both * bounds.moved(h) <= found.clearance[rows]
    good = near & (bounds.angles * h <= found.angle[rows]) & (h <= bounds.reach)
    covered[rows] = good
    hopeless[rows] = ~good & (h * bounds.speed < LEAST)
    return covered, hopeless


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Intervals that are clear: number of their way (k,), middle and half of them, 0 to 1, and the pose in the middle."""

    way: np.ndarray
    middle: np.ndarray
    half: np.ndarray
    r: np.ndarray
    R: np.ndarray


def _continuous(
    member: Member, a: np.ndarray, b: np.ndarray, ends: Examined, pieces: list[_Pieces], clear: np.ndarray
) -> np.ndarray:
    """Which of the ways that are `clear` lead from the pose of one end to that of the other without a jump, (N,)."""
    one = _Pieces(*(np.concatenate([getattr(p, f.name) for p in pieces]) for f in fields(_Pieces)))
    rows = np.flatnonzero(clear[one.way])
    rows = rows[np.lexsort((one.middle[rows], one.way[rows]))]
    way, near = one.way[rows], (one.r[rows], one.R[rows])
    if not rows.size:
        return clear
    before, after = (
        _flat(*member.kinematics.fk(a[way] + at[:, None] * (b - a)[way], near=near))
        for at in (one.middle[rows] - one.half[rows], one.middle[rows] + one.half[rows])
    )
    places = _flat(ends.r, ends.R)
    starts = np.append(True, way[1:] != way[:-1])
    comes = np.where(starts[:, None], places[way], np.roll(after, 1, axis=0))
    lasts = np.roll(starts, -1)
    apart = np.abs(before - comes).max(axis=1)
    apart[lasts] = np.maximum(apart[lasts], np.abs(after - places[len(a) + way])[lasts].max(axis=1))
    found = clear.copy()
    found[way[~(apart < SAME)]] = False
    return found


def _flat(r: np.ndarray, R: np.ndarray) -> np.ndarray:
    return np.hstack([r, R.reshape(len(R), 9)])


def _bounds(member: Member, q: np.ndarray, r: np.ndarray, R: np.ndarray, rate: np.ndarray) -> _Bounds:
    geometry = member.linked.geometry
    levers = np.linalg.norm(geometry.on_plate, axis=1)
    motion = _motion(member, q, r, R, rate)
    largest = motion.joints.max(axis=1, keepdims=True)
    W = 2 * motion.spin[:, None] + (
        LITTLE * largest / max(float(levers.max()), LEVER) if member.turns else 0.0
    )
    more = motion.apart / 2 + LITTLE * largest
    apart = motion.apart + more  # speed between the ends of a link, as assumed
    u = apart / geometry.length
    changes = np.stack([u, levers * (u + W)], axis=2)[:, :, : motion.columns.shape[1]]
    G = motion.columns @ changes
    radius = np.maximum(np.abs(np.linalg.eigvals(G)).max(axis=1), TINY)
    curved = apart**2 / geometry.length + levers * W**2 + motion.inward
    held = np.eye(G.shape[1]) - G / (2 * radius[:, None, None])
    second = np.linalg.solve(held, motion.columns @ curved[:, :, None])[:, :, 0]
    along, twist = second[:, 0], second[:, 1] if member.turns else np.zeros(len(q))
    faster = along[:, None] + levers * (twist[:, None] + W**2) + motion.inward
    reach = np.minimum(0.5 / radius, (more / np.maximum(faster, TINY)).min(axis=1))
    if member.turns:
        reach = np.minimum(reach, (W[:, 0] - motion.spin) / np.maximum(twist, TINY))
    body = max(
        [float(levers.max()), *(max(map(np.linalg.norm, (c.start, c.end))) for c in member.limits.plate)]
    )
    return _Bounds(
        reach=np.where(largest[:, 0] > 0, reach, np.inf),  # nothing moves
        speed=np.maximum(motion.speed + motion.spin * body, largest[:, 0]),
        growth=along + (twist + W[:, 0] ** 2) * body,
        angles=(apart / geometry.length).max(axis=1) + np.maximum(W[:, 0], motion.turning),
    )


@dataclass(frozen=True, eq=False)
class _Motion:
    """Motion at samples: columns (k, 1 or 2, m): lengths of the columns of the inverse of P, for position and rotation.

    speed (k,) of the tool, spin (k,) of the plate; apart (k, m): speed between the ends of a link; joints, inward (k, m):
    bounds of speed and acceleration of joints on carts; turning (k,): of turntables.
    """

    columns: np.ndarray
    speed: np.ndarray
    spin: np.ndarray
    apart: np.ndarray
    joints: np.ndarray
    inward: np.ndarray
    turning: np.ndarray


def _motion(member: Member, q: np.ndarray, r: np.ndarray, R: np.ndarray, rate: np.ndarray) -> _Motion:
    geometry = member.linked.geometry
    _, _, by_pose, by_joints = geometry.slopes(q, r, R)
    inverse = np.linalg.inv(by_pose if member.turns else by_pose[:, :, :3])
    x = -np.einsum("kij,kj->ki", inverse, np.einsum("kmn,kn->km", by_joints, rate))
    spin = x[:, 3:] if member.turns else np.zeros_like(x)
    plate = x[:, None, :3] + cross(spin[:, None], geometry.on_plate @ np.swapaxes(R, 1, 2))
    apart = plate - _joint_speeds(member, q, rate)
    blocks = inverse.reshape(len(q), -1, 3, inverse.shape[2])
    return _Motion(
        columns=np.sqrt((blocks**2).sum(axis=2)),
        speed=np.linalg.norm(x[:, :3], axis=1),
        spin=np.linalg.norm(spin, axis=1),
        apart=np.linalg.norm(apart, axis=2),
        **_joint_bounds(member, rate),
    )


def _joint_speeds(member: Member, q: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Velocities of the joints on carts and turntables, (k, m, 3)."""
    geometry = member.linked.geometry
    found = rate[:, geometry.arm, None] * geometry.direction[geometry.arm]
    if not geometry.turntables:
        return found
    joints = geometry.cart_joints(q)
    for arm in range(len(geometry.offset)):
        links, (_, *columns) = geometry.links_of(arm), geometry.columns_of(arm)
        turns = geometry.frames(arm, q)[2]
        for column, (axis, place) in zip(columns, turns, strict=True):
            spin = np.broadcast_to(axis, (len(q), 3)) * rate[:, column, None]
            found[:, links] += cross(spin[:, None], joints[:, links] - np.asarray(place)[:, None])
    return found


def _joint_bounds(member: Member, rate: np.ndarray) -> dict[str, np.ndarray]:
    """Bounds of speed (k, m) and acceleration (k, m) of the joints on carts, and of the rotation of turntables (k,)."""
    geometry = member.linked.geometry
    arm, sizes = geometry.arm, np.linalg.norm(geometry.direction, axis=1)
    speed = np.abs(rate[:, arm]) * sizes[arm]
    inward, spins = np.zeros_like(speed), np.zeros((len(rate), len(geometry.offset)))
    levers = np.linalg.norm(geometry.on_cart, axis=1)
    for k in reversed(range(len(geometry.turntables))):  # from the joint inwards
        links = geometry.links_of(geometry.turntables[k].arm)
        speed[:, links] += np.abs(rate[:, 3 + k, None]) * levers[links]
        spins[:, geometry.turntables[k].arm] += np.abs(rate[:, 3 + k])
        inward[:, links] = spins[:, geometry.turntables[k].arm, None] ** 2 * levers[links]
        levers[links] += np.linalg.norm(geometry.turntables[k].offset)
    return dict(joints=speed, inward=inward, turning=spins.max(axis=1, initial=0.0))
