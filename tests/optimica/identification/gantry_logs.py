"""Synthetic logs of the three-link robot: a motion in its workspace, and forces of a plant that is not the model."""

from dataclasses import dataclass, replace
from functools import cache

import casadi as ca
import numpy as np
from scipy.interpolate import make_interp_spline

from gantrytau import translate
from gantrytau.dae import Dae
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import MotionLog

RATE = 250.0  # Hz
DURATION = 41.0  # s
CENTRE = np.array([0.85, 2.6, -0.55])
COULOMB, VISCOUS = np.array([128.62, 145.13, 194.57]), np.array([102.43, 355.25, 388.77])
NOISE = 20.0  # N
MOTION = 1  # seed of amplitudes, frequencies and phases where one motion is enough
IDEAL = replace(prototypes.L1, link_masses=(0.8, 0.8, 1.2))


@dataclass(frozen=True)
class Extras:
    """What the model does not know: shares of asymmetry and saddle friction, Stribeck (m/s its speed) and cogging in N."""

    asymmetry: float = 0.0
    stribeck: float = 0.0
    saddle: float = 0.0
    cogging: float = 0.0
    fall: float = 0.1


PLAIN = Extras()
REAL = Extras(asymmetry=0.12, stribeck=40.0, saddle=0.05, cogging=10.0)


@cache
def robot() -> Dae:
    """The robot as its record has it, translated once."""
    return translate(GantryTau(prototypes.L1))


@cache
def _ideal() -> tuple[Kinematics, ca.Function]:
    dae = translate(GantryTau(IDEAL, friction=None))
    names = [f"carts[{i}].s" for i in range(3)]
    given = [*names, *(f"der({n})" for n in names), *(f"der(der({n}))" for n in names)]
    return Kinematics(robot()), dae.function(given=given, find=[f"carts[{i}].f" for i in range(3)])


@cache
def motion(seed: int = MOTION) -> tuple[np.ndarray, ...]:
    """t, q, q', q'' and forces of an ideal robot without friction, of a slow and a fast part in a small box."""
    kinematics, inverse = _ideal()
    t = np.arange(int(RATE * DURATION)) / RATE
    rng = np.random.default_rng(seed)
    reach = np.array([0.25, 0.15, 0.15])
    r = np.tile(CENTRE, (len(t), 1))
    for axis in range(3):
        for hz, share in ((0.07, 0.5), (0.13, 0.4), (0.6, 0.3), (1.1, 0.2), (1.7, 0.12)):
            amplitude = reach[axis] * share * rng.uniform(0.6, 1.0)
            fade = 1.0 if hz < 0.2 else 1 / (1 + np.exp(-(t - DURATION / 2)))  # slow, then fast
            r[:, axis] += (
                fade * amplitude * np.sin(2 * np.pi * hz * t * rng.uniform(0.9, 1.1) + rng.uniform(0, 6))
            )
    q = kinematics.ik(r)
    spline = make_interp_spline(t, q, k=5)
    v, a = spline.derivative(1)(t), spline.derivative(2)(t)
    rigid = np.asarray(ca.vertcat(*inverse.map(len(t))(*np.hstack([q, v, a]).T[:, None]))).T
    return t, q, v, a, rigid


def forces(extras: Extras, motion_seed: int = MOTION) -> np.ndarray:
    """Forces of the drives without noise, (N, 3)."""
    _, q, v, _, rigid = motion(motion_seed)
    sign = np.sign(v)
    coulomb = COULOMB * (1 + extras.asymmetry * sign) + extras.saddle * np.abs(rigid)
    coulomb = coulomb + extras.stribeck * np.exp(-((v / extras.fall) ** 2))
    return rigid + coulomb * sign + VISCOUS * v + extras.cogging * np.sin(2 * np.pi * q / 0.06)


def log(seed: int, extras: Extras = PLAIN, noise: float = NOISE, motion_seed: int = MOTION) -> MotionLog:
    """A log of encoders of 1 micrometre and forces with white noise."""
    t, q, *_ = motion(motion_seed)
    rng = np.random.default_rng(seed)
    return MotionLog(
        t,
        q + 1e-6 * rng.standard_normal(q.shape),
        forces(extras, motion_seed) + noise * rng.standard_normal(q.shape),
    )
