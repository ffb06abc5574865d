"""Measured motion of a robot: actuator positions and forces over time."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from gantrytau import Columns, Model, ModelError, Result, translate
from gantrytau.border.checks import array, number, whole
from gantrytau.dae import Dae
from gantrytau.describing.record import Record
from gantrytau.kinematics.kinematics import driven_joints
from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.calibration.devices.sampled_devices import instants
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.logs.log_checks import GAP, check_log
from gantrytau_optimica.identification.logs.log_files import read_log, write_log
from gantrytau_optimica.identification.logs.lost_rows import lost_rows
from gantrytau_optimica.identification.spectra.sampled_motion import rows_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False, repr=False)
class MotionLog(Record):
    """Measured motion of a robot of n actuators, in N rows over time.

    t: time (N,) in s; q: actuator positions (N, n) in m, or rad of turning actuators; f: actuator forces (N, n) in N, or
    torques in N.m, as the model has them: along q, before friction. v: speeds of actuators (N, n) in m/s or None; r: tool
    positions (N, 3) in m or None. Arrays are copied and cannot be written to; one actuator may be told as (N,).
    Raises ModelError for shapes that do not fit and for what is no number.
    """

    t: Any
    q: Any
    f: Any
    v: Any = None
    r: Any = None

    def __post_init__(self):
        for name in ("t", "q", "f", "v", "r"):
            values = getattr(self, name)
            if values is not None:
                object.__setattr__(self, name, rows_of("MotionLog", name, values))
        rows, actuators = len(self.t), self.q.shape[1]
        for name, columns in (("q", actuators), ("f", actuators), ("v", actuators), ("r", 3)):
            if getattr(self, name) is not None:
                array("MotionLog", name, getattr(self, name), (rows, columns), finite=False)

    @classmethod
    def read(cls, path: str | Path) -> Self:
        """A log from a CSV file whose columns are known by the names in its header, in any order.

        Time: t, time; positions, forces and perhaps speeds: q1..qn, f1..fn, v1..vn, or carts[0].s, carts[0].f, carts[0].v
        and so on, or carts[0].phi and .tau of what turns; tool positions: x, y, z or tool.r[0].. . Units stand behind names,
        "q1 [mm]" or "f1 (kN)"; without one, values are SI. Cells are separated by commas, blanks, semicolons or tabs: with
        the last two, decimals may have a comma. Empty cells are NaN. Columns with other names are not read.
        Raises ModelError for columns that are missing or doubtful, and cells that are no numbers, with the line.
        """
        return cls(**read_log(Path(path)))

    @staticmethod
    def lines(path: str | Path, rows: Any) -> np.ndarray:
        """Lines of a file that `read` reads, from 1, in which rows of its log stand, which count from 0."""
        return Columns.read(path).lines[np.asarray(rows, dtype=int)]

    @classmethod
    def of(
        cls,
        result: Result,
        robot: Model | Dae,
        *,
        period: float = 0.004,
        encoder: float = 0.0,
        force: float = 0.0,
        seed: int = 0,
    ) -> Self:
        """The log that a simulated motion would give: samples every `period` s, with white noise.

        result: of `simulate(robot, ...)`; encoder, force: standard deviations in m (rad) and N (N.m); seed: of the noise,
        the same for the same seed. Forces that jump, as those of sampled controllers do, are means over the period around
        each sample; of a run of `Rig` they are `measured.f`. Columns follow the inputs of the robot, lengths first; r is
        that of `tool.r` if there is one, without noise. Raises ModelError for a robot without driven coordinates, for a
        period that is not above 0, and for a result with outputs farther apart than that.
        """
        period = number("MotionLog.of", "period", period, above=0.0)
        for name, value in dict(encoder=encoder, force=force).items():
            number("MotionLog.of", name, value, least=0.0)
        whole("MotionLog.of", "seed", seed, least=0)
        joints = driven_joints(robot if isinstance(robot, Dae) else translate(robot, units=False))
        drives = [f"{name[:-2]}.f" if name.endswith(".s") else f"{name[:-4]}.tau" for name in joints]
        t = instants(result, 1 / period)
        q = np.column_stack([result.at(t, name) for name in joints])
        if "measured.f" in result.arrays:
            f = result.at(t, "measured.f")
        elif np.any(np.diff(result.time) == 0):
            f = np.column_stack([_means(result, name, t, period) for name in drives])
        else:
            f = np.column_stack([result.at(t, name) for name in drives])
        noise = np.random.default_rng(seed).normal(size=(2, *q.shape))
        r = result.at(t, "tool.r") if "tool.r" in result.arrays else None
        return cls(t, q + encoder * noise[0], f + force * noise[1], r=r)

    def save(self, path: str | Path) -> Path:
        """Write the log as a CSV file, in SI, which `read` reads to the last digit."""
        write_log(Path(path), dict(t=self.t, q=self.q, f=self.f, v=self.v, r=self.r))
        return Path(path)

    def plot(
        self, *, beside: "Mapping[str, MotionLog] | None" = None, file: str | os.PathLike[str] | None = None
    ) -> "Figure":
        """Forces of the actuators over time, with other logs by name, as of models: Dressler (2012), Figure 6.5."""
        import matplotlib.pyplot as plt

        if file is not None:
            check_suffix(file)
        n = self.f.shape[1]
        figure, axes = plt.subplots(
            n, squeeze=False, sharex=True, figsize=(8.0, 1.0 + 1.8 * n), layout="constrained"
        )
        for i, axis in enumerate(axes[:, 0]):
            axis.plot(self.t, self.f[:, i], color="0.7", linewidth=0.8, label="measured")
            for name, log in (beside or {}).items():
                axis.plot(log.t, log.f[:, i], linewidth=1.0, label=name)
            axis.set_ylabel(f"actuator {i + 1} [N]")
            axis.grid(alpha=0.3)
        axes[0, 0].legend(fontsize="small")
        axes[-1, 0].set_xlabel("time [s]")
        return finished(figure, file)

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        span = f", {self.t[0]:g} to {self.t[-1]:g} s" if len(self) else ""
        more = "".join(f", with {name}" for name in ("v", "r") if getattr(self, name) is not None)
        return f"<MotionLog: {len(self)} rows of {self.q.shape[1]} actuators{span}{more}>"

    def __getitem__(self, rows: Any) -> Self:
        """The log of some rows: a slice, indices or a mask."""
        if isinstance(rows, (int, np.integer)):
            rows = slice(rows, rows + 1 or None)
        arrays = (self.t, self.q, self.f, self.v, self.r)
        return type(self)(*(None if one is None else one[rows] for one in arrays))

    def between(self, start: float, stop: float) -> Self:
        """The rows from start to stop, both in s and included."""
        return self[(self.t >= start) & (self.t <= stop)]

    @property
    def period(self) -> float:
        """Median distance of samples in s; NaN of fewer than two rows."""
        return float(np.median(np.diff(self.t))) if len(self) > 1 else np.nan

    @property
    def finite(self) -> np.ndarray:
        """Which rows hold numbers only, (N,)."""
        arrays = [one for one in (self.t[:, None], self.q, self.f, self.v, self.r) if one is not None]
        return np.logical_and.reduce([np.isfinite(one).all(axis=1) for one in arrays])

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings in this log, whatever the robot: kinds "nan", "time", "gaps", "lost rows", "millimetres",
        "saturated force", "slow", "constant velocity", "delay", "sign of force".
        """
        return check_log(self.t, self.q, self.f, self.finite)

    def without_lost_rows(self) -> tuple[Self, np.ndarray]:
        """The log with rows that were lost between others put in by cubic splines, without v and r; and for each of its rows
        the number of the row here that is the next.
        """
        rows = np.arange(len(self))
        lost = lost_rows(self.t, self.q) if np.all(self.finite) else np.zeros(len(self), dtype=int)
        if not lost.any():
            return self, rows
        from scipy.interpolate import make_interp_spline

        places = rows + np.cumsum(lost)
        whole = np.arange(places[-1] + 1)
        q, f = (make_interp_spline(places, x, k=3)(whole) for x in (self.q, self.f))
        return type(self)(self.t[0] + self.period * whole, q, f), np.searchsorted(places, whole)

    def parts(self) -> tuple[Self, ...]:
        """The stretches between gaps, times that do not rise, and rows without numbers: to be differentiated one by one."""
        good = self.finite
        kept = np.flatnonzero(good)
        step = np.diff(self.t)
        broken = (step <= 0) | (step > GAP * np.median(step[step > 0])) if np.any(step > 0) else step <= 0
        crossed = np.add.reduceat(np.append(broken, False), kept)[:-1] > 0 if kept.size > 1 else False
        ends = np.flatnonzero((np.diff(kept) > 1) | crossed) + 1
        return tuple(self[rows] for rows in np.split(kept, ends) if rows.size)


