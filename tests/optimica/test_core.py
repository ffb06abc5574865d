"""The transcription core on its records: known answers, derivatives, points, pieces, limits and failures."""

from __future__ import annotations

import os
import re
import signal
import threading
import time
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from gantrytau_optimica.collocation import scheme
from gantrytau_optimica.control_problem import ControlProblem, Limit, Parameter, PointValue, Signal
from gantrytau_optimica.layout import Pieces
from gantrytau_optimica.solver import Solver, SolverOptions, solve
from gantrytau_optimica.transcription import transcribe
from tests.benchmarks import gta, gta_problem
from tests.benchmarks.pose_pairs import core_solver, sweep
from tests.optimica import records


def objective(problem: ControlProblem, elements: int, **policy) -> float:
    """Objective at a solution found to 1e-10."""
    solution = solve(transcribe(problem, elements, **policy), options=SolverOptions(tolerance=1e-10))
    assert solution.success, solution.report()
    return solution.objective


@pytest.mark.parametrize(
    ("elements", "points", "value"), [(50, 3, 3.17619576), (100, 5, 3.17495079), (20, 8, 3.17620199)]
)
def test_van_der_pol_with_a_bound(elements, points, value):
    assert objective(records.van_der_pol(), elements, points=points) == pytest.approx(value, abs=1e-6)


def test_van_der_pol_in_least_time_from_any_start_time():
    # printed to 1e-8; on 50 elements the switches of the control cost 1e-6 or less
    assert objective(records.van_der_pol_minimum_time(), 50) == pytest.approx(2.28115871, abs=1e-6)
    late = records.van_der_pol_minimum_time(5.0)
    assert objective(late, 50) == pytest.approx(7.28115871, abs=1e-6)
    problem = records.van_der_pol_minimum_time()
    with_time = replace(problem, integrand=problem.time)
    assert objective(with_time, 50) == pytest.approx(4.8830012, abs=1e-6)


def test_double_integrator():
    assert objective(records.double_integrator(), 50) == pytest.approx(2.0, abs=1e-6)
    assert objective(records.double_integrator(top_speed=0.5), 50) == pytest.approx(2.5, abs=1e-6)


def test_linear_quadratic_with_terminal_state():
    assert objective(records.linear_quadratic(), 50) == pytest.approx(50.9836626, abs=1e-6)
    gauss = objective(records.linear_quadratic(), 50, scheme_name="gauss")
    assert gauss == pytest.approx(50.9836626, abs=1e-6)


@pytest.mark.parametrize(("elements", "points", "value"), [(50, 3, 1857.68739), (75, 4, 1858.4286628)])
def test_reactor(elements, points, value):
    assert objective(records.reactor(), elements, points=points) == pytest.approx(value, abs=2e-5)


def test_blocked_control():
    value = objective(records.van_der_pol(), 40, controls={"u": Pieces("constant")})
    assert value == pytest.approx(3.31090705, abs=1e-6)


def test_pieces_hold_their_kind_and_their_largest_step():
    pieces = {"u": Pieces("linear", elements=2, max_step=0.25)}
    motion = solve(transcribe(records.van_der_pol(), 30, controls=pieces)).trajectory
    knots = motion.value("u", motion.borders[::2])
    assert np.abs(np.diff(knots)).max() < 0.25 + 1e-7
    middle = motion.value("u", motion.borders[1::2])
    assert middle == pytest.approx((knots[1:] + knots[:-1]) / 2, abs=1e-12)
    constant = solve(transcribe(records.van_der_pol(), 30, controls={"u": Pieces("constant", 3)})).trajectory
    inside = constant.value("u", np.linspace(0.01, 1.99, 7))
    assert np.ptp(inside) == 0.0
    right = constant.value("u", constant.borders[3], side="right")
    assert right == constant.value("u", constant.borders[4])
    assert right != constant.value("u", constant.borders[3])


@pytest.mark.parametrize(("name", "extra"), [("radau", -1), ("gauss", 0)])
@pytest.mark.parametrize("points", [1, 2, 3])
def test_the_end_value_converges_with_the_order_of_the_scheme(name, extra, points):
    x, z = ca.SX.sym("x"), ca.SX.sym("z")
    at_start = ca.SX.sym("at_start")
    decay = ControlProblem(
        states=(Signal("x", x),),
        ode=ca.vertcat(z),
        algebraics=(Signal("z", z),),
        residuals=z + x,
        final_time=4.0,
        points=(PointValue(at_start, x, "initial"),),
        boundary=(Limit(at_start, 0.1, 0.1, "start"),),
    )
    exact = 0.1 * np.exp(-4)
    errors = []
    for elements in (32, 64) if points == 1 else (8, 16):
        motion = solve(
            transcribe(decay, elements, points=points, scheme_name=name),
            options=SolverOptions(tolerance=1e-13),
        ).trajectory
        errors.append(abs(float(motion.value("x", 4.0)) - exact))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * points + extra, abs=0.2)


