"""A tool that is led by its velocities, and the hand that leads it into a hole."""

from gantrytau import (
    Input,
    Model,
    Output,
    Parameter,
    Real,
    atan2,
    between,
    cross,
    der,
    dot,
    fmax,
    if_else,
    limit,
    logic_and,
    norm_2,
    sampled,
    sqrt,
    time,
)
from gantrytau.language.statements import root
from gantrytau.mechanics.multibody import Frame
from gantrytau.mechanics.multibody.orientation import of_quaternion

EYE_PERIOD = 0.1  # s, that a guess of the eye is held


class PegTool(Model):
    """A peg on a robot whose servos follow velocities as a lag of first order, whatever pushes the peg.

    frame_b: origin in the middle of the tip, z along the peg to its clamp. Velocities are those of the tool centre point,
    which is `tcp` from the tip towards the clamp.
    """

    T = Parameter(2.303e-3, unit="s", min=0.0, description="lag of the servos (assumed)")
    tcp = Parameter(0.0, unit="m", description="from the tip to the tool centre point, along the peg")
    v_ref = Input(3, unit="m/s", description="wanted velocity of the tool centre point")
    w_ref = Input(3, unit="rad/s", description="wanted angular velocity")
    r = Real(
        3, unit="m", start=[0.0, 0.0, 0.01], fixed=True, description="place of the tip where nothing bends"
    )
    q = Real(
        4, unit="1", start=[1.0, 0.0, 0.0, 0.0], fixed=True, description="orientation, a unit quaternion"
    )
    v = Real(3, unit="m/s", start=0.0, fixed=True, description="velocity of the tool centre point")
    w = Real(3, unit="rad/s", start=0.0, fixed=True, description="angular velocity")
    axis = Real(3, unit="1", description="direction from the tip to the clamp")
    angle = Real(unit="rad", description="tilt of the peg against the vertical")
    frame_b = Frame()

    def equations(self):
        s, u, w = self.q[0], self.q[1:4], self.w
        R = of_quaternion(self.q / norm_2(self.q))
        yield root(self.frame_b, R=R, w=w)
        yield self.frame_b.r == self.r
        yield self.axis == R[:, 2]
        # a trillionth of a radian too large, so that it has a slope where the peg is upright
        across = self.q[1] ** 2 + self.q[2] ** 2 + 1e-24
        yield self.angle == 2 * atan2(sqrt(across), sqrt(s**2 + self.q[3] ** 2))
        yield self.T * der(self.v) == self.v_ref - self.v
        yield self.T * der(w) == self.w_ref - w
        yield der(self.r) == self.v - cross(w, self.tcp * self.axis)
        yield der(self.q[0]) == -dot(w, u) / 2
        yield der(self.q[1:4]) == (s * w + cross(w, u)) / 2


class PegHand(Model):
    """An operator who puts a peg into a hole at the origin, by eye: moves above it, pushes gently, and draws it out again.

    What he sees is late by `delay`, and the place of the hole is misjudged by a slow random error. He wants velocities
    that lead to where the peg shall be, and pushes the handle after the speed that he feels. A peg that stands on the rim
    for too long he lifts, and aims again. Decided every `period`.
    """

    period = Parameter(0.004, unit="s", description="period of decisions")
    gain = Parameter(3.0, unit="1/s", min=0.0, description="velocity for a distance")
    delay = Parameter(0.2, unit="s", min=0.0, description="lag of what is seen")
    mind = Parameter(0.6, unit="s", min=0.0, description="time in which the eye changes its mind")
    eye = Parameter(3e-4, unit="m", min=0.0, description="standard deviation of the misjudged place")
    held = Parameter(EYE_PERIOD, unit="s", min=0.0, description="period of `white`")
    arm = Parameter(60.0, unit="N.s/m", min=0.0, description="force for a velocity")
    muscle = Parameter(0.08, unit="s", min=0.0, description="lag of the force")
    speed = Parameter(5e-3, unit="m/s", min=0.0, description="largest wanted speed into the hole")
    fast = Parameter(0.02, unit="m/s", min=0.0, description="largest wanted speed out of it")
    above = Parameter(3e-3, unit="m", description="height at which he aims")
    below = Parameter(-0.0295, unit="m", description="height to which he pushes")
    rim = Parameter(1e-3, unit="m", min=0.0, description="height and depth within which it stands on the rim")
    patience = Parameter(
        5.0, unit="s", min=0.0, description="for which it may stand there until he lifts it and aims again"
    )
    aiming = Parameter(2.0, unit="s", min=0.0, description="for which he lifts it")
    away = Parameter(0.03, unit="m", description="height to which he withdraws")
    begin = Parameter(20.0, unit="s", description="when he begins to push")
    leave = Parameter(79.0, unit="s", description="when he withdraws")
    white = Input(2, unit="1", start=0.0, description="white noise of standard deviation 1")
    r = Input(3, unit="m", description="place of the tip")
    v = Input(3, unit="m/s", description="velocity of the handle")
    seen = Real(3, unit="m", start=[0.0, 0.0, 0.01], fixed=True, description="place of the tip as it is seen")
    error = Real(2, unit="m", start=0.0, fixed=True, description="how far the hole is misjudged")
    stood = Real(unit="s", start=0.0, description="time for which the peg has stood on the rim")
    lifted = Real(unit="s", start=0.0, description="time for which he goes on to lift it")
    wanted = Real(3, unit="m/s", start=0.0, description="wanted velocity")
    f = Output(3, unit="N", start=0.0, fixed=True, description="force of the hand on the handle")

    def equations(self):
        goal = if_else(time < self.begin, self.above, if_else(time < self.leave, self.below, self.away))
        pushes = between(self.begin, time, self.leave)
        stands = logic_and(pushes, between(-self.rim, self.seen[2], self.rim))
        goal = if_else(logic_and(pushes, self.lifted > 0), self.above, goal)
        yield sampled(self.stood, if_else(stands, self.stood + self.period, 0), period=self.period)
        lifts = if_else(self.stood > self.patience, self.aiming, fmax(self.lifted - self.period, 0))
        yield sampled(self.lifted, lifts, period=self.period)
        sideways = self.gain * (self.error - self.seen[:2])
        upwards = limit(self.gain * (goal - self.seen[2]), -self.speed, self.fast)
        yield self.delay * der(self.seen) == self.r - self.seen
        guess = (
            self.eye * sqrt(2 * self.mind / self.held) * self.white
        )  # of which a lag leaves the deviation `eye`
        yield self.mind * der(self.error) == guess - self.error
        yield sampled(self.wanted[:2], sideways, period=self.period)
        yield sampled(self.wanted[2], upwards, period=self.period)
        yield self.muscle * der(self.f) == self.arm * (self.wanted - self.v) - self.f
