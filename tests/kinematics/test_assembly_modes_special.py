"""Hexapods with fewer modes, singular ones, or none; bad input; paths that are lost."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from gantrytau import ModelError, StructureError
from gantrytau.kinematics import assembly_modes
from gantrytau.kinematics.modes import study_roots
from gantrytau.kinematics.modes.study_roots import all_roots, placed
from gantrytau.kinematics.modes.study_start import distinct
from gantrytau.kinematics.modes.study_tracking import Paths, track
from tests.kinematics.test_assembly_modes import MET, SAME, assert_same_poses, flat, random_hexapod

POSE = np.array([0.05, 0.03, 1.0]), Rotation.from_rotvec([0.1, 0.2, 0.15]).as_matrix()


def circle(degrees, radius: float) -> np.ndarray:
    angle = np.radians(degrees)
    return radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(6)], axis=1)


def assembled(base: np.ndarray, platform: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A hexapod with POSE as one of its modes."""
    r, R = POSE
    return base, platform, np.linalg.norm(r + platform @ R.T - base, axis=1)


PAIRS_ON_BASE = circle([0, 0, 120, 120, 240, 240], 1.0)
SPREAD_ON_BASE = circle([-10, 10, 110, 130, 230, 250], 1.0)
PAIRS_ON_PLATFORM = circle([-60, 60, 60, 180, 180, 300], 0.6)


@pytest.mark.parametrize("base", [PAIRS_ON_BASE, SPREAD_ON_BASE], ids=["octahedron", "6-3"])
def test_three_pairs_of_joints_leave_16_modes(base):
    # Nanua, Waldron and Murthy (1990): a polynomial of degree 8 in the square of one unknown
    modes = assembly_modes(*assembled(base, PAIRS_ON_PLATFORM))
    assert len(modes) == 16
    assert not modes.complete
    assert modes.regular.all()
    assert modes.error.max() < MET
    text = "\n".join(modes.findings)
    assert "joints 0-5, 1-2, 3-4 of the platform coincide" in text
    assert ("joints 0-1, 2-3, 4-5 of the base coincide" in text) == (base is PAIRS_ON_BASE)
    assert "24 of 40 modes are at infinity" in text


def test_planar_joints_have_mirrored_modes():
    base, platform, lengths = assembled(SPREAD_ON_BASE, circle([-40, 35, 75, 165, 195, 310], 0.6))
    modes = assembly_modes(base, platform, lengths)
    assert modes.complete
    mirror = np.diag([1.0, 1.0, -1.0])  # of the base, and of the platform, which it leaves in place
    mirrored = np.concatenate([modes.r @ mirror, (mirror @ modes.R @ mirror).reshape(-1, 9)], axis=1)
    assert_same_poses(mirrored, flat(modes), 1e-6)  # two modes are 1e3 away, and known less well
    assert any("mirrored by the plane of the base" in finding for finding in modes.findings)
    assert (modes.group == -1).sum() == (modes.group == 1).sum() == modes.real.sum() / 2


def test_a_singular_pose_is_one_mode_where_two_meet():
    base, platform, _ = random_hexapod(2)
    r = np.array([0.1, 0.2, 1.0])

    def determinant(x: float) -> float:
        platform[0, 0] = x
        along = r + platform - base
        return float(np.linalg.det(np.concatenate([along, np.cross(platform, along)], axis=1)))

    grid = np.linspace(-3, 3, 100)
    values = [determinant(x) for x in grid]
    k = int(np.flatnonzero(np.diff(np.sign(values)))[0])
    brentq(determinant, grid[k], grid[k + 1], xtol=1e-15)
    modes = assembly_modes(base, platform, np.linalg.norm(r + platform - base, axis=1))
    assert not modes.complete
    assert len(modes) == 39
    assert modes.regular.sum() == 38
    assert modes.real[~modes.regular].all()
    np.testing.assert_allclose(modes.r[~modes.regular], [r], atol=1e-5)  # as the record says
    assert any(finding.startswith("1 of the modes found are singular") for finding in modes.findings)


def test_a_platform_on_parallel_links_of_one_length_is_not_held():
    # R = I, r on a sphere: the links move it like a table, and no mode stands alone
    joints = np.random.default_rng(3).normal(size=(6, 3))
    modes = assembly_modes(joints, joints, np.ones(6))
    assert not modes.complete
    assert not modes.regular.all()
    assert any("do not hold the platform" in finding for finding in modes.findings)
    assert any("form parallelograms" in finding for finding in modes.findings)


