"""Contact of a sphere or a point with a plane: bounces against their law, energy, friction, rolling; any orientation."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from gantrytau import Fixed, Model, ModelError, Parameter, connect, simulate, translate
from gantrytau.mechanics import multibody
from gantrytau.mechanics.multibody import (
    Body,
    HuntCrossley,
    LinearContact,
    PointMass,
    SurfaceContact,
    World,
    WorldForce,
)
from tests.mechanisms.rows import row
from tests.references.rotations import random_rotation, turn

TOLERANCE = 1e-8
LOSS = 1e-6  # of the energy of one bounce at that tolerance
G = 9.81


class Dropped(Model):
    """A point mass above a plane."""

    world = World(g=0.0)
    ground = multibody.Fixed()
    ball = PointMass(m=0.5)
    contact = SurfaceContact(point=True)

    def equations(self):
        yield from row(self.ground, self.contact, self.ball)


def thrown(r, v):
    return dict(frame_a=dict(r=Fixed(r)), v=Fixed(v))


def restitution(v_0, a):
    """e of Hunt and Crossley's law: log((1 + x) / (1 - e x)) = (1 + e) x."""
    x = 1.5 * a * v_0
    left = brentq(lambda e: np.log1p(x) - np.log1p(-e * x) - (1 + e) * x, 1e-9, min(1.0, 1 / x) * (1 - 1e-12))
    return float(left)


@pytest.mark.parametrize(
    "law", [HuntCrossley(k=1e8), HuntCrossley(k=1e5, n=1.0), HuntCrossley(k=1e6, n=2.5), LinearContact(c=1e5)]
)
def test_an_elastic_bounce_keeps_the_energy(law):
    model = Dropped(ball=thrown([0, 0, 0.1], [0.5, 0, -2.0]), contact=dict(law=law))
    run = simulate(model, stop=0.2, tolerance=TOLERANCE)
    assert run["contact.law.f"].min() == 0.0
    assert (run.final("ball.v") ** 2).sum() == pytest.approx(4.25, rel=LOSS)
    assert run.final("ball.v") == pytest.approx([0.5, 0.0, 2.0], rel=LOSS, abs=LOSS)


@pytest.mark.parametrize("a", [0.01, 0.2, 2.0])
@pytest.mark.parametrize(
    ("m", "k", "n"), [(0.5, 1e6, 1.5), (1e-6, 1e4, 1.5), (3.0, 1e5, 1.0), (3.0, 1e7, 2.0)]
)
def test_a_bounce_loses_what_its_law_says(a, m, k, n):
    ball = thrown([0, 0, 1e-3], [0, 0, -1.0]) | dict(m=m)
    run = simulate(
        Dropped(ball=ball, contact=dict(law=HuntCrossley(k=k, n=n, a=a))), stop=0.5, tolerance=TOLERANCE
    )
    assert run.final("ball.v")[2] == pytest.approx(restitution(1.0, a), rel=LOSS)


def test_the_slope_of_the_loss_is_the_dissipation():
    assert (1 - restitution(1e-3, 0.5)) / 1e-3 == pytest.approx(0.5, rel=1e-3)


@pytest.mark.parametrize("d", [10.0, 100.0, 400.0])
def test_spring_and_damper_are_cut_where_they_would_pull(d):
    m, c = 0.5, 1e4
    run = simulate(
        Dropped(ball=thrown([0, 0, 1e-3], [0, 0, -1.0]), contact=dict(law=LinearContact(c=c, d=d))),
        stop=0.5,
        tolerance=TOLERANCE,
        points=5001,
    )
    assert run["contact.law.f"].min() == 0.0
    assert run["contact.law.f"].max() >= 0.9 * d  # the damper begins with a jump
    # p'' = -(c p + d p') / m from p = 0, p' = 1 until the force is zero: where p' / p = -c / d
    roots = np.roots([m, d, c]).astype(complex)
    one, other = roots

    def motion(t):
        """Depth and its rate."""
        p = (np.exp(one * t) - np.exp(other * t)) / (one - other)
        return np.real(np.array([p, (one * np.exp(one * t) - other * np.exp(other * t)) / (one - other)]))

    t = np.linspace(1e-7, 0.5, 500001)
    force = [c, d] @ motion(t)
    k = int(np.argmax(force < 0))
    end = brentq(lambda now: [c, d] @ motion(now), t[k - 1], t[k])
    assert run.final("ball.v")[2] == pytest.approx(-motion(end)[1], abs=LOSS)


