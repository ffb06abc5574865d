"""A peg in a hole: energy of its faces, two-point contact, chamfer, floor, friction."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import Fixed, Model, ModelError, connect, simulate, translate
from gantrytau.mechanics import multibody
from gantrytau.mechanics.multibody import Body, FrameForce, HuntCrossley, PegContact, World, WorldTorque
from tests.mechanisms.rows import row

TOLERANCE = 1e-9
J = np.diag([2e-4, 2e-4, 1e-5])
CENTRE = np.array([0.0, 0.0, 0.05])
SOFT = HuntCrossley(k=1e6)


class Peg(Model):
    """A free peg over a hole, or in it."""

    world = World(g=0.0)
    hole = multibody.Fixed()
    peg = Body(m=0.2, r_cm=CENTRE, J=J)
    contact = PegContact(clearance=1e-3, chamfer=1e-3, rim=SOFT, edge=SOFT, floor=SOFT)
    push, twist = FrameForce(), WorldTorque()

    def equations(self):
        yield from row(self.hole, self.contact, self.peg)
        yield connect(self.push.frame_b, self.peg.frame_a)
        yield connect(self.twist.frame_b, self.peg.frame_a)


def held(r, v=(0, 0, 0), w=(0, 0, 0), tilt=(0, 0, 0)):
    x, y, z, s = Rotation.from_rotvec(tilt).as_quat()
    return dict(r=Fixed(r), v=Fixed(v), w=Fixed(w), q=Fixed([s, x, y, z]))


def kinetic(run):
    turned = Rotation.from_quat(run["peg.q"][:, [1, 2, 3, 0]])
    w = np.array(run["peg.w"])
    v = run["peg.v"] + np.cross(w, turned.apply(CENTRE))
    return 0.1 * (v**2).sum(1) + turned.inv().apply(w) ** 2 @ np.diag(J) / 2


def apart(run):
    return np.all([run[f"contact.{part}.p"] <= 0 for part in ("rim", "edge", "floor")], axis=0)


@pytest.mark.parametrize(
    ("start", "parts"),
    [
        (held([5e-4, 0, -0.015], [0.05, 0.03, -0.01], [2.0, -4.0, 3.0]), {"rim", "edge"}),
        (held([0, 2e-4, -0.02], [0.01, 0.02, -0.2], [0.5, 0.2, 3.0]), {"rim", "floor"}),
        (held([1.6e-3, 0, 2e-3], [0, 0, -0.1]), {"rim"}),
        (held([0.02, 0, 2e-3], [0.01, 0, -0.1], [0, 0, 5.0]), {"rim"}),
    ],
    ids=["walls", "floor", "chamfer", "plane"],
)
def test_elastic_faces_give_all_energy_back(start, parts):
    run = simulate(Peg(peg=start), stop=0.3, tolerance=TOLERANCE)
    energy, free = kinetic(run), apart(run)
    assert np.count_nonzero(free) > 20
    assert np.abs(energy[free] / energy[0] - 1).max() < 1e-5  # some dozen bounces of 1e-7 each
    touched = {part for part in ("rim", "edge", "floor") if run[f"contact.{part}.f"].max() > 0}
    assert parts <= touched
    assert np.all(run["contact.r"][:, 2] > -0.032)


def test_rubbing_loses_energy_only():
    start = held([5e-4, 0, -0.015], [0.05, 0.03, -0.01], [2.0, -4.0, 3.0])
    run = simulate(Peg(peg=start, contact=dict(mu=0.3)), stop=0.2, tolerance=TOLERANCE)
    energy = kinetic(run)[apart(run)]
    assert np.diff(energy).max() < 1e-6 * energy[0]
    assert energy[-1] < 0.7 * energy[0]


@pytest.mark.parametrize("angle", [0.0, 2.0, np.pi / 2, np.pi])
def test_two_points_hold_a_tilted_peg(angle):
    """Twisted, it leans at rim and edge: the tilt is that of two clearances over the depth between the two."""
    direction = np.array([np.cos(angle), np.sin(angle), 0.0])
    depth, clearance, torque = 0.02, 5e-4, 0.2
    start = held([0, 0, -depth])
    stiff = HuntCrossley(k=1e9, a=20.0)
    contact = dict(clearance=clearance, chamfer=0.0, rim=stiff, edge=stiff, mu=0.5)
    run = simulate(
        Peg(peg=start, contact=contact), stop=0.5, inputs={"twist.t": torque * direction}, tolerance=1e-8
    )
    r, lean = run.final("contact.r"), run.final("contact.tilt")
    assert np.linalg.norm(run.final("peg.w")) < 1e-3
    across = np.cross(direction, [0, 0, 1])  # about the torque the axis goes this way
    pressed = torque / -r[2]
    into = 2 * (pressed / 1e9) ** (1 / 1.5)
    slope = lean @ across[:2] / np.sqrt(1 - lean @ lean)
    assert slope == pytest.approx((2 * clearance + into) / -r[2], rel=1e-3)
    assert run.final("contact.rim.f") == pytest.approx(pressed, rel=1e-2)
    assert run.final("contact.edge.f") == pytest.approx(pressed, rel=1e-2)
    assert run.final("contact.t") == pytest.approx(-torque * direction, abs=1e-4)


def test_the_chamfer_leads_in_what_the_plane_stops():
    damped = HuntCrossley(k=3e7, a=2.0)
    parts = dict(rim=damped, edge=damped, floor=damped, clearance=2e-4, mu=0.05, v_s=0.01)
    for chamfer, inside in ((1e-3, True), (0.0, False)):
        # pushed straight by a spring that holds it upright and gives way aside

        class Led(Model):
            """A peg on a compliant holder that presses it down."""

            world = World(g=0.0)
            hole = multibody.Fixed()
            holder = multibody.Fixed(r=[8e-4, 0, -0.02])
            mount = multibody.Bushing(
                c=np.diag([200.0, 200.0, 500.0]),
                c_phi=10 * np.eye(3),
                d=np.diag([10.0, 10.0, 20.0]),
                d_phi=0.05 * np.eye(3),
            )
            peg = Body(m=0.2, r_cm=CENTRE, J=J)
            contact = PegContact(chamfer=chamfer, **parts)

            def equations(self):
                yield from row(self.holder, self.mount, self.peg)
                yield from row(self.hole, self.contact, self.peg)

        run = simulate(Led(peg=held([8e-4, 0, 2e-3])), stop=0.6, tolerance=1e-6)
        assert bool(run.final("contact.r")[2] < -0.018) is inside
        assert abs(run.final("contact.r")[0]) < (3e-4 if inside else 9e-4)


def test_far_away_and_aside_nothing_is_felt():
    for r in ([0, 0, 0], [0, 0, -0.01], [5e-4, -5e-4, -0.02], [0.1, 0.1, 1e-9], [0, 0, 1e6]):
        found = translate(Peg(peg=held(r))).evaluate()
        assert np.array_equal(found["contact.f"], np.zeros(3))
        assert np.array_equal(found["contact.t"], np.zeros(3))
        assert np.all(np.isfinite(found["der(peg.v)"]))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (dict(clearance=0.0), "expected a clearance above zero"),
        (dict(v_s=0.0), "expected a smoothing speed above zero"),
        (dict(chamfer=0.05), "expected a hole deeper than its chamfer"),
    ],
)
def test_what_is_no_hole_is_refused(changes, words):
    with pytest.raises(ModelError, match=rf"contact \(PegContact\).*; {words}"):
        translate(Peg(contact=changes))
