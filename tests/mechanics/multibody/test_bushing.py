"""Elastic joints: small and large rotations, energy, frames exactly aligned."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import Fixed, Model, ModelError, linearize, simulate, translate
from gantrytau.mechanics.multibody import Body, Bushing, FixedRotation, World
from tests.mechanisms.rows import row
from tests.references.rotations import turn

TOLERANCE = 1e-10
J = np.diag([0.02, 0.03, 0.04])
SOFT = dict(
    c=np.diag([100.0, 200.0, 300.0]), c_phi=np.diag([1.0, 2.0, 3.0]), c_mixed=np.diag([1.0, -2.0, 3.0])
)


class Mounted(Model):
    """A body on a bushing."""

    world = World(g=0.0)
    block = Body(m=2.0, J=J)
    mount = Bushing(**SOFT)

    def equations(self):
        yield from row(self.world, self.mount, self.block)


def quaternion(vector):
    x, y, z, w = Rotation.from_rotvec(vector).as_quat()
    return np.array([w, x, y, z])


def at(dae, vector, r=(0.0, 0.0, 0.0)):
    """What there is where the body rests at r, turned by a rotation vector."""
    rest = np.zeros(3)
    return dae.evaluate({"block.q": quaternion(vector), "block.r": r, "block.v": rest, "block.w": rest})


@pytest.mark.parametrize("angle", [0.0, 1e-300, 1e-12, 1e-6, 0.1, np.pi / 2, 3.0, 3.14])
def test_torque_about_a_principal_axis_is_proportional_to_the_angle(angle):
    dae = translate(Mounted(mount=dict(c_mixed=np.zeros((3, 3)))))
    for axis, stiffness in zip(np.eye(3), (1.0, 2.0, 3.0), strict=True):
        for sign in (1, -1):
            found = at(dae, sign * angle * axis)
            # near half a turn rounding of the trace is divided by its distance from -1
            near = 1e-6 if angle > 3.1 else 1e-12
            assert found["mount.phi"] == pytest.approx(sign * angle * axis, rel=near, abs=1e-16)
            assert found["mount.t"] == pytest.approx(sign * stiffness * angle * axis, rel=near, abs=1e-15)


def test_the_law_is_that_of_the_matrix_where_frames_are_aligned():
    system = linearize(translate(Mounted()), at={"block.r": [0.0] * 3})
    c = np.block([[SOFT["c"], SOFT["c_mixed"]], [SOFT["c_mixed"].T, SOFT["c_phi"]]])
    modes = np.linalg.eigvals(-np.linalg.solve(np.diag([2.0, 2.0, 2.0, 0.02, 0.03, 0.04]), c))
    expected = np.sort(np.sqrt(-np.real(modes)))
    found = np.sort(np.abs(np.imag(system.poles)))[::-1][:12:2][::-1]
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    # roots of a double zero, of the size of the root of rounding
    assert np.abs(np.real(system.poles)).max() < 1e-5


@pytest.mark.parametrize("seed", range(3))
def test_force_and_torque_are_the_slope_of_the_energy(seed):
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(6, 6))
    c = factor @ factor.T
    dae = translate(Mounted(mount=dict(c=c[:3, :3], c_phi=c[3:, 3:], c_mixed=c[:3, 3:])))
    vector = rng.normal(size=3)
    vector *= 2.8 / np.linalg.norm(vector)
    place = rng.normal(size=3)
    here = at(dae, vector, place)
    R, step = turn(vector), 1e-5
    for axis in np.eye(3):
        ends = [Rotation.from_matrix(turn(sign * step * axis) @ R).as_rotvec() for sign in (1, -1)]
        high, low = (at(dae, end, place)["mount.energy"] for end in ends)
        assert (high - low) / (2 * step) == pytest.approx(here["mount.t"] @ axis, rel=1e-6, abs=1e-6)
        high, low = (at(dae, vector, place + s * step * axis)["mount.energy"] for s in (1, -1))
        assert (high - low) / (2 * step) == pytest.approx(here["mount.f"] @ axis, rel=1e-6, abs=1e-6)


def energy(run):
    """Kinetic and elastic energy of the body, J."""
    q = run["block.q"]
    local = Rotation.from_quat(q[:, [1, 2, 3, 0]]).inv().apply(np.array(run["block.w"]))
    return (run["block.v"] ** 2).sum(1) + (local**2 @ np.diag(J)) / 2 + run["mount.energy"]


SPUN = dict(r=Fixed([0.1, 0.2, -0.1]), v=Fixed([0.3, 0.1, 0.0]), w=Fixed([9.0, -6.0, 3.0]))


def test_a_body_that_turns_far_keeps_its_energy():
    run = simulate(Mounted(block=SPUN), stop=2.0, tolerance=TOLERANCE)
    assert np.linalg.norm(run["mount.phi"], axis=1).max() > 1.3
    assert np.ptp(energy(run)) < 1e3 * TOLERANCE * energy(run)[0]


def test_what_is_damped_comes_to_rest_in_the_middle_and_loses_what_the_damper_takes():
    damped = Mounted(block=SPUN, mount=dict(d=4 * np.eye(3), d_phi=0.1 * np.eye(3)))
    run = simulate(damped, stop=20.0, tolerance=TOLERANCE, points=4001)
    assert np.all(np.diff(energy(run)) < 100 * TOLERANCE)
    v, w = run["block.v"], run["block.w"]
    power = 4.0 * (v**2).sum(1) + 0.1 * (w**2).sum(1)
    lost = np.trapezoid(power, run.time)
    assert lost == pytest.approx(energy(run)[0] - energy(run)[-1], rel=1e-3)  # the rule of trapezia
    assert np.abs(run.final("block.r")).max() < 1e-4
    assert np.abs(run.final("mount.phi")).max() < 1e-4


def test_the_other_way_round_and_turned_it_is_the_same_motion():
    class Turned(Model):
        """The bushing between frames that are both turned."""

        world = World(g=0.0)
        before, after = FixedRotation(n=[1, 2, 3], phi=2.5), FixedRotation(n=[1, 2, 3], phi=-2.5)
        block = Body(m=2.0, J=J)
        mount = Bushing(c=150 * np.eye(3), c_phi=2 * np.eye(3))
        turned = False

        def equations(self):
            a, b = self.mount.frame_a, self.mount.frame_b
            a, b = (b, a) if self.turned else (a, b)
            yield from row(self.world, self.before, a)
            yield from row(b, self.after, self.block)

    gentle = dict(r=Fixed([0.1, 0.2, -0.1]), v=Fixed([0.3, 0.1, 0.0]), w=Fixed([1.0, -0.6, 0.3]))

    class Backwards(Turned):
        """The same with its ends exchanged."""

        turned = True

    plain = Mounted(
        block=gentle, mount=dict(c=150 * np.eye(3), c_phi=2 * np.eye(3), c_mixed=np.zeros((3, 3)))
    )
    expected = simulate(plain, stop=1.0, tolerance=TOLERANCE)
    forwards, backwards = (
        simulate(model(block=gentle), stop=1.0, tolerance=TOLERANCE) for model in (Turned, Backwards)
    )
    for name in ("block.r", "block.q"):  # the same stiffness about all axes knows no direction
        np.testing.assert_allclose(forwards[name], expected[name], atol=1e3 * TOLERANCE)
    np.testing.assert_allclose(backwards["block.q"], expected["block.q"], atol=1e3 * TOLERANCE)
    np.testing.assert_allclose(backwards["block.r"], expected["block.r"], atol=1e3 * TOLERANCE)


@pytest.mark.parametrize(
    "changes",
    [
        dict(c=-np.eye(3)),
        dict(c=np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])),
        dict(c_mixed=100 * np.eye(3)),
        dict(d=np.diag([1.0, 1.0, -1e-9])),
        dict(d_mixed=np.eye(3)),
    ],
)
def test_a_matrix_that_drives_is_refused(changes):
    letter = next(iter(changes))[0]
    words = f"mount .Bushing.*; expected symmetric {letter} and {letter}_phi, which with {letter}_mixed resist every"
    with pytest.raises(ModelError, match=words):
        translate(Mounted(mount=changes))
