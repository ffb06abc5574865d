"""Figures of kinematics: poses per second beside a C loop, and how surely and quickly the F1 finds its pose."""

import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from gantrytau.kinematics import Kinematics, accuracy, assembly_modes, assembly_study
from gantrytau.kinematics.rotations import turned
from gantrytau_models import (
    DeltaRobot,
    F1GantryTau,
    FiveBar,
    GantryTau,
    SixLinkGantryTau,
    StewartPlatform,
    prototypes,
)
from tests.benchmarks.table import Row, at_least, at_most, in_turn, shown
from tests.kinematics.test_assembly_modes import HOME, f1_hexapod, link_errors, random_hexapod
from tests.kinematics.test_kinematics_f1 import LIMIT, poses
from tests.references.cart_errors import CASE_1, CASE_2, slice_between_guideways

POSES = 1_000_000
MANY = 50_000  # of robots without closed form
# (4.9) pose after pose, as it is written down
LOOP = r"""
#include <math.h>
void ik(long n, const double *r, const double *A, const double *v, const double *L, double *q)
{
    for (long k = 0; k < n; k++)
        for (int i = 0; i < 3; i++) {
            const double *a = A + 3 * i, *u = v + 3 * i;
            double x = r[3 * k] - a[0], y = r[3 * k + 1] - a[1], z = r[3 * k + 2] - a[2];
            double uu = u[0] * u[0] + u[1] * u[1] + u[2] * u[2], p = u[0] * x + u[1] * y + u[2] * z;
            q[3 * k + i] = (p - sqrt(p * p - uu * (x * x + y * y + z * z - L[i] * L[i]))) / uu;
        }
}
"""


def rows() -> Iterator[Row]:
    """All figures of kinematics."""
    yield from _three_links()
    yield from _others()
    yield from _through_equations()
    yield from _right_poses()
    yield from _assembly_modes()
    yield from _errors_of_d1()


def _three_links() -> Iterator[Row]:
    kinematics = Kinematics(GantryTau(prototypes.L1))
    random = np.random.default_rng(0)
    r = kinematics.home.r + random.uniform(-0.3, 0.3, (POSES, 3))
    with tempfile.TemporaryDirectory() as folder:
        loop, q = _compiled(Path(folder), r)
        loop()
        assert np.abs(kinematics.ik(r) - q).max() < 1e-12
        times = in_turn({"ik": lambda: kinematics.ik(r), "C": loop}, 7)
    rate = POSES / times["ik"] / 1e6
    yield at_least("three links, inverse, million poses per second", round(rate, 1), 2)
    yield shown("the same, a C loop (cc -O2)", f"{POSES / times['C'] / 1e6:.3g}")
    yield at_most("three links, inverse against a C loop", times["ik"] / times["C"], 3.0, "x")
    q = kinematics.ik(r)
    times = in_turn({"fk": lambda: kinematics.fk(q), "jacobian": lambda: kinematics.jacobian(r)}, 3)
    yield shown("three links, forward, million poses per second", f"{POSES / times['fk'] / 1e6:.3g}")
    yield shown("three links, Jacobian, million poses per second", f"{POSES / times['jacobian'] / 1e6:.3g}")


def _compiled(folder: Path, r: np.ndarray) -> tuple[Callable[[], None], np.ndarray]:
    """The C loop over poses r, and the array that it fills."""
    (folder / "ik.c").write_text(LOOP)
    subprocess.run(["cc", "-O2", "-shared", "-fPIC", "-o", "ik.so", "ik.c", "-lm"], cwd=folder, check=True)
    function = ctypes.CDLL(str(folder / "ik.so")).ik
    arms = prototypes.L1.arms
    q = np.empty_like(r)
    arrays = [r, *(np.array([getattr(arm, n) for arm in arms]) for n in ("offset", "direction", "length")), q]

    def loop() -> None:
        function(ctypes.c_long(len(r)), *(a.ctypes.data_as(ctypes.c_void_p) for a in arrays))

    return loop, q


def _others() -> Iterator[Row]:
    random = np.random.default_rng(1)
    for name, robot in (("six links", SixLinkGantryTau(prototypes.D1)), ("F1", F1GantryTau(prototypes.F1))):
        kinematics = Kinematics(robot)
        count = 20_000
        q = kinematics.home.q + random.uniform(-0.1, 0.1, (count, len(kinematics.joints)))
        r, R = kinematics.fk(q)
        given = R if len(kinematics.joints) == 6 else None
        calls = {"fk": lambda k=kinematics, q=q: k.fk(q), "ik": lambda k=kinematics, r=r, R=given: k.ik(r, R)}
        times = in_turn(calls, 3)
        rates = ", ".join(f"{count / times[word]:.2g}" for word in ("ik", "fk"))
        yield shown(f"{name}, inverse and forward, poses per second", rates)


