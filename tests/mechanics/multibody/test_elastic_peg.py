"""A peg that bends in a hole: equilibrium, energy, two points, the way in, friction, block and floor."""

from itertools import product

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from gantrytau import Fixed, Input, Model, ModelError, connect, der, simulate, translate
from gantrytau.language.statements import root
from gantrytau.mechanics import multibody
from gantrytau.mechanics.multibody import ElasticPegContact, Frame
from gantrytau.mechanics.multibody.elastic_peg import Compliance, two_points
from gantrytau.mechanics.multibody.orientation import of_quaternion, spin_of_quaternion
from tests.mechanisms.rows import row

LENGTH, BENDING, WALL, CLEARANCE, DEPTH, MU = 0.095, 236.0, 5e3, 3e-4, 0.03, 0.3
FOUND = ["f", "t", "f_tip", "f_edge", "f_end", "inserted", "frame_a.f", "frame_a.t", "frame_b.f", "frame_b.t"]


class Led(Model):
    """A frame that is where it is told to be."""

    frame_b = Frame()
    r = Input(3, unit="m", description="position")
    q = Input(4, unit="1", description="orientation, a unit quaternion", start=[1.0, 0.0, 0.0, 0.0])

    def equations(self):
        yield root(self.frame_b, R=of_quaternion(self.q), w=spin_of_quaternion(self.q, der(self.q)))
        yield self.frame_b.r == self.r


class Held(Model):
    """A peg that is held over a hole, or in it."""

    hole = multibody.Fixed()
    peg = Led()
    contact = ElasticPegContact(mu=MU)

    def equations(self):
        yield connect(self.hole.frame_b, self.contact.frame_a)
        yield connect(self.peg.frame_b, self.contact.frame_b)


@pytest.fixture(scope="module")
def contact():
    """Forces and torques of the contact for place, rotation vector, speed and angular velocity of the peg."""
    of = translate(Held()).function(
        ["peg.r", "peg.q", "der(peg.r)", "der(peg.q)"], [f"contact.{n}" for n in FOUND]
    )

    def held(r, turn=(0, 0, 0), v=(0, 0, 0), w=(0, 0, 0)):
        x, y, z, s = Rotation.from_rotvec(turn).as_quat()
        u, w = np.array([x, y, z]), np.array(w, dtype=float)
        rate = np.concatenate([[-u @ w], s * w + np.cross(w, u)]) / 2
        values = of(r, [s, x, y, z], v, rate)
        return {name: np.array(value).ravel() for name, value in zip(FOUND, values, strict=True)}

    return held


def compliances(inserted, bending=BENDING, wall=WALL):
    """Of Euler-Bernoulli's cantilever, by the textbook's a^2 (3 b - a) / (6 E I), and the walls'."""
    stiffness = bending * LENGTH**3 / 3
    shaft = LENGTH - inserted
    return Compliance(
        LENGTH**3 / (3 * stiffness) + 1 / wall,
        shaft**3 / (3 * stiffness) + 1 / wall,
        shaft**2 * (3 * LENGTH - shaft) / (6 * stiffness),
    )


def forces_of():
    tip, edge, c, clearance = ca.SX.sym("p", 2), ca.SX.sym("q", 2), ca.SX.sym("c", 3), ca.SX.sym("r")
    found = two_points(tip, edge, Compliance(*ca.vertsplit(c)), clearance)
    return ca.Function("forces", [tip, edge, c, clearance], found)


def places(count, scale=1.0, seed=0):
    """Places of the tip and of the shaft at the edge, anywhere around the hole, and lengths inserted."""
    rng = np.random.default_rng(seed)
    inserted = rng.uniform(0, DEPTH, count) * rng.integers(0, 2, count) + rng.uniform(0, 1e-3, count)
    tip = rng.normal(size=(count, 2)) * CLEARANCE * 10 ** rng.uniform(-1, 1.5, (count, 1))
    tilt = rng.normal(size=(count, 2)) * 10 ** rng.uniform(-3, -0.8, (count, 1))
    return scale * tip, scale * (tip + inserted[:, None] * tilt), inserted


