"""A robot with more drives than the place of its flange needs: the rest is left to the optimiser."""

from typing import Any

import numpy as np

from gantrytau import between, translate
from gantrytau_models import F1WithWrist, prototypes
from gantrytau_optimica import Free, Optimization, final, initial, optimize
from tests.optimica.known_answers.closed_loops import PAIRS

BEGIN = PAIRS["f1"]["pairs"][0][0]["tool_r"]
ANGLES = [
    "turntables[0].phi",
    "turntables[1].phi",
    "turntables[2].phi",
    "wrist.joints[0].phi",
    "wrist.joints[1].phi",
]
WAY = np.array([0.04, -0.05, 0.03])  # m, of the flange


class Placed(Optimization):
    """Eight drives carry the flange of the F1 to another place, from rest to rest."""

    robot: Any = F1WithWrist(prototypes.F1)
    final_time = Free(0.5, unit="s", min=0.02)
    still = False
    place: Any = None

    def objective(self):
        return self.final_time

    def constraints(self):
        robot = self.robot
        joints = [*robot.turntables, *robot.wrist.joints]
        yield initial(robot.tool.r) == BEGIN
        for point in (initial, final):
            yield point(robot.tool.v) == 0
            for joint in joints:
                yield point(joint.w) == 0
        for joint in joints:
            yield initial(joint.phi) == 0
            if self.still:
                yield final(joint.phi) == 0
        if self.still:
            yield final(robot.tool.r) == list(BEGIN + WAY)
        else:
            yield final(robot.wrist.r) == self.place
        for cart in robot.carts:
            yield between(-1000, cart.f, 1000)
        for turntable in robot.turntables:
            yield between(-60, turntable.tau, 60)
        for joint in robot.wrist.joints:
            yield between(-20, joint.tau, 20)


def flange(tool) -> np.ndarray:
    """Where the flange is with the tool at a place and all angles zero."""
    dae = translate(F1WithWrist(prototypes.F1))
    return np.ravel(dae.evaluate({"tool.r": list(tool), **dict.fromkeys(ANGLES, 0.0)})["wrist.r"])


def test_states_are_what_the_robot_prefers():
    """Not rates of bodies in the wrist, which follow from those of the plate but for a small part."""
    dae = translate(F1WithWrist(prototypes.F1))
    assert {*ANGLES, "tool.r[0]", "tool.r[1]", "tool.r[2]"} <= set(dae.states)


def test_a_redundant_drive_is_used():
    """Where only the flange is told where to go, the motion to the same place without turning is one of many."""
    place = list(flange(BEGIN + WAY))
    free, still = (
        optimize(type("Told", (Placed,), told), elements=10) for told in (dict(place=place), dict(still=True))
    )
    np.testing.assert_allclose(free["robot.wrist.r"][-1], place, atol=1e-7)  # ten times Ipopt's tolerance
    np.testing.assert_allclose(still["robot.wrist.r"][-1], place, atol=1e-7)
    assert free.final_time < 0.8 * still.final_time
    assert max(free.iterations, still.iterations) <= 200
    # where the flange points is not told, and is used
    assert np.ptp(np.ravel(free["robot.wrist.joints[1].phi"])) > 0.05
