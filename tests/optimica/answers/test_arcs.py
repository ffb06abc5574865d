"""The arcs of an optimum, next to motions whose arcs are known."""

from typing import Any

import numpy as np
import pytest

from gantrytau import between
from gantrytau_optimica import optimize
from tests.optimica.known_answers.known_problems import zero
from tests.optimica.known_answers.test_singular import Regulator
from tests.optimica.problems import FastestMass, LinearQuadratic, Mass


def told(optimum) -> list[tuple[str, str]]:
    return [(arc.name, arc.side) for arc in optimum.arcs]


def test_full_force_and_full_brake():
    optimum = optimize(FastestMass, elements=7, refine=1e-6)
    assert told(optimum) == [("mass.u", "max"), ("mass.u", "min")]
    first, second = optimum.arcs
    assert first.begin == 0.0
    # the switch is an unknown of the program, which is exact for parabolas
    assert first.end == second.begin == pytest.approx(1.0, abs=1e-6)
    assert second.end == pytest.approx(2.0, abs=1e-6)
    assert "Arcs:\n  mass.u max 0 to 1 s\n  mass.u min 1 to 2 s" in optimum.report()


def test_a_limit_on_a_speed_is_an_arc_and_its_force_not_singular():
    class Limited(FastestMass):
        mass: Any = Mass(u=dict(min=-1.0, max=1.0))

        def constraints(self):
            yield from super().constraints()
            yield between(-0.5, self.mass.v, 0.5)

    optimum = optimize(Limited, elements=7, refine=1e-6)
    assert told(optimum)[:3] == [("mass.u", "max"), ("mass.u", "between"), ("mass.u", "min")]
    assert optimum.arcs[1].begin == pytest.approx(0.5, abs=1e-3)
    assert optimum.arcs[1].end == pytest.approx(2.0, abs=1e-3)
    limit = optimum.arcs[3]
    assert limit.side == "max"
    assert limit.begin == pytest.approx(0.5, abs=0.1)  # of collocation points
    assert limit.end == pytest.approx(2.0, abs=0.1)


def test_an_input_without_limits_has_no_arcs():
    assert optimize(LinearQuadratic).arcs == ()


def test_an_arc_of_a_regulator_begins_where_its_analysis_says():
    # x = t - t^2 / 2 and v = 1 - t until they meet v = x tanh(t - 5)
    switch = zero(lambda t: (1 - t) - (t - t**2 / 2) * np.tanh(t - 5), 1.0, 2.0)
    optimum = optimize(Regulator, elements=50, refine=1e-6)
    assert told(optimum) == [("mass.u", "min"), ("mass.u", "singular")]
    assert optimum.arcs[0].end == pytest.approx(switch, abs=5e-3)
