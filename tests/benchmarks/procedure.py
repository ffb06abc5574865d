"""The planned calibration of an L1: how long it takes, and robots that the plan has not seen calibrated by it."""

import time
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from gantrytau.kinematics import Box, Kinematics, Limits
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import CalibrationPlan, LaserTracker, Measurements, calibrate, plan_calibration
from gantrytau_optimica.calibration.links.arm_closure import read_arms
from gantrytau_optimica.calibration.links.arm_factors import scales
from tests.benchmarks.table import Row, at_least, at_most, shown

WANTED, TAPE = 50e-6, 0.005
FRESH = 20  # robots that are drawn after the plan is made
LIMITS = Limits(
    strokes=(0.0, 2.0), obstacles=Box((0.2, 2.0, -2.5), (0.5, 2.6, -1.2)), link_radius=0.02, clearance=0.02
)
TRACKER = LaserTracker((4.0, 3.0, 0.0))


def rows() -> Iterator[Row]:
    """The example of `plan_calibration` with 40 poses and 20 robots, and others calibrated with its poses."""
    robot = GantryTau(prototypes.L1)
    begin = time.perf_counter()
    plan = plan_calibration(robot, LIMITS, TRACKER, wanted=WANTED, tape=TAPE)
    yield shown("L1, plan of 40 poses, 20 robots", f"{time.perf_counter() - begin:.1f} s")
    yield at_most("the same, worst simulated error", 1e6 * float(plan.trials.worst), 1e6 * WANTED, "um")
    errors = np.array([_error(robot, plan, seed) for seed in range(FRESH)])
    yield at_least(
        f"share of {FRESH} robots not drawn for the plan within wanted", float((errors <= WANTED).mean()), 1.0
    )
    share = (errors <= plan.trials.worst).mean()
    yield shown("the same within the worst simulated error", f"{share:.2f}")


def _error(robot: GantryTau, plan: CalibrationPlan, seed: int) -> float:
    """Mean error, m, of the tool of another robot after its calibration, laid over the truth best."""
    random, truth = np.random.default_rng(10_000 + seed), Kinematics(robot)
    arms = read_arms(robot)
    moved = [arm.moved(TAPE * scales(arm) * random.standard_normal(arm.count)) for arm in arms]
    truth = truth.replaced({name: arm.values[name] for arm in moved for name in arm.free})
    q = plan.q[plan.measured]
    read = TRACKER.measure(truth.fk(q)[0], seed=seed).r
    found = calibrate(robot, Measurements(q, read), holdout=None)
    at = plan.workspace.q[:: max(len(plan.workspace.q) // 500, 1)]
    place, true = found.kinematics.fk(at)[0], truth.fk(at)[0]
    both = np.isfinite(place).all(axis=1) & np.isfinite(true).all(axis=1)
    place, true = (each[both] - each[both].mean(axis=0) for each in (place, true))
    turn = Rotation.align_vectors(true, place)[0]
    return float(np.linalg.norm(turn.apply(place) - true, axis=1).mean())


if __name__ == "__main__":
    for row in rows():
        print(row)
