"""A motion that tells parameters well: what it foretells, and how it is handed to a simulation or a robot."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gantrytau import ModelError, Samples
from gantrytau.describing.record import Record
from gantrytau_optimica.fitting.linear import column_norms
from gantrytau_optimica.identification.excitation.fourier_series import FourierSeries
from gantrytau_optimica.identification.excitation.motion_regressor import MotionRegressor
from gantrytau_optimica.identification.logs.motion_log import MotionLog
from gantrytau_optimica.procedure.documents.rapid import RapidOptions

STEP = 0.1  # s between two targets of a program


@dataclass(frozen=True, eq=False, repr=False)
class Excitation(Record):
    """A motion of a robot of n actuators, in N rows over time.

    log: time, positions, speeds and forces of the actuators as the model foretells them, and the tool; series: of the
    tool; names: of the k parameters; condition: of the slopes of the forces, parameters in SI; predicted: standard
    deviation of each parameter if forces have independent noise of 1 N (N.m) in each row; used: share of each limit.
    """

    robot: str
    log: MotionLog
    series: FourierSeries
    names: tuple[str, ...]
    condition: float
    predicted: Mapping[str, float]
    used: Mapping[str, float]
    actuators: tuple[str, ...]
    start: Mapping[str, float]
    by_actuators: MotionRegressor

    @property
    def time(self) -> np.ndarray:
        """Times (N,) in s."""
        return self.log.t

    @property
    def q(self) -> np.ndarray:
        """Positions of the actuators (N, n) in m."""
        return self.log.q

    @property
    def signal(self) -> dict[str, Samples]:
        """Forces by input: `simulate(robot, stop=, inputs=excitation.signal, starts=excitation.start)`."""
        return {name: Samples(self.time, f) for name, f in zip(self.actuators, self.log.f.T, strict=True)}

    def gain(self, log: MotionLog) -> dict[str, float]:
        """How much larger the deviation of each parameter is by another motion of as many rows, which need not be rest.

        Speeds of the log are taken, or slopes of its positions; their accelerations are slopes of splines. Infinite for
        what the motion does not tell. Raises ModelError for a log of other actuators.
        """
        if log.q.shape[1] != len(self.actuators):
            raise ModelError(
                f"Excitation.gain: found {log!r}, expected a log of the {len(self.actuators)} actuators of {self.robot}",
                argument="log",
            )
        from scipy.interpolate import make_interp_spline

        spline = make_interp_spline(log.t, log.q, k=5)
        motion = np.hstack([log.q, spline(log.t, 1) if log.v is None else log.v, spline(log.t, 2)])
        Y = self.by_actuators.rows(motion)[4].reshape(-1, len(self.names))
        other = deviations(Y) * np.sqrt(len(log) / len(self.log))
        return {name: float(d / self.predicted[name]) for name, d in zip(self.names, other, strict=True)}

    def save(self, path: str | Path) -> Path:
        """Time, positions, forces, speeds and tool as CSV, which `MotionLog.read` reads. Returns the path."""
        return self.log.save(path)

    def program(self, name: str = "Excitation", *, step: float = STEP) -> str:
        """A robot program in RAPID (ABB): joint targets in mm, each reached `step` s after the one before.

        Carts are the axes of the robot. It goes slowly to the first target, and then through all without stopping.
        Raises ModelError for names that RAPID does not take and steps that are no multiple of a row.
        """
        RapidOptions(name)
        period = self.log.period
        every = round(step / period) if np.isfinite(step) else 0
        if every < 1 or abs(every * period - step) > 1e-6 * period:
            raise ModelError(
                f"Excitation.program: found step={step!r}, expected a multiple of {period:g} s",
                argument="step",
            )
        lines = [
            f"MODULE {name}",
            f"  ! {self.robot}, {len(self.log) * period:.6g} s, targets every {step:g} s",
        ]
        lines += [f"  PROC Run{name}()"[:40]]
        for row in range(0, len(self.log), every):
            axes = [f"{1e3 * s:.4f}" for s in self.q[row]] + ["0"] * (6 - len(self.actuators))
            speed = "v100, fine" if row == 0 else f"v1000 \\T:={step:g}, z1"
            lines += [
                f"    MoveAbsJ [[{','.join(axes)}],",
                f"      [9E9,9E9,9E9,9E9,9E9,9E9]], {speed}, tool0;",
            ]
        return "\n".join([*lines, "  ENDPROC", "ENDMODULE", ""])

    def __repr__(self) -> str:
        used = ", ".join(f"{name} {share:.0%}" for name, share in self.used.items())
        lines = [
            f"<Excitation of {self.robot}: {self.time[-1]:g} s, {len(self.names)} parameters",
            f"  condition {self.condition:.0f}, limits used: {used}",
        ]
        lines += [f"  {name}: {1e3 * d:.3g}e-3 by noise of 1 N" for name, d in self.predicted.items()]
        return "\n".join(lines) + ">"


def deviations(Y: np.ndarray) -> np.ndarray:
    """Deviations (k,) of parameters by independent noise of 1 in all rows of Y (N, k); infinite where there is no slope."""
    scale = column_norms(Y)
    _, sizes, V = np.linalg.svd(Y / scale, full_matrices=False)
    if sizes[-1] <= 1e-12 * sizes[0]:
        return np.full(Y.shape[1], np.inf)
    return np.sqrt(np.sum((V / sizes[:, None]) ** 2, axis=0)) / scale
