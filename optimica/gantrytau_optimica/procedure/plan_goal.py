"""What `plan_calibration` is asked for."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class PlanGoal:
    """The numbers of a plan, as `plan_calibration` explains them; home: (n,) in m and rad."""

    poses: int
    wanted: float
    tape: float
    robots: int
    seed: int
    margin: float
    spacing: float | None
    home: np.ndarray