def test_no_law_pulls_what_is_torn_away():
    class Torn(Dropped):
        """The point mass is pulled off by a force."""

        pull = WorldForce()

        def equations(self):
            yield from super().equations()
            yield connect(self.pull.frame_b, self.contact.frame_b)

    for law in (HuntCrossley(k=1e5, a=5.0), LinearContact(c=1e3, d=300.0)):
        run = simulate(
            Torn(ball=thrown([0, 0, -0.01], [0, 0, 0]), contact=dict(law=law)),
            stop=0.2,
            inputs={"pull.f": [0.0, 0.0, 500.0]},
        )
        assert run["contact.law.f"].min() >= 0.0
        assert run["contact.law.f"].max() > 1.0
        assert run.final("ball.v")[2] > 500.0 / 0.5 * 0.1


PLANES = [np.zeros(3), [np.pi / 2, 0, 0], [np.pi, 0, 0], [0, -np.pi / 2, 0], [0.3, -1.2, 2.0]]


@pytest.mark.parametrize("vector", PLANES)
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_a_bounce_is_the_same_in_any_orientation_and_size(vector, scale):
    vector = np.array(vector)
    angle = float(np.linalg.norm(vector))
    R = turn(vector)
    place = scale * np.array([0.3, -0.2, 0.5])
    model = Dropped(
        ground=dict(r=place, n=vector / angle if angle else [1, 0, 0], phi=angle),
        ball=thrown(place + scale * R @ [0, 0, 1e-3], scale * R @ [0.4, 0.1, -1.0]),
        contact=dict(law=HuntCrossley(k=1e6 / np.sqrt(scale), a=0.2 / scale), mu=0.3, v_s=1e-3 * scale),
    )
    run = simulate(model, stop=0.1, tolerance=TOLERANCE)
    e = restitution(1.0, 0.2)
    v = R.T @ run.final("ball.v") / scale
    assert v[2] == pytest.approx(e, rel=2e-6 if scale == 1 else 1e-5)
    # sliding all the time, the tangential push is mu times the normal push, but for (v_s / slip)^2 / 2
    slow = np.hypot(0.4, 0.1) - min(0.3 * (1 + e), 0.5)
    if slow > 0:
        assert np.hypot(*v[:2]) == pytest.approx(slow, rel=1e-3)
    else:
        assert np.hypot(*v[:2]) < 0.02
    assert v[0] * 0.1 == pytest.approx(v[1] * 0.4, abs=1e-5)


class Rolling(Model):
    """A ball on an inclined plane."""

    slope = Parameter(0.2, unit="rad", description="inclination", evaluate=True)
    world = World(g=G)
    ground = multibody.Fixed(n=[0, 1, 0], phi=slope)
    ball = Body(m=0.5, J=0.4 * 0.5 * 0.1**2 * np.eye(3))
    contact = SurfaceContact(radius=0.1, law=HuntCrossley(k=1e7, a=0.5))

    def equations(self):
        yield from row(self.ground, self.contact, self.ball)


def rolled(slope, mu, v_s=1e-5, stop=0.5):
    depth = (0.5 * G * np.cos(slope) / 1e7) ** (1 / 1.5)  # at rest
    normal = np.array([np.sin(slope), 0.0, np.cos(slope)])
    start = dict(r=Fixed((0.1 - depth) * normal), v=Fixed(np.zeros(3)), w=Fixed(np.zeros(3)))
    run = simulate(
        Rolling(slope=slope, ball=start, contact=dict(mu=mu, v_s=v_s)), stop=stop, tolerance=TOLERANCE
    )
    down = np.array([np.cos(slope), 0.0, -np.sin(slope)])
    return run, run.final("ball.v") @ down


