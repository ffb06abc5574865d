"""Where a parallelogram falls flat it can go on as one or crossed: no output grid lets a simulation step over it."""

from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from gantrytau import Dae, SolveError, Start, simulate, translate
from gantrytau.simulation.full_coordinates import Coordinates
from gantrytau.simulation.singular_poses import Look, approach, doubtful
from gantrytau_models import FourBar

POINTS = (51, 101, 251, 252, 333, 1001, 2001)
R, GROUND, GRAVITY = 0.3, 1.0, 9.81  # m, m, m/s2; all bars weigh 1 kg
SWINGING = (
    2 * R**2 / 3 + R**2
)  # kg.m2: crank and rocker turn about their ends, the coupler is carried in a circle
MOMENT = 2 * GRAVITY * R  # N.m when flat
CLOSE = 1e-4  # s; the time is found by a straight line over the last thousandth of the distance


@cache
def parallelogram(phi: float, w: float, coupler: float = GROUND) -> Dae:
    return translate(FourBar(GROUND, dict(length=R, phi=Start(phi), w=Start(w)), coupler, R))


@cache
def at_rest() -> Dae:
    """With the starts that the linkage has by itself."""
    return translate(FourBar(1.0, 0.3, 1.0, 0.3))


def flat(phi: float, w: float, torque: float, stop: float = 1.0) -> float:
    """When the crank lies along the ground, s: a pendulum of one coordinate, integrated apart; NaN: not before the end."""
    swing = solve_ivp(
        lambda t, y: [y[1], (torque - MOMENT * np.cos(y[0])) / SWINGING], (0.0, stop), [phi, w],
        method="DOP853", rtol=1e-11, atol=1e-11, dense_output=True,
    ).sol  # fmt: skip
    t = np.linspace(0.0, stop, 4001)
    side = np.sin(swing(t)[0])
    (passed,) = np.nonzero(side[:-1] * side[1:] < 0)
    if not passed.size:
        return np.nan
    root: Any = brentq(lambda s: np.sin(swing(s)[0]), t[passed[0]], t[passed[0] + 1])
    return root


def until_singular(model: Dae, **settings: Any):
    """The motion, and the time of the singular pose that ends it, NaN without one."""
    try:
        return simulate(model, **settings), np.nan
    except SolveError as error:
        return error.result, error.time


@pytest.mark.parametrize("points", POINTS[1::3])
def test_every_grid_stops_at_the_flat_pose(points):
    with pytest.raises(SolveError, match="singular pose") as caught:
        simulate(at_rest(), stop=1.0, points=points)
    error = caught.value
    assert error.time == pytest.approx(flat(1.0, 0.0, 0.0), abs=CLOSE)
    motion = error.result
    assert error.time - 1.0 / (points - 1) - CLOSE < motion.time[-1] < error.time
    np.testing.assert_allclose(motion["rocker.phi"], motion["crank.phi"], rtol=0, atol=1e-6)


@pytest.mark.parametrize("stop", [0.29, 5.0, 100.0])
def test_the_length_of_the_simulation_moves_nothing(stop):
    with pytest.raises(SolveError, match="singular pose") as caught:
        simulate(at_rest(), stop=stop, points=51)
    assert caught.value.time == pytest.approx(flat(1.0, 0.0, 0.0), abs=CLOSE)


def test_starts_and_torques_at_random():
    random = np.random.default_rng(11)
    met = 0
    for points in POINTS:
        phi, w, torque = random.uniform([0.2, -10.0, -20.0], [2.9, 10.0, 20.0])
        expected = flat(phi, w, torque)
        motion, time = until_singular(
            parallelogram(phi, w), stop=1.0, points=points, inputs={"torque": torque}
        )
        assert time == pytest.approx(expected, abs=CLOSE, nan_ok=True)
        met += not np.isnan(time)
        np.testing.assert_allclose(motion["rocker.phi"], motion["crank.phi"], rtol=0, atol=1e-6)
    assert met > 4


def test_samples_at_irregular_times():
    """The mesh has their times too: intervals of all lengths."""
    random, dae = np.random.default_rng(5), at_rest()
    for count, torque in zip((3, 40, 400), (0.0, -2.0, 3.0), strict=True):
        times = np.concatenate([[0.0], np.sort(random.uniform(0.0, 1.0, count)), [1.0]])
        with pytest.raises(SolveError, match="singular pose") as caught:
            simulate(dae, stop=1.0, points=57, inputs={"torque": (times, np.full(times.size, torque))})
        assert caught.value.time == pytest.approx(flat(1.0, 0.0, torque), abs=CLOSE)


