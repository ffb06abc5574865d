"""Motions whose accelerations are known in closed form, as runs of a robot."""

import numpy as np

from gantrytau import Result
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, prototypes

PERIOD = 0.004
PLACE = np.array([0.9, 2.7, -0.7])
LATE = 15  # samples, by which carts follow their references
UNITS = {"q": "m", "a": "m/s2", "r": "m"}


def l1_kinematics() -> Kinematics:
    return Kinematics(GantryTau(prototypes.L1))


def swung_ramp(t: np.ndarray, *, stop: float = np.inf) -> tuple[np.ndarray, np.ndarray]:
    """A ramp with a sine upon it, at rest until 1 s and from `stop` on: positions (N,) in m, accelerations in m/s2.

    1 cm each second, at 2 Hz, so that it rests at each half of a second.
    """
    w = 4 * np.pi
    tau = np.clip(t, 1.0, stop) - 1.0
    return 0.01 * (tau - np.sin(w * tau) / w), 0.01 * w * np.sin(w * tau)


def run_of(
    kinematics: Kinematics, z: np.ndarray, *, period: float = PERIOD, **measured: np.ndarray
) -> Result:
    """A run whose carts hold a stiff tool at PLACE + z (N, 3), with further readings a and r (N, 3)."""
    q = kinematics.ik(PLACE + z)
    given = q[np.minimum(np.arange(len(q)) + LATE, len(q) - 1)]
    named = {"q_ref": given, "measured.q": q} | {f"measured.{letter}": x for letter, x in measured.items()}
    values = {f"{name}[{k}]": x[:, k] for name, x in named.items() for k in range(3)}
    units = {f"measured.{letter}": UNITS[letter] for letter in ("q", *measured)}
    return Result(period * np.arange(len(z)), values, units=units, title="an analytic run")
