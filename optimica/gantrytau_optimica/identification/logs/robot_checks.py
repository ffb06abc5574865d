"""Checks of a log against the robot that it is said to be of, with the robot's nominal values."""

from collections.abc import Iterator
from itertools import combinations

import casadi as ca
import numpy as np

from gantrytau import Model, ModelError, translate
from gantrytau.dae import Dae
from gantrytau.kinematics.kinematics import Kinematics, driven_joints
from gantrytau_optimica.fitting.finding import Finding, agreeing, rows_in_words
from gantrytau_optimica.identification.logs.log_checks import WINDOW, slopes
from gantrytau_optimica.identification.logs.motion_log import MotionLog

POSES = 5000  # rows, evenly spread, whose poses are looked at
FORCES = 500  # rows whose forces are compared
CROSSED = 0.1  # of the squares of forces, which a robot of the right order leaves at most
EXPLAINED = 0.4  # of what is left, below which columns must bring it to be called exchanged
ALIKE = 0.6  # correlation of forces with those of the nominal robot, above which their ratio says something
ALONE = 0.8  # the same for one force by itself
FACTOR = 4.0  # to either side: masses and friction of a robot are better known than that


def check_motion(robot: Model | Dae, log: MotionLog) -> tuple[Finding, ...]:
    """Disagreements of a log with a robot: kinds "workspace", "order of actuators", "unit of force",
    "sign of force".

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
    """Measured forces beside those of the robot with its nominal values, along the longest stretch."""
    part = max(log.parts(), key=len, default=log)
    width = max(int(WINDOW / part.period), 2) if len(part) > 1 else 2
    if len(part) < 5 * width:
        return
    v, a, _, inner = slopes(part.t, part.q, width)
    kept = np.unique(np.linspace(0, len(inner) - 1, FORCES).astype(int))
    measured, motion = part.f[inner[kept]], (part.q[inner[kept]], v[kept], a[kept])
    nominal = nominal_forces(dae, joints, *motion)
    good = np.isfinite(nominal).all(axis=1)
    every = np.arange(len(log))
    order = _order(dae, joints, motion, measured) if _left(nominal, measured) > CROSSED else None
    if order:
        yield Finding("order of actuators", every, order)
        return
    yield from _ratios(nominal[good], measured[good], every)


def _ratios(nominal: np.ndarray, measured: np.ndarray, rows: np.ndarray) -> Iterator[Finding]:
    """Signs and units, of all forces together, or of those (N, n) that stand out alone."""
    whole, alike = _ratio(nominal.ravel(), measured.ravel())
    each = [_ratio(x, y) for x, y in zip(nominal.T, measured.T, strict=True)]
    sure = {k: ratio for k, (ratio, share) in enumerate(each) if share > ALONE}
    if alike > ALIKE and all(1 / FACTOR < ratio / whole < FACTOR for ratio in sure.values()):
        found = {"forces": whole}
    else:
        found = {f"forces in f{k + 1}": ratio for k, ratio in sure.items()}
    for who, ratio in found.items():
        if ratio < 0:
            yield Finding(
                "sign of force",
                rows,
                f"{who} are against those that the robot needs with its nominal values; change the sign of f, or that of q",
            )
        if not 1 / FACTOR < abs(ratio) < FACTOR:
            words = (
                f"{1 / abs(ratio):.3g} times smaller" if abs(ratio) < 1 else f"{abs(ratio):.3g} times larger"
            )
            yield Finding(
                "unit of force",
                rows,
                f"{who} are {words} than those that the robot needs with its nominal values: torques of motors in N.m, "
                "forces before or after a gear, or another unit; divide torques by the radius of the transmission, or "
                "write the unit in the header, 'f1 [kN]'",
            )


def _ratio(nominal: np.ndarray, measured: np.ndarray) -> tuple[float, float]:
    """The ratio of forces by least squares, and how alike they are, 0 to 1; 0 where there are none."""
    size = float(np.linalg.norm(nominal) * np.linalg.norm(measured))
    product = float(nominal @ measured)
    return (product / float(nominal @ nominal), abs(product) / size) if size else (1.0, 0.0)


def _left(nominal: np.ndarray, measured: np.ndarray) -> float:
    """Share of the squares of measured forces that nominal ones, in any unit and sign for each, leave; 1 without any."""
    good = np.asarray(np.isfinite(nominal).all(axis=1))
    if 2 * np.count_nonzero(good) < len(good):
        return 1.0
    shares = [_ratio(x, y)[1] ** 2 for x, y in zip(nominal[good].T, measured[good].T, strict=True)]
    return 1 - float(np.mean(shares))


def _order(
    dae: Dae, joints: tuple[str, ...], motion: tuple[np.ndarray, ...], measured: np.ndarray
) -> str | None:
    """What two actuators, exchanged in f or in q and f, would mend; None where no exchange explains the forces."""
    own = nominal_forces(dae, joints, *motion)
    now, best = _left(own, measured), (1.0, "")
    for i, j in combinations(range(len(joints)), 2):
        exchanged = np.arange(len(joints))
        exchanged[[i, j]] = j, i
        both = nominal_forces(dae, joints, *(x[:, exchanged] for x in motion))
        names = (f"f{i + 1} and f{j + 1}", f"q{i + 1}, f{i + 1} and q{j + 1}, f{j + 1}")
        for nominal, name in zip((own, both), names, strict=True):
            best = min(best, (_left(nominal, measured[:, exchanged]), name))
    left, name = best
    if left > EXPLAINED * now:
        return None
    return (
        f"columns {name} are exchanged: so the robot with its nominal values explains {1 - left:.0%} of the forces by "
        f"squares, and {1 - now:.0%} as they are; expected the order {', '.join(joints)}"
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
