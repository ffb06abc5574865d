"""The way through the poses of a plan as a motion to look at: straight in joint coordinates, at rest where it measures."""

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from gantrytau import Dae, Model, Result, translate
from gantrytau.language.self_description.appearance import Cloud, ForceArrow, Shape
from gantrytau_optimica.procedure.robot_samples import Member

PARTS = 12  # of a way from pose to pose
SHORTEST = 0.05  # s, of such a way
DOT = 0.02  # m, of a place to measure


def plan_motion(
    robot: Model, member: Member, q: np.ndarray, measured: np.ndarray, speed: float, rest: float
) -> Result:
    """The robot at q (k, n) one after another, as a `Result` of what is needed to be seen.

    member: the same robot, judged; measured (k,): where it rests, rest: for how long, s; speed: of the tool, m/s.
    """
    dae = translate(robot, events=True)
    places, instants = _driven(member, q, measured, speed, rest)
    shapes = [shape for shape in dae.flat.shapes if not isinstance(shape, ForceArrow)]
    values = {name: np.full(len(places), value) for name, value in dae.parameter_values.items()}
    values |= dict(_followed(dae, member.kinematics.joints, places, shapes))
    values |= dict(zip(member.kinematics.joints, places.T, strict=True))
    targets, _ = member.pose(q[measured])
    around = [shape for obstacle in member.limits.obstacles for shape in obstacle.shapes()]
    every = [*shapes, *around, *([Cloud(places=targets, size=DOT)] if len(targets) else [])]
    return Result(instants, values, title=dae.name, shapes=every)


def _driven(
    member: Member, q: np.ndarray, measured: np.ndarray, speed: float, rest: float
) -> tuple[np.ndarray, np.ndarray]:
    """Joint coordinates (N, n) and instants (N,) in s of a drive through q (k, n)."""
    along = np.linspace(0, 1, PARTS + 1)[1:]
    places, instants = [q[0]], [0.0]
    for (a, b), stops in zip(pairwise(q), measured[1:], strict=True):
        leg = a + along[:, None] * (b - a)
        r, _ = member.pose(np.vstack([a, leg]))
        length = float(np.nansum(np.linalg.norm(np.diff(r, axis=0), axis=1)))
        instants += list(instants[-1] + max(length / speed, SHORTEST) * along)
        places += list(leg)
        if stops and rest > 0:
            instants.append(instants[-1] + rest)
            places.append(b)
    return np.array(places), np.array(instants)


def _followed(
    dae: Dae, joints: Sequence[str], q: np.ndarray, shapes: Sequence[Shape]
) -> Iterator[tuple[str, np.ndarray]]:
    """What shapes need at joint coordinates (N, n), scalar by scalar, (N,)."""
    known = set(dae.parameter_values)
    names = list(dict.fromkeys(name for shape in shapes for name in shape.names))
    wanted = [name for name in names if not set(dae.flat.expand(name)) <= known]
    function = dae.function(list(joints), wanted)
    rows = [
        np.concatenate([np.array(x).ravel() for x in function.call([float(x) for x in one])]) for one in q
    ]
    scalars = [scalar for name in wanted for scalar in dae.flat.expand(name)]
    return zip(scalars, np.array(rows).T, strict=True)