def test_parallelogram_clusters_are_told_and_solved():
    # nominal clusters: links 1, 2 and 3, 4, 5 are parallel at R = I
    rng = np.random.default_rng(4)
    carts, platform = rng.normal(size=(3, 3)), rng.uniform(-0.2, 0.2, (6, 3))
    base = platform + carts[[0, 1, 1, 2, 2, 2]]
    lengths = np.linalg.norm(np.array([0.1, 0.3, 1.0]) - carts, axis=1)[[0, 1, 1, 2, 2, 2]]
    modes = assembly_modes(base, platform, lengths)
    assert modes.complete
    level = np.abs(modes.R - np.eye(3)).max((1, 2)) < SAME
    assert level.sum() == 2  # the two of the three-link robot
    assert modes.feasible[level].all()
    assert any("links 1-2, 3-4, 3-5, 4-5 form parallelograms" in finding for finding in modes.findings)


def test_links_too_short_have_complex_modes_only():
    base, platform, lengths = random_hexapod(5)
    modes = assembly_modes(base + np.array([0, 0, 20.0]), platform, 0.1 * lengths)
    assert modes.complete
    assert not modes.real.any()
    assert not modes.feasible.any()
    assert modes.poses[0].shape == (0, 3)
    assert any("no mode is real" in finding and "units" in finding for finding in modes.findings)


def test_similar_hexagons_are_refused():
    hexagon = circle(60 * np.arange(6), 1.0)
    with pytest.raises(StructureError, match=r"found 5 independent conditions of six links"):
        assembly_modes(*assembled(hexagon, 0.5 * hexagon))


@pytest.mark.parametrize("name", ["base", "platform"])
def test_joints_on_a_line_are_refused(name):
    hexapod = dict(zip(("base", "platform", "lengths"), random_hexapod(6), strict=True))
    hexapod[name] = np.linspace(0, 1, 6)[:, None] * [1.0, 2.0, 3.0] + 4.0
    with pytest.raises(StructureError, match=rf"found all joints of the {name} on one line.*move one of"):
        assembly_modes(**hexapod)


BASE, PLATFORM, LENGTHS = random_hexapod(7)


@pytest.mark.parametrize(
    ("arguments", "argument"),
    [
        ((BASE[:5], PLATFORM, LENGTHS), "base"),
        ((BASE, PLATFORM.T, LENGTHS), "platform"),
        ((BASE, PLATFORM, LENGTHS[None]), "lengths"),
        ((BASE + 1j, PLATFORM, LENGTHS), "base"),
        ((BASE * [1, 1, np.nan], PLATFORM, LENGTHS), "base"),
        ((BASE, PLATFORM, LENGTHS * [1, 1, 1, -1, 1, 1]), "lengths"),
    ],
    ids=["five", "transposed", "many", "complex", "gap", "negative"],
)
def test_what_is_no_hexapod_is_refused(arguments, argument):
    with pytest.raises(ModelError) as refusal:
        assembly_modes(*arguments)
    assert refusal.value.argument == argument


def spoilt(monkeypatch: pytest.MonkeyPatch, spoil, times: int) -> list[float]:
    """Let `spoil` change the first tracks; the tolerances of all tracks."""
    tolerances = []

    def tracked(homotopy, roots, *, tolerance):
        paths = track(homotopy, roots, tolerance=tolerance)
        tolerances.append(tolerance)
        return spoil(paths) if len(tolerances) <= times else paths

    monkeypatch.setattr(study_roots, "track", tracked)
    return tolerances


def lose_three_pairs(paths: Paths) -> Paths:
    z, t = paths.z.copy(), paths.t.copy()
    lost = np.abs(z @ z.conj().T).argmax(1) < 6
    for k in np.flatnonzero(lost):  # and those that conjugation would give back
        lost |= np.abs(z.conj() @ z[k].conj()) > 1 - 1e-9
    t[lost] = 0.5
    return Paths(z, t)


def double_two(paths: Paths) -> Paths:
    z = paths.z.copy()
    z[:2] = z[2:4]
    for k in range(4, 40):  # their conjugates, too
        if (np.abs(z[k] @ paths.z[:2].T) > 1 - 1e-9).any():
            z[k] = z[2]
    return Paths(z, paths.t)


@pytest.mark.parametrize("spoil", [lose_three_pairs, double_two])
def test_lost_and_doubled_paths_are_followed_again_more_closely(monkeypatch, spoil):
    *hexapod, _ = placed(BASE, PLATFORM, LENGTHS)
    expected = all_roots(*hexapod).z
    tolerances = spoilt(monkeypatch, spoil, times=1)
    found = all_roots(*hexapod).z
    assert len(tolerances) == 2
    assert tolerances[1] < tolerances[0]
    assert len(found) == 40
    assert not distinct(np.concatenate([expected, found]))[40:].any()


def test_modes_that_stay_lost_are_told(monkeypatch):
    spoilt(monkeypatch, lambda paths: Paths(paths.z, np.where(np.arange(40) < 40, 0.5, paths.t)), times=9)
    modes = assembly_modes(BASE, PLATFORM, LENGTHS)
    assert not modes.complete
    assert len(modes) == 0
    assert any("40 of 40 modes were lost on the way" in finding for finding in modes.findings)
