"""All solutions of the kinematics of links: branches, and which of them a robot could be in."""

import itertools
from dataclasses import dataclass

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau.describing.record import Record
from gantrytau.kinematics.modes.assembly_modes import assembly_modes
from gantrytau.kinematics.poses import Poses, answered
from gantrytau.kinematics.rods.closed_form import meeting
from gantrytau.kinematics.rods.lengths_by_newton import solve_lengths
from gantrytau.kinematics.rods.rod_robots import RodRobot, SixRods, ThreeRods, TurningRods

SAME = 1e-6  # m or rad between solutions that are one
GRID = 24  # starts around a turn of each turntable


@dataclass(frozen=True, eq=False)
class Configuration(Record):
    """One solution: q (N, n), r (N, 3), R (N, 3, 3) and feasible (N,), or one pose without the first axis.

    feasible: the solution exists, keeps the bounds of the model, and no two links cross. name: signs of its branch, for
    robots computed by their equations.
    """

    q: np.ndarray
    r: np.ndarray
    R: np.ndarray
    feasible: np.ndarray
    name: str = ""


def of_joints(robot: RodRobot, q: np.ndarray, one: bool, limits: np.ndarray) -> list[Configuration]:
    """All poses of actuator coordinates; those of the branch at home first."""
    if isinstance(robot, ThreeRods):
        R = robot.repeated(len(q))
        foot, height, margin = meeting(robot.spheres(q, R)[0], robot.geometry.length)
        lost = ~(margin >= 0.0)
        height[lost], R[lost] = np.nan, np.nan
        up = robot.ahead * np.sign(height @ robot.geometry.direction.sum(axis=0))[:, None] * height
        return [configuration(robot, q, foot + s * up, R, one, limits) for s in (1.0, -1.0)]
    if len(q) > 1:
        raise ModelError(
            f"Kinematics.configurations: found q of {len(q)} rows, expected one for a robot with six links, as the number "
            "of solutions differs from pose to pose; ask for one after the other"
        )
    if not np.isfinite(q).all():
        return []
    geometry = robot.geometry
    modes = assembly_modes(geometry.cart_joints(q)[0], geometry.on_plate, geometry.length)
    r, R = np.real(modes.r[modes.real]), np.real(modes.R[modes.real])
    home_r, home_R, _ = robot.fk(q)
    if np.isnan(home_r).any():  # nothing on the branch
        home_r, home_R = robot.home.r, robot.home.R
    away = np.linalg.norm(r - home_r, axis=1) + np.linalg.norm(R - home_R, axis=(1, 2))
    return [configuration(robot, q, r[k][None], R[k][None], one, limits) for k in np.argsort(away)]


def of_pose(robot: RodRobot, at: Poses, limits: np.ndarray) -> list[Configuration]:
    """All actuator coordinates of a pose, those with the arms on the sides they have at home first."""
    if isinstance(robot, TurningRods):
        return _of_turntables(robot, at, limits)
    found = []
    for sides in np.array(list(itertools.product((1.0, -1.0), repeat=len(robot.sides)))) * robot.sides:
        if isinstance(robot, SixRods) and at.R is None:
            q, R, _ = robot.follow(at.r, sides)
        else:
            q, _ = robot.ik(at.r, at.R, sides)
            R = robot.repeated(len(at.r)) if at.R is None else at.R
        found.append(configuration(robot, q, at.r, R, at.one, limits))
    return found


def of_signs(at: Poses, q: np.ndarray, signs: np.ndarray, limits: np.ndarray) -> list[Configuration]:
    """Solutions q (m, n) of one pose by their signs (s, m), those as at home first."""
    if not at.one:
        raise ModelError(
            f"Kinematics.configurations: found {len(at.r)} positions, expected one pose of a robot through its equations; "
            "ask for one after the other"
        )
    R = np.eye(3) if at.R is None else at.R[0]
    inside = np.all((q >= limits[:, 0]) & (q <= limits[:, 1]), axis=1)
    named = sorted(
        ("".join("+" if s > 0 else "-" for s in column), k) for k, column in enumerate(signs.T.tolist())
    )
    return [Configuration(q[k], at.r[0], R, inside[k : k + 1].all(), name) for name, k in named]


def configuration(robot: RodRobot, q, r, R, one: bool, limits: np.ndarray) -> Configuration:
    """A solution with what can be said of it."""
    with np.errstate(invalid="ignore"):
        inside = ((q >= limits[:, 0]) & (q <= limits[:, 1])).all(axis=1)
        feasible = inside & np.isfinite(r).all(axis=1) & ~robot.crossed(q, r, R)
    q, r, R, feasible = answered(one, q, np.array(r), np.array(R), feasible)
    return Configuration(q, r, R, feasible)


def _of_turntables(robot: TurningRods, at: Poses, limits: np.ndarray) -> list[Configuration]:
    """All q of one pose of the F1: what each arm can do, found from many starts, in all combinations."""
    if len(at.r) > 1 or at.R is None:
        raise ModelError(
            f"Kinematics.configurations: found {len(at.r)} positions and {'no' if at.R is None else 'an'} orientation, "
            "expected one pose of a robot with turntables; ask for one after the other, with R"
        )
    arms = [_of_arm(robot, arm, at.r, at.R) for arm in robot.geometry.arms]
    found = []
    for parts in itertools.product(*arms):
        q = np.zeros((1, 6))
        for arm, part in enumerate(parts):
            q[0, robot.geometry.columns_of(arm)] = part
        found.append(configuration(robot, q, at.r, at.R, at.one, limits))
    return found


def _of_arm(robot: TurningRods, arm: int, r: np.ndarray, R: np.ndarray) -> list[np.ndarray]:
    """Coordinates of an arm for one pose, the solution of the robot's own branch first."""
    columns = robot.geometry.columns_of(arm)
    turns = np.linspace(-np.pi, np.pi, GRID, endpoint=False)
    angles = np.array(list(itertools.product(turns, repeat=len(columns) - 1)))
    starts = [robot.five_degrees(r, R, robot.sides)]
    for side in (robot.sides, -robot.sides):
        q = np.zeros((len(angles), 6))
        q[:, columns[1:]] = angles
        starts.append(robot.with_carts(q, r, R, side))
    q = np.concatenate(starts)
    many = len(q)
    free = [6 + k for k in columns]
    poses = np.repeat(r, many, axis=0), np.repeat(R, many, axis=0)
    q = solve_lengths(robot.geometry.of_arm(arm), q, *poses, free)[0][:, columns]
    q[:, 1:] = np.arctan2(np.sin(q[:, 1:]), np.cos(q[:, 1:]))
    found: list[np.ndarray] = []
    for solution in q[np.isfinite(q).all(axis=1)]:
        gaps = [solution - other for other in found]
        if all(max(abs(g[0]), *np.abs(2 * np.sin(g[1:] / 2)), 0.0) > SAME for g in gaps):
            found.append(solution)
    return found
