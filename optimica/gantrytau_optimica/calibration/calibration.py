"""What `calibrate` found: identified rods, as a robot, as kinematics and as a report."""

from functools import cached_property
from typing import Any

import numpy as np

from gantrytau import GantryTauError, Model, ModelError
from gantrytau.kinematics import Kinematics
from gantrytau_optimica.calibration.diagnostics.fitted_rods import FittedRods
from gantrytau_optimica.calibration.links.nominal_rods import with_numbers
from gantrytau_optimica.calibration.report.report import Reported


class Calibration(Reported, FittedRods):
    """A calibrated robot. `found.parameters["arms[0].length"]` is in m, vectors are arrays (3,), or name elements."""

    @cached_property
    def kinematics(self) -> Any:
        """`Kinematics` of the calibrated robot, with `.ik .fk .jacobian`; of models 2 to 5, and of quaternions of any
        length, `chains`.
        """
        if self.orientation == "free" and self.nominal_rods.turntables:
            return self.chains
        try:
            return Kinematics(self.robot)
        except GantryTauError:  # no model has measured guideways or directions of single links
            return self.chains

    @cached_property
    def robot(self) -> Model:
        """The robot with the identified parameters, started in a measured pose. Raises ModelError for models 2 to 5 and for
        quaternions of any length, which no robot can hold.
        """
        nominal = self.nominal_rods
        if self.model in (2, 3, 4, 5):
            raise ModelError(
                f"robot: model {self.model} has measured guideways or a direction for each link, which {nominal.name} has "
                "not; use .kinematics, or calibrate with model=None"
            )
        if self.model == 1 and nominal.turns:
            raise ModelError(
                "robot: model 1 has one link on each arm, and the robot six; use .kinematics, or model=None"
            )
        if self.orientation == "free" and nominal.turntables:
            raise ModelError(
                "robot: found orientation='free', whose quaternions turn no rigid turntable, expected 'local' or 'unit'; "
                "calibrate with one of these, or use .kinematics"
            )
        values = dict(self.parameters)
        for table in nominal.rods.turntables:
            u = values[table.orientation]
            values[table.orientation] = u / np.linalg.norm(u)
        robot = with_numbers(nominal.robot, values | self._given_places())
        if nominal.turntables:
            return robot
        return robot.modified(dict(tool=dict(r=dict(start=list(self.chains.start_r)))))

    def _given_places(self) -> dict[str, np.ndarray]:
        """What is given in a frame of its own that the frame of the measurements moved: turntables on carts."""
        arms = {name: value for arm in self.arms for name, value in arm.values.items()}
        names = [table.offset for table in self.nominal_rods.rods.turntables]
        return {name: arms[name] for name in names}
