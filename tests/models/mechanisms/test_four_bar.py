"""The four-bar linkage built from plain revolutes, against one crank angle and Lagrange, and the forces in its pins."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from gantrytau import InitializationError, ModelError, SolveError, Start, simulate, translate
from gantrytau_models.mechanisms.planar.four_bar import FourBar
from tests.families import first_of
from tests.references import four_bar
from tests.references.rotations import random_rotation

RATES = ["der(crank.w)", "der(coupler.w)", "der(rocker.w)"]
TURNED = random_rotation(np.random.default_rng(3))
PLANES = {  # normal, direction of the pivots
    "upright": ([0.0, -1.0, 0.0], [1.0, 0.0, 0.0]),
    "level": ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0]),
    "tilted": ([1.0, 2.0, 3.0], [1.0, 0.0, 0.0]),
    "upside down": ([1.0, 0.0, 1.0], [0.0, -2.0, 0.0]),
    "random": (list(TURNED[:, 2]), list(TURNED[:, 0])),
}
BRANCH = {1: {}, -1: dict(rocker=Start(-1.0))}


def axes(n, e):
    """Plane axes (x, y, normal) in columns, resolved in the world, (3, 3)."""
    y = np.cross(n, e)
    x = np.cross(y, n)
    return np.array([side / np.linalg.norm(side) for side in (x, y, np.array(n))]).T


def linkage(bars, n, e, **starts):
    """The model with the numbers of the reference; starts: of the angles, by bar."""
    parts = [
        dict(length=length, m=m, r_cm=[*centre, 0.0], J=np.diag([0.4, 0.8, 1.0]) * J)
        for length, m, centre, J in zip(bars.lengths, bars.masses, bars.centres, bars.inertias, strict=True)
    ]
    for name, start in starts.items():
        parts[("crank", "coupler", "rocker").index(name)]["phi"] = start
    return FourBar(bars.ground, *parts, n=n, e=e)


def in_plane(bars, n, e):
    """The reference with gravity as it acts in the plane."""
    return replace(bars, gravity=four_bar.gravity_in_plane(axes(n, e)))


def compare(dae, bars, branch, count=8, seed=0):
    """Accelerations and pin forces at random states of the crank; those out of reach are left out."""
    random = np.random.default_rng(seed)
    for theta, w, torque in random.uniform([-np.pi, -5, -9], [np.pi, 5, 9], (count, 3)):
        expected, pins = four_bar.accelerations_with_reactions(bars, theta, w, torque, branch)
        at = dae.evaluate({"crank.phi": theta, "crank.w": w, "torque": torque})
        found = np.array([at[name] for name in RATES])
        assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()
        yield at, pins


@pytest.mark.parametrize(
    ("plane", "branch"), first_of([("random", 1), ("upright", -1), *product(PLANES, (1, -1))], 2)
)
def test_accelerations_and_pin_forces_in_any_plane(plane, branch):
    n, e = PLANES[plane]
    bars = in_plane(four_bar.example(), n, e)
    dae = translate(linkage(bars, n, e, **BRANCH[branch]), find=RATES)
    assert dae.diagnosis.mobility == 1
    assert dae.states == ("crank.phi", "crank.w")
    # one shift along the normal, two rotations out of the plane
    words = [name.rpartition(", ")[2].split()[0] for name in dae.diagnosis.redundant]
    assert sorted(words) == ["orientation", "orientation", "position"]
    for at, pins in compare(dae, bars, branch):
        forces = [-at[f"{pin}.frame_b.f"] for pin in ("crank_pivot", "rocker_pivot")]  # on the bars
        onto = axes(n, e)[:, :2].T @ np.array(forces).T
        expected = pins[[0, 3]].T
        assert np.abs(onto - expected).max() < 1e-10 * np.abs(expected).max()


def test_functions_stay_on_the_branch_near_the_start():
    n, e = PLANES["upright"]
    bars = in_plane(four_bar.example(), n, e)
    for branch, start in BRANCH.items():
        dae = translate(linkage(bars, n, e, **start))
        here = dae.evaluate()["crank.phi"]
        angles = dae.function(["crank.phi"], ["coupler.phi", "rocker.phi"])
        for theta in np.linspace(here - 0.3, here + 0.3, 7):  # found by iteration from the start
            expected = four_bar.loop(bars, theta, branch).angles[1:]
            found = np.array([float(x) for x in angles(theta)])
            away = (found - expected + np.pi) % (2 * np.pi) - np.pi
            assert np.abs(away).max() < 1e-12


def test_energy_grows_by_the_work_of_the_torque():
    n, e = PLANES["tilted"]
    bars = in_plane(four_bar.example(), n, e)
    model = linkage(bars, n, e)
    model = FourBar(**{**model.modifications, "crank": {**model.modifications["crank"], "w": Start(12.0)}})
    motion = simulate(model, stop=2.0, inputs={"torque": 3.0}, tolerance=1e-10)
    theta, w = motion["crank.phi"], motion["crank.w"]
    energy = [four_bar.energy(bars, *now) for now in zip(theta, w, strict=True)]
    balance = energy - 3.0 * theta
    assert np.ptp(theta) > 2 * np.pi  # all round
    assert np.ptp(balance) < 1e-6 * np.ptp(energy)  # ten thousand times the integrator's tolerance


SWINGING = 2 * 2.0 * 0.25 / 3 + 1.0 * 0.25  # kg.m2, two slender bars and the coupler at their ends
MOMENT = (2 * 2.0 / 2 + 1.0) * 0.5 * 9.81  # N.m, of their weight when they are level


def parallelogram(start, **crank):
    """Crank and rocker alike, coupler like the ground; hangs down."""
    return FourBar(0.8, dict(length=0.5, m=2.0, phi=Start(start), **crank), 0.8, dict(length=0.5, m=2.0))


def test_parallelogram_swings_as_a_pendulum():
    dae = translate(parallelogram(-0.7))
    assert len(dae.diagnosis.redundant) == 3
    motion = simulate(dae, stop=5.0, tolerance=1e-10)
    np.testing.assert_allclose(motion["rocker.phi"], motion["crank.phi"], rtol=0, atol=1e-9)
    np.testing.assert_allclose(motion["coupler.phi"], 0.0, atol=1e-9)  # ten times the integrator's tolerance
    swing = solve_ivp(
        lambda t, y: [y[1], -MOMENT * np.cos(y[0]) / SWINGING],
        (0.0, 5.0), [-0.7, 0.0], method="DOP853", rtol=1e-12, atol=1e-12, t_eval=motion.time,
    )  # fmt: skip
    np.testing.assert_allclose(
        motion["crank.phi"], swing.y[0], atol=1e-6
    )  # tolerance times a growing phase error


def test_flat_parallelogram_is_told_as_singular():
    """Where all bars lie in one line the parallelogram may turn into its crossed form."""
    kicked = parallelogram(-0.7, w=Start(8.0))
    with pytest.raises(SolveError, match="FourBar: the motion meets a singular pose") as raised:
        simulate(kicked, stop=1.0, tolerance=1e-9)
    swing = solve_ivp(
        lambda t, y: [y[1], -MOMENT * np.cos(y[0]) / SWINGING], (0.0, 1.0), [-0.7, 8.0],
        rtol=1e-10, atol=1e-10, dense_output=True,
    ).sol  # fmt: skip
    flat = brentq(lambda t: swing(t)[0], 0.0, 0.2)  # the crank along the ground
    assert raised.value.time == pytest.approx(flat, abs=1e-3)  # s; one step of the output, 2 ms, halved
    before = raised.value.result
    np.testing.assert_allclose(before["rocker.phi"], before["crank.phi"], rtol=0, atol=1e-6)


@pytest.mark.parametrize("start", [-2.0, 0.3, 7.0])
def test_parallelogram_starts_parallel(start):
    at = translate(parallelogram(start)).evaluate()
    assert at["crank.phi"] == pytest.approx(start, abs=1e-12)
    assert at["rocker.phi"] == pytest.approx(start, abs=1e-12)


def test_crossed_parallelogram_is_another_branch():
    crossed = FourBar(0.8, dict(length=0.5, phi=Start(1.0)), 0.8, dict(length=0.5, phi=Start(-2.0)))
    bars = replace(four_bar.example(), ground=0.8, lengths=np.array([0.5, 0.8, 0.5]))
    at = translate(crossed).evaluate({"crank.phi": 1.2})
    assert at["rocker.phi"] == pytest.approx(four_bar.loop(bars, 1.2, -1).angles[2], abs=1e-12)


@pytest.mark.parametrize(
    ("ground", "lengths", "theta"),
    [
        (1.0, [0.6, 0.4, 0.6], 1.0471975511965976),  # trapezium in its symmetric pose, cos = 1/2
        (1.0, [1.0, 1.0, 1.0], np.pi / 2),  # square
        (1.0, [1.0, 1.0, 1.0], 0.8),  # rhombus
        (1.0, [0.5, 1.0, 0.5], np.pi / 2),  # rectangle
    ],
)
@pytest.mark.parametrize("plane", first_of(["tilted", "upright"]))
def test_symmetric_geometry(ground, lengths, theta, plane):
    lengths = np.array(lengths)
    n, e = PLANES[plane]
    bars = four_bar.FourBar(
        ground, lengths, np.ones(3), np.outer(lengths / 2, [1.0, 0.0]), lengths**2 / 12, np.zeros(2)
    )
    bars = in_plane(bars, n, e)
    dae = translate(linkage(bars, n, e, crank=Start(theta)), find=RATES)
    assert len(dae.diagnosis.redundant) == 3
    at = dae.evaluate({"crank.phi": theta, "crank.w": 1.5, "torque": 2.0})
    expected = four_bar.accelerations(bars, theta, 1.5, 2.0)
    assert np.abs([at[name] for name in RATES] - expected).max() < 1e-10 * np.abs(expected).max()


def test_default_bars_are_slender():
    at = translate(FourBar(crank=dict(length=0.3, m=2.0), rocker=dict(length=0.6, m=0.5))).evaluate()
    assert at["crank.J"] == pytest.approx(np.diag([0.0, 1.0, 1.0]) * 2.0 * 0.09 / 12)
    assert at["rocker.r_cm"] == pytest.approx([0.3, 0.0, 0.0])


def test_lengths_that_cannot_close_are_refused():
    words = "FourBar: found rocker = 2.4 m, expected less than 2.2 m, the other three lengths together"
    with pytest.raises(ModelError, match=words):
        FourBar(rocker=2.4)
    with pytest.raises(ModelError, match=r"found ground = 3 m, expected less than 1.8 m"):
        FourBar(3.0, crank=dict(length=0.3))
    # parameters that change later are met by the loop itself
    with pytest.raises(InitializationError, match=r"the loop through rocker.rod, .* stays open"):
        simulate(FourBar(), stop=0.1, parameters={"rocker.length": 2.4})


def test_a_crank_angle_out_of_reach_is_refused():
    model = FourBar(1.0, 0.9, 0.5, 0.5)  # a double rocker: the crank does not go round
    with pytest.raises(InitializationError, match="is off by"):
        translate(model).evaluate({"crank.phi": 2.5})


@pytest.mark.parametrize(
    ("n", "e"), [([1.0, 0.0, 0.0], [-2.0, 0.0, 0.0]), ([0.0, 0.0, 0.0], [1.0, 0.0, 0.0])]
)
def test_directions_that_span_no_plane_are_refused(n, e):
    with pytest.raises(ModelError, match="expected vectors that are not zero and not parallel"):
        FourBar(n=n, e=e)
