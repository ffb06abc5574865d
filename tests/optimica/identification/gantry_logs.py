"""Synthetic logs of the three-link robot: a motion in its workspace, and forces of a plant that is not the model."""

from dataclasses import dataclass, replace
from functools import cache

import casadi as ca
import numpy as np
from scipy.interpolate import make_interp_spline

from gantrytau import translate
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import MotionLog

RATE = 250.0  # Hz
DURATION = 41.0  # s
CENTRE = np.array([0.85, 2.6, -0.55])
COULOMB, VISCOUS = np.array([128.62, 145.13, 194.57]), np.array([102.43, 355.25, 388.77])
NOISE = 20.0  # N
MOTION = 1  # seed of the phases; of 0 to 4, limits cost 0 to 0.18 %
IDEAL = replace(prototypes.L1, link_masses=(0.8, 0.8, 1.2))


@dataclass(frozen=True)
class Extras:
    """What the model does not know: shares of asymmetry and saddle friction, Stribeck and cogging in N."""

    asymmetry: float = 0.0
    stribeck: float = 0.0
    saddle: float = 0.0
    cogging: float = 0.0


PLAIN = Extras()
REAL = Extras(asymmetry=0.12, stribeck=40.0, saddle=0.05, cogging=10.0)


@cache
def motion() -> tuple[np.ndarray, ...]:
    """t, q, q', q'' and forces of an ideal robot without friction, of a slow and a fast part in a small box."""
    t = np.arange(int(RATE * DURATION)) / RATE
    rng = np.random.default_rng(MOTION)
    reach = np.array([0.25, 0.15, 0.15])
    r = np.tile(CENTRE, (len(t), 1))
    for axis in range(3):
        for hz, share in ((0.07, 0.5), (0.13, 0.4), (0.6, 0.3), (1.1, 0.2), (1.7, 0.12)):
            amplitude = reach[axis] * share * rng.uniform(0.6, 1.0)
            fade = 1.0 if hz < 0.2 else 1 / (1 + np.exp(-(t - DURATION / 2)))  # slow, then fast
            r[:, axis] += (
                fade * amplitude * np.sin(2 * np.pi * hz * t * rng.uniform(0.9, 1.1) + rng.uniform(0, 6))
            )
    q = Kinematics(GantryTau(prototypes.L1)).ik(r)
    spline = make_interp_spline(t, q, k=5)
    v, a = spline.derivative(1)(t), spline.derivative(2)(t)
    dae = translate(GantryTau(IDEAL, friction=None))
    names = [f"carts[{i}].s" for i in range(3)]
    given = [*names, *(f"der({n})" for n in names), *(f"der(der({n}))" for n in names)]
    f = dae.function(given=given, find=[f"carts[{i}].f" for i in range(3)])
    rigid = np.asarray(ca.vertcat(*f.map(len(t))(*np.hstack([q, v, a]).T[:, None]))).T
    return t, q, v, a, rigid


def forces(extras: Extras) -> np.ndarray:
    """Forces of the drives without noise, (N, 3)."""
    _, q, v, _, rigid = motion()
    sign = np.sign(v)
    coulomb = COULOMB * (1 + extras.asymmetry * sign) + extras.saddle * np.abs(rigid)
    coulomb = coulomb + extras.stribeck * np.exp(-((v / 0.1) ** 2))
    return rigid + coulomb * sign + VISCOUS * v + extras.cogging * np.sin(2 * np.pi * q / 0.06)


def log(seed: int, extras: Extras = PLAIN, noise: float = NOISE) -> MotionLog:
    """A log of encoders of 1 micrometre and forces with white noise."""
    t, q, *_ = motion()
    rng = np.random.default_rng(seed)
    return MotionLog(
        t, q + 1e-6 * rng.standard_normal(q.shape), forces(extras) + noise * rng.standard_normal(q.shape)
    )