@pytest.mark.parametrize(("scale", "clearance"), [(1.0, 3e-4), (1e-9, 3e-13), (1e9, 3e5), (1.0, 3e-10)])
def test_both_places_are_in_equilibrium(scale, clearance):
    tip, edge, inserted = places(20_000, scale)
    c = compliances(inserted)
    flat = np.vstack(np.broadcast_arrays(*c))
    first, second = (np.array(f).T for f in forces_of()(tip.T, edge.T, flat, clearance))
    touched = 0
    for p, f, soft, other in ((tip, first, c.tip, second), (edge, second, c.edge, first)):
        at = p + np.reshape(soft, (-1, 1)) * f + c.mixed[:, None] * other  # less its depth in the wall
        load = np.linalg.norm(f, axis=1)
        wall = np.where(load[:, None] > 0, at + clearance * f / np.maximum(load, 1e-300)[:, None], 0)
        assert np.abs(wall).max() * BENDING < 1e-11 * scale  # N, a hundredth of what is asked for
        free = np.linalg.norm(at[load == 0], axis=1)
        assert free.max(initial=0) < clearance + 1e-14 * scale
        touched += np.count_nonzero(load)
    assert touched > 10_000


def test_it_is_the_point_of_least_energy():
    tip, edge, inserted = places(60, seed=3)
    of = forces_of()
    for p, q, s in zip(tip, edge, inserted, strict=True):
        c = compliances(s)
        beam = np.array([[c.tip - 1 / WALL, c.mixed], [c.mixed, c.edge - 1 / WALL]])
        stiff = np.kron(np.linalg.inv(beam), np.eye(2))
        pose = np.concatenate([p, q])

        def energy(u, stiff=stiff, pose=pose):
            at = np.linalg.norm((pose + u).reshape(2, 2), axis=1)
            return (u @ stiff @ u + WALL * np.sum(np.maximum(at - CLEARANCE, 0) ** 2)) / 2

        forces = np.concatenate([np.array(f).ravel() for f in of(p, q, c, CLEARANCE)])
        bent = np.kron(beam, np.eye(2)) @ forces
        least = minimize(energy, bent, method="Nelder-Mead", options=dict(xatol=1e-9, fatol=1e-14))
        assert energy(bent) <= least.fun + 1e-12 * (1 + energy(0 * bent))  # no search finds less
        assert energy(bent) <= energy(0 * bent)


def test_it_is_free_in_the_hole_and_above_it(contact):
    for turn in (0.0, 2.0, np.pi / 2, np.pi):
        for r in ([0, 0, -0.01], [2.9e-4, 0, -0.02], [0, 0, 1e-9], [0.02, 0.01, 1e-9], [0, 0, 0]):
            found = contact(r, [0, 0, turn])
            assert not np.any(found["f"])
            assert not np.any(found["t"])
    assert contact([0, 0, -0.01])["inserted"] == pytest.approx(0.01)
    assert contact([0.02, 0, -1e-4])["inserted"] == 0.0


def test_it_is_the_same_from_all_sides(contact):
    poses = [([4e-4, 1e-4, -0.012], [0.02, 0.1, 0.3], [0.01, -0.02, -0.03], [0.3, 0.1, 0.2])]
    poses += [([0.004, 1e-3, -1e-4], [0.02, 0.1, 0.0], [0.01, 0.0, -0.01], [0.0, 0.1, 0.2])]
    for pose in poses:
        one = contact(*pose)
        for cosine, sine in ((0, 1), (-1, 0), (0, -1)):
            R = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
            other = contact(*(R @ np.array(part) for part in pose))
            assert other["f"] == pytest.approx(R @ one["f"], abs=1e-13)  # N, rounding
            assert other["t"] == pytest.approx(R @ one["t"], abs=1e-15)


