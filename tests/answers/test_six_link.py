"""The six-link robot, whose plate is held by six links: its orientation follows from the constraints by iteration."""

import dataclasses

import numpy as np
import pytest

from gantrytau import extract_mechanism, linearize, translate
from gantrytau_models import GantryTau, prototypes
from gantrytau_models.mechanisms.six_link import SixLinkGantryTau

CARTS, SPEEDS, FORCES = ([f"carts[{i}].{letter}" for i in range(3)] for letter in "svf")
POSES = [[0.5, 3.0, -0.6], [0.85, 2.98, -0.63], [1.2, 2.7, -0.3]]
# the orientation is iterated to 1e-13, speeds and forces follow from it by linear equations; forces of the largest
NEAR = {"constraints": 1e-11, "speeds": 1e-10, "forces": 1e-9, "accelerations": 1e-9}
CHOSEN = dict(tool="tool.r", joints=CARTS, forces=FORCES)


def uneven():
    """L1 with one link 5 mm longer than its neighbour: the plate tilts as it moves."""
    first, second, third = prototypes.L1.arms
    links = (dataclasses.replace(second.links[0], length=second.links[0].length + 5e-3), *second.links[1:])
    return dataclasses.replace(prototypes.L1, arms=(first, dataclasses.replace(second, links=links), third))


@pytest.fixture(scope="module")
def tilting():
    return translate(SixLinkGantryTau(uneven()))


@pytest.fixture(scope="module")
def mechanism(tilting):
    return extract_mechanism(tilting, **CHOSEN)


def numbers(function, *arguments):
    return np.array(function(*arguments)).squeeze()


def test_parallel_links_are_the_three_link_robot():
    six = extract_mechanism(SixLinkGantryTau(prototypes.L1), **CHOSEN)
    masses = tuple(sum(link.mass for link in arm.links) for arm in prototypes.L1.arms)
    three = GantryTau(dataclasses.replace(prototypes.L1, link_masses=masses))
    carts = translate(three).function(["tool.r"], CARTS)
    peer = extract_mechanism(three, **CHOSEN)
    for pose in POSES:
        q = np.squeeze(np.array(carts(pose)))
        assert np.abs(numbers(six.constraints, pose, q)).max() < 1e-12
        for name in ("velocity_jacobian", "M1", "M2", "G"):
            expected = numbers(getattr(peer, name), pose, q)
            # the orientation is iterated to 1e-13, and inertias are ratios of forces
            off = np.abs(numbers(getattr(six, name), pose, q) - expected).max()
            assert off < 1e-10 * np.abs(expected).max()


def imbalance(dae, mechanism, pose):
    """By how much inverse dynamics and the mechanism differ in a motion drawn by chance; forces of the largest."""
    random = np.random.default_rng(6)
    dT, ddT = random.normal(size=3), random.normal(size=3)
    names = [*CARTS, *SPEEDS, *(f"der({n})" for n in SPEEDS), *FORCES]
    motion = dae.function(["tool.r", "tool.v", "der(tool.v)"], names)(pose, dT, ddT)
    q, dq, ddq, f = np.squeeze(np.array(motion)).reshape(4, 3)
    W = numbers(mechanism.velocity_jacobian, pose, q)
    left = numbers(mechanism.M1, pose, q) @ ddT + numbers(mechanism.M2, pose, q) @ ddq
    left += numbers(mechanism.G, pose, q) + numbers(mechanism.bias, pose, q, dT, dq)
    differences = {
        "constraints": numbers(mechanism.constraints, pose, q),
        "speeds": W @ dT - dq,
        "forces": (left - W.T @ f) / np.abs(left).max(),
        "accelerations": numbers(mechanism.accelerations, pose, q, dT, dq, ddq) - ddT,
    }
    return {name: np.abs(values).max() for name, values in differences.items()}


@pytest.mark.parametrize("pose", POSES)
def test_balance_holds_for_a_plate_that_tilts(tilting, mechanism, pose):
    found = imbalance(tilting, mechanism, pose)
    assert all(found[name] < NEAR[name] for name in NEAR), found


def test_balance_of_the_d1():
    """Among its equations are some that lean on others by 1e-7, which rounding must not make independent."""
    dae = translate(SixLinkGantryTau(prototypes.D1))
    mechanism = extract_mechanism(dae, **CHOSEN)
    for pose in ([-1.4, -4.45, 0.05], [-1.2, -4.3, 0.2]):
        found = imbalance(dae, mechanism, pose)
        assert all(found[name] < NEAR[name] for name in NEAR), found


def test_poses_out_of_reach_have_no_numbers(mechanism, capfd):
    for name in ("constraints", "velocity_jacobian", "M1", "G"):
        assert np.all(np.isnan(numbers(getattr(mechanism, name), [0.5, 30.0, -0.6], [0.1, 0.0, 0.0])))
    assert capfd.readouterr() == ("", "")  # and nothing is told on the screen


def test_constraints_are_printed_where_the_rest_has_no_closed_form(mechanism):
    text = str(mechanism)
    assert text.count("by iteration") == 1
    for i, count in enumerate((1, 2, 3)):
        for j in range(count):
            assert f"arms[{i}].links[{j}].length^2" in text
    assert "0 = tool.q[0]^2 + tool.q[1]^2 + tool.q[2]^2 + tool.q[3]^2 - 1" in text


def test_linear_system_of_the_plate_against_finite_differences(tilting):
    linear = linearize(tilting, at={"tool.r": POSES[0], "tool.v": [0.3, -0.2, 0.1]}, outputs=["tool.w"])
    function = tilting.function(["tool.r", "tool.v", *FORCES], ["der(tool.v)", "tool.w"])
    centre = np.array([*linear.point["tool.r"], *linear.point["tool.v"], *(linear.point[n] for n in FORCES)])

    def value(x):
        return np.concatenate([np.array(r).ravel() for r in function(x[:3], x[3:6], *x[6:])])

    found = np.vstack([np.hstack([linear.A[3:], linear.B[3:]]), np.hstack([linear.C, linear.D])])
    for j, width in enumerate([1e-4] * 3 + [1e-3] * 3 + [1e-1] * 3):
        step = width * np.eye(9)[j]
        slope = (value(centre + step) - value(centre - step)) / (2 * width)
        # a difference of second order: its error is the square of the relative width
        assert np.abs(found[:, j] - slope).max() < 1e-4 * max(1.0, np.abs(slope).max())
