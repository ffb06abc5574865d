"""Whether an answer is a minimum, against dense linear algebra and exact solutions; maxima and saddles are left."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gantrytau import Fixed, Input, Model, Parameter, Real, between, cos, der, sin
from gantrytau_optimica import Free, Optimization, final, load_optimum, optimize, prepare
from gantrytau_optimica.solving.curvature import least_curvature
from gantrytau_optimica.solving.ipopt import objective_size
from tests.families import NIGHTLY
from tests.optimica.problems import Mass

N, ROWS = 6, 2


class Quadratic(Optimization):
    """The least of x' Q x / 2 + c x with A x = 0."""

    Q = Parameter(np.eye(N))
    c = Parameter(np.ones(N))
    A = Parameter(np.ones((ROWS, N)))
    x: Any = Free(np.zeros(N), min=-1.0, max=1.0)

    def objective(self):
        x = [self.x[k] for k in range(N)]
        square = sum(self.Q[i, j] * x[i] * x[j] for i in range(N) for j in range(N))
        return square / 2 + sum(self.c[k] * x[k] for k in range(N))

    def constraints(self):
        for i in range(ROWS):
            yield sum(self.A[i, k] * self.x[k] for k in range(N)) == 0


def drawn(random, wanted):
    """Matrices whose curvatures along A x = 0 are `wanted`, and the null space of A."""
    rows = random.normal(size=(ROWS, N))
    null = np.linalg.svd(rows)[2][ROWS:].T
    turned = np.linalg.qr(random.normal(size=(wanted.size, wanted.size)))[0]
    whole = random.normal(size=(N, N))
    inside = null @ turned @ np.diag(wanted) @ turned.T @ null.T
    beside = np.eye(N) - null @ null.T
    return inside + beside @ (whole + whole.T) + (whole + whole.T) @ beside, rows, null


@pytest.mark.parametrize("kind", ["up", "down", "flat", "any"])
def test_random_quadratics(kind):
    random = np.random.default_rng(["up", "down", "flat", "any"].index(kind))
    prepared = prepare(Quadratic, parameters=["Q", "A", "c"])
    for _ in range(50 if NIGHTLY else 15):
        wanted = random.uniform(0.1, 3.0, N - ROWS)
        if kind == "down":
            wanted *= -1
        if kind == "flat":
            wanted[random.integers(N - ROWS)] = 0.0
        if kind == "any":
            wanted *= random.choice([-1.0, 1.0], N - ROWS)
        Q, A, null = drawn(random, wanted)
        np.testing.assert_allclose(np.linalg.eigvalsh(null.T @ Q @ null), np.sort(wanted), atol=1e-12)
        found = prepared.solve({"Q": Q, "A": A, "c": np.zeros(N)})  # from a place without slopes
        x = np.array([found.free[f"x[{k}]"] for k in range(N)])
        assert np.max(np.abs(A @ x)) < 1e-7
        if np.min(wanted) < 0:  # to a corner, where the curvature along the sides that bind is not negative
            assert found.left >= 1
            assert found.objective < -1e-2
            held = np.eye(N)[np.abs(x) > 1 - 1e-4]
            rank = np.linalg.matrix_rank(np.vstack([A, held]))
            inside = np.linalg.svd(np.vstack([A, held]))[2][rank:].T
            assert np.all(np.linalg.eigvalsh(inside.T @ Q @ inside) > -1e-6)
            assert found.second_order.verdict in ("minimum", "flat")
            continue
        assert found.left == 0
        assert found.second_order.verdict == ("flat" if kind == "flat" else "minimum")
        assert found.second_order.flat == np.sum(wanted == 0)
        # equations give by 1e-7 of their sizes, limits by the last barrier
        size = objective_size(found.program)
        assert found.second_order.curvature * size == pytest.approx(np.min(wanted), abs=1e-4)


@pytest.mark.parametrize("factor", [1e-9, 1.0, 1e9])
def test_the_unit_of_the_objective_does_not_matter(factor):
    class Hills(Optimization):
        x, y = Free(0.5), Free(0.0)

        def objective(self):
            return factor * ((self.x**2 - 1) ** 2 + (self.y**2 - 1) ** 2)

    found = optimize(Hills)
    assert found.left == 1
    assert abs(found.free["y"]) == pytest.approx(1.0, abs=1e-4)
    assert found.second_order.verdict == "minimum"
    assert "1 left on the way, where it fell to both sides." in found.report()


class Boat(Model):
    """Goes anywhere with speed 1 at most in each direction."""

    x = Real(start=0.0, fixed=True)
    y = Real(start=0.0, fixed=True)
    ux = Input(min=-1.0, max=1.0)
    uy = Input(min=-1.0, max=1.0)

    def equations(self):
        yield der(self.x) == self.ux
        yield der(self.y) == self.uy


class HeadOn(Optimization):
    """Around a disk of radius 1 that stands in the middle of the way, with a speed of 1."""

    boat = Boat()
    final_time = Free(4.0, min=0.1, max=50.0)

    def objective(self):
        return self.final_time

    def constraints(self):
        yield (self.boat.x - 2) ** 2 + self.boat.y**2 >= 1
        yield self.boat.ux**2 + self.boat.uy**2 <= 1
        yield final(self.boat.x) == 4
        yield final(self.boat.y) == 0