def strained(found):
    """Energy of beam and faces, J."""
    c = compliances(found["inserted"][0])
    tip, edge, end = found["f_tip"], found["f_edge"], found["f_end"]
    return (c.tip * tip @ tip + c.edge * edge @ edge + 2 * c.mixed * tip @ edge) / 2 + end @ end / (2 * WALL)


def test_forces_are_the_slope_of_the_energy(contact):
    rng = np.random.default_rng(1)
    two = 0
    for depth, turn in product((0.006, 0.015, 0.029), range(4)):
        r = np.append(rng.normal(size=2) * 5e-4, -depth)
        tilt = 0.1 * Rotation.from_rotvec([0, 0, turn]).as_matrix() @ [0, 1, 0]
        here = contact(r, tilt)
        two += np.any(here["f_tip"]) and np.any(here["f_edge"])
        for way in np.eye(6):
            step = 1e-7
            ends = []
            for h in (-step, step):
                turned = Rotation.from_rotvec(h * way[3:]) * Rotation.from_rotvec(tilt)
                ends.append(strained(contact(r + h * way[:3], turned.as_rotvec())))
            slope = -(ends[1] - ends[0]) / (2 * step)
            wrench = np.concatenate([here["f"], here["t"]])
            assert way @ wrench == pytest.approx(slope, abs=float(1e-5 * np.linalg.norm(here["f"]) + 1e-9))
    assert two >= 6


class Free(Model):
    """A body on a peg in its hole."""

    world = multibody.World(g=0.0)
    hole = multibody.Fixed()
    body = multibody.Body(m=0.05, r_cm=[0, 0, 0.1], J=np.diag([2e-4, 2e-4, 1e-5]))
    contact = ElasticPegContact()

    def equations(self):
        yield from row(self.hole, self.contact, self.body)


def test_a_body_on_it_keeps_its_energy():
    """From flying free to tip and edge bent at once, through the dynamics of a rigid body."""
    start = dict(r=Fixed([1e-4, 0, -0.02]), v=Fixed([0.03, 0.01, 0]), w=Fixed([0.1, 0.5, 0]))
    run = simulate(Free(body=start | dict(q=Fixed([1.0, 0, 0, 0]))), stop=0.08, tolerance=1e-9, points=201)
    turned = Rotation.from_quat(run["body.q"][:, [1, 2, 3, 0]])
    w = np.array(run["body.w"])
    v = run["body.v"] + np.cross(w, turned.apply([0, 0, 0.1]))
    kinetic = 0.05 * (v**2).sum(1) / 2 + turned.inv().apply(w) ** 2 @ [2e-4, 2e-4, 1e-5] / 2
    names = ("inserted", "f_tip", "f_edge", "f_end")
    bent = [strained({n: np.atleast_1d(run[f"contact.{n}"][k]) for n in names}) for k in range(len(w))]
    energy = kinetic + bent
    assert np.ptp(energy) < 1e-6 * energy[0]  # a thousand times the tolerance
    assert max(bent) > 0.5 * energy[0]
    both = np.linalg.norm(run["contact.f_tip"], axis=1) * np.linalg.norm(run["contact.f_edge"], axis=1)
    assert np.count_nonzero(both > 0) > 20


def test_two_points_hold_from_the_angle_of_two_clearances_over_the_depth(contact):
    for direction in (0.0, 2.0, np.pi / 2, np.pi):
        # turned about this, it leans along the other
        lean = np.array([-np.sin(direction), np.cos(direction), 0])
        along = np.array([np.cos(direction), np.sin(direction), 0])
        angle = np.arctan(2 * CLEARANCE / 0.02)
        for share, touches in ((1 - 1e-6, False), (1 + 1e-6, True)):
            found = contact(np.array([0, 0, -0.02]) - CLEARANCE * along, share * angle * lean)
            assert (np.linalg.norm(found["t"]) > 0) == touches
        found = contact(np.array([0, 0, -0.02]) - CLEARANCE * along, 1.5 * angle * lean)
        assert found["t"] @ lean < 0  # it is turned upright
        assert found["f_tip"] @ found["f_edge"] < 0
        assert found["f"][2] > 0  # and driven out, as the edge pushes across the bent shaft


