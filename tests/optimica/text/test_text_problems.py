"""Optimica text: the optima of its problems, which are known, and what is said of wrong text."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from gantrytau import Model, simulate
from gantrytau_optimica import Optimization, load_optimica, optimize

HERE = Path(__file__).parent
SAME = 1e-7  # ten times the tolerance of Ipopt, of the size of an objective


@pytest.fixture(scope="module")
def problems():
    return load_optimica(HERE / "problems.mop")


def objective(problem, **policy):
    return optimize(problem, **policy).objective


def test_an_optimization_is_an_optimization_and_a_model_a_model(problems):
    assert issubclass(problems["Problems.Lagrange"], Optimization)
    assert issubclass(problems["Problems.Cart"], Model)
    assert not issubclass(problems["Problems.Cart"], Optimization)
    assert "Problems.FastestLater" in problems.names


@pytest.mark.parametrize(
    ("name", "elements", "points", "value"),
    [  # of collocation on the same meshes, by hand
        ("Lagrange", 50, 3, 3.17619576),
        ("Mayer", 20, 8, 3.17620199),
        ("StirredTank", 50, 3, 1857.68739),
    ],
)
def test_costs_of_known_meshes(problems, name, elements, points, value):
    assert objective(problems[f"Problems.{name}"], elements=elements, points=points) == pytest.approx(
        value, rel=1e-8
    )


@pytest.mark.parametrize(
    ("name", "value"),
    [  # exact, or converged on fine meshes to the digits
        ("Fastest", 2.2811848),
        ("FastestLater", 7.2811848),
        ("FreeStart", 3 + 2 * 2.2811848),
        ("CarInMinimumTime", 2.5),
        ("CatalystMixing", -0.0480556815),
    ],
)
def test_refined_optima(problems, name, value):
    assert objective(problems[f"Problems.{name}"], elements=20, refine=1e-6) == pytest.approx(value, rel=1e-6)


def test_static_problems(problems):
    box = optimize(problems["Problems.Box"])
    assert [box["width"], box["depth"], box["height"]] == pytest.approx([2, 2, 1], rel=SAME)  # by hand
    assert optimize(problems["Problems.SteadyTank"])["inflow"] == pytest.approx(0.5, rel=SAME)  # sqrt(0.25)


def test_parameters_from_measured_points(problems):
    holes, times = (0.0265670e-4, 0.0271390e-4), np.arange(0, 61, 10.0)
    inputs = {"u": lambda t: [5 + ca.sin(t / 5), 6 - ca.sin(t / 5)]}
    tanks = problems["Problems.Tanks"](a=[*holes, 0.03e-4, 0.03e-4])
    filled = simulate(tanks, stop=60.0, inputs=inputs, tolerance=1e-10)
    levels = [[filled.at(t, f"x[{k}]") for k in (1, 2)] for t in times]
    found = optimize(problems["Problems.TankHoles"](y=levels), elements=12)
    assert [found["a1"], found["a2"]] == pytest.approx(holes, rel=1e-6)  # of collocation with 5 s an element
