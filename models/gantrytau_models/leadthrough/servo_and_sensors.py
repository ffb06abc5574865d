"""What moves the tool, and what measures its forces."""

from gantrytau import Input, Model, Output, Parameter, der, require


class LedArm(Model):
    """Base of arms that follow velocities of their tool, in axes of the tool."""

    v_ref = Input(3, unit="m/s", start=0.0, description="velocity that is asked for")
    f = Input(3, unit="N", start=0.0, description="force of the tool on what it touches")
    v = Output(3, unit="m/s", start=0.0, description="velocity of the tool")
    r = Output(3, unit="m", start=0.0, description="position of the tool")


class VelocityServo(LedArm):
    """A rigid arm that follows velocities, and that no force pushes back: T_v v' = v_ref - v, r' = v.

    "A servo much faster than the lead-through loop" (printed) fits 2.3 ms.
    """

    T_v = Parameter(2.303e-3, unit="s", min=0.0, description="time constant of the velocity")

    def equations(self):
        yield require(self.T_v > 0, "expected a time constant above zero")
        yield self.T_v * der(self.v) == self.v_ref - self.v
        yield der(self.r) == self.v


class ForceSensor(Model):
    """A sensor of six axes: noise in each sample, a bias that stays for a run, and the weight beyond it less what is
    known of that weight.

    `white_f`, `white_t` and `bias_f`, `bias_t` are given by white noise of standard deviation 1, the biases with one number
    for a run: `surface_disturbances()` has them.
    """

    std_f = Parameter(0.05, unit="N", min=0.0, description="standard deviation of a sample of the force")
    std_t = Parameter(0.0, unit="N.m", min=0.0, description="standard deviation of a sample of the torque")
    std_bias_f = Parameter(0.03, unit="N", min=0.0, description="standard deviation of the bias of the force")
    std_bias_t = Parameter(
        0.0, unit="N.m", min=0.0, description="standard deviation of the bias of the torque"
    )
    m = Parameter(0.0, unit="kg", min=0.0, description="mass beyond the sensor")
    m_known = Parameter(m, unit="kg", min=0.0, description="mass whose weight is taken off")
    gravity = Parameter([0.0, 0.0, 9.81], unit="m/s2", description="gravity in axes of the tool")
    f = Input(3, unit="N", start=0.0, description="force")
    t = Input(3, unit="N.m", start=0.0, description="torque")
    white_f = Input(3, unit="1", start=0.0, description="white noise of standard deviation 1")
    white_t = Input(3, unit="1", start=0.0, description="white noise of standard deviation 1")
    bias_f = Input(3, unit="1", start=0.0, description="a number of standard deviation 1 for a run")
    bias_t = Input(3, unit="1", start=0.0, description="a number of standard deviation 1 for a run")
    f_seen = Output(3, unit="N", description="force as measured")
    t_seen = Output(3, unit="N.m", description="torque as measured")

    def equations(self):
        weight = (self.m - self.m_known) * self.gravity
        yield self.f_seen == self.f + weight + self.std_f * self.white_f + self.std_bias_f * self.bias_f
        yield self.t_seen == self.t + self.std_t * self.white_t + self.std_bias_t * self.bias_t
