"""The Stewart platform from components against virtual work in the speeds of its platform, written by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gantrytau import Fixed, ModelError, Start, StructureError, simulate, translate
from gantrytau_models.mechanisms.stewart import StewartPlatform, pairs_of_joints
from tests.families import first_of
from tests.references import stewart
from tests.references.rotations import turn

LENGTHS = [f"legs[{k}].s" for k in range(6)]
FORCES = [f"legs[{k}].f" for k in range(6)]
POSE = ["platform.r", *(f"platform.q[{k}]" for k in (1, 2, 3))]
MASSES = np.array([1.5, 0.8])
CENTRES = np.array([0.25, 0.15])
ACROSS = np.array([0.03, 0.02])
AXIAL = np.array([0.002, 0.001])


def robot(kind):
    """The reference: symmetric in every respect, or with random joints and a platform without symmetry."""
    base = pairs_of_joints(0.6, 0.2)
    platform = np.roll(pairs_of_joints(0.3, 0.2, np.pi / 3), 1, axis=0)
    symmetric = stewart.Stewart(
        base, platform, np.zeros((6, 3)), 10.0, np.zeros(3), np.diag([0.3, 0.3, 0.5]),
        MASSES, CENTRES, ACROSS, AXIAL,
    )  # fmt: skip
    if kind == "symmetric":
        return symmetric
    random = np.random.default_rng(7)
    half = random.normal(size=(3, 3))
    return replace(
        symmetric,
        base=base + random.uniform(-0.08, 0.08, (6, 3)),
        platform=platform + random.uniform(-0.05, 0.05, (6, 3)),
        centre=np.array([0.02, -0.03, 0.05]),
        inertia=0.3 * np.eye(3) + 0.05 * half @ half.T,
    )


def built(reference, **platform):
    """The model with the numbers of the reference, and the reference with the axes of the model's joints."""
    bodies = ("cylinder", "piston")
    bare = StewartPlatform(reference.base, reference.platform)
    legs = []
    for leg in bare.modifications["legs"]:
        u = np.array(leg["direction"])
        along = np.outer(u, u)
        part = {}
        for i, name in enumerate(bodies):
            part[f"{name}_mass"], part[f"{name}_centre"] = MASSES[i], CENTRES[i]
            part[f"{name}_J"] = ACROSS[i] * (np.eye(3) - along) + AXIAL[i] * along
        legs.append(part)
    body = dict(m=reference.mass, r_cm=list(reference.centre), J=reference.inertia)
    model = StewartPlatform(reference.base, reference.platform, legs=legs, platform=body | platform)
    axes = np.array([leg["axis"] for leg in bare.modifications["legs"]])
    return model, replace(reference, axes=axes)


def quaternion(vector):
    """Unit quaternion, scalar first, of the rotation by |vector| about vector."""
    angle = np.linalg.norm(vector)
    return np.array([np.cos(angle / 2), *(np.sinc(angle / (2 * np.pi)) / 2 * vector)])


