"""Values at times that the optimiser chooses: a mass that passes points with least effort, against the Gram matrix."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize

from gantrytau import Fixed, SolveError
from gantrytau_optimica import Free, Optimization, at, final, optimize
from gantrytau_optimica.solving import moving_points
from tests.optimica.problems import Mass


def effort(times: np.ndarray, places: np.ndarray) -> float:
    """The least integral of u^2 from rest at 0 through places at times.

    x(t) = integral of (t - s)+ u(s): u is a sum of such kernels, whose products integrate to m^2 (3 M - m) / 6.
    """
    low, high = np.minimum.outer(times, times), np.maximum.outer(times, times)
    return float(places @ np.linalg.solve(low**2 * (3 * high - low) / 6, places))


def least(places: list[float], guesses: list[list[float]], extra: float = 0.0) -> tuple[float, np.ndarray]:
    """Least effort to 0 at the end, and where the points lie; extra: cost of the time, whose end is then free."""

    def cost(times: np.ndarray) -> float:
        every = times if extra else np.append(times, 1.0)
        return effort(every, np.append(places, 0.0)) + extra * every[-1]

    options = {"xatol": 1e-10, "fatol": 1e-14}
    found: Any = min(
        (minimize(cost, g, method="Nelder-Mead", options=options) for g in guesses), key=lambda r: r.fun
    )
    return float(found.fun), found.x


def through(guess: float) -> type[Optimization]:
    """Through 0.1 and back to 0 within 1."""

    class Through(Optimization):
        m = Mass(x=Fixed(0.0), v=Fixed(0.0))
        final_time = 1.0
        tc = Free(guess, min=0.05, max=0.95)

        def integrand(self):
            return self.m.u**2

        def constraints(self):
            yield final(self.m.x) == 0
            yield at(self.tc, self.m.x) == 0.1

    return Through


@pytest.mark.parametrize(("guess", "elements"), [(0.05, 50), (0.5, 10), (0.5, 50), (0.95, 15), (0.3, 20)])
def test_a_point_goes_to_its_element_from_anywhere(guess, elements):
    best, (time,) = least([0.1], [[0.6]])
    optimum = optimize(through(guess), elements=elements)
    # inputs of three points in an element round the corner that the best one has at the point
    assert optimum.objective == pytest.approx(best, rel=1e-2 / elements**1.5)
    assert optimum.free["tc"] == pytest.approx(time, abs=1e-2 / elements)
    assert not any("stays within its element" in limit.name for limit in optimum.program.problem.boundary)


def test_a_point_settles_on_every_mesh_of_a_refinement():
    optimum = optimize(through(0.1), elements=15, refine=1e-6)
    assert optimum.refinement.reached
    assert optimum.objective == pytest.approx(least([0.1], [[0.6]])[0], rel=1e-5)
    # where there are several minima a solve finds the one near its guess
    assert "Best near the guess of tc; other times may be better, try starts=." in optimum.report()


def test_two_points_settle_together():
    class Two(Optimization):
        m = Mass(x=Fixed(0.0), v=Fixed(0.0))
        final_time = 1.0
        ta, tb = Free(0.2, min=0.05, max=0.95), Free(0.9, min=0.05, max=0.98)

        def integrand(self):
            return self.m.u**2

        def constraints(self):
            yield final(self.m.x) == 0
            yield at(self.ta, self.m.x) == 0.1
            yield at(self.tb, self.m.x) == -0.1

    best, times = least([0.1, -0.1], [[0.3, 0.8]])
    optimum = optimize(Two, elements=20)
    assert optimum.objective == pytest.approx(best, rel=2e-4)
    assert [optimum.free["ta"], optimum.free["tb"]] == pytest.approx(times, abs=1e-3)


def test_a_fixed_time_of_a_free_horizon_settles():
    class Open(Optimization):
        m = Mass(x=Fixed(0.0), v=Fixed(0.0))
        final_time = Free(1.0, min=0.5, max=2.0)

        def integrand(self):
            return self.m.u**2 + 0.5

        def constraints(self):
            yield final(self.m.x) == 0
            yield at(0.4, self.m.x) == 0.1

    def cost(end: Any) -> float:
        return effort(np.array([0.4, float(np.ravel(end)[0])]), np.array([0.1, 0.0])) + 0.5 * float(
            np.ravel(end)[0]
        )

    best: Any = minimize(cost, [1.2], method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-14})
    optimum = optimize(Open, elements=50)
    assert optimum.objective == pytest.approx(best.fun, rel=2e-5)


def test_what_does_not_settle_is_no_solution_and_told_by_the_condition(monkeypatch):
    monkeypatch.setattr(moving_points, "ROUNDS", 1)
    with pytest.raises(SolveError, match="not settled: the times of values in `at") as caught:
        optimize(through(0.1), elements=50)
    assert not caught.value.optimum.success
    assert "`at(tc) of m.x == 0.1`" in caught.value.optimum.status