@pytest.mark.parametrize("name", ["radau", "gauss"])
@pytest.mark.parametrize("points", range(1, 6))
def test_quadrature_is_exact_to_its_order(name, points):
    rule = scheme(name, points)
    for degree in range(2 * points - (1 if name == "radau" else 0)):
        assert rule.quadrature @ rule.points**degree == pytest.approx(1 / (degree + 1), rel=1e-13)


def test_assembled_derivatives_are_those_of_the_program():
    problem = records.van_der_pol_minimum_time()
    problem = replace(problem, integrand=problem.time * problem.inputs[0].symbol ** 2)
    program = transcribe(problem, 5, scheme_name="gauss", controls={"u": Pieces("linear", 2)}).program
    random = np.random.default_rng(1)
    x, p = ca.MX.sym("x", program.variables), ca.MX.sym("p", 0)
    lam = ca.MX.sym("lam", program.rows)
    f, g = program.nlp(x, p)
    hessian = ca.triu(ca.hessian(0.7 * f + ca.dot(lam, g), x)[0])
    known = ca.Function("known", [x, lam], [ca.gradient(f, x), ca.jacobian(g, x), hessian])
    at, weights = random.uniform(0.5, 1.5, program.variables), random.uniform(-1, 1, program.rows)
    mine = [program.grad_f(at, [])[1], program.jac_g(at, [])[1], program.hess_lag(at, [], 0.7, weights)]
    for expected, found in zip(known(at, weights), mine, strict=True):
        assert np.asarray(found) == pytest.approx(np.asarray(expected), abs=1e-13)


def test_points_at_any_time_and_at_a_fraction_of_a_free_horizon():
    problem = records.double_integrator()
    x = problem.states[0].symbol
    T, halfway = problem.final_time, ca.SX.sym("halfway")
    through = replace(
        problem,
        points=(*problem.points, PointValue(halfway, x, 0.37 * T)),
        boundary=(*problem.boundary, Limit(halfway, 0.15, 0.15, "way at 0.37 T")),
    )
    motion = solve(transcribe(through, 20)).trajectory
    assert float(motion.value("x", 0.37 * motion.final)) == pytest.approx(0.15, abs=1e-7)

    fixed = records.linear_quadratic()
    point = ca.SX.sym("point")
    fixed = replace(
        fixed,
        points=(*fixed.points, PointValue(point, fixed.states[1].symbol, 1.2345)),
        boundary=(*fixed.boundary, Limit(point, 0.5, 0.5, "speed at 1.2345 s")),
    )
    motion = solve(transcribe(fixed, 10)).trajectory
    assert float(motion.value("v", 1.2345)) == pytest.approx(0.5, abs=1e-7)


def test_a_point_at_a_physical_time_finds_its_element_while_the_horizon_is_free():
    problem = records.double_integrator()
    point = ca.SX.sym("point")
    problem = replace(
        problem,
        points=(*problem.points, PointValue(point, problem.states[1].symbol, 0.7)),
        boundary=(*problem.boundary, Limit(point, 0.4, 0.4, "speed at 0.7 s")),
    )
    solution = solve(transcribe(problem, 40))  # guessed at 1 s, the motion takes more than 2 s
    assert solution.success
    assert float(solution.trajectory.value("v", 0.7)) == pytest.approx(0.4, abs=1e-7)


def test_parameters_change_between_solves_of_one_transcription():
    problem = records.double_integrator()
    distance, top = ca.SX.sym("distance"), ca.SX.sym("top")
    end = problem.points[1].symbol
    problem = replace(
        problem,
        parameters=(Parameter("distance", distance, 1.0), Parameter("top", top, 9.0)),
        path_limits=(Limit(problem.states[1].symbol, -np.inf, top, "speed"),),
        boundary=(problem.boundary[0], Limit(end, ca.vertcat(distance, 0), ca.vertcat(distance, 0), "end")),
    )
    solver = Solver(transcribe(problem, 50))
    assert solver.solve().objective == pytest.approx(2.0, abs=1e-6)
    assert solver.solve({"distance": 4.0}).objective == pytest.approx(4.0, abs=1e-6)
    assert solver.solve({"top": 0.5}).objective == pytest.approx(2.5, abs=1e-6)


def test_multipliers_are_sensitivities():
    found = solve(transcribe(records.linear_quadratic(), 20)).multipliers["final state[0]"].values[0]
    near, far = (objective(records.linear_quadratic(4.0 + d), 20) for d in (-1e-3, 1e-3))
    # quadratic in the final state, so that the central difference is exact; the sign is that of upper limits
    assert -found == pytest.approx((far - near) / 2e-3, abs=1e-6)


