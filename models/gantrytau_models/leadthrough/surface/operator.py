"""A person who leads a tool: eye, arm, tremor; and the forces that follow."""

import math
from typing import Any

import casadi as ca

from gantrytau import Input, Model, Output, Parameter, Real, der, if_else, sampled, time
from gantrytau.border.checks import instance
from gantrytau_models.leadthrough.assumed.records import OperatorRecord

DELAY = 10  # looks, 0.2 s, between what is seen and what is done about it


class Operator(Model):
    """A hand on the handle. It goes to and fro along x, keeps the height that the eye judges, 0.2 s late and wrong by some
    slow misjudgement, and at last pulls the tool off. It feels the handle, never the force of the tool.

    record: as `operators.SKILLED`; pressing: whether it helps the contact with some force. The force follows with the time
    constant of the muscle. `draw` and the `white` inputs are given by white noise of standard deviation 1, as
    `surface_disturbances()` has them. Raises ModelError for what is no record.
    """

    period = Parameter(0.004, unit="s", min=0.0, description="between two decisions")
    look = Parameter(0.02, unit="s", min=0.0, description="between two looks of the eye")
    speed = Parameter(unit="m/s", min=0.0, description="speed to and fro along x")
    stroke_time = Parameter(unit="s", min=0.0, description="time of one way")
    approach = Parameter(unit="m/s", min=0.0, description="largest speed to and from the surface")
    eye_gain = Parameter(unit="1/s", min=0.0, description="speed for an error of the height")
    misjudgement = Parameter(unit="m", min=0.0, description="standard deviation of the height as seen")
    misjudgement_time = Parameter(unit="s", min=0.0, description="how long a misjudgement lasts")
    depth = Parameter(unit="m", description="intended depth below the surface")
    arm = Parameter(unit="N.s/m", min=0.0, description="force for an error of the velocity")
    muscle_time = Parameter(unit="s", min=0.0, description="time constant of the force")
    tremor = Parameter(unit="N", min=0.0, description="standard deviation of the tremor")
    tremor_frequency = Parameter(unit="Hz", min=0.0, description="frequency of the tremor")
    tremor_time = Parameter(0.5, unit="s", min=0.0, description="in which the tremor comes and goes")
    force_noise = Parameter(unit="1", min=0.0, description="standard deviation of the force over itself")
    press = Parameter(unit="N", min=0.0, description="force by which contact is helped")
    pull = Parameter(unit="N", min=0.0, description="force that ends the contact")
    spread = Parameter(unit="1", min=0.0, description="largest deviation from run to run")
    pull_time = Parameter(13.0, unit="s", description="when the tool is pulled off")
    height = Input(unit="m", start=0.0, description="of the tool above the surface")
    v = Input(3, unit="m/s", start=0.0, description="velocity of the handle")
    white = Input(unit="1", start=0.0, description="white noise of standard deviation 1, of the judgement")
    white_tremor = Input(
        2, unit="1", start=0.0, description="white noise of standard deviation 1, of the tremor"
    )
    white_force = Input(unit="1", start=0.0, description="white noise of standard deviation 1, of the force")
    draw = Input(3, unit="1", start=0.0, description="numbers of standard deviation 1 for a run")
    judged = Real(unit="m", start=0.0, nominal=1e-3, description="misjudgement of the height")
    seen = Real(DELAY, unit="m", description="heights on their way from the eye, the newest first")
    wanted = Real(3, unit="m/s", start=0.0, description="velocity that is wanted")
    intended = Real(3, unit="N", start=0.0, description="force that is intended beside")
    noisy = Real(unit="1", start=1.0, description="force over the intended one")
    swing = Real(2, unit="1", start=0.0, description="the tremor's sine and cosine, which come and go")
    muscle = Real(3, unit="N", start=0.0, description="force of the muscles")
    f = Output(3, unit="N", description="force on the handle")

    def __init__(self, record: OperatorRecord, *, pressing: bool = True, **modifications: Any):
        instance("Operator", "record", record, OperatorRecord, "a record such as operators.SKILLED")
        values = {name: getattr(record, name) for name in record.__dataclass_fields__ if name != "name"}
        super().__init__(values | ({} if pressing else dict(press=0.0)), **modifications)

    def _spread(self, k: int) -> Any:
        """A factor near 1, the same for a run."""
        return 1 + self.spread * ca.sin(self.draw[k])

    def equations(self):
        period, pulling = self.period, time >= self.pull_time
        keep = ca.exp(-period / self.misjudgement_time)
        judged = keep * self.judged + self.misjudgement * ca.sqrt(1 - keep**2) * self.white
        yield sampled(self.judged, judged, period=period)
        yield sampled(self.seen[0], self.height, period=self.look)
        for k in range(1, DELAY):
            yield sampled(self.seen[k], self.seen[k - 1], period=self.look)
        # z points into the surface
        down = self.eye_gain * (self.seen[DELAY - 1] + self.judged + self.depth * self._spread(1))
        down = ca.fmax(-self.approach, ca.fmin(down, self.approach))
        stroke = if_else(ca.sin(ca.pi * time / self.stroke_time) >= 0, 1.0, -1.0)
        wanted = [self.speed * self._spread(0) * stroke, 0.0, if_else(pulling, 0.0, down)]
        near = if_else(self.seen[DELAY - 1] < self.depth, 1.0, 0.0)
        beside = if_else(pulling, -self.pull, near * self.press)
        for k in range(3):
            yield sampled(self.wanted[k], wanted[k], period=period)
            yield sampled(self.intended[k], beside if k == 2 else 0.0, period=period)
        yield sampled(self.noisy, 1 + self.force_noise * self.white_force, period=period)
        keep = ca.exp(-period / self.tremor_time)
        for k in range(2):
            swing = keep * self.swing[k] + ca.sqrt(1 - keep**2) * self.white_tremor[k]
            yield sampled(self.swing[k], swing, period=period)
        meant = self.arm * self._spread(2) * (self.wanted - self.v) + self.intended
        yield self.muscle_time * der(self.muscle) == self.noisy * meant - self.muscle
        angle = 2 * math.pi * self.tremor_frequency * time
        tremor = self.tremor * (self.swing[0] * ca.sin(angle) + self.swing[1] * ca.cos(angle))
        yield self.f == self.muscle + tremor * ca.vertcat(0.6, 0.0, 1.0)
