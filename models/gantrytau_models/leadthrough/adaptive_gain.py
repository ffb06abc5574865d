"""A force control with an adaptive gain: the gain falls while the contact force swings, and rises slowly afterwards.

    V_t = s K (f_ref n - f),    e = n.f - lowpass(n.f)
    s falls by T / fall in a period where the mean square of e is above limit^2, else it rises by T / rise, up to 1

The loop is stable while K times the stiffness of the surface stays below a critical gain. Beyond it the force swings, on a
metal plate with 68 Hz, and the swing reveals an unknown stiffness. Dressler (2012), section 8.5, asks for a force law that
is robust against stiffness and prints none: this one is ours. With force noise of 20 mN the gain stays below the critical
one; without noise the swing cannot be detected.
"""

import math

import casadi as ca

from gantrytau import Parameter, Real, dot, if_else, require, sampled
from gantrytau_models.leadthrough.laws import ToolForceControl


class AdaptiveForceControl(ToolForceControl):
    """`ToolForceControl` that uses a `share` of its K: `control=dict(tool=AdaptiveForceControl())`."""

    period = Parameter(0.004, unit="s", min=0.0, description="sampling period, that of the controller")
    slow = Parameter(20.0, unit="Hz", min=0.0, description="frequency above which the force swings")
    window = Parameter(0.05, unit="s", min=0.0, description="time over which its square is averaged")
    limit = Parameter(0.3, unit="N", min=0.0, description="rms swing above which the gain falls")
    fall = Parameter(0.2, unit="s", min=0.0, description="time constant with which it falls")
    rise = Parameter(5.0, unit="s", min=0.0, description="time constant with which it rises")
    least = Parameter(0.2, unit="1", min=0.0, max=1.0, description="least share of the gain")
    mean = Real(unit="N", start=0.0, description="slow part of the force along n")
    square = Real(unit="N2", start=0.0, description="mean square of the rest")
    share = Real(unit="1", start=1.0, description="share of K that is used")

    def equations(self):
        for time in (self.window, self.fall, self.rise):
            yield require(time > self.period, "expected times longer than the period")
        swing = dot(self.n, self.f) - self.mean
        keep, rest = ca.exp(-2 * math.pi * self.slow * self.period), ca.exp(-self.period / self.window)
        change = if_else(self.square > self.limit**2, -self.period / self.fall, self.period / self.rise)
        share = ca.fmax(self.least, ca.fmin(1.0, self.share * (1 + change)))
        yield sampled(self.mean, self.mean + (1 - keep) * swing, period=self.period)
        yield sampled(self.square, rest * self.square + (1 - rest) * swing**2, period=self.period)
        yield sampled(self.share, share, period=self.period)
        yield from super().equations()

    def _gain(self):
        return self.share * self.K
