"""The control of a tool that is led by hand while it is in a hole, (8.2) to (8.11) of Dressler (2012)."""

from typing import Any, Literal

import numpy as np

from gantrytau import Parameter, Real, if_else, norm_2, sampled
from gantrytau.border.checks import check_words
from gantrytau_models.leadthrough.laws import ToolForceControl
from gantrytau_models.leadthrough.lead_through import HandAndTool

GATES = {"force": float(np.pi), "gated": float(np.radians(10.0))}  # rad, by the name of the normal

Normal = Literal["force", "gated"]


class PegControl(HandAndTool):
    """The laws of lead-through for a hole, where contact is wherever there is a force, however it points.

    Without contact the hand leads. In contact it does so across n, the direction of the tool's force f; along n force is
    controlled to zero, and the torque about the tool centre point turns the tool until there is none (8.11). Contact begins
    above the force `on` and ends below `off`. All vectors are in axes of the tool, z out of it into the hole; gains are
    assumed, not printed.

    normal: "force" takes n = f / |f|; "gated" does so only within 10 degrees of z (8.10), which leaves out the forces of
    walls, and is here to show it. Raises ModelError for another.
    """

    on = Parameter(0.25, unit="N", min=0.0, description="force above which there is contact")
    off = Parameter(0.15, unit="N", min=0.0, description="force below which there is none any more")
    tool = ToolForceControl(K=[0.005] * 3, K_tau=[3.0] * 3, f_ref=0.0)
    touched = Real(unit="1", start=0.0, description="the contact of the sample before")

    def __init__(self, normal: Normal = "force", **modifications: Any):
        check_words(PegControl.__init__, locals(), "PegControl")
        super().__init__(dict(normal=dict(gate=GATES[normal])), **modifications)

    def equations(self):
        yield from super().equations()
        enough = if_else(self.touched > 0.5, self.off, self.on)
        yield self.contact == if_else(norm_2(self.f_t) > enough, 1, 0)
        yield sampled(self.touched, self.contact, period=self.period)
