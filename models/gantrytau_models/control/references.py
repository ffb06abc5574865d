"""References of the tool as models, so that they go wherever the model goes, into an FMU too."""

import casadi as ca
import numpy as np

from gantrytau import Model, Output, Parameter, Real, cos, exp, sin, time


class CircularReference(Model):
    """A circle of the tool, entered smoothly from rest: the angular velocity rises to one turn per `period`.

    The circle begins at `start`, in the direction of `ahead`, and bends towards `aside`; both should be unit
    vectors that are perpendicular. `r` connects to the `r_ref` of a controller.
    """

    start = Parameter([0.5, 2.8, -0.8], unit="m", description="where it begins, resolved in the world")
    ahead = Parameter([1.0, 0.0, 0.0], unit="1", description="direction at the start")
    aside = Parameter([0.0, 1.0, 0.0], unit="1", description="direction from the start to the centre")
    radius = Parameter(0.1, unit="m", min=0.0, description="radius of the circle")
    period = Parameter(1.0, unit="s", min=0.0, description="of one turn")
    rise = Parameter(0.3, unit="s", min=0.0, description="time constant with which the speed rises")
    phi = Real(unit="rad", description="angle on the circle")
    r = Output(3, unit="m", description="position of the reference, resolved in the world")

    def equations(self):
        late = self.rise * (1 - exp(-time / self.rise))
        yield self.phi == 2 * np.pi * (time - late) / self.period
        on_circle = ca.vertcat(sin(self.phi), 1 - cos(self.phi))
        yield self.r == self.start + self.radius * (ca.horzcat(self.ahead, self.aside) @ on_circle)