def test_an_obstacle_met_head_on_is_passed():
    found = optimize(HeadOn, elements=100)
    # two tangents and the arc between: cos(a) = 1/2 where they touch
    exact = 2 * np.sqrt(3.0) + np.pi / 3
    assert found.objective == pytest.approx(exact, rel=1e-3)  # corners of the speed within elements
    assert found.iterations < 100
    assert np.max(np.abs(found["boat.y"])) == pytest.approx(1.0, abs=1e-3)


def test_an_obstacle_beside_the_way_is_none():
    class Free_(HeadOn):
        def constraints(self):
            yield (self.boat.x - 2) ** 2 + (self.boat.y - 3) ** 2 >= 1
            yield from list(super().constraints())[1:]

    found = optimize(Free_, elements=20)
    assert found.objective == pytest.approx(4.0, abs=1e-6)
    assert np.max(np.abs(found["boat.y"])) < 1e-6


class Inverted(Optimization):
    """A pendulum that stands upright, phi = 0, and is to hang as low as it can, without a push."""

    phi = Real(start=0.0, fixed=True)
    w = Real(start=0.0, fixed=True)
    u = Input(min=-0.1, max=0.1)
    final_time = 3.0

    def equations(self):
        yield der(self.phi) == self.w
        yield der(self.w) == sin(self.phi) + self.u

    def integrand(self):
        return cos(self.phi)


def test_a_pendulum_that_stands_falls():
    found = optimize(Inverted, elements=30)
    assert found.left == 1
    assert found.success
    assert np.max(np.abs(found["phi"])) > 0.5
    # to one side with all there is, as nothing else is faster
    assert np.min(np.abs(found["u"][1:])) == pytest.approx(0.1, abs=1e-3)


class Moved(Optimization):
    """1 m from rest to rest."""

    mass: Any = Mass(x=Fixed(0.0), v=Fixed(0.0), u=dict(min=-1.0, max=1.0))
    final_time: Any = Free(1.5, min=0.1)
    share = Parameter(1.0)

    def objective(self):
        return self.share * self.final_time

    def constraints(self):
        yield final(self.mass.x) == 1
        yield final(self.mass.v) == 0


def test_of_least_time_nothing_is_free():
    found = optimize(Moved, elements=20)  # a border at the switch
    assert found.second_order.verdict == "minimum"
    assert "A minimum: conditions and limits leave nothing free." in found.report()


def test_what_does_not_matter_is_flat():
    class Two(Moved):
        other = Mass(x=Fixed(0.0), v=Fixed(0.0))
        slack = Free(0.3, min=0.0, max=1.0)

        def constraints(self):
            yield from super().constraints()
            yield between(-1, self.other.u, 1)

    found = optimize(Two, elements=10, points=2)
    assert found.second_order.verdict == "flat"
    assert found.second_order.flat == 21  # one of each force at a point, and the number
    assert re.search(
        r"A minimum, but not the only one: flat \(within 1e-04\) in 21 directions", found.report()
    )


def test_the_least_curvature_of_a_motion():
    class Effort(Optimization):
        mass = Mass(x=Fixed(0.0), v=Fixed(0.0))
        final_time = 1.0

        def integrand(self):
            return self.mass.u**2

        def constraints(self):
            yield final(self.mass.x) == 1
            yield final(self.mass.v) == 0

    curvatures = []
    for elements in (20, 40):
        found = optimize(Effort, elements=elements)
        assert found.second_order.verdict == "minimum"
        curvatures.append(found.second_order.curvature)
    # d' M d counts u, x and v, of which the last two grow with u: nearly the same on every mesh
    assert curvatures[0] == pytest.approx(curvatures[1], rel=0.1)


def test_a_place_that_cannot_be_left_is_told():
    prepared = prepare(Column, max_iterations=5)
    first = prepared.solve()
    assert first.status.startswith("stationary but no minimum")
    assert first.second_order.verdict == "saddle"
    assert re.search(r"No minimum: the objective falls to both sides .* most with bend", first.report())


class Column(Optimization):
    """Under nearly twice the load at which it buckles."""

    phi = Real(start=0.0, fixed=True)
    bend = Input()
    final_time = 1.0

    def equations(self):
        yield der(self.phi) == self.bend

    def integrand(self):
        return self.bend**2 / 2 + 4.6 * (cos(self.phi) - 1)


def test_phases_have_one_verdict():
    class Both(Optimization):
        one = Column()
        other = Column()

        def objective(self):
            return 0

    found = optimize(Both, elements=10)
    assert found.left == 1  # both at once
    assert found.second_order.verdict == "minimum"
    assert min(np.max(np.abs(found[f"{n}.phi"])) for n in ("one", "other")) > 0.5


def test_it_is_told_of_saved_answers(tmp_path):
    found = optimize(Moved, elements=20)
    found.save(tmp_path / "move.optimum")
    assert str(found.second_order) in load_optimum(tmp_path / "move.optimum").report()


def test_what_was_not_solved_has_no_curvature():
    found = optimize(Moved, elements=20)
    lost = replace(found, solution=replace(found.solution, success=False))
    assert lost.second_order.verdict == "not known"
    assert "not known" in str(lost.second_order)
    assert least_curvature(found.program, found.solution).known
