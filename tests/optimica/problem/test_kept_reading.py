"""What was read of a problem, kept for a call that says the same."""

import gc
import weakref
from typing import Any

from gantrytau import Input, Model, Parameter, Real, between, der
from gantrytau_optimica import Free, Optimization, final, initial, optimize, prepare
from gantrytau_optimica.problem.kept_reading import MOST
from gantrytau_optimica.problem.read_problem import read_problem
from gantrytau_optimica.transcription.assemble import Assembled


class Mass(Model):
    x = Real(unit="m", start=0.0, description="place")
    v = Real(unit="m/s", start=0.0, description="speed")
    u = Input(unit="N", description="force")
    m = Parameter(1.0, unit="kg", description="mass")

    def equations(self):
        yield der(self.x) == self.v
        yield self.m * der(self.v) == self.u


def moved(limits: list[float]) -> type[Optimization]:
    """A mass moved by 1 m, with a limit of its force that is read anew in each call."""

    class Moved(Optimization):
        mass = Mass()
        final_time = Free(1.0, unit="s", min=0.1, max=20.0)

        def objective(self):
            return self.final_time

        def constraints(self):
            yield initial(self.mass.x) == 0.0
            yield initial(self.mass.v) == 0.0
            yield final(self.mass.x) == 1.0
            yield final(self.mass.v) == 0.0
            yield between(-limits[0], self.mass.u, limits[0])

    return Moved


def test_a_model_is_translated_anew_only_where_the_problem_says_something_else():
    limits = [1.0]
    problem = moved(limits)
    first = read_problem(problem)
    assert read_problem(problem).dae is first.dae
    assert read_problem(problem(mass=Mass(m=2.0))).dae is not first.dae
    limits[0] = 4.0
    assert read_problem(problem).dae is not first.dae


def test_the_fastest_motion_follows_a_limit_that_changes():
    limits = [1.0]
    problem = moved(limits)
    for limit, time in ((1.0, 2.0), (1.0, 2.0), (4.0, 1.0)):  # s, 2 sqrt(distance * mass / force)
        limits[0] = limit
        assert abs(optimize(problem, elements=4).final_time - time) < 1e-6


def test_a_program_is_made_anew_for_another_mesh_method_or_form_and_for_kernels_that_are_awaited(monkeypatch):
    problem = moved([1.0])

    def made(**policy: Any) -> Assembled:
        return prepare(problem, **policy).program.assembled

    first = made(elements=4)
    assert made(elements=[1, 1, 1, 1]) is first
    others = dict(elements=5), dict(points=2), dict(scheme="gauss"), dict(lengths="free"), dict(refine=1e-4)
    for other in (*others, dict(compile=False), dict(controls={"mass.u": dict(kind="constant")})):
        assert made(**{"elements": 4, **other}) is not made(elements=4)
    last = made(elements=4)
    assert made(elements=4) is last
    monkeypatch.setattr(Assembled, "awaited", True)
    assert made(elements=4) is not last


def test_few_problems_are_kept():
    kept = weakref.ref(read_problem(moved([1.0])).dae)
    for number in range(MOST):
        read_problem(moved([2.0 + number]))
    gc.collect()
    assert kept() is None
