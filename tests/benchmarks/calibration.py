"""Calibration of three links from 100,000 poses beside scipy on the same least squares, its errors, and the F1."""

from collections.abc import Iterator
from typing import Any, cast

import numpy as np
from scipy.optimize import least_squares

from gantrytau_models import F1GantryTau, GantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from tests.benchmarks.table import Row, at_least, at_most, in_turn, shown
from tests.optimica.calibration import f1_data
from tests.optimica.calibration.synthetic import GRID, NOISE, disturbed, grid, inverse, nominal, three_links

POSES = 100_000
SEEDS = 50
TOLERANCE = 1e-12  # of scipy, with which it reaches 1e-9 m


def rows() -> Iterator[Row]:
    """Time of a whole call of `calibrate`, from arrays to the error of held-out poses, and figures of 779 poses."""
    yield from _speed()
    yield from _errors()
    yield from _spread()
    yield from _turning()


def _poses() -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    low, high = np.array(GRID)[:, 0], np.array(GRID)[:, 1]
    r = rng.uniform(low, high, (2 * POSES, 3))
    q = inverse(prototypes.L1, r)
    good = np.flatnonzero(np.isfinite(q).all(axis=1))[:POSES]
    return q[good], r[good] + NOISE * rng.standard_normal((POSES, 3))


def _scipy(q: np.ndarray, r: np.ndarray, start: np.ndarray, exact: bool) -> np.ndarray:
    """Parameters (L, A, v) of three links, (3, 7), by scipy one after another, as tightly as numpy allows."""

    def fit(i: int) -> np.ndarray:
        def errors(p: np.ndarray) -> np.ndarray:
            y = p[1:4] + q[:, i, None] * p[4:] - r
            return np.einsum("ij,ij->i", y, y) - p[0] ** 2

        def slopes(p: np.ndarray) -> np.ndarray:
            y = 2 * (p[1:4] + q[:, i, None] * p[4:] - r)
            return np.column_stack([np.full(len(y), -2 * p[0]), y, q[:, i, None] * y])

        tolerances = dict.fromkeys(("xtol", "ftol", "gtol"), TOLERANCE)
        return least_squares(errors, start[i], jac=cast(Any, slopes if exact else "2-point"), **tolerances).x

    return np.array([fit(i) for i in range(3)])


def _speed() -> Iterator[Row]:
    q, r = _poses()
    record = disturbed(prototypes.L1, 0.01)
    robot = GantryTau(record)
    lengths, offsets, directions = three_links(record)
    start = np.column_stack([lengths, offsets, directions])
    found = calibrate(robot, Measurements(q, r), holdout=None)
    names = ("length", "offset", "direction")
    ours = np.array([np.hstack([found.parameters[f"arms[{i}].{n}"] for n in names]) for i in range(3)])
    apart = np.abs(_scipy(q, r, start, True) - ours).max()
    yield at_most("calibrate, 100,000 poses, parameters apart from those of scipy", apart, 1e-9, "m")
    times = in_turn(
        {
            "calibrate": lambda: calibrate(robot, Measurements(q, r), holdout=None).error,
            "exact": lambda: _scipy(q, r, start, True),
            "differences": lambda: _scipy(q, r, start, False),
        },
        7,
    )
    yield shown("calibrate, 100,000 poses, whole call", f"{1e3 * times['calibrate']:.0f} ms")
    ratios = {key: round(times[key] / times["calibrate"], 1) for key in ("differences", "exact")}
    yield at_least("scipy least_squares with differences / calibrate", ratios["differences"], 10.0)
    yield at_least("scipy least_squares with the exact Jacobian / calibrate", ratios["exact"], 3.0)


