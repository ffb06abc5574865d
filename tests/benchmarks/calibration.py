"""Calibration of three links from 100,000 poses beside scipy on the same least squares, and its errors."""

from collections.abc import Iterator
from typing import Any, cast

import numpy as np
from scipy.optimize import least_squares

from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate
from tests.benchmarks.table import Row, at_least, at_most, in_turn, shown
from tests.calibration.synthetic import GRID, NOISE, disturbed, grid, inverse, nominal, three_links

POSES = 100_000
TOLERANCE = 1e-12  # of scipy, with which it reaches 1e-9 m


def rows() -> Iterator[Row]:
    """Time of a whole call of `calibrate`, from arrays to the error of held-out poses, and figures of 779 poses."""
    yield from _speed()
    yield from _errors()


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
    missed = np.linalg.norm(found.kinematics.fk(q, near=r)[0] - r, axis=1).mean()
    yield at_most("the same against the true robot", 1e6 * missed, 4.0, "um")
    other = calibrate(nominal(), data, method="ipopt")
    apart = max(np.abs(found.parameters[n] - other.parameters[n]).max() for n in found.parameters)
    yield at_most("Gauss-Newton and Ipopt apart", apart, 1e-9, "m")
    parallel = calibrate(GantryTau(prototypes.L1), data, model="parallel")
    yield at_most("non-parallel over parallel guideways, error", found.error / parallel.error, 0.4)


if __name__ == "__main__":
    for row in rows():
        print(row)
