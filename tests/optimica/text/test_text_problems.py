"""Optimica text: the optima of its problems, which are known, and what is said of wrong text."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from gantrytau import Model, ModelError, simulate
from gantrytau_optimica import Optimization, load_optimica, optimize

HERE = Path(__file__).parent
PLANT = """
  model Plant
    Real x(start = 1, fixed = true);
    input Real u;
  equation
    der(x) = u - x;
  end Plant;
  optimization P("""
WRONG = [  # arguments and body of an optimization, column in line 8, and what is said
    ("objectve = x(finalTime)) extends Plant;", 18, "'objectve', which .* did you mean 'objective'"),
    ("finalTime = 1, finalTime = 2) extends Plant;", 33, "second 'finalTime'"),
    ("objective) extends Plant;", 18, "'objective' without a value, expected objective = "),
    ("objective = {1, 2}) extends Plant;", 30, r"an array \[2\] as objective, expected a number"),
    ("objective = x) extends Plant;", 30, r"'x', which changes over time, expected .* x\(finalTime\)"),
    ("objectiveIntegrand = x(finalTime)) extends Plant;", 39, "'x' at a time in an integrand"),
    ("objective = x(0, 1)) extends Plant;", 30, r"expected one time, as x\(finalTime\)"),
    ("objective = x(u)) extends Plant;", 30, r"x\(u\), expected a time of numbers and parameters"),
    ("objective = p(1)) Plant p(u = 1);", 30, "component 'p' called with a time"),
    ("static = 2) extends Plant;", 27, "2 as static, expected true or false"),
    (") extends Plant; parameter Integer n(free = true) = 3;", 55, "'n' free, which is Integer"),
    (") extends Plant(x(initalGuess = 2));", 36, "did you mean 'initialGuess'"),
    (") extends Plant; Real inputs = x;", 40, "'inputs', a name that is taken"),
    (") extends Plant; equation u = x(0);", 48, "'x' with a time, expected that in costs and constraints"),
    (") extends Plant; constraint x < 1;", 48, "expected '=', '<=' or '>='"),
    (") extends Plant; constraint 0 <= x <= 1;", 46, "a second relation '<=', .* write two constraints"),
    (") extends Plant; constraint 1 <= 0;", 46, "1 <= 0, which never holds"),
    (") extends Plant; constraint {x, u} <= {1, 2, 3};", 46, r"sizes \[2\] and \[3\] beside '<='"),
    (") extends Plant; constraint if x > 0 then u <= 1; end if;", 46, "a condition that varies"),
    (") extends Plant; constraint connect(x, u);", 46, "what is no constraint, expected"),
]
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
        ("SpeedLimit", 0.1698212),
        ("Penicillin", -1.486581),
    ],
)
def test_refined_optima(problems, name, value):
    # ten times what is asked: refined inputs are straight lines in each element
    assert objective(problems[f"Problems.{name}"], elements=20, refine=1e-6) == pytest.approx(value, rel=1e-5)


def test_equations_of_index_three_have_the_optimum_of_those_in_an_angle(problems):
    cartesian, angle = (
        objective(problems[f"Problems.{name}"], elements=10, points=5) for name in ("Pendulum", "Swing")
    )
    assert cartesian == pytest.approx(angle, rel=1e-7)  # of collocation of order nine


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


@pytest.mark.parametrize(("text", "column", "words"), WRONG, ids=[one[0] for one in WRONG])
def test_wrong_text_is_told_with_its_place(tmp_path, text, column, words):
    file = tmp_path / "wrong.mop"
    file.write_text(f"package W{PLANT}{text} end P;\nend W;\n")
    with pytest.raises(ModelError, match=rf"wrong.mop, line 8, column {column}: found .*{words}"):
        optimize(load_optimica(file)["W.P"], elements=2)


def test_a_model_has_no_constraints_and_a_mo_file_no_optimization(tmp_path):
    (tmp_path / "model.mop").write_text("model M Real x = 1; constraint x <= 2; end M;")
    with pytest.raises(ModelError, match="line 1, column 21: found constraints in the model M"):
        load_optimica(tmp_path / "model.mop")
    (tmp_path / "model.mo").write_text("model M Real x(free = true); end M;")
    with pytest.raises(ModelError, match=r"found 'free', which is Optimica, expected it in a \.mop file"):
        load_optimica(tmp_path / "model.mo")["M"]


def test_a_step_on_a_border_of_elements_counts_on_its_side_and_a_free_state_begins_anywhere(tmp_path):
    (tmp_path / "step.mop").write_text(
        """optimization Step(objective = x(finalTime), objectiveIntegrand = if time < 0.5 then 1 else 3,
            startTime = 0, finalTime = 1)
          Real x(start = 1, free = true, min = 0.2, max = 3);
          input Real u(min = -1, max = 1);
        equation
          der(x) = u;
        end Step;"""
    )
    found = optimize(load_optimica(tmp_path / "step.mop")["Step"], elements=4)
    assert found.objective == pytest.approx(0.2 + 2, abs=1e-6)  # of Ipopt's relaxed limits
