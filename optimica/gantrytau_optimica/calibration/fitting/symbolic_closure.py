"""Closure errors of links in symbols of CasADi, written from the formulas alone: what Ipopt differentiates."""

from collections.abc import Iterator, Mapping
from typing import Any

import casadi as ca
import numpy as np

from gantrytau_optimica.calibration.links.arm_closure import ArmClosure
from gantrytau_optimica.calibration.links.arm_links import ArmOverPoses
from gantrytau_optimica.calibration.links.closure import Chain
from gantrytau_optimica.calibration.links.groups import Group


def errors_of(group: Group, x: ca.MX) -> Iterator[ca.MX]:
    """Closure errors of the links of a group, (N, 1) each, or (N, m) of an arm on turntables."""
    arms: set[int] = set()
    for link, places in zip(group.chains, group.places, strict=True):
        p = x[places.tolist()]
        if isinstance(link, Chain):
            yield _of_chain(link, p)
        elif id(link.poses) not in arms:  # once for all its links
            arms.add(id(link.poses))
            yield _of_arm(link.poses, p)


def _of_chain(chain: Chain, p: ca.MX) -> ca.MX:
    """Errors (N, 1), as `Chain.error` writes them, all poses by one function that is mapped."""
    N = len(chain.q)
    parameters, q, T, R = ca.SX.sym("p", chain.size), ca.SX.sym("q"), ca.SX.sym("T", 3), ca.SX.sym("R", 3, 3)
    if chain.points is None:
        along = q * parameters[4:7]
        data = chain.q[None]
    else:  # Q a with the rotation vector as exponential
        a, w = ca.SX.sym("a", 3), parameters[4:7]
        turned = ca.DM(np.eye(3) if chain.turned is None else chain.turned)
        along = _turn(w) @ turned @ a
        q, data = a, chain.points.T
    y = T - parameters[1:4] - along
    given, columns = [q, T], [data, chain.r.T]
    if chain.R is not None:
        y += R @ parameters[7:10]
        given.append(ca.vec(R))
        columns.append(_columns(chain.R))
    one = ca.Function("closure", [parameters, *given], [ca.sumsqr(y) - parameters[0] ** 2])
    return one.map(N)(ca.repmat(p, 1, N), *(ca.DM(c) for c in columns)).T


def _columns(R: np.ndarray) -> np.ndarray:
    """Matrices (N, 3, 3), column after column, (9, N)."""
    return R.transpose(2, 1, 0).reshape(9, len(R))


def _of_arm(poses: ArmOverPoses, p: ca.MX) -> ca.MX:
    """Errors (N, m) of (4.16)-(4.24)."""
    N = len(poses.q)
    R = np.tile(np.eye(3), (N, 1, 1)) if poses.R is None else poses.R
    data = (poses.q.T, poses.r.T, _columns(R))
    one = _closure(poses.arm, poses.q.shape[1])
    return one.map(N)(ca.repmat(p, 1, N), *map(ca.DM, data)).T


def _closure(arm: ArmClosure, actuators: int) -> ca.Function:
    """(p, q, T, R_T) -> e, (m,), for one pose."""
    p, q, T, R = (ca.SX.sym(*size) for size in (("p", arm.count), ("q", actuators), ("T", 3), ("R", 3, 3)))
    value: dict[str | None, ca.SX] = {name: ca.SX(ca.DM(each)) for name, each in arm.values.items()}
    value[None] = ca.SX.zeros(3)
    start = 0
    for name in arm.free:
        size = 3 if arm.is_local(name) else arm.values[name].size
        value[name] = p[start : start + size]
        start += size
    errors = []
    for rod, length in zip(arm.said.rods, arm.lengths, strict=True):
        on_arm = value[rod.offset]
        for table, column in reversed(list(zip(arm.turntables, arm.columns, strict=True))):
            turn = _turn(value[table.axis] * (q[column] * value[f"{table.name}.gain"]))
            on_arm = value[table.offset] + _seat(arm, table.orientation, value) @ turn @ on_arm
        A = value[arm.said.offset] + q[arm.cart] * value[arm.said.direction] + on_arm
        errors.append(
            (ca.sumsqr(T + R @ value[rod.plate_offset] - A) - value[rod.length] ** 2) / (2 * length)
        )
    return ca.Function("closure", [p, q, T, ca.vec(R)], [ca.vertcat(*errors)])


def _seat(arm: ArmClosure, name: str, value: Mapping[Any, ca.SX]) -> ca.SX:
    u = value[name]
    if arm.is_local(name):
        return _quaternion(ca.SX(ca.DM(arm.values[name]))) @ _turn(u)
    return _quaternion(u / ca.norm_2(u) if arm.orientation == "unit" else u)


def _quaternion(u: ca.SX) -> ca.SX:
    cross = ca.skew(u[1:])
    return ca.SX.eye(3) + 2 * u[0] * cross + 2 * cross @ cross


def _turn(vector: ca.SX) -> ca.SX:
    """The rotation by a vector in rad, also at zero, where its derivatives have to be right."""
    angle = ca.sqrt(ca.sumsqr(vector) + 1e-30)
    cross = ca.skew(vector)
    return ca.SX.eye(3) + ca.sin(angle) / angle * cross + 2 * (ca.sin(angle / 2) / angle) ** 2 * cross @ cross
