"""Estimates of what is learnt from, by what was measured in a run.

    zhat = F_r r + F_u u + F_y y                                             Dressler (2012), (7.4), (7.7)

An estimator is linear: what it makes of deviations from rest it makes of the lifted response of a robot as well, so that one
definition serves runs and the proof that learning converges.
"""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.describing.record import Record
from gantrytau_optimica.learning.filters.zero_phase import ZeroPhase
from gantrytau_optimica.learning.pose_maps import PoseMap

SENSORS = {"q": "measured.q", "z": "measured.q", "a": "measured.a", "r": "measured.r"}
MOVED = 1e-3  # of the motion, from which a reference has left its first position; corrections begin before it does
FEW = 25  # samples of rest, below which sensors cannot be set to zero
EVEN = 0.01  # of the period, by which times may be off
SLOW = 2.0  # Hz, below which arms hardly bend
MOVING = 0.015  # m/s2, rms of slow accelerations by which an accelerometer can be judged
LIKE = 2.0  # times more or less than kinematics, by which slow accelerations may be read


class Estimator(Record):
    """What is learnt from. joints: positions of the actuators, else of the tool.

    reads: what is needed of a run, of "q", measured positions of the actuators, "z", forward kinematics of these, "a",
    acceleration of the tool, and "r", its position.
    """

    joints: ClassVar[bool] = False
    reads: ClassVar[tuple[str, ...]] = ("z",)

    def combine(self, signals: Mapping[str, np.ndarray], period: float) -> np.ndarray:
        """Deviations of the estimate (N, n, ...) for those of what is read, by letter, samples every period s."""
        raise NotImplementedError

    def estimate(self, run: Result, kinematics: PoseMap) -> np.ndarray:
        """Positions (N, n) of the actuators, or (N, 3) of the tool, in m, by what was measured in a run from rest.

        Sensors are set to zero at rest, where arms do not bend. Raises ModelError for a run without the sensors that are
        read, for one that does not rest long enough, and for an accelerometer that reads along another axis.
        """
        means, signals = self._deviations(run, kinematics)
        letter = "q" if self.joints else "z"
        still = at_rest(run)
        base = means[letter] if letter in means else self._signal(letter, run, kinematics)[still].mean(axis=0)
        return base + self.combine(signals, sampling_period(run))

    def signals(self, run: Result, kinematics: PoseMap) -> dict[str, np.ndarray]:
        """Deviations from rest (N, n) of what is read, by letter; raises as `estimate` does."""
        return self._deviations(run, kinematics)[1]

    def _deviations(
        self, run: Result, kinematics: PoseMap
    ) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Means at rest, and deviations from them, by letter."""
        signals = {letter: self._signal(letter, run, kinematics) for letter in self.reads}
        still = at_rest(run)
        if len(still) < FEW and set(self.reads) & {"a", "r"}:
            raise ModelError(
                f"{type(self).__name__}: found {len(still)} samples of rest before the motion, expected {FEW} at least, by "
                "which sensors are set to zero; begin the reference with rest, or the "
                "window of learning later",
                argument="reference",
            )
        means = {letter: np.mean(x[still], axis=0) for letter, x in signals.items()}
        found = {letter: x - means[letter] for letter, x in signals.items()}
        if {"z", "a"} <= set(found):
            _check_accelerometer(type(self).__name__, found["z"], found["a"], sampling_period(run))
        return means, found

    def _signal(self, letter: str, run: Result, kinematics: PoseMap) -> np.ndarray:
        name = SENSORS[letter]
        there = sorted({n.split("[")[0] for n in run.names if n.startswith("measured.")})
        if name not in there:
            raise ModelError(
                f"{type(self).__name__}: found a run with {', '.join(there) or 'nothing measured'}, expected {name}; take a "
                "robot with this sensor, or another estimator",
                argument="estimator",
            )
        found = np.asarray(run[name])
        found = kinematics.fk(found)[0] if letter == "z" else found
        bad = np.flatnonzero(~np.isfinite(found).all(axis=1))
        if bad.size:
            words = (
                f"that puts the tool out of reach at {run.time[bad[0]]:g} s"
                if letter == "z"
                else "that is not finite"
            )
            raise ModelError(
                f"{type(self).__name__}: found {name} {words} in {len(bad)} of {len(found)} rows, first {bad[0]}, expected "
                "numbers throughout; run it again, or repair these rows",
                argument="run",
            )
        return found


def at_rest(run: Result) -> np.ndarray:
    """Rows before references leave their first values, (K,)."""
    q_ref = np.asarray(run["q_ref"])
    away = np.abs(q_ref - q_ref[0]).max(axis=1)
    moved = np.flatnonzero(away > MOVED * away.max())
    return np.arange(moved[0] if moved.size else len(q_ref))


def sampling_period(run: Result) -> float:
    """Distance of the samples of a run in s. Raises ModelError for uneven ones, as a record has that lost some."""
    steps = np.diff(run.time)
    odd = np.flatnonzero(~(np.abs(steps - np.median(steps)) <= EVEN * np.median(steps)))
    if odd.size:
        raise ModelError(
            f"Estimator: found {steps[odd[0]]:.4g} s after row {odd[0]} of a run and {np.median(steps):.4g} s elsewhere, "
            "expected one period throughout; run it again, or put what is missing in between",
            argument="run",
        )
    return float((run.time[-1] - run.time[0]) / len(steps))


def _check_accelerometer(place: str, z: np.ndarray, a: np.ndarray, period: float) -> None:
    """ModelError for accelerations a (N, 3) in m/s2 that are not, slowly, those of kinematics z (N, 3) in m."""
    slow = ZeroPhase.butterworth(2, SLOW)
    expected, read = (slow.apply(x, period) for x in (np.diff(z, 2, axis=0) / period**2, a[1:-1]))
    for i, axis in enumerate("xyz"):
        square = np.mean(expected[:, i] ** 2)
        gain = np.mean(expected[:, i] * read[:, i]) / square if square > MOVING**2 else 1.0
        if not 1 / LIKE < gain < LIKE:
            raise ModelError(
                f"{place}: found measured.a that reads {gain:.2g} times what kinematics accelerates in {axis} below "
                f"{SLOW:g} Hz, expected about once; give accelerations resolved in the world, in m/s2, with the sign of "
                "the motion",
                argument="run",
            )
