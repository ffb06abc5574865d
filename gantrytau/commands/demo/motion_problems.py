"""The minimum-time motions of thesis Table 3.1, and one of the robot with six links, as problems."""

from gantrytau import Input, Parameter, Real, between
from gantrytau.mechanics import LinearFriction, TanhFriction
from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import Free, Optimization, final, initial

START, END = (0.0, 2.51, -1.03), (1.711, 3.46, -0.24)  # m
LIMIT = 6.337  # N.m, of each motor
SIX_LINK_START, SIX_LINK_END = (-0.381, -4.235, -0.014), (0.318, -4.682, 0.154)  # m
FORCE = 1200.0  # N, of each cart of the robot with six links


class RobotOnLine(GantryTau):
    """The robot with its tool on the straight line from A to B."""

    def equations(self):
        yield from super().equations()
        share = (self.tool.r[0] - START[0]) / (END[0] - START[0])
        for k in (1, 2):
            yield self.tool.r[k] == START[k] + share * (END[k] - START[k])


class FreePath(Optimization):
    """Carry the tool from A to B as fast as the motors allow, more gently for w > 0."""

    robot = GantryTau(prototypes.GT_A)
    weight = Parameter(0.0, unit="1/(N2.m2)", description="weight w of the energy")
    gear = Parameter(190.5, unit="1/m", description="force along the guideway per torque of the motor")
    torque = Input(3, unit="N.m", description="motor torque", min=-LIMIT, max=LIMIT)
    square = Real(unit="N2.m2", description="sum of the squared torques")
    final_time = Free(1.0, unit="s", min=0.1, max=5.0, description="duration of the motion")

    def equations(self):
        for k, cart in enumerate(self.robot.carts):
            yield cart.f == self.gear * self.torque[k]
        yield self.square == sum(self.torque[k] ** 2 for k in range(3))

    def objective(self):
        return self.final_time

    def integrand(self):
        return self.weight * self.square

    def constraints(self):
        yield initial(self.robot.tool.r) == START
        yield final(self.robot.tool.r) == END
        yield initial(self.robot.tool.v) == 0
        yield final(self.robot.tool.v) == 0


class OnLine(FreePath):
    """The same along the straight line: one torque moves the tool, the other two follow from the line."""

    robot = RobotOnLine(prototypes.GT_A)
    given = ("torque[2]",)


class SixLinks(Optimization):
    """Carry the plate of the robot D1 as fast as its carts allow: six rods hold it, and no closed form knows how."""

    robot = SixLinkGantryTau(prototypes.D1)
    final_time = Free(1.0, unit="s", min=0.05, max=5.0, description="duration of the motion")

    def objective(self):
        return self.final_time

    def constraints(self):
        for cart in self.robot.carts:
            yield between(-FORCE, cart.f, FORCE)
        yield initial(self.robot.tool.r) == SIX_LINK_START
        yield final(self.robot.tool.r) == SIX_LINK_END
        yield initial(self.robot.tool.v) == 0
        yield final(self.robot.tool.v) == 0


def robots(friction: str) -> tuple[GantryTau, RobotOnLine, SixLinkGantryTau]:
    """The robots of the three problems with a law of friction: "tanh", or piecewise "linear" as the thesis has it."""
    law = {"tanh": TanhFriction, "linear": LinearFriction}[friction]
    return (
        GantryTau(prototypes.GT_A, friction=law),
        RobotOnLine(prototypes.GT_A, friction=law),
        SixLinkGantryTau(prototypes.D1, friction=law),
    )
