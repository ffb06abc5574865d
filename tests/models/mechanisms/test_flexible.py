"""The robot that gives way: its modes, its static stiffness, its energy, and its stiff limit."""

import re
from dataclasses import replace

import numpy as np
import pytest

from gantrytau import ModelError, linearize, simulate, translate
from gantrytau_models import FlexibleGantryTau, GantryTau, prototypes
from gantrytau_models.mechanisms.flexible import unstretched

RECORD = prototypes.L1_flexible
PLACE = np.array([0.9, 2.7, -0.7])
TOOL = [f"tool.{letter}[{k}]" for letter in "rv" for k in range(3)]
UNDAMPED = dict(frame=dict(d=0.0), arms=[dict(d=0.0)] * 3)


def locked(**modifications) -> np.ndarray:
    """State matrix of the tool, (6, 6), with carts and frame locked: positions in m, then speeds."""
    linear = linearize(FlexibleGantryTau(RECORD, friction=None, r=PLACE, **modifications))
    rows = [linear.states.index(name) for name in TOOL]
    return np.array(linear.A)[np.ix_(rows, rows)]


def test_modes_with_carts_and_frame_locked():
    poles = np.linalg.eigvals(locked())
    poles = poles[np.argsort(np.abs(poles))][::2]
    # calibrated to these; the figures are rounded to three digits at most
    assert np.abs(poles) / (2 * np.pi) == pytest.approx([10.3, 12.2, 78.0], rel=0.01)
    assert -poles.real / np.abs(poles) == pytest.approx(0.05, rel=0.2)  # what the record says of damping


def held(place, **modifications) -> np.ndarray:
    """Frequencies in Hz of the robot whose carts are held on the frame that sways, rising."""
    linear = linearize(FlexibleGantryTau(RECORD, friction=None, r=place, **modifications))
    A, B = np.array(linear.A), np.array(linear.B)
    speeds = [linear.states.index(f"carts[{k}].v") for k in range(3)]
    places = [linear.states.index(f"arms[{k}].rail.s") for k in range(3)]
    # forces by which no cart is accelerated along its guideway
    A = A - B @ np.linalg.solve(B[speeds], A[speeds])
    rest = np.setdiff1d(np.arange(len(A)), [*speeds, *places])
    return np.sort(np.abs(np.linalg.eigvals(A[np.ix_(rest, rest)])))[::2] / (2 * np.pi)


def test_held_carts_leave_the_sway_of_the_frame_and_the_modes_of_the_arms():
    frequencies = held(PLACE)
    assert frequencies == pytest.approx([7.4, 10.4, 12.2, 78.4], rel=0.01)
    # at no place do these springs have a second mode of the tool below 12.1 Hz: 1.8 kg more at the wrist
    # Table 6.4
    assert held([0.9, 3.2, -0.4], plate_mass=24.2)[:3] == pytest.approx([7.4, 10.5, 11.5], abs=0.3)


def test_the_point_at_rest_is_one():
    dae = translate(FlexibleGantryTau(RECORD, friction=None, r=PLACE))
    rest = {f"carts[{k}].s": float(s) for k, s in enumerate(unstretched(RECORD, PLACE))}
    point = linearize(dae, at=rest, steady=True).point
    forces = {f"carts[{k}].f": point[f"carts[{k}].f"] for k in range(3)}
    held = simulate(dae, stop=0.02, starts={name: point[name] for name in dae.states}, inputs=forces)
    assert np.ptp(held["tool.r"], axis=0) == pytest.approx(np.zeros(3), abs=1e-10)  # m, of a sag of 2 mm
    weight = sum(arm_force(point, k) for k in range(3))
    assert weight == pytest.approx([0, 0, 9.81 * RECORD.plate_mass], abs=1e-6)


def arm_force(point, k) -> np.ndarray:
    """Force of an arm on the tool, (3,) in N, from how much longer its rod is than its link."""
    rod = point["tool.r"] - point[f"arms[{k}].frame_cart.r"]
    length = np.linalg.norm(rod)
    return -RECORD.arm_stiffness[k] * (length - RECORD.arms[k].length) * rod / length


def test_static_stiffness_is_that_of_the_arms_seen_through_the_jacobian():
    h = 1e-5
    to_carts = np.column_stack([
        (unstretched(RECORD, PLACE + h * e) - unstretched(RECORD, PLACE - h * e)) / (2 * h) for e in np.eye(3)
    ])  # J^-1  # fmt: skip
    along = [
        np.dot(PLACE - arm.offset - s * np.array(arm.direction), arm.direction) / arm.length
        for arm, s in zip(RECORD.arms, unstretched(RECORD, PLACE), strict=True)
    ]
    at_carts = np.diag(np.array(RECORD.arm_stiffness) * np.square(along))  # along guideways, not along links
    stiffness = -RECORD.plate_mass * locked()[3:, :3]
    expected = to_carts.T @ at_carts @ to_carts
    # differences: h2 and 1e-16 / h
    assert stiffness == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())