@pytest.mark.parametrize("row", gta.ROWS)
def test_rows_of_the_published_table(row):
    task, duration, _ = gta.ROWS[row]
    solution = solve(transcribe(gta_problem.control_problem(task), 50))
    # converged runs of the free row without weight scatter by 1.5e-4
    tolerance = 1.5e-4 if task.weight == 0 and not task.line else 2e-5
    assert solution.free["final_time"] == pytest.approx(duration, abs=tolerance)


def test_random_moves_converge_from_their_straight_line():
    verdicts = sweep(core_solver(), count=12)  # the bench tries all two hundred
    assert [verdict.status for verdict in verdicts] == ["solved"] * 12


def test_a_limit_on_a_multiple_of_a_signal_is_a_bound():
    problem = records.double_integrator()
    v = problem.states[1].symbol
    multiple = replace(problem, path_limits=(Limit(1 - 2 * v, 0.0, np.inf, "margin of speed"),))
    transcription = transcribe(multiple, 50)
    assert not any(group.kind == "path" for group in transcription.groups)
    assert solve(transcription).objective == pytest.approx(2.5, abs=1e-6)


def test_a_limit_that_moves_with_a_free_number_holds():
    problem = records.double_integrator()
    v, T = problem.states[1].symbol, problem.final_time
    moving = replace(problem, path_limits=(Limit(v, -np.inf, T / 5, "speed"),))
    motion = solve(transcribe(moving, 50)).trajectory
    # T = 1 / top + top with top = T / 5 gives T = 2.5
    assert motion.final == pytest.approx(2.5, abs=1e-6)


def test_an_impossible_problem_is_explained_in_its_own_words():
    solution = solve(transcribe(records.double_integrator(distance=9.0, longest=3.0), 20))
    assert not solution.success
    report = solution.report()
    assert "infeasible" in report
    assert "T at its upper limit 3 s" in report
    assert "u at its upper limit 1 m/s2 from t = " in report
    assert re.search(r"(initial|final) state\[[01]\] is \S+, required", report)


def test_a_value_that_is_no_number_is_named():
    problem = records.double_integrator()
    x, v = (state.symbol for state in problem.states)
    broken = replace(problem, ode=ca.vertcat(v, ca.log(x - 5)))
    broken = replace(broken, inputs=())
    solution = solve(transcribe(broken, 5))
    assert not solution.success
    assert "der(v) is nan" in solution.report()


def test_iteration_limit_and_time_limit_keep_the_iterate():
    transcription = transcribe(records.van_der_pol(), 50)
    short = solve(transcription, options=SolverOptions(max_iterations=3))
    assert (short.status, short.success, short.iterations) == ("iteration limit reached", False, 3)
    assert np.isfinite(short.trajectory.value("x1")).all()


def test_an_interrupt_returns_the_last_iterate():
    seen = []

    def stop(progress):
        seen.append(progress.iteration)
        if progress.iteration == 4:
            raise KeyboardInterrupt

    solution = Solver(transcribe(records.van_der_pol(), 50)).solve(progress=stop)
    assert (solution.status, solution.success) == ("interrupted", False)
    assert seen == [0, 1, 2, 3, 4]
    assert np.isfinite(solution.variables).all()


def test_control_c_during_a_solve_is_an_interrupt():
    solver = Solver(transcribe(records.van_der_pol(), 400, points=5))
    threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()
    solution = solver.solve(progress=lambda _: time.sleep(0.02))
    assert solution.status == "interrupted"
    assert solver.solve().success  # the prepared solver is as good as new


def test_other_errors_of_the_progress_function_are_raised():
    def fail(_):
        raise ZeroDivisionError("on purpose")

    with pytest.raises(ZeroDivisionError, match="on purpose"):
        Solver(transcribe(records.van_der_pol(), 10)).solve(progress=fail)


def test_mistakes_in_a_record_are_named():
    problem = records.double_integrator()
    x = problem.states[0].symbol
    with pytest.raises(ValueError, match="objective contains x, unknown there; a signal is used at a time"):
        replace(problem, objective=x)
    with pytest.raises(ValueError, match="1 derivatives for the states, expected 2"):
        replace(problem, ode=x)
    with pytest.raises(ValueError, match="two variables are called 'x'"):
        replace(problem, states=(problem.states[0], problem.states[0]))
    with pytest.raises(ValueError, match=r"x: min 2\.0 and max 1\.0 leave no value"):
        replace(problem, states=(replace(problem.states[0], min=2.0, max=1.0), problem.states[1]))
    with pytest.raises(ValueError, match="'w' is no input; inputs are u"):
        transcribe(problem, 5, controls={"w": Pieces("constant")})
    with pytest.raises(ValueError, match="first guess of x: found nan"):
        Solver(transcribe(problem, 5)).solve(guess={"x": np.nan})
    with pytest.raises(ValueError, match="'distance' is no parameter of the problem; parameters are none"):
        Solver(transcribe(problem, 5)).solve({"distance": 2.0})