def _means(result: Result, name: str, t: np.ndarray, period: float) -> np.ndarray:
    """Means of a variable around each time (N,), as its impulses on both sides, a period long, move sampled positions."""
    time, values = result.time, result[name]
    slopes = np.diff(values) / np.where(np.diff(time) > 0, np.diff(time), np.inf)
    impulse = np.append(0.0, np.cumsum(np.diff(time) * (values[1:] + values[:-1]) / 2))
    steps = np.diff(time)
    moved = np.append(0.0, np.cumsum(steps * impulse[:-1] + steps**2 * (2 * values[:-1] + values[1:]) / 6))

    def at(when: np.ndarray) -> np.ndarray:
        k = np.clip(np.searchsorted(time, when, side="right") - 1, 0, len(time) - 2)
        x = when - time[k]
        return moved[k] + x * impulse[k] + x**2 * values[k] / 2 + x**3 * slopes[k] / 6

    inner = np.clip(t, time[0] + period, time[-1] - period)  # at both ends those of the neighbours
    return (at(inner + period) - 2 * at(inner) + at(inner - period)) / period**2


def join(logs: Sequence[MotionLog]) -> MotionLog:
    """One log of several of the same robot, each of which begins a second after the one before: `parts` parts them again.

    v and r are kept where all have them. Raises ModelError for no log, and for logs of different numbers of actuators.
    """
    widths = [log.q.shape[1] for log in logs]
    if len(set(widths)) != 1:
        raise ModelError(
            f"join: found logs of {widths} actuators, expected one log or more of the same robot"
        )
    times, end = [], 0.0
    for log in logs:
        times.append(log.t - log.t[0] + end if len(log) else log.t)
        end = times[-1][-1] + 1.0 if len(log) else end
    kept = [name for name in ("v", "r") if all(getattr(log, name) is not None for log in logs)]
    arrays = {name: np.concatenate([getattr(log, name) for log in logs]) for name in ("q", "f", *kept)}
    return MotionLog(np.concatenate(times), **arrays)
