"""Cells with robots, small enough for tests, and what judges them independently: dense samples, boxes by hand."""

from typing import Any

import numpy as np

from gantrytau.kinematics import Box, Limits
from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import LaserTracker
from gantrytau_optimica.calibration import TMac
from gantrytau_optimica.calibration.links.arm_closure import read_arms
from gantrytau_optimica.calibration.links.arm_factors import scales

LOW, HIGH = np.array([0.6, 2.4, -3.0]), np.array([0.8, 2.5, -0.4])  # a post within the workspace of the L1
RADIUS, CLEARANCE = 0.02, 0.02


def varied(policy: dict[str, Any], **others: Any) -> dict[str, Any]:
    """Keywords of plan_calibration, some of them changed."""
    return policy | others


def l1():
    """An L1, a tracker before it and limits with a post in the middle."""
    limits = Limits(strokes=(0.0, 2.0), obstacles=Box(LOW, HIGH), link_radius=RADIUS, clearance=CLEARANCE)
    return GantryTau(prototypes.L1), limits, LaserTracker((4.0, 3.0, 0.0))


def symmetric():
    """Three equal links on parallel guideways at the corners of an equilateral triangle, exactly symmetric."""
    angles = np.pi / 2 + np.arange(3) * 2 * np.pi / 3
    arms = [dict(length=1.5, offset=[0.0, np.cos(a), np.sin(a)], direction=[1.0, 0.0, 0.0]) for a in angles]
    robot = GantryTau(prototypes.GT_A).modified(dict(arms=arms, tool=dict(r=dict(start=[2.0, 0.0, 0.0]))))
    limits = Limits(
        strokes=(0.0, 2.0), obstacles=Box((1.5, 0.3, -0.1), (2.5, 0.4, 0.1)), link_radius=0.02, clearance=0.02
    )
    return robot, limits, LaserTracker((6.0, 0.0, 0.0))


def six_links():
    """A D1 with all of its links and a T-Mac."""
    limits = Limits(strokes=(0.0, 2.0), link_radius=0.01, clearance=0.005)
    return SixLinkGantryTau(prototypes.D1), limits, TMac((4.0, -4.0, 0.0))


def box_distance(points, low=LOW, high=HIGH):
    """Distance of points (..., 3) from a box, zero inside: by clamping, not by the signed distance of the library."""
    return np.linalg.norm(points - np.clip(points, low, high), axis=-1)


def other_arms(robot, tape, seed):
    """Arms of robots within the tape error, drawn here."""
    random = np.random.default_rng(seed)
    return [arm.moved(tape * scales(arm) * random.standard_normal(arm.count)) for arm in read_arms(robot)]


def meeting_of_spheres(centres, lengths):
    """The point of three spheres (N, 3, 3), (3,) that lies ahead along x, by the planes in which they meet pairwise."""
    a, b, c = centres[:, 0], centres[:, 1], centres[:, 2]
    rows = np.stack([b - a, c - a], axis=1)
    right = 0.5 * (
        np.stack([(b**2).sum(1) - (a**2).sum(1), (c**2).sum(1) - (a**2).sum(1)], axis=1)
        + np.stack([lengths[0] ** 2 - lengths[1] ** 2, lengths[0] ** 2 - lengths[2] ** 2])
    )
    foot = np.einsum("nij,nj->ni", np.linalg.pinv(rows), right)
    normal = np.cross(rows[:, 0], rows[:, 1])
    normal *= (np.sign(normal[:, 0]) / np.linalg.norm(normal, axis=1))[:, None]
    away = foot - a
    half = np.einsum("ni,ni->n", away, normal)
    rest = half**2 - ((away**2).sum(1) - lengths[0] ** 2)
    return foot + (-half + np.sqrt(rest))[:, None] * normal


def same(a, b):
    """Whether two plans are equal to the last bit."""
    for name in ("q", "r", "R", "measured", "lost", "unseen"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    for name in ("before", "after", "largest", "in_frame"):
        np.testing.assert_array_equal(getattr(a.trials, name), getattr(b.trials, name))
    assert a.verdict.reasons == b.verdict.reasons
    assert a.prediction.error == b.prediction.error