def test_energy_is_kept_without_damping_and_friction():
    robot = FlexibleGantryTau(RECORD, friction=None, r=PLACE, **UNDAMPED)
    swing = simulate(robot, stop=0.3, tolerance=1e-9)
    moved = swing["tool.r"]
    kinetic = RECORD.plate_mass * np.sum(swing["tool.v"] ** 2, axis=1) / 2
    kinetic += RECORD.frame_mass * swing["frame.v"] ** 2 / 2
    fallen = RECORD.plate_mass * 9.81 * moved[:, 2]
    for i, mass in enumerate(RECORD.cart_masses):
        kinetic += mass * np.sum(swing[f"carts[{i}].body.v"] ** 2, axis=1) / 2
        fallen += mass * 9.81 * swing[f"carts[{i}].frame.r"][:, 2]
    elastic = RECORD.frame_stiffness * swing["frame.s"] ** 2 / 2
    elastic += sum(swing[f"arms[{i}].link.energy"] for i in range(3))
    energy = kinetic + fallen + elastic
    assert np.ptp(kinetic) > 1.0  # J: it does move
    # ten thousand times the integrator's tolerance, over 3 to 30 swings
    assert np.ptp(energy) < 1e-5 * np.ptp(kinetic)


def test_stiff_arms_and_frame_make_it_the_rigid_robot():
    push = {"carts[0].f": 60.0, "carts[1].f": -20.0, "carts[2].f": 40.0}

    def moved(robot, start):
        run = simulate(robot, stop=0.2, inputs=push, tolerance=1e-8)
        return run.final("tool.r") - start

    rigid = GantryTau(RECORD, friction=None, tool=dict(r=dict(start=PLACE.tolist())))
    exact = moved(rigid, PLACE)
    misses = []
    for factor in (30.0, 300.0):
        stiff = replace(
            RECORD,
            arm_stiffness=factor * np.array(RECORD.arm_stiffness),
            # damping with the root keeps the ratios, so that nothing rings
            arm_damping=10 * np.sqrt(factor) * np.array(RECORD.arm_damping),
            frame_stiffness=factor * RECORD.frame_stiffness,
            frame_damping=10 * np.sqrt(factor) * RECORD.frame_damping,
        )
        misses.append(np.linalg.norm(moved(FlexibleGantryTau(stiff, friction=None, r=PLACE), PLACE) - exact))
    assert np.linalg.norm(exact) > 0.01
    # links and feet are longer by force over stiffness, some 200 N over 1e8 N/m
    assert misses[1] < 1e-3 * np.linalg.norm(exact)
    assert misses[0] / misses[1] == pytest.approx(10.0, rel=0.3)  # first order in the compliance


def test_gauge_moves_by_the_lever_and_accelerometer_reads_acceleration():
    dae = translate(FlexibleGantryTau(RECORD, friction=None, r=PLACE))
    start = dae.evaluate({})
    assert start["gauge.r"] == pytest.approx(PLACE, abs=1e-12)
    # nothing is stretched yet: free fall
    assert start["accelerometer.a"] == pytest.approx([0.0, 0.0, -9.81], abs=1e-9)
    small = np.array([1e-6, 2e-6, -3e-6])
    there = dae.evaluate(dict(zip(TOOL[:3], PLACE + small, strict=True)))
    assert there["gauge.r"] - PLACE == pytest.approx(RECORD.lever * small, abs=1e-11)  # to first order
    pulled = there["accelerometer.a"] - start["accelerometer.a"]
    assert pulled == pytest.approx(locked()[3:, :3] @ small, rel=1e-4, abs=1e-6)


def test_wrong_record_and_place_out_of_reach():
    with pytest.raises(ModelError, match=r"found Prototype\(name='L1'\).*prototypes\.L1_flexible"):
        FlexibleGantryTau(prototypes.L1)  # type: ignore[arg-type]
    with pytest.raises(ModelError, match=r"link 1 of 2\.0608 m does not reach; expected a tool nearer"):
        FlexibleGantryTau(RECORD, r=(0.9, 9.0, -0.7))
    with pytest.raises(ModelError, match="FlexibleGantryTau: found r of 2"):
        FlexibleGantryTau(RECORD, r=(0.9, 2.7))


def test_record_says_calibrated_and_never_measured():
    assert "calibrated to Table 7.2" in RECORD.source
    assert not re.search("measured", RECORD.source)
    assert RECORD.cart_masses == prototypes.L1.cart_masses
    assert RECORD.arms == prototypes.L1.arms
