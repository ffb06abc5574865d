"""Runs of the flexible robot that excite its modes, for whoever identifies them.

At `PLACE` with `WRIST` kg the modes of held carts are the 7.4, 10.5 and 11.5 Hz of Table 6.4, within 0.3 Hz.
"""

from dataclasses import replace

import numpy as np

from gantrytau import Result, prbs
from gantrytau.mechanics.translational import Friction
from gantrytau_models import FlexibleGantryTau, PreslidingFriction, cart_servos, prototypes
from gantrytau_models.mechanisms.flexible import unstretched
from gantrytau_optimica import Rig
from gantrytau_optimica.learning import Scatter

RECORD = prototypes.L1_flexible
PERIOD = 0.004
PLACE, WRIST = np.array([0.9, 3.2, -0.4]), 24.2


def flexible_rig(
    friction: type[Friction] | None = PreslidingFriction,
    noise: Scatter | None = None,
    *,
    stiffness: float = 1.0,
) -> Rig:
    """The robot near `PLACE`, its servos tuned there; stiffness: of arms and feet, relative."""
    record = replace(
        RECORD,
        arm_stiffness=tuple(stiffness * c for c in RECORD.arm_stiffness),
        frame_stiffness=stiffness * RECORD.frame_stiffness,
    )
    robot = FlexibleGantryTau(record, friction=friction, plate_mass=WRIST)
    return Rig(robot, cart_servos(RECORD, r=PLACE), period=PERIOD, noise=noise)


def excited(rig: Rig, *, rows: int = 6000, amplitude: float = 1e-3, seed: int = 1) -> Result:
    """Pseudo-random sequences of 10 bits, held for 5 samples, a third of a period apart from cart to cart; no speeds."""
    t = PERIOD * np.arange(rows)
    sequences = [prbs(10, 5 * PERIOD, amplitude, seed=0).values(t + 341 * k * 5 * PERIOD) for k in range(3)]
    return rig.run(unstretched(RECORD, PLACE) + np.column_stack([s.ravel() for s in sequences]), seed=seed)


def kinematic_motion(run: Result) -> np.ndarray:
    """Where stiff arms would have the tool, by the encoders, less its mean, (N, 3) in m."""
    h = 1e-5
    to_carts = [
        (unstretched(RECORD, PLACE + h * e) - unstretched(RECORD, PLACE - h * e)) / (2 * h) for e in np.eye(3)
    ]
    z = (run["measured.q"] - unstretched(RECORD, PLACE)) @ np.linalg.inv(np.column_stack(to_carts)).T
    return z - z.mean(axis=0)
