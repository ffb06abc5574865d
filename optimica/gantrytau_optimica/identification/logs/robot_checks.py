"""Checks of a log against the robot that it is said to be of, with the robot's nominal values."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from gantrytau import Model, ModelError, translate
from gantrytau.dae import Dae
from gantrytau.kinematics.kinematics import Kinematics, driven_joints
from gantrytau_optimica.calibration.data.findings import Finding, agreeing, rows_in_words
from gantrytau_optimica.identification.logs.log_checks import WINDOW, slopes
from gantrytau_optimica.identification.logs.motion_log import MotionLog

POSES = 5000  # rows, evenly spread, whose poses are looked at
FORCES = 500  # rows whose forces are compared
ALIKE = 0.6  # correlation of forces with those of the nominal robot, above which their ratio says something
FACTOR = 4.0  # to either side: masses and friction of a robot are better known than that


def check_motion(robot: Model | Dae, log: MotionLog) -> tuple[Finding, ...]:
    """What of a log does not go with a robot: kinds "workspace", "unit of force", "sign of force".

    Raises ModelError where not all actuators are logged, or more than there are.
    """
    dae = robot if isinstance(robot, Dae) else translate(robot, units=False)
    joints = driven_joints(dae)
    if log.q.shape[1] != len(joints):
        raise ModelError(
            f"MotionLog: found {log.q.shape[1]} actuators, expected the {len(joints)} of {dae.name}: {', '.join(joints)}; "
            "log all of them, as each one's force depends on the motion of the others"
        )
    return (*_workspace(dae, log), *_forces(dae, joints, log))


def _workspace(dae: Dae, log: MotionLog) -> Iterator[Finding]:
    if "tool.r" not in dae.vectors:
        return
    finite = np.flatnonzero(np.isfinite(log.q).all(axis=1))
    looked = finite[np.unique(np.linspace(0, len(finite) - 1, min(len(finite), POSES)).astype(int))]
    if not looked.size:
        return
    r, _ = Kinematics(dae).fk(log.q[looked])
    outside = looked[~np.isfinite(r).all(axis=1)]
    if outside.size:
        have = agreeing(outside, "are")
        yield Finding(
            "workspace",
            outside,
            f"{rows_in_words(outside)} of the {len(looked)} looked at {have} outside of the workspace: the links do not "
            "reach with the geometry of this robot; look at unit, zero and order of the actuators, or calibrate it",
        )


def _forces(dae: Dae, joints: tuple[str, ...], log: MotionLog) -> Iterator[Finding]:
    """The ratio of measured forces to those of the robot with its nominal values, along the longest stretch."""
    part = max(log.parts(), key=len, default=log)
    width = max(int(WINDOW / part.period), 2) if len(part) > 1 else 2
    if len(part) < 5 * width:
        return
    v, a, _, inner = slopes(part.t, part.q, width)
    kept = np.unique(np.linspace(0, len(inner) - 1, FORCES).astype(int))
    measured = part.f[inner[kept]]
    nominal = nominal_forces(dae, joints, part.q[inner[kept]], v[kept], a[kept])
    good = np.isfinite(nominal).all(axis=1)
    x, y = nominal[good].ravel(), measured[good].ravel()
    size = float(np.linalg.norm(x) * np.linalg.norm(y))
    if not size or abs(x @ y) < ALIKE * size:
        return
    ratio = float(x @ y / (x @ x))
    every = np.arange(len(log))
    if ratio < 0:
        yield Finding(
            "sign of force",
            every,
            "forces are against those that the robot needs with its nominal values; change the sign of f, or that of q",
        )
    if not 1 / FACTOR < abs(ratio) < FACTOR:
        words = f"{1 / abs(ratio):.3g} times smaller" if abs(ratio) < 1 else f"{abs(ratio):.3g} times larger"
        yield Finding(
            "unit of force",
            every,
            f"forces are {words} than those that the robot needs with its nominal values: torques of motors in N.m, or "
            "another unit; divide torques by the radius of the transmission, or write the unit in the header, 'f1 [kN]'",
        )


def nominal_forces(
    dae: Dae, joints: tuple[str, ...], q: np.ndarray, v: np.ndarray, a: np.ndarray
) -> np.ndarray:
    """Forces (N, n) that a robot needs for q, v, a (N, n) with its nominal values; NaN where it cannot be there."""
    motion = [*joints, *(f"der({name})" for name in joints), *(f"der(der({name}))" for name in joints)]
    drives = [f"{name[:-2]}.f" if name.endswith(".s") else f"{name[:-4]}.tau" for name in joints]
    whole = dae.function(given=motion, find=drives)
    x = ca.MX.sym("x", len(motion))
    one = ca.Function("f", [x], [ca.vertcat(*whole.call(ca.vertsplit(x)))])
    return np.asarray(one.map(len(q))(np.hstack([q, v, a]).T)).T