def test_cut_forces_balance(contact):
    r = np.array([6e-4, -2e-4, -0.018])
    found = contact(r, [0.03, 0.1, 0.0], [0.01, 0.0, -0.02])
    assert np.linalg.norm(found["f"]) > 0.1
    assert found["frame_b.f"] == pytest.approx(-found["f"])
    assert found["frame_b.t"] == pytest.approx(-found["t"])
    assert found["frame_a.f"] == pytest.approx(found["f"])
    assert found["frame_a.t"] == pytest.approx(found["t"] + np.cross(r, found["f"]))


def test_friction_holds_back_and_not_more_than_its_share(contact):
    pose = ([8e-4, 0, -0.01], [0, 0, 0])
    push = contact(*pose)["f"]
    load = np.linalg.norm(push)
    for v in ([0, 0, -1.0], [0, 0, 1.0], [0, 1.0, 0], [0, 0.6, -0.8]):
        rubbed = contact(*pose, v)["f"] - push
        assert rubbed @ v == pytest.approx(-MU * load, rel=1e-4)  # the bent shaft leans by less than 0.01
        assert np.linalg.norm(rubbed) < MU * load
    slow = contact(*pose, [0, 0, -1e-6])["f"] - push
    assert slow[2] == pytest.approx(MU * load * 1e-3, rel=1e-3)
    along = contact(*pose, push)["f"] - push
    assert np.linalg.norm(along) < 1e-12  # straight out of the wall nothing slides


def test_beside_the_hole_the_block_pushes_and_at_its_end_the_floor(contact):
    upright = contact([0.005, 0, -1e-4])
    assert upright["f"] == pytest.approx([0, 0, WALL * 1e-4])
    tilted = contact([0.005, 0, -1e-4], [0, 0.1, 0])
    soft = 1 / WALL + np.sin(0.1) ** 2 / BENDING
    assert tilted["f"] == pytest.approx([0, 0, 1e-4 / soft])
    aside = tilted["f"][2] * np.sin(0.1) * np.cos(0.1) / BENDING  # the tip is bent away under the load
    assert tilted["t"] == pytest.approx([0, aside * tilted["f"][2], 0])
    floor = contact([0, 0, -DEPTH - 2e-4])
    assert floor["f"] == pytest.approx([0, 0, WALL * 2e-4])


def test_below_the_mouth_the_tip_is_where_less_energy_holds_it(contact):
    depth, spring = 1e-3, 1 / (1 / BENDING + 1 / WALL)
    limit = CLEARANCE + depth * np.sqrt(WALL / spring)
    inside, outside = (contact([limit * share, 0, -depth]) for share in (1 - 1e-9, 1 + 1e-9))
    assert inside["f"][0] < 0
    assert inside["f"][2] < 0.02 * outside["f"][2]
    assert inside["inserted"] > 0
    assert outside["inserted"] == 0
    # but for the edge, just above the tip
    assert strained(inside) == pytest.approx(strained(outside), rel=0.05)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (dict(clearance=0.0), "contact.*expected a clearance above zero"),
        (dict(wall=0.0), "contact.*expected a stiffness above zero"),
        (dict(bending=0.0), "contact.*expected a stiffness above zero"),
        (dict(v_s=0.0), "contact.*expected a smoothing speed above zero"),
        (dict(depth=0.1), "contact.*expected a hole that is less deep than the peg is long"),
    ],
)
def test_what_is_no_peg_and_no_hole_is_refused(change, message):
    with pytest.raises(ModelError, match=message):
        translate(Held(contact=change))
