"""Runs at constant speed as one row each: means of position, speed and force."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gantrytau import ModelError
from gantrytau.describing.record import Record
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.friction.carried_mass import CarriedMass
from gantrytau_optimica.identification.logs.motion_log import MotionLog

STEADY = 0.02  # of its speed, by which parts of a run may differ from it
PARTS = 5  # of a run, whose speeds are compared
AT_REST = 1e-4  # of the fastest run of an actuator
ROWS = 100  # of a run, at which the weight is looked up


@dataclass(frozen=True, eq=False)
class ConstantRuns(Record):
    """Means of R runs, (R, n) each.

    runs: their numbers, (R,); q, v, f: positions, speeds and forces; slope, known: forces of 1 kg at the tool and of all
    but the tool. An actuator that rests, whose friction is any, has v of exactly zero.
    """

    runs: np.ndarray
    q: np.ndarray
    v: np.ndarray
    f: np.ndarray
    slope: np.ndarray
    known: np.ndarray


def constant_runs(runs: Sequence[MotionLog], load: CarriedMass) -> tuple[ConstantRuns, tuple[Finding, ...]]:
    """Means of the runs that are at constant speed, and a finding that names the others.

    Raises ModelError for what are no runs of this robot, and where none is at constant speed.
    """
    if isinstance(runs, MotionLog) or not isinstance(runs, Sequence) or not len(runs):
        raise ModelError(
            f"identify_friction: found runs={runs!r}, expected a list of MotionLogs, one for each run at constant speed",
            argument="runs",
        )
    found = [_means(k, run, load) for k, run in enumerate(runs)]
    v = np.array([speed for _, speed, _ in found])
    v[np.abs(v) <= AT_REST * np.max(np.abs(v), axis=0)] = 0.0
    strays = np.array([stray for _, _, stray in found])
    steady = np.all((strays <= STEADY * np.abs(v)) | (v == 0), axis=1)
    kept = np.flatnonzero(steady)
    if not kept.size:
        raise ModelError(
            f"identify_friction: found no run of {len(runs)} at constant speed, expected runs whose speed keeps within "
            f"{STEADY:.0%}; cut off where they start and stop",
            argument="runs",
        )
    q, f, slope, known = (np.array([found[k][0][j] for k in kept]) for j in range(4))
    words = (
        f"runs {', '.join(map(str, np.flatnonzero(~steady)))} are not at constant speed ({STEADY:.0%}) and left out: "
        "inertia would count as friction; cut off where they start and stop"
    )
    unsteady = (Finding("not constant", np.flatnonzero(~steady), words),) if kept.size < len(runs) else ()
    return ConstantRuns(kept, q, v[kept], f, slope, known), unsteady


def _means(
    number: int, run: MotionLog, load: CarriedMass
) -> tuple[tuple[np.ndarray, ...], np.ndarray, np.ndarray]:
    """Means of q, f and of the forces of the model; speeds; how far parts of the run stray from them."""
    n = len(load.coordinates)
    if not isinstance(run, MotionLog) or run.q.shape[1] != n:
        raise ModelError(
            f"identify_friction: found run {number} {run!r}, expected a MotionLog of the {n} actuators "
            f"{', '.join(load.actuators)}",
            argument="runs",
        )
    rows = np.flatnonzero(run.finite)
    if not rows.size or (rows.size == 1 and run.v is None) or np.any(np.diff(run.t[rows]) <= 0):
        raise ModelError(
            f"identify_friction: found run {number} with {rows.size} rows of numbers at times that do not all rise, "
            "expected two at least, or one with a speed v",
            argument="runs",
        )
    parts = [part for part in np.array_split(rows, PARTS) if part.size > 1]
    v = _speed(run, rows)
    strays = (
        np.max([np.abs(_speed(run, part) - v) for part in parts], axis=0) if len(parts) == PARTS else 0 * v
    )
    some = rows[np.unique(np.linspace(0, rows.size - 1, min(rows.size, ROWS)).astype(int))]
    slope, known = load.forces(run.q[some], np.tile(v, (some.size, 1)))
    return (
        (run.q[rows].mean(axis=0), run.f[rows].mean(axis=0), slope.mean(axis=0), known.mean(axis=0)),
        v,
        strays,
    )


def _speed(run: MotionLog, rows: np.ndarray) -> np.ndarray:
    """Speeds (n,): means of those that were logged, or slopes of positions."""
    if run.v is not None:
        return run.v[rows].mean(axis=0)
    t = run.t[rows] - run.t[rows].mean()
    return t @ run.q[rows] / (t @ t)