def test_a_ball_rolls_down_with_five_sevenths_of_what_slides_and_slides_where_friction_is_small():
    run, speed = rolled(0.2, mu=0.5)
    assert speed == pytest.approx(5 / 7 * G * np.sin(0.2) * 0.5, rel=1e-3)  # the depth, and creep at v_s
    assert run.final("ball.w")[1] == pytest.approx(speed / 0.1, rel=1e-3)
    _, speed = rolled(0.2, mu=0.02)
    assert speed == pytest.approx(G * (np.sin(0.2) - 0.02 * np.cos(0.2)) * 0.5, rel=1e-3)


def test_a_sphere_that_meets_both_frames_moving_gives_back_impulse_and_moment():
    class Meeting(Model):
        """Two free bodies, one with a plane on it, the other a sphere."""

        world = World(g=0.0)
        plate = Body(m=2.0, J=np.diag([0.05, 0.06, 0.1]))
        ball = Body(m=0.5, J=2e-3 * np.eye(3))
        contact = SurfaceContact(radius=0.1, mu=0.4, law=HuntCrossley(k=1e6))

        def equations(self):
            yield from row(self.plate, self.contact, self.ball)

    R = random_rotation(np.random.default_rng(4))
    model = Meeting(
        plate=dict(v=Fixed(R @ [0.1, 0, 0.5]), w=Fixed([0.3, -0.2, 0.4])),
        ball=dict(r=Fixed([0.1, 0.2, 0.13]), v=Fixed([0.3, 0.1, -1.5]), w=Fixed([1.0, 2.0, 3.0])),
    )
    run = simulate(model, stop=0.1, tolerance=TOLERANCE)
    assert run["contact.law.f"].max() > 100.0

    def moments(k):
        masses, places, speeds = (
            (2.0, 0.5),
            (run["plate.r"][k], run["ball.r"][k]),
            (run["plate.v"][k], run["ball.v"][k]),
        )
        plate = Rotation.from_quat(run["plate.q"][k][[1, 2, 3, 0]])
        spin = plate.apply(np.diag([0.05, 0.06, 0.1]) @ plate.inv().apply(np.array(run["plate.w"][k])))
        spin = spin + 2e-3 * run["ball.w"][k]
        impulse = sum(m * v for m, v in zip(masses, speeds, strict=True))
        return impulse, spin + sum(m * np.cross(r, v) for m, r, v in zip(masses, places, speeds, strict=True))

    for before, after in zip(moments(0), moments(-1), strict=True):
        np.testing.assert_allclose(after, before, atol=1e3 * TOLERANCE)


def test_what_rests_stays_and_a_bounce_that_ends_is_told_to_its_end():
    depth = (0.5 * G / 1e7) ** (1 / 1.5)
    model = Dropped(
        world=dict(g=G), ball=thrown([0, 0, -depth], [0, 0, 0]), contact=dict(law=HuntCrossley(k=1e7, a=0.5))
    )
    run = simulate(model, stop=2.0, tolerance=TOLERANCE)
    assert np.ptp(run["ball.frame_a.r"][:, 2]) < 10 * TOLERANCE
    model = Dropped(
        world=dict(g=G), ball=thrown([0, 0, 0.02], [0, 0, 0]), contact=dict(law=HuntCrossley(k=1e6, a=2.0))
    )
    run = simulate(model, stop=3.0, tolerance=TOLERANCE)
    assert run.final("contact.law.f") == pytest.approx(0.5 * G, rel=1e-3)


def test_bad_planes_are_refused():
    for changes, words in (
        (dict(n=[0.0, 0.0, 0.0]), "expected a normal that is not zero"),
        (dict(v_s=0.0), "expected a smoothing speed above zero"),
        (dict(mu=-0.1), "contact.mu"),
        (dict(law=HuntCrossley(n=0.5)), "contact.law.n"),
    ):
        with pytest.raises(ModelError, match=words):
            translate(Dropped(contact=changes))
