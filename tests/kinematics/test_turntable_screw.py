"""Angles of motors and turntables: the law of cosines, round trips, slopes by differences, dead centres, places in space."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import ModelError
from gantrytau.kinematics import Kinematics, TurntableScrew
from gantrytau_models import F1GantryTau, prototypes

SCREWS = {
    "usual": TurntableScrew(base=0.3, crank=0.12, angle=1.2, lead=0.005),
    "other side": TurntableScrew(base=0.3, crank=0.12, angle=-1.2, lead=0.005),
    "left-hand": TurntableScrew(base=0.25, crank=0.1, angle=math.pi / 2, lead=-0.004),
    "equal arms": TurntableScrew(base=0.2, crank=0.2, angle=2.5, lead=0.01),
    "long crank": TurntableScrew(base=0.1, crank=0.5, angle=0.4, lead=0.002),
}
all_screws = pytest.mark.parametrize("screw", SCREWS.values(), ids=SCREWS)


def inside(screw: TurntableScrew, count: int = 201) -> np.ndarray:
    """Angles of the turntable between the dead centres."""
    least, most = screw.range
    return least + (most - least) * (np.arange(count) + 0.5) / count


@all_screws
def test_pivots_are_as_far_apart_as_the_screw_is_long(screw):
    phi = inside(screw)
    base, crank = np.array([screw.base, 0.0, 0.0]), [screw.crank, 0.0, 0.0]
    nut = Rotation.from_euler("z", (screw.angle + phi)[:, None]).apply(crank)
    apart = np.linalg.norm(nut - base, axis=1)
    np.testing.assert_allclose(screw.length(phi), apart, rtol=1e-12)
    # a turn of the motor is the lead
    start = np.linalg.norm(Rotation.from_euler("z", screw.angle).apply(crank) - base)
    np.testing.assert_allclose(screw.motor(phi) / (2 * math.pi) * screw.lead, apart - start, atol=1e-13)
    # the lever is the distance of the line through both pivots from the axis
    along = (nut - base) / apart[:, None]
    np.testing.assert_allclose(screw.lever(phi), np.cross(base, along)[:, 2], atol=1e-13)


@all_screws
def test_forth_and_back(screw):
    phi = inside(screw)
    # by the slope at dead centres
    np.testing.assert_allclose(screw.turntable(screw.motor(phi)), phi, atol=1e-11)
    assert screw.motor(0.0) == 0.0
    assert abs(screw.turntable(0.0)) < 1e-15 * 4
    assert np.shape(screw.motor(0.1 * np.eye(3))) == (3, 3)


@all_screws
def test_slopes_are_differences(screw):
    phi, step = inside(screw)[5:-5], 1e-5
    by_motor = (screw.motor(phi + step) - screw.motor(phi - step)) / (2 * step)
    scale = np.abs(screw.ratio(phi)).max()
    np.testing.assert_allclose(screw.ratio(phi), by_motor, atol=1e-6 * scale)
    by_ratio = (screw.ratio(phi + step) - screw.ratio(phi - step)) / (2 * step)
    np.testing.assert_allclose(screw.ratio_slope(phi), by_ratio, atol=1e-5 * np.abs(by_ratio).max())
    # a turntable goes slower by as much
    theta = screw.motor(phi)
    by_theta = (screw.turntable(theta + step) - screw.turntable(theta - step)) / (2 * step)
    np.testing.assert_allclose(by_theta * screw.ratio(phi), 1.0, rtol=1e-3)


@all_screws
def test_nothing_is_beyond_dead_centres(screw):
    least, most = screw.range
    assert most - least == pytest.approx(math.pi)
    assert least < 0 < most
    phi = np.array([least - 0.1, least, most, most + 0.1, np.nan, np.inf])
    for answer in (screw.motor, screw.length, screw.lever, screw.ratio, screw.ratio_slope):
        assert np.isnan(answer(phi)).all()
    near = np.array([least + 1e-6, most - 1e-6])
    assert np.abs(screw.lever(near)).max() < 1e-5 * max(screw.base, screw.crank) or screw.base == screw.crank
    longest = 2 * math.pi / screw.lead * (screw.base + screw.crank - float(screw.length(0.0)))
    assert np.isnan(screw.turntable(1.001 * longest))
    assert np.isfinite(screw.turntable(0.999 * longest))


def test_largest_lever_is_the_shorter_arm():
    # the screw is across the shorter arm where it touches the circle of its pivot
    screw = SCREWS["usual"]
    phi = np.linspace(*screw.range, 100_001)[1:-1]
    assert np.nanmax(screw.lever(phi)) == pytest.approx(0.12, rel=1e-8)
    # cos(angle + phi) = crank / base there, by Pythagoras
    assert math.cos(screw.angle + phi[np.nanargmax(screw.lever(phi))]) == pytest.approx(0.12 / 0.3, abs=1e-4)


def test_screws_of_places_in_space():
    rng = np.random.default_rng(4)
    for _ in range(20):
        turn = Rotation.random(rng=rng)
        screw = TurntableScrew(
            base=rng.uniform(0.1, 0.5), crank=rng.uniform(0.05, 0.3), angle=rng.uniform(-3.1, 3.1), lead=0.005
        )
        height = rng.uniform(-1, 1)
        base, nut = (
            np.array([screw.base, 0, height]),
            Rotation.from_euler("z", screw.angle).apply([screw.crank, 0, height]),
        )
        found = TurntableScrew.of_places(
            axis=3 * turn.apply([0, 0, 1.0]), base=turn.apply(base), nut=turn.apply(nut), lead=0.005
        )
        for name in ("base", "crank", "angle", "lead"):
            assert getattr(found, name) == pytest.approx(getattr(screw, name), rel=1e-9)


def test_motors_of_an_f1_that_reorients_its_plate():
    # section 2.2: the F1 turns its plate by 15 to 30 degrees; a screw at a right angle takes its turntables there
    screw = TurntableScrew(base=0.3, crank=0.1, angle=math.pi / 2, lead=0.005)
    f1 = Kinematics(F1GantryTau(prototypes.F1))
    tilt = Rotation.from_rotvec(np.radians([[20.0, 0, 0], [0, 20.0, 0], [-20.0, 0, 0]])).as_matrix()
    q = f1.ik(np.tile(f1.home.r, (3, 1)), tilt @ f1.home.R)
    motors = screw.motor(q[:, 3:])
    assert np.isfinite(motors).all()
    assert np.abs(motors).max() > 2 * math.pi
    np.testing.assert_allclose(screw.turntable(motors), q[:, 3:], atol=1e-13)
    np.testing.assert_allclose(
        f1.fk(np.hstack([q[:, :3], screw.turntable(motors)]))[0], np.tile(f1.home.r, (3, 1)), atol=1e-10
    )


@pytest.mark.parametrize(
    "wrong", [dict(base=0.0), dict(crank=-0.1), dict(angle=0.0), dict(angle=90.0), dict(lead=0.0)]
)
def test_numbers_that_make_no_screw(wrong):
    with pytest.raises(ModelError) as caught:
        TurntableScrew(**(dict(base=0.3, crank=0.1, angle=1.0, lead=0.005) | wrong))
    assert caught.value.argument == next(iter(wrong))


def test_places_and_angles_that_cannot_be():
    of_places: Any = TurntableScrew.of_places
    places: dict[str, Any] = dict(axis=[0, 0, 1], base=[0.3, 0, 0], nut=[0, 0.1, 0], lead=0.005)
    for change, message in (
        (dict(axis=[0, 0, 0]), "an axis of length 0"),
        (dict(base=[0.3, 0]), "found base of 2"),
        (dict(nut=[0, 0.1, 0.02]), "pivots 0.02 m apart along the axis"),
        (dict(base=[0, 0, 0]), "found base=0.0"),
        (dict(nut=[0.1, 0, 0]), "found angle=0.0"),
    ):
        with pytest.raises(ModelError, match=message):
            of_places(**(places | change))
