"""The same cost by Ipopt, for one arm: where limits or equations between its parameters are wanted, or as a check.

    minimise  sum e_jk(p)^2 + sum ((p - p0) noise / tape)^2     subject to |u| = 1 with orientation "unit"

Directions that the data do not hold are drawn to their nominal values by the second sum, which is what a tape measure
says, and weighs nothing where they do. Written with CasADi from (4.16)-(4.24) alone, not from the code of `arms`.
"""

from collections.abc import Iterable, Mapping
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.calibration.fitting.arm_fit import (
    NOISE,
    TAPE,
    ArmFit,
    checked_poses,
    fitted,
    prior_pulls,
    scales,
    triangle,
)
from gantrytau_optimica.calibration.fitting.constraints import read_constraints
from gantrytau_optimica.calibration.rods.arms import Arm


def fit_arm_with_ipopt(
    arm: Arm,
    q: np.ndarray,
    r: np.ndarray,
    R: np.ndarray | None,
    *,
    noise: float = NOISE,
    tape: float = TAPE,
    fixed: Iterable[str] = (),
    limits: Mapping[str, tuple[float, float]] | None = None,
    prior: Mapping[str, float] | None = None,
    weights: np.ndarray | None = None,
    constraints: Mapping[str, Any] | None = None,
    tolerance: float = 1e-8,
) -> ArmFit:
    """Fit the unknowns of an arm to measured poses by Ipopt.

    q, r, R, noise, tape: as for `fit_arm`; tape: infinite for the plain sum of squares; fixed: names of unknowns that
    keep their values; limits: least and largest values by name, m or 1, of rotations about the nominal ones;
    prior: as for `fit_arm`; weights: of the squares, (N, m), as a robust loss found them, or None; constraints: equations
    and limits as in `constraints.py`; tolerance: of Ipopt, on a sum of squares in units of the noise.
    Raises ModelError for unknown names and arrays that do not fit.
    """
    q, r, R = checked_poses(arm, q, r, R)
    p, x0, scale = ca.MX.sym("p", arm.count), arm.vector, scales(arm)
    residual = _closure(arm, q.shape[1])
    data = [
        q.T,
        r.T,
        (np.tile(np.eye(3), (len(q), 1, 1)) if R is None else R).transpose(0, 2, 1).reshape(-1, 9).T,
    ]
    everything = residual.map(len(q))(ca.repmat(p, 1, len(q)), *map(ca.DM, data))
    if weights is not None:
        everything *= ca.DM(np.sqrt(weights).T)
    pulls = prior_pulls(arm, prior, noise)
    units = [ca.sumsqr(p[place]) for place in _quaternions(arm)]
    wanted = read_constraints(constraints or {}, arm.names)
    near = ca.sumsqr((p - x0) / scale * noise / tape) + ca.sumsqr(ca.DM(pulls) * (p - x0))
    problem = {"x": p, "f": (ca.sumsqr(everything) + near) / noise**2}
    kept = [*units, *(each.expression(p) for each in wanted)]
    problem |= {"g": ca.vertcat(*kept)} if kept else {}
    least, most = (
        np.concatenate([np.ones(len(units)), *(getattr(c, side) for c in wanted)]) for side in ("low", "high")
    )
    options = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.tol": tolerance}
    options |= {"ipopt.bound_relax_factor": 0.0}  # limits hold as they are said
    solver = ca.nlpsol("fit", "ipopt", problem, options)
    low, high = _limits(arm, fixed, limits or {})
    found: Any = solver(x0=x0, lbx=low, ubx=high, lbg=least, ubg=most)
    stats = solver.stats()
    arm = arm.moved(np.array(found["x"]).ravel() - x0)
    system = (triangle(arm, q, r, R, scale, weights), scale, pulls)
    return fitted(arm, (q, r, R), (int(stats["iter_count"]), bool(stats["success"])), system, noise / tape)


def _limits(
    arm: Arm, fixed: Iterable[str], limits: Mapping[str, tuple[float, float]]
) -> tuple[np.ndarray, np.ndarray]:
    low, high, nominal = np.full(arm.count, -np.inf), np.full(arm.count, np.inf), arm.vector
    names = list(arm.names)
    for name in (*fixed, *limits):
        if name not in names:
            raise ModelError(f"{arm.name}: there is no unknown {name!r}, expected one of {', '.join(names)}")
    for name, (least, most) in limits.items():
        low[names.index(name)], high[names.index(name)] = least, most
    for name in fixed:
        low[names.index(name)] = high[names.index(name)] = nominal[names.index(name)]
    return low, high


def _quaternions(arm: Arm) -> list[list[int]]:
    """Where quaternions of unit length stand among the unknowns."""
    if arm.orientation != "unit":
        return []
    names = [f"{turntable.name}.orientation[" for turntable in arm.turntables]
    return [[k for k, each in enumerate(arm.names) if each.startswith(name)] for name in names]


def _closure(arm: Arm, actuators: int) -> ca.Function:
    """(p, q, T, R_T) -> e, (m,), for one pose."""
    p, q, T, R = (ca.SX.sym(*size) for size in (("p", arm.count), ("q", actuators), ("T", 3), ("R", 3, 3)))
    value: dict[str, ca.SX] = {name: ca.SX(ca.DM(each)) for name, each in arm.values.items()}
    start = 0
    for name in arm.free:
        local = name.endswith(".orientation") and arm.orientation == "local"
        size = 3 if local else arm.values[name].size
        value[name] = p[start : start + size]
        start += size
    errors = []
    for link, length in zip(arm.links, arm.lengths, strict=True):
        on_arm = value[f"{link}.offset"] if link != arm.name else ca.SX.zeros(3)
        for turntable in reversed(arm.turntables):
            turn = _turn(turntable.axis * (q[turntable.column] * value[f"{turntable.name}.gain"]))
            on_arm = value[f"{turntable.name}.offset"] + _seat(arm, turntable.name, value) @ turn @ on_arm
        A = value[f"{arm.name}.offset"] + q[arm.cart] * value[f"{arm.name}.direction"] + on_arm
        on_plate = value.get(f"{link}.plate_offset", ca.SX.zeros(3))
        errors.append((ca.sumsqr(T + R @ on_plate - A) - value[f"{link}.length"] ** 2) / (2 * length))
    return ca.Function("closure", [p, q, T, ca.vec(R)], [ca.vertcat(*errors)])


def _seat(arm: Arm, name: str, value: Mapping[str, ca.SX]) -> ca.SX:
    u = value[f"{name}.orientation"]
    if arm.orientation == "local":
        return _quaternion(ca.SX(ca.DM(arm.values[f"{name}.orientation"]))) @ _turn(u)
    return _quaternion(u)


def _quaternion(u: ca.SX) -> ca.SX:
    cross = ca.skew(u[1:])
    return ca.SX.eye(3) + 2 * u[0] * cross + 2 * cross @ cross


def _turn(vector: ca.SX) -> ca.SX:
    """The rotation by a vector in rad, also at zero, where its derivatives have to be right."""
    angle = ca.sqrt(ca.sumsqr(vector) + 1e-30)
    cross = ca.skew(vector)
    return ca.SX.eye(3) + ca.sin(angle) / angle * cross + 2 * (ca.sin(angle / 2) / angle) ** 2 * cross @ cross