def _through_equations() -> Iterator[Row]:
    """Robots that have nothing but their equations, within 0.2 m about the start."""
    random = np.random.default_rng(2)
    delta, stewart, bars = (
        Kinematics(DeltaRobot()),
        Kinematics(StewartPlatform(), tool="platform"),
        Kinematics(FiveBar()),
    )
    r = delta.home.r + random.uniform(-0.2, 0.2, (MANY, 3))
    wide = delta.home.r + random.uniform(-0.5, 0.5, (MANY, 3))  # a third of it is out of reach
    q = delta.ik(r)
    place = stewart.home.r + random.uniform(-0.1, 0.1, (MANY, 3))
    turn = turned(np.broadcast_to(stewart.home.R, (MANY, 3, 3)), random.uniform(-0.1, 0.1, (MANY, 3)))
    legs = stewart.ik(place, turn)
    motors = bars.home.q + random.uniform(-0.3, 0.3, (MANY, 2))
    bars.fk(motors)
    calls = {
        "delta robot, inverse": lambda: delta.ik(r),
        "delta robot, inverse, whole workspace": lambda: delta.ik(wide),
        "delta robot, forward": lambda: delta.fk(q),
        "Stewart platform, inverse": lambda: stewart.ik(place, turn),
        "Stewart platform, forward": lambda: stewart.fk(legs),
        "five bars, forward": lambda: bars.fk(motors),
    }
    times = in_turn(calls, 3)
    for name, duration in times.items():
        target = 200_000 if name.startswith("delta robot, inverse") else None
        rate, figure = float(f"{MANY / duration:.3g}"), f"{name}, poses per second"
        yield shown(figure, f"{rate:g}") if target is None else at_least(figure, rate, target)


def _right_poses() -> Iterator[Row]:
    kinematics = Kinematics(F1GantryTau(prototypes.F1))
    r, R = poses(kinematics, 20_000)
    q = kinematics.ik(r, R)
    bent = kinematics.ball_joint_angles(r, R, np.nan_to_num(q)).max(axis=(1, 2))
    inside = np.flatnonzero(np.isfinite(q[:, 0]) & (bent < LIMIT))[:10_000]
    begin = time.perf_counter()
    found, _ = kinematics.fk(q[inside])
    duration = time.perf_counter() - begin
    right = int(np.sum(np.abs(found - r[inside]).max(axis=1) < 1e-9))
    yield at_least("F1, right poses of 10000 from the five-degree start", right, 10_000)
    yield at_most("F1, most iterations of these", kinematics.iterations, 6)
    yield shown("F1, iterations of these on average", f"{kinematics.iterations_by_pose.mean():.2f}")
    yield shown("F1, time of these", f"{duration:.3g} s")


def _assembly_modes() -> Iterator[Row]:
    random = np.random.default_rng(5)
    spread = np.array([0.3, 0.3, 0.3, 0.4, 0.4, 0.5])  # m, rad
    poses_of_f1 = [f1_hexapod(HOME + spread * q) for q in random.uniform(-1, 1, (100, 6))]
    assembly_modes(*poses_of_f1[0])  # reads its start system once
    for name, hexapods in (("F1", poses_of_f1), ("random hexapods", [random_hexapod(k) for k in range(100)])):
        times, found = [], []
        for hexapod in hexapods:
            begin = time.perf_counter()
            found.append(assembly_modes(*hexapod))
            times.append(time.perf_counter() - begin)
        whole = sum(modes.complete and len(modes) == 40 for modes in found)
        yield at_least(f"assembly modes, {name}, 40 of 40 in 100", whole, 98)
        yield at_most(f"assembly modes, {name}, median time", 1e3 * float(np.median(times)), 100, "ms")
        errors = [link_errors(m, *h).max(axis=1) for m, h in zip(found, hexapods, strict=True)]
        real = max(float(e[m.real].max()) for e, m in zip(errors, found, strict=True))
        yield at_most(f"assembly modes, {name}, links of real modes", 1e3 * real, 1e-9, "mm")
        exact = [link_errors(m.exact, *h).max() < 1e-12 for m, h in zip(found, hexapods, strict=True)]
        words = ", ".join(f"{sum(met)} in {what}" for met, what in (
            ([e.max() < 1e-12 for e in errors], "doubles"), (exact, "long numbers"),
        ))  # fmt: skip
        yield shown(f"assembly modes, {name}, of 100 with all 40 within 1e-9 mm", words)
    robot = Kinematics(F1GantryTau(prototypes.F1))
    begin = time.perf_counter()
    study = assembly_study(robot, HOME + spread * random.uniform(-1, 1, (50, 6)))
    each = 1e3 * (time.perf_counter() - begin) / len(study)
    yield at_least(
        "study of assembly modes, poses of 50 with all 40, 16 in the thesis", int(study.complete.sum()), 49
    )
    yield at_most("study of assembly modes, time of a pose", each, 100, "ms")
    yield shown("study of assembly modes, poses by real modes", str(study.histogram))


def _errors_of_d1() -> Iterator[Row]:
    """Section 4.3 and Appendix A: the ranges over the slice between the guideways, and the bound beside Monte Carlo."""
    kinematics = Kinematics(GantryTau(prototypes.D1))
    r = slice_between_guideways()
    for name, case, low, high in (("1", CASE_1, 140, 240), ("2", CASE_2, 90, 170)):
        found = accuracy(kinematics, r, case)
        error = 1e6 * found.error
        yield at_least(
            f"D1, error of case {name}, least over the slice, um", round(float(error.min()), 1), low
        )
        yield at_most(f"D1, error of case {name}, largest over the slice", float(error.max()), high, "um")
        sampled = np.linalg.norm(found.sampled(2000), axis=2).max(axis=1)
        share = float((sampled / found.bound).max())
        yield at_most(f"D1, case {name}, largest of 2000 sampled errors by its bound", share, 1.0)