def states(count, seed=0):
    """Poses within some decimetres and half a radian of home, speeds, and forces of the legs."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        r = np.array([0.0, 0.0, 0.8]) + random.uniform(-0.15, 0.15, 3)
        yield r, random.uniform(-0.3, 0.3, 3), *random.normal(size=(2, 3)), random.normal(size=6) * 100


@pytest.fixture(scope="module", params=first_of(["random", "symmetric"]))
def pair(request):
    model, reference = built(robot(request.param))
    return translate(model), reference


def test_six_degrees_of_freedom(pair):
    dae, _ = pair
    assert dae.diagnosis.mobility == 6
    assert dae.diagnosis.redundant == ()
    assert set(dae.inputs) == set(FORCES)


def test_lengths_of_the_legs(pair):
    dae, reference = pair
    inverse = dae.function(POSE, LENGTHS)
    for r, a, *_ in states(20):
        found = [float(x) for x in inverse(r, *quaternion(a)[1:])]
        np.testing.assert_allclose(found, stewart.lengths(reference, r, turn(a)), rtol=1e-12)


def test_forward_and_inverse_dynamics(pair):
    dae, reference = pair
    pose = [*POSE, "platform.v", "platform.w"]
    forward = dae.function([*pose, *FORCES], ["der(platform.v)", "der(platform.w)"])
    for r, a, v, w, f in states(20, seed=1):
        expected = stewart.accelerations(reference, stewart.Pose(r, turn(a), v, w), f)
        found = forward(r, *quaternion(a)[1:], v, w, *f)
        found = np.concatenate([np.array(x).ravel() for x in found])
        assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()
    inverse = dae.function([*pose, "der(platform.v)", "der(platform.w)"], FORCES)
    for r, a, v, w, f in states(20, seed=2):
        motion = stewart.accelerations(reference, stewart.Pose(r, turn(a), v, w), f)
        found = np.array([float(x) for x in inverse(r, *quaternion(a)[1:], v, w, motion[:3], motion[3:])])
        assert np.abs(found - f).max() < 1e-10 * np.abs(f).max()


def test_pose_from_the_lengths(pair):
    dae, reference = pair
    for r, a, *_ in states(3, seed=2):
        s = stewart.lengths(reference, r, turn(a))
        at = dae.evaluate(dict(zip(LENGTHS, s, strict=True)))
        expected, R = stewart.pose_of_lengths(reference, s, np.array([0.0, 0.0, 0.8]), np.eye(3))
        np.testing.assert_allclose(at["platform.r"], expected, atol=1e-11)
        np.testing.assert_allclose(at["platform.R"], R, atol=1e-11)


def test_energy_is_kept():
    model, reference = built(robot("random"), v=Start([0.1, 0.2, 1.5]), w=Start([0.5, 0.3, -0.4]))
    fall = simulate(model, stop=0.3, tolerance=1e-9, points=31)
    motion = zip(fall["platform.r"], fall["platform.R"], fall["platform.v"], fall["platform.w"], strict=True)
    energy = [stewart.energy(reference, stewart.Pose(*now)) for now in motion]
    assert np.ptp(fall["platform.r"][:, 2]) > 0.1  # thrown up, m
    assert np.ptp(energy) < 1e-5  # J, of 150: a hundred times the integrator's tolerance


@pytest.mark.parametrize(("kind", "seed"), first_of([("symmetric", 5), ("random", 6)]))
def test_starts_that_are_a_fifth_of_the_size_away_find_the_pose(kind, seed):
    reference, random = robot(kind), np.random.default_rng(seed)
    r, a = np.array([0.0, 0.0, 0.8]) + random.uniform(-0.16, 0.16, 3), random.uniform(-0.3, 0.3, 3)
    s = stewart.lengths(reference, r, turn(a))
    near, turned = r + random.uniform(-0.16, 0.16, 3), a + random.uniform(-0.2, 0.2, 3)
    model = StewartPlatform(
        reference.base,
        reference.platform,
        legs=[dict(s=Fixed(length)) for length in s],
        platform=dict(r=Start(list(near)), q=Start(list(quaternion(turned)))),
    )
    at = translate(model).evaluate()
    np.testing.assert_allclose(at["platform.r"], r, atol=1e-10)
    np.testing.assert_allclose(at["platform.R"], turn(a), atol=1e-10)


def test_pose_of_the_start_is_kept():
    q = quaternion(np.array([0.1, -0.2, 0.3]))
    at = translate(StewartPlatform(platform=dict(r=Start([0.1, 0.05, 0.7]), q=Start(list(q))))).evaluate()
    np.testing.assert_allclose(at["platform.r"], [0.1, 0.05, 0.7], rtol=1e-14)
    np.testing.assert_allclose(at["platform.q"], q, rtol=0, atol=1e-14)


@pytest.mark.parametrize("scale", first_of([1.0, 0.5]))  # the first with upright legs
def test_regular_hexagons_move_but_cannot_be_driven(scale):
    """Joints that are similar figures: singular in every pose, so the lengths do not determine the pose."""
    joints = pairs_of_joints(0.5, np.pi / 6)
    model, reference = built(replace(robot("symmetric"), base=joints, platform=scale * joints))
    dae = translate(model)
    forward = dae.function(
        [*POSE, "platform.v", "platform.w", *FORCES], ["der(platform.v)", "der(platform.w)"]
    )
    for r, a, v, w, f in states(5, seed=3):
        expected = stewart.accelerations(reference, stewart.Pose(r, turn(a), v, w), f)
        found = np.concatenate([np.array(x).ravel() for x in forward(r, *quaternion(a)[1:], v, w, *f)])
        assert np.abs(found - expected).max() < 1e-10 * np.abs(expected).max()
    with pytest.raises(StructureError, match=r"StewartPlatform: (more is driven|constraints depend on each)"):
        translate(model, given=LENGTHS)


def test_wrong_joints_are_refused():
    joints = pairs_of_joints(0.5, 0.2)
    for call, words in (
        (lambda: StewartPlatform(np.zeros((5, 3))), "StewartPlatform: found base_joints of 5 x 3"),
        (lambda: StewartPlatform(home=[0.0, 0.8]), "found home of 2"),
        (lambda: StewartPlatform(joints, joints, home=[0.0, 0.0, 0.0]), "joints of legs[0] coincide at home"),
    ):
        with pytest.raises(ModelError) as caught:
            call()
        assert words in str(caught.value)
