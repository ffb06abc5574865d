"""Whether a robot keeps its limits all along a way that is straight in its actuator coordinates.

    P x' = -Q q'     x = (r, rho w): the pose, rotation by a length; P, Q: slopes of the link lengths, q' constant on a way

At a sample P has the least singular value s. Within h of it rows of P turn by at most D h in all, so that for h <= s / (2
D) the plate stays held, on its branch, and |x'| <= 2 |Q q'| / s. The second derivative of the closure then bounds |x''|
<= (2 / s) |w^2 / L + rho W^2 + |A''||, w the speed between the ends of a link, W of rotation, A'' of joints on
turntables: no point of plate or links moves by more than V h + C h^2 / 2. An interval of a way is clear if that is less
than what the sample at its middle leaves; else it is halved, until it is clear, or a sample breaks a limit, or hardly
anything moves in it. Nothing that happens between two samples can be missed; a way that is refused may be free by a hair.
"""

from dataclasses import dataclass

import numpy as np

from gantrytau_optimica.procedure.fleet import Fleet, Member

FIRST = 4  # intervals that a way begins with
LEAST = 2.5e-4  # m, motion within an interval below which it is not halved again
MOST = 200_000  # samples at once


@dataclass(frozen=True, eq=False)
class _Bounds:
    """What bounds motion about samples, (k,) each: as far as h the rest holds; speeds, and C; see above."""

    reach: np.ndarray
    speed: np.ndarray
    growth: np.ndarray
    relative: np.ndarray
    turning: np.ndarray
    turning_growth: np.ndarray
    shortest: float

    def moved(self, h: np.ndarray) -> np.ndarray:
        """How far any point moves within h, (k,) in m."""
        return self.speed * h + self.growth * h**2 / 2

    def turned(self, h: np.ndarray) -> np.ndarray:
        """By how much the angle of any ball joint changes within h, (k,) in rad."""
        of_links = (self.speed + self.growth * h + self.relative) / self.shortest
        return h * (of_links + self.turning + self.turning_growth * h)


def clear_ways(fleet: Fleet, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Which of the ways from a (N, n) to b (N, n) all robots of a fleet can go, (N,)."""
    clear = np.ones(len(a), dtype=bool)
    for member in fleet.members:
        left = np.flatnonzero(clear)
        if left.size:
            clear[left] = _clear_of(member, a[left], b[left])
    return clear


def _clear_of(member: Member, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    clear = np.ones(len(a), dtype=bool)
    ends = np.concatenate([a, b])
    broken = ~member.judged(ends).safe
    clear[broken[: len(a)] | broken[len(a) :]] = False
    way: np.ndarray = np.repeat(np.arange(len(a)), FIRST)
    half: np.ndarray = np.full(len(way), 0.5 / FIRST)
    middle: np.ndarray = np.tile((np.arange(FIRST) + 0.5) / FIRST, len(a))
    while True:
        kept = clear[way]
        way, middle, half = way[kept][:MOST], middle[kept][:MOST], half[kept][:MOST]
        if not way.size:
            return clear
        covered, hopeless = _covered(member, a[way] + middle[:, None] * (b - a)[way], (b - a)[way], half)
        clear[way[hopeless]] = False
        way, middle, half = way[~covered], middle[~covered], half[~covered] / 2
        middle = np.concatenate([middle - half, middle + half])
        way, half = np.tile(way, 2), np.tile(half, 2)


def _covered(
    member: Member, q: np.ndarray, rate: np.ndarray, half: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Which samples answer for all of their intervals, (k,); and which break a limit or cannot be told, (k,)."""
    found = member.judged(q)
    covered, hopeless = np.zeros(len(q), dtype=bool), ~found.safe
    rows = np.flatnonzero(found.safe)
    if not rows.size:
        return covered, hopeless
    bounds = _bounds(member, q[rows], found.r[rows], found.R[rows], rate[rows])
    h = half[rows]
    both = 2.0 if member.limits.link_radius else 1.0  # links may move towards each other
    near = both * bounds.moved(h) <= found.clearance[rows]
    good = near & (bounds.turned(h) <= found.angle[rows]) & (h <= bounds.reach)
    covered[rows] = good
    hopeless[rows] = ~good & (h * np.maximum(bounds.speed, bounds.relative) < LEAST)
    return covered, hopeless


def _bounds(member: Member, q: np.ndarray, r: np.ndarray, R: np.ndarray, rate: np.ndarray) -> _Bounds:
    geometry = member.linked.geometry
    lever = float(np.linalg.norm(geometry.on_plate, axis=1).max()) if member.turns else 0.0
    body = max([lever, *(max(map(np.linalg.norm, (c.start, c.end))) for c in member.limits.plate)])
    _, _, by_pose, by_joints = geometry.slopes(q, r, R)
    joints, inward, turning = _joint_motion(member, rate)
    P = by_pose[:, :, :3] if not lever else by_pose / np.repeat([1.0, lever], 3)
    asked = -np.einsum("kmn,kn->km", by_joints, rate)
    left, s, right = np.linalg.svd(P)
    least = s[:, -1]
    x = np.einsum("kji,kj->ki", right, np.einsum("kji,kj->ki", left, asked) / s)
    X = 2 * np.linalg.norm(joints, axis=1) / least
    W = X / lever if lever else np.zeros_like(X)
    apart = (np.sqrt(2.0) if lever else 1.0) * X[:, None] + joints  # speed between the ends of a link
    u = apart / geometry.length
    rows = 2 * u + W[:, None] if lever else u
    curved = apart**2 / geometry.length + (lever * W**2)[:, None] + inward
    second = 2 / least * np.linalg.norm(curved, axis=1)
    spin = np.linalg.norm(x[:, 3:], axis=1) / lever if lever else np.zeros_like(X)
    relative = joints.max(axis=1)
    return _Bounds(
        reach=least / (2 * np.linalg.norm(rows, axis=1)),
        speed=np.maximum(np.linalg.norm(x[:, :3], axis=1) + spin * body, relative),
        growth=second * (1 + (body / lever if lever else 0.0)) + W**2 * body,
        relative=relative,
        turning=np.maximum(spin, turning),
        turning_growth=second / lever if lever else np.zeros_like(X),
        shortest=float(geometry.length.min()),
    )


def _joint_motion(member: Member, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
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
    return speed, inward, spins.max(axis=1, initial=0.0)
