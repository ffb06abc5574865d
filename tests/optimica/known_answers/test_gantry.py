"""The minimum-time motions GT-A of the L1 robot, against values computed independently on the same mesh."""

import numpy as np
import pytest

from gantrytau import Fixed, ModelError, SolveError, simulate
from gantrytau.commands.demo.motion_problems import LIMIT, FreePath, OnLine
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import final, initial, optimize
from tests.benchmarks.pose_sweep import pairs, reach, sweep
from tests.families import NIGHTLY

START, END = np.array([0.0, 2.51, -1.03]), np.array([1.711, 3.46, -0.24])
PAIRS = 4 if NIGHTLY else 2  # of poses


@pytest.fixture(scope="module")
def straight():
    """Along the line, no weight of the energy."""
    return optimize(OnLine)


def test_free_path_in_minimum_time():
    optimum = optimize(FreePath)
    # converged runs scatter by 1.5e-4 around 0.913510; a faster branch exists
    assert optimum.final_time < 0.913510 + 1.5e-4
    assert optimum.objective == pytest.approx(optimum.final_time, rel=1e-14)
    np.testing.assert_allclose(optimum["robot.tool.r"][[0, -1]], [START, END], atol=1e-9)
    assert np.max(np.abs(optimum["torque"][1:])) < LIMIT + 1e-6


@pytest.mark.parametrize(
    ("weight", "duration", "cost"), [(0.001, 0.92103, 0.99343), (0.01, 0.97598, 1.52098)]
)
def test_free_path_with_energy(weight, duration, cost):
    optimum = optimize(FreePath(weight=weight))
    assert optimum.final_time == pytest.approx(duration, abs=2e-5)
    assert optimum.objective == pytest.approx(cost, abs=1e-3)  # energies are known to three digits
    assert optimum.objective == pytest.approx(
        optimum.final_time + weight * optimum.integral("square"), abs=1e-9
    )


def test_straight_line(straight):
    assert straight.final_time == pytest.approx(0.974057, abs=2e-5)
    assert straight.integral("square") == pytest.approx(57.18, abs=0.02)
    share = (straight["robot.tool.r"] - START) / (END - START)
    np.testing.assert_allclose(share, share[:, :1] * np.ones(3), atol=1e-8)


@pytest.mark.parametrize(("elements", "duration"), [(25, 0.975339), (100, 0.973830)])
def test_the_straight_line_converges_to_the_phase_plane(elements, duration):
    # exact: 0.9737820 s by integration in the phase plane
    optimum = optimize(OnLine, elements=elements)
    assert optimum.final_time == pytest.approx(duration, abs=2e-6)
    assert 0.9737820 < optimum.final_time


def test_the_robot_on_a_line_has_two_states_and_one_control(straight):
    assert straight.dae.states == ("robot.tool.r[0]", "robot.tool.v[0]")
    assert straight.dae.inputs == ("torque[2]",)


def test_an_end_that_is_given_twice_on_the_line_must_agree():
    class Aside(OnLine):
        def constraints(self):
            yield from super().constraints()
            yield final(self.robot.tool.r[1]) == 3.0

    with pytest.raises(ModelError, match=r"contradicts other conditions at the same time.* 3\.46"):
        optimize(Aside)


def test_an_end_out_of_reach_names_the_links_and_the_conditions():
    class Far(FreePath):
        def constraints(self):
            yield initial(self.robot.tool.r) == START
            yield final(self.robot.tool.r) == (1.711, 4.9, -0.24)

    with pytest.raises(SolveError) as caught:
        optimize(Far)
    words = str(caught.value)
    assert words.startswith("Far: no solution: the end is out of reach: `final(robot.tool.r[1]) == 4.9`")
    assert "leave no solution of robot.arms[1].link (SphericalSpherical), equation 1" in words
    assert words.count("`final(robot.tool.r[2])") == 1
    assert "robot.tool.r[0]" not in words  # along the guideways all is in reach
    assert "from which robot.carts[1].s follows" in words
    assert "sqrt" not in words
    assert caught.value.optimum["robot.tool.r"].shape == (151, 3)
    assert not caught.value.optimum.success


def test_a_start_out_of_reach_is_named_too():
    class Far(FreePath):
        def constraints(self):
            yield initial(self.robot.tool.r) == (0.0, 4.9, -1.03)
            yield final(self.robot.tool.r) == END

    with pytest.raises(SolveError, match=r"the start is out of reach: `initial\(robot\.tool\.r\[1\]\) =="):
        optimize(Far)


def test_a_motion_that_is_too_fast_says_which_limits_are_in_the_way():
    class Hasty(OnLine):
        final_time = 0.9

        def objective(self):
            return 0.0

    with pytest.raises(SolveError) as caught:
        optimize(Hasty, max_iterations=200)
    report = caught.value.optimum.report()
    assert "horizon 0 to 0.9 s" in report
    assert "At their limits:" in report
    assert "torque[" in report
    assert "sqrt" not in report


def test_an_unfinished_motion_can_be_looked_at(tmp_path):
    with pytest.raises(SolveError, match="iteration limit reached after 3 iterations") as caught:
        optimize(FreePath, max_iterations=3)
    assert "max_iterations=" in str(caught.value)
    assert "sqrt" not in str(caught.value)
    optimum = caught.value.optimum
    optimum.plot("robot.tool.r", file=tmp_path / "unfinished.png")
    assert (tmp_path / "unfinished.png").stat().st_size > 1000


def test_random_pairs_of_poses_converge_from_their_straight_line():
    verdicts = sweep(PAIRS, seed=7, elements=30).values
    assert [v.status for v in verdicts] == ["solved"] * PAIRS
    for verdict, (start, end) in zip(verdicts, pairs(PAIRS, seed=7), strict=True):
        assert verdict.start == tuple(start)
        assert verdict.end == tuple(end)
        assert min(reach(start), reach(end)) > 0.5
        assert 0.1 < verdict.time < 2.0


def test_another_solution_as_guess_saves_iterations():
    cold = optimize(FreePath(weight=0.001))
    warm = optimize(FreePath(weight=0.001), elements=60, guess=cold)
    assert warm.iterations < cold.iterations / 2
    assert warm.final_time == pytest.approx(cold.final_time, abs=5e-4)  # another mesh


def test_played_back_the_motion_ends_where_it_should():
    found = optimize(FreePath(weight=0.01), elements=60)
    times = np.linspace(0, found.final_time, 2001)
    forces = {f"carts[{k}].f": (times, found.signal(f"robot.carts[{k}].f")(times)) for k in range(3)}
    tool = dict(r=Fixed(found["robot.tool.r"][0]), v=Fixed(0.0))
    played = simulate(GantryTau(prototypes.GT_A, tool=tool), stop=found.final_time, inputs=forces)
    # the torques of this weight are smooth but at both ends, where their polynomials wiggle
    assert played["tool.r"][-1] == pytest.approx([1.711, 3.46, -0.24], abs=2e-3)
