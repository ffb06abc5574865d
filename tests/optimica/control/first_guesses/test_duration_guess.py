import numpy as np
import pytest

from gantrytau import between
from gantrytau_models import DeltaRobot, FourBar
from gantrytau_optimica import Free, Optimization, final, initial, optimize, prepare


def crank(duration: float, limit: float = 20.0) -> type[Optimization]:
    """A four-bar linkage turned by its crank through 1.5 rad; duration: the guess in s."""

    class Turned(Optimization):
        robot = FourBar(crank=dict(length=0.3))
        final_time = Free(duration, min=1e-3, unit="s")

        def objective(self):
            return self.final_time

        def constraints(self):
            crank = self.robot.crank
            for at, phi in ((initial, 0.5), (final, 2.0)):
                yield at(crank.phi) == phi
                yield at(crank.w) == 0
            yield between(-limit, self.robot.torque, limit)

    return Turned


def guessed(problem, **policy) -> float:
    """The guess of the duration that the solver is given, s."""
    (number,) = (n for n in prepare(problem, **policy).program.problem.free if n.name == "final_time")
    return number.guess


def test_guesses_of_any_duration_come_to_the_same_pace():
    paces = [guessed(crank(duration)) for duration in (0.01, 0.3, 5.0)]
    fastest = optimize(crank(0.3), elements=10).final_time
    assert np.ptp(np.log(paces)) < np.log(1.5)
    assert 0.5 * fastest < min(paces)
    assert max(paces) < 2 * fastest
    slow = optimize(crank(60.0), elements=10)
    assert slow.final_time == pytest.approx(fastest, rel=1e-6)
    assert slow.iterations < 60


def test_a_duration_of_the_caller_is_kept():
    assert guessed(crank(0.3), guess={"final_time": 7.0}) == 7.0


def test_limits_that_hold_no_weight_leave_the_guess_as_it_is():
    assert guessed(crank(0.3, limit=1e-3)) == 0.3


def test_a_vector_that_moves_along_one_axis_has_one_size():
    class Lifted(Optimization):
        robot = DeltaRobot()
        final_time = Free(1.0, min=0.02, unit="s")

        def objective(self):
            return self.final_time

        def constraints(self):
            for at, z in ((initial, -0.9), (final, -0.8)):
                yield at(self.robot.tool.r) == [0.0, 0.0, z]
                yield at(self.robot.tool.v) == [0.0, 0.0, 0.0]
            for arm in self.robot.arms:
                yield between(-12.0, arm.tau, 12.0)

    problem = prepare(Lifted, elements=10).program.problem
    sizes = {s.name: s.nominal for s in problem.signals}
    speeds = [x for name, x in sizes.items() if name.startswith("robot.tool.v[")]
    assert len(speeds) == 3
    assert np.ptp(speeds) == 0.0
