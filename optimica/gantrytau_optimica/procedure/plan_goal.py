"""What `plan_calibration` is asked for."""

from dataclasses import dataclass
from typing import Any

from gantrytau.border.checks import number, whole
from gantrytau_optimica.calibration.data.data_checks import FEWEST

NAME = "plan_calibration"
LARGEST = 0.1  # m, of errors and margins; what is larger was written in mm


@dataclass(frozen=True, eq=False)
class PlanGoal:
    """The numbers of a plan, as `plan_calibration` explains them, which refuses wrong ones; home: (n,) in m and rad."""

    poses: int
    wanted: float
    tape: float
    robots: int
    seed: int
    margin: float
    spacing: float | None
    home: Any

    def __post_init__(self):
        for name in ("wanted", "tape"):
            value = number(NAME, name, getattr(self, name), above=0.0, most=LARGEST, unit="m")
            object.__setattr__(self, name, value)
        # without one no way is shown to be clear
        number(NAME, "margin", self.margin, above=0.0, below=LARGEST)
        if self.spacing is not None:
            number(NAME, "spacing", self.spacing, above=0.0)
        for name, least in (("robots", 1), ("seed", 0), ("poses", FEWEST)):
            whole(NAME, name, getattr(self, name), least=least)
