"""An iteration that takes its time does not hold up the end of time, Ctrl-C, or the next solve."""

import signal
import threading
import time
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from gantrytau_optimica import optimize, prepare
from gantrytau_optimica.solving.clock import Clock
from gantrytau_optimica.solving.interruptible import GRACE, attended
from gantrytau_optimica.solving.ipopt import Pressed, Solver
from gantrytau_optimica.transcription.program import first_guess
from tests.optimica.problems import FastestMass

BUSY = 1.0  # s, what a loaded machine may take to look again
STUCK = 8.0  # s, of the iteration that takes its time


class Slow(ca.Callback):
    """A Hessian that is given after STUCK seconds at one of its calls: an iteration between two looks at the clock."""

    def __init__(self, function: ca.Function, at: int):
        ca.Callback.__init__(self)
        self.function, self.at, self.calls = function, at, 0
        self.construct(function.name(), {})

    def get_n_in(self):
        return self.function.n_in()

    def get_n_out(self):
        return self.function.n_out()

    def get_name_in(self, i):
        return self.function.name_in(i)

    def get_name_out(self, i):
        return self.function.name_out(i)

    def get_sparsity_in(self, i):
        return self.function.sparsity_in(i)

    def get_sparsity_out(self, i):
        return self.function.sparsity_out(i)

    def eval(self, arg):
        self.calls += 1
        if self.calls == self.at:
            time.sleep(STUCK)
        return self.function.call(arg)


def solver_of(at: int, max_time: float, progress=None):
    """A program, and a solver of it whose iteration `at` takes its time."""
    prepared = prepare(FastestMass, elements=10)
    program = prepared.program
    assembled = replace(program.assembled)
    # in place of the one that it would make
    vars(assembled)["hess_lag"] = Slow(program.assembled.hess_lag, at)
    program = replace(program, assembled=assembled)
    settings = replace(prepared.solver.settings, max_time=max_time, progress=progress)
    return program, Solver(program, settings)


def timed(program, solver):
    begin = time.perf_counter()
    solution = solver.solve(program, first_guess(program))
    return solution, time.perf_counter() - begin


def test_time_ends_within_an_iteration_and_the_last_iterate_is_kept():
    seen = []
    program, solver = solver_of(4, 1.0, lambda iteration, objective: seen.append((iteration, objective)))
    solution, taken = timed(program, solver)
    assert taken < 1.0 + GRACE + BUSY
    assert (solution.success, solution.status) == (False, "time limit reached")
    assert solution.iterations == len(seen) > 1
    assert solution.objective == seen[-1][1]
    objective, rows = program.assembled.nlp(solution.w / program.places.scale, [])
    assert float(objective) == pytest.approx(solution.objective, rel=1e-12)
    assert np.allclose(np.array(rows).ravel(), solution.constraints, rtol=0, atol=1e-12)
    assert solution.multipliers.shape == (program.assembled.rows,)


def test_a_solver_that_was_left_solves_again_as_if_nothing_had_been():
    program, solver = solver_of(4, 1.0)
    solution, _ = timed(program, solver)
    assert not solution.success
    again, _ = timed(program, Solver(program, replace(solver.settings, max_time=60.0)))
    same, _ = timed(program, replaced(solver, 60.0))
    plain = optimize(FastestMass, elements=10)
    assert again.success
    assert same.success
    assert same.objective == again.objective == pytest.approx(plain.objective, rel=1e-12)
    assert same.iterations == plain.iterations


def replaced(solver, max_time):
    """The same solver with more time."""
    solver.settings = replace(solver.settings, max_time=max_time)
    return solver


def test_the_first_iteration_takes_its_time():
    program, solver = solver_of(1, 0.5)
    solution, taken = timed(program, solver)
    assert taken < 0.5 + GRACE + BUSY
    assert (solution.success, solution.status) == (False, "time limit reached")
    assert np.all(np.isfinite(solution.w))


def test_ctrl_c_does_not_wait_for_an_iteration():
    program, solver = solver_of(4, 60.0)
    before = signal.getsignal(signal.SIGINT)
    timer = threading.Timer(1.0, signal.raise_signal, (signal.SIGINT,))
    timer.start()
    begin = time.perf_counter()
    with pytest.raises(Pressed) as caught:
        solver.solve(program, first_guess(program))
    timer.join()
    assert time.perf_counter() - begin < 1.0 + GRACE + 2 * BUSY
    assert caught.value.solution.status == "interrupted"
    assert caught.value.solution.iterations >= 1
    assert signal.getsignal(signal.SIGINT) is before


def test_progress_is_told_on_the_thread_of_the_caller():
    threads = set()
    program, solver = solver_of(10**6, 60.0, lambda *a: threads.add(threading.current_thread()))
    assert timed(program, solver)[0].success
    assert threads == {threading.current_thread()}


def test_what_progress_raises_comes_to_the_caller():
    def wrong(iteration, objective):
        raise ZeroDivisionError("of the one who is told")

    program, solver = solver_of(10**6, 60.0, wrong)
    with pytest.raises(ZeroDivisionError, match="of the one who is told"):
        timed(program, solver)


def test_what_a_solver_raises_comes_to_the_caller():
    program, solver = solver_of(10**6, 60.0)
    watch = solver.watched()
    watch.begin(Clock(60.0))
    with pytest.raises(Exception, match=r"shape|dimension|mismatch"):
        attended(solver.nlpsol, watch, dict(x0=np.zeros(program.places.size + 1)))