@pytest.mark.parametrize("turn", [-0.2, -0.05, -0.02])
@pytest.mark.parametrize("points", [51, 251, 1001])
def test_a_swing_that_turns_before_it_is_flat_goes_on(turn, points):
    start = -0.7
    speed = np.sqrt(2 * MOMENT * (np.sin(turn) - np.sin(start)) / SWINGING)  # energy, at rest at the turn
    motion = simulate(parallelogram(start, speed), stop=2.0, points=points)
    times = np.linspace(0.0, 2.0, points)
    swing = solve_ivp(
        lambda t, y: [y[1], -MOMENT * np.cos(y[0]) / SWINGING], (0.0, 2.0), [start, speed],
        method="DOP853", rtol=1e-11, atol=1e-11, t_eval=times,
    )  # fmt: skip
    np.testing.assert_allclose(motion["crank.phi"], swing.y[0], atol=1e-6)  # tolerance times a phase error
    np.testing.assert_allclose(motion["rocker.phi"], motion["crank.phi"], rtol=0, atol=1e-6)


def energy(motion, coupler: float) -> np.ndarray:
    """Kinetic and potential energy of three slender bars, J, from the angles and speeds of the motion."""
    total = np.zeros(motion.time.size)
    corner = velocity = np.zeros((2, 1))
    for name, length in (("crank", R), ("coupler", coupler), ("rocker", R)):
        phi, w = motion[f"{name}.phi"], motion[f"{name}.w"]
        along, across = np.array([np.cos(phi), np.sin(phi)]), w * np.array([-np.sin(phi), np.cos(phi)])
        if name == "rocker":  # on its own pivot
            corner = velocity = np.zeros((2, 1))
        v = velocity + length / 2 * across
        total += (v * v).sum(axis=0) / 2 + length**2 / 24 * w**2 + GRAVITY * (corner + length / 2 * along)[1]
        corner, velocity = corner + length * along, velocity + length * across
    return total


@pytest.mark.parametrize("coupler", [1.01, 1.001, 0.9999])
def test_bars_that_only_nearly_fall_flat_pass(coupler):
    """No ways to assemble cross, however near they come; a jump to the other one would not keep the energy."""
    for points in (51, 251, 1001):
        motion = simulate(parallelogram(1.0, 0.0, coupler), stop=1.0, points=points)
        found = energy(motion, coupler)
        # a thousandfold of the tolerance: next to the pose speeds change a hundred times as fast
        assert np.ptp(found) < 1e-5 * MOMENT


def walk(distance, point: float, end: float, last: float = np.inf):
    """The walk along a line of given distances from a singular pose; there are no points behind `last`."""

    def step(at, length):
        if at[2] + length > last:
            raise RuntimeError("no solution")
        return np.zeros(0), np.zeros(0), at[2] + length, np.zeros(0)

    def look(at):
        return Look(np.ones(1), np.array([distance(at[2])]), np.ones(1, dtype=bool))

    return approach((np.zeros(0), np.zeros(0), point, np.zeros(0)), end, step, look)


@pytest.mark.parametrize("zero", [0.001, 0.04, 0.5, 0.999])
def test_a_walk_ends_before_the_distance_is_zero(zero):
    found = walk(lambda t: 3 * abs(t - zero), 0.0, 1.0)
    assert found.singular
    assert found.point[2] < zero
    assert found.zero == pytest.approx(zero, abs=1e-9)  # the fall is straight


@pytest.mark.parametrize("least", [2e-3, 0.02, 0.5])
def test_a_walk_that_turns_arrives(least):
    found = walk(lambda t: np.hypot(least, 3 * (t - 0.4)), 0.0, 1.0)
    assert found.arrived
    assert not found.singular
    assert found.point[2] == pytest.approx(1.0, abs=1e-12)


def test_a_walk_that_cannot_go_on_is_no_singular_pose():
    found = walk(lambda t: 1.0 - 0.1 * t, 0.0, 1.0, last=0.3)
    assert not found.arrived
    assert not found.singular
    assert found.point[2] == pytest.approx(0.3, abs=2e-4)  # the shortest steps are 1/16384 of the way


def test_constraints_that_are_lost_end_the_motion_where_it_happens(monkeypatch):
    project = Coordinates.project

    def until(self, x, t, w):
        if t.max() > 0.1234:
            raise SolveError("lost")
        return project(self, x, t, w)

    monkeypatch.setattr(Coordinates, "project", until)
    with pytest.raises(SolveError, match=r"stopped at t = 0\.1234 s: the constraints cannot be") as caught:
        simulate(FourBar(), stop=1.0)
    assert caught.value.time == pytest.approx(0.1234, abs=1e-6)  # 2 ms in shortest steps
    assert caught.value.result.time[-1] == pytest.approx(0.122)  # the point before


def test_doubt_is_raised_from_both_sides_and_on_uneven_times():
    t = np.array([0.0, 0.1, 0.4, 0.5, 0.9, 1.0])
    for zero in (0.05, 0.39, 0.45, 0.6):
        distance = abs(t - zero)
        doubt = doubtful(t, Look(np.ones(t.size), distance, np.ones(t.size, dtype=bool)))
        assert doubt[np.searchsorted(t, zero) - 1]
    calm = Look(np.ones(t.size), 1.0 - 0.3 * t, np.ones(t.size, dtype=bool))
    assert not doubtful(t, calm).any()
