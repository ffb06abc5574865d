"""Conditions at the end that others there decide, along every motion."""

from typing import Any

import numpy as np
import pytest

from gantrytau import Input, Model, Real, SolveError, der
from gantrytau_optimica import Free, Optimization, final, optimize
from gantrytau_optimica.failures.following_ends import following_ends
from gantrytau_optimica.optimize import prepare
from tests.families import first_of
from tests.optimica.known_answers.literature_problems import Reorientation, SwingUp


class Turned(Model):
    """A direction, whose length is kept, and its rate."""

    c = Real(start=1.0, fixed=True)
    s = Real(start=0.0, fixed=True)
    w = Real(start=0.0, fixed=True)
    u = Input(min=-1.0, max=1.0)

    def equations(self):
        yield der(self.c) == -self.w * self.s
        yield der(self.s) == self.w * self.c
        yield der(self.w) == self.u


class Turn(Optimization):
    """In least time to a direction, both of its numbers given."""

    body: Any = Turned()
    end: Any = (np.cos(2.0), np.sin(2.0))
    final_time = Free(2.0, min=0.1)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield final(self.body.c) == self.end[0]
        yield final(self.body.s) == self.end[1]
        yield final(self.body.w) == 0


@pytest.mark.parametrize(
    ("problem", "names"),
    [
        (Turn, ["final(body.s) == 0.909297"]),
        (Reorientation, ["final(body.q[3]) == 0.258819"]),  # the norm of a quaternion
        (SwingUp, []),
    ],
)
def test_ends_that_follow_from_others(problem, names):
    assert [limit.name for limit, _ in following_ends(prepare(problem).built)] == names


def test_a_problem_with_an_end_that_follows_is_solved():
    assert optimize(Turn).final_time == pytest.approx(2 * np.sqrt(2.0), abs=1e-6)  # 1 rad in each half


AXES = [(1, 2, 3), (-2, 1, 1), (1, 1, 0), (0, 0, 1), (1, 0, 0)]


@pytest.mark.parametrize(
    ("axis", "degrees"), first_of([(axis, angle) for angle in (150, 120, 90) for axis in AXES], 1)
)
def test_a_turn_takes_as_long_as_the_one_back(axis, degrees):
    """Played backwards, the motion that turns a body about an axis turns it about the opposite one."""

    class Turned(Reorientation):
        way = 1.0

        def constraints(self):
            half = np.radians(degrees) / 2
            x, y, z = self.way * np.sin(half) * np.array(axis) / np.linalg.norm(axis)
            yield final(self.body.q) == [x, y, z, np.cos(half)]
            yield final(self.body.w) == [0.0, 0.0, 0.0]

    class Back(Turned):
        way = -1.0

    there, back = optimize(Turned), optimize(Back)
    assert there.final_time == pytest.approx(back.final_time, rel=1e-4)


def test_an_end_that_contradicts_others_is_named():
    class Longer(Turn):
        end = (0.0, 1.2)

    with pytest.raises(SolveError, match=r"final\(body.s\) == 1.2` follows from the others at the end"):
        optimize(Longer, max_iterations=100)