def _errors() -> Iterator[Row]:
    q, r = grid(prototypes.L1)
    data = Measurements(q, r + NOISE * np.random.default_rng(0).standard_normal(r.shape))
    found = calibrate(nominal(), data)
    yield at_most("L1, 779 poses, 10 um noise: mean of held out", 1e6 * found.error, 18.0, "um")
    yield at_least(
        "the same, as three coordinates of 10 um are 16 um long", round(1e6 * float(found.error), 2), 14.0
    )
    missed = np.linalg.norm(found.kinematics.fk(q, near=r)[0] - r, axis=1).mean()
    yield at_most("the same against the true robot", 1e6 * missed, 4.0, "um")
    other = calibrate(nominal(), data, method="ipopt")
    apart = max(np.abs(found.parameters[n] - other.parameters[n]).max() for n in found.parameters)
    yield at_most("Gauss-Newton and Ipopt apart", apart, 1e-9, "m")
    parallel = calibrate(GantryTau(prototypes.L1), data, model="parallel")
    yield at_most("non-parallel over parallel guideways, error", found.error / parallel.error, 0.4)


def _spread() -> Iterator[Row]:
    """Lengths beside their Cramer-Rao bound, and the covariance that is reported beside that bound and the spread."""
    q, r = grid(prototypes.L1)
    names = [f"arms[{i}].{n}" for i in range(3) for n in ("length", "offset", "direction")]
    true = np.concatenate([np.r_[a.length, a.offset, a.direction] for a in prototypes.L1.arms])
    bounds, robot = np.sqrt(np.concatenate([np.diag(_bound(i, q[::2], r[::2])) for i in range(3)])), nominal()
    found, said = [], []
    for seed in range(SEEDS):
        run = calibrate(
            robot, Measurements(q, r + NOISE * np.random.default_rng(seed).standard_normal(r.shape))
        )
        found.append(np.concatenate([np.atleast_1d(run.parameters[n]) for n in names]))
        said.append(np.sqrt(np.diag(run.covariance(names))))
    worst = float(np.abs((np.array(found) - true) / bounds).max())
    yield at_most(f"parameters of {SEEDS} seeds, deviations of the Cramer-Rao bound", worst, 4.0)
    lengths = 1e6 * bounds[::7]
    yield shown("Cramer-Rao bound of the lengths", ", ".join(f"{x:.1f}" for x in lengths) + " um")
    apart = float(np.abs(np.sqrt(np.mean(np.square(said), axis=0)) / bounds - 1).max())
    yield at_most("reported deviations apart from the bound", apart, 0.1)
    spread = np.sqrt(np.mean(np.square(np.array(found) - true), axis=0)) / bounds
    yield shown("spread over the seeds by the bound", f"{spread.min():.2f} to {spread.max():.2f}")


def _bound(i: int, q: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Cramer-Rao bound of (L, A, v) of link i, by hand: 4 s^2 L^2 (J'J)^-1."""
    L, A, v = (x[i] for x in three_links(prototypes.L1))
    d = A + q[:, i, None] * v - r
    J = np.column_stack([np.full(len(q), -2 * L), 2 * d, 2 * q[:, i, None] * d])
    return (2 * L * NOISE) ** 2 * np.linalg.inv(J.T @ J)


def _turning() -> Iterator[Row]:
    """The F1 by Gauss-Newton and by Ipopt, the whole call of `calibrate` on the same measurements."""
    poses = f1_data.f1_poses(f1_data.f1_arms(), 185)
    robot, data = F1GantryTau(prototypes.F1), Measurements(*f1_data.measured(poses, seed=1))
    times = in_turn(
        {
            "gauss-newton": lambda: calibrate(robot, data, holdout=None).error,
            "ipopt": lambda: calibrate(robot, data, holdout=None, method="ipopt").error,
        },
        3,
    )
    yield shown("F1, 185 poses, 69 parameters, whole call", f"{1e3 * times['gauss-newton']:.0f} ms")
    ratio = round(times["ipopt"] / times["gauss-newton"], 1)
    yield at_least("F1 by Ipopt / by Gauss-Newton", ratio, 20.0)


if __name__ == "__main__":
    for row in rows():
        print(row)
