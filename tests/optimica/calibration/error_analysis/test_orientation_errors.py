"""Errors of orientation with a known cause: a link, a joint, a bent guideway, or noise."""

from dataclasses import replace

import matplotlib
import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.kinematics import Kinematics
from gantrytau.kinematics.rotations import turned
from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica.calibration.data.findings import CalibrationError
from gantrytau_optimica.calibration.error_analysis.orientation_errors import (
    Causes,
    orientation_causes,
    orientation_errors,
)
from tests.optimica.refusals import refused

matplotlib.use("Agg")

# the frame of the tracker is 4 deg off
ALONG = np.mean([arm.direction for arm in prototypes.D1.arms], axis=0)


def grid() -> np.ndarray:
    """180 places of the tool of D1 in six layers, as many as in thesis section 4.2 (176)."""
    x, y, z = np.linspace(-1.4, 0.6, 6), np.linspace(-4.9, -3.9, 6), np.linspace(-0.4, 0.5, 5)
    return np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)


@pytest.fixture(scope="module")
def d1() -> Kinematics:
    return Kinematics(SixLinkGantryTau(prototypes.D1))


@pytest.fixture(scope="module")
def level() -> Kinematics:
    """D1 as drawn: joints of one arm stand to each other as on the plate, links of one arm are of one length."""
    R = np.array(prototypes.D1.plate_rotation)
    arms = []
    for arm in prototypes.D1.arms:
        links = [
            replace(
                link, length=arm.length, offset=tuple(np.array(arm.offset) + R @ np.array(link.plate_offset))
            )
            for link in arm.links
        ]
        arms.append(replace(arm, links=links))
    return Kinematics(SixLinkGantryTau(replace(prototypes.D1, arms=arms)))


def poses_of(kinematics: Kinematics, lengths=None, moved=None, noise: float = 0.0):
    """Measured poses of a robot whose links are longer by `lengths` (6,) and whose cart joints are off by moved(q).

    Newton's method on the lengths, independent of the linearisation that the causes are found with.
    """
    geometry = kinematics.linked().geometry
    q = kinematics.ik(grid())
    r, R = kinematics.fk(q)
    A = geometry.cart_joints(q) + (0.0 if moved is None else moved(q))
    wanted = geometry.length + (0.0 if lengths is None else np.asarray(lengths))
    for _ in range(8):
        B = geometry.plate_joints(r, R)
        found = np.linalg.norm(B - A, axis=2)
        u = (B - A) / found[:, :, None]
        rows = np.concatenate([u, np.cross(B - r[:, None], u)], axis=2)
        step = np.linalg.solve(rows, (wanted - found)[:, :, None])[:, :, 0]
        r, R = r + step[:, :3], turned(R, step[:, 3:])
        if np.abs(step).max() < 1e-13:
            break
    else:
        raise AssertionError("Newton's method did not converge")
    random = np.random.default_rng(2)
    r = r + noise * random.standard_normal(r.shape)
    return q, r, turned(R, noise / 0.2 * random.standard_normal(r.shape))  # joints are some 0.2 m apart


def rolling(arm: int):
    """A cart that rolls about its guideway by up to 0.05 mrad and strays 50 um to the side, in waves of 1.5 m."""

    def moved(q):
        wave = np.sin(2 * np.pi * q[:, arm] / 1.5)
        joints = offsets[arm] - offsets[arm].mean(axis=0)
        shift = 50e-6 * wave[:, None, None] * np.array([0.0, 1.0, 0.0])
        roll = 5e-5 * np.cos(2 * np.pi * q[:, arm] / 1.5)[:, None, None] * np.cross([1.0, 0.0, 0.0], joints)
        whole = np.zeros((len(q), 6, 3))
        whole[:, links[arm]] = shift + roll
        return whole

    links = [[0], [1, 2], [3, 4, 5]]
    offsets = [np.array([link.offset for link in a.links]) for a in prototypes.D1.arms]
    return moved


def test_turns_are_those_that_were_made():
    random = np.random.default_rng(1)
    turns = 1e-3 * random.standard_normal((100, 3))
    base = turned(np.eye(3)[None], np.array([[0.3, 1.2, -0.4]]))[0]
    R = turned(np.broadcast_to(base, (100, 3, 3)), turns)
    found = orientation_errors(random.normal(size=(100, 3)), R, reference=base)
    assert found.turns == pytest.approx(turns, abs=1e-14)
    assert found.angle == pytest.approx(np.linalg.norm(turns, axis=1), abs=1e-14)
    mean = orientation_errors(np.zeros((100, 3)), R)
    assert mean.turns.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-6)  # second order in turns of 1e-3


def test_euler_angles_make_the_rotation(d1):
    q = d1.ik(grid())
    r, R = d1.fk(q)
    angles = orientation_errors(r, R).euler
    a, b, c = angles.T
    about_z = [turned(np.eye(3)[None].repeat(len(x), 0), np.outer(x, [0, 0, 1])) for x in (a, c)]
    about_y = turned(np.eye(3)[None].repeat(len(b), 0), np.outer(b, [0, 1, 0]))
    assert about_z[0] @ about_y @ about_z[1] == pytest.approx(R, abs=1e-12)


def test_the_orientation_of_d1_varies_as_much_as_in_the_thesis(d1):
    """Figure 4.7: 0.1 deg in alpha and 0.5 deg in beta; here from the links of Table 5.9, in a box of our choice."""
    r, R = d1.fk(d1.ik(grid()))
    alpha, beta, _ = np.degrees(orientation_errors(r, R).variation)
    assert 0.3 < beta < 0.7
    assert alpha < beta / 2


def test_the_level_robot_is_level(level):
    _, R = level.fk(level.ik(grid()))
    assert orientation_errors(grid(), R).angle.max() < 1e-6  # plate_rotation has six decimals


@pytest.mark.parametrize("link", [1, 3, 5])
def test_a_link_that_is_too_long(level, link):
    q, r, R = poses_of(level, lengths=200e-6 * np.eye(6)[link], noise=5e-7)
    causes = orientation_causes(level, q, r, R)
    layers = orientation_errors(r, R, along=ALONG).by_layers()
    assert causes.cause == layers.cause == "links"
    assert causes.chance > 1e-3
    assert layers.shares["links"] > 0.95
    assert causes.shares["links"] > 0.95
    made = level.fk(q)[1]
    found = orientation_errors(r, R @ np.swapaxes(made, 1, 2), reference=np.eye(3)).turns
    # a twentieth of 200 um over 0.2 m
    assert causes.links == pytest.approx(found - found.mean(axis=0), abs=5e-5)


@pytest.mark.parametrize("arm", [1, 2])
def test_a_cart_that_rolls_and_strays(level, arm):
    q, r, R = poses_of(level, moved=rolling(arm), noise=1e-6)
    causes = orientation_causes(level, q, r, R, degree=8)
    layers = orientation_errors(r, R, along=ALONG).by_layers(4)
    assert causes.cause == "guideways"
    assert causes.chance < 1e-6
    assert layers.chance < 1e-6
    assert layers.shares["guideways"] > 0.3  # the rest of it looks the same in all layers


def test_what_is_shifted_along_with_both_is_parted(level):
    """Both at once: each part is what it is alone, but for what constant errors can imitate of the guideway."""
    lengths = 100e-6 * np.array([0, 1, -1, 0, 1, 0])
    alone = orientation_causes(level, *poses_of(level, moved=rolling(2)), degree=8)
    both = orientation_causes(level, *poses_of(level, lengths, rolling(2)), degree=8)
    assert both.guideways == pytest.approx(alone.guideways, abs=1e-6)  # second order of 1 mrad
    link = orientation_causes(level, *poses_of(level, lengths), degree=8)
    assert both.links == pytest.approx(link.links + alone.links, abs=1e-6)


def test_noise_alone_has_no_cause(level):
    q, r, R = poses_of(level, noise=5e-6)
    causes = orientation_causes(level, q, r, R)
    assert causes.chance > 1e-3
    assert causes.cause == "rest"
    assert orientation_errors(r, R, along=ALONG).by_layers().cause == "rest"


def bent(seed: int):
    """Carts of one to three arms that stray by some 50 um and turn by some 0.25 mrad, in waves of 0.8 to 3 m."""
    rng = np.random.default_rng(seed)
    which = rng.permutation(3)[: rng.integers(1, 4)]
    periods, phases = rng.uniform(0.8, 3.0, 3), rng.uniform(0, 2 * np.pi, (3, 2, 3))
    sizes = 50e-6 * rng.normal(size=(3, 2, 3)) / np.array([1.0, 0.2])[:, None]
    first = np.array([0, 1, 1, 2, 2, 2])

    def moved(q):
        whole = np.zeros((len(q), 6, 3))
        for link, arm in enumerate(first):
            offsets = np.array([each.offset for each in prototypes.D1.arms[arm].links])
            joint = np.array(offsets[link - np.argmax(first == arm)]) - offsets.mean(axis=0)
            angle = 2 * np.pi * q[:, arm, None, None] / periods[arm] + phases[arm]
            shift, turn = np.moveaxis(sizes[arm] * np.sin(angle), 1, 0)
            whole[:, link] = (shift + np.cross(turn, joint)) * (arm in which)
        return whole

    return moved


@pytest.mark.parametrize("seed", range(12))
def test_the_cause_is_never_mistaken(level, seed):
    """At random: what links did is found as that, and what guideways did is never put on links."""
    lengths = 100e-6 * np.random.default_rng(seed).standard_normal(6)
    x = grid()[:, 0]
    for layers in (x < np.inf, x < -1.0 + 1e-9, x < -1.4 + 1e-9):  # six, two, one
        q, r, R = (a[layers] for a in poses_of(level, lengths=lengths, noise=2e-6))
        assert orientation_causes(level, q, r, R).cause in {"links", "unknown"}
        q, r, R = (a[layers] for a in poses_of(level, moved=bent(seed), noise=2e-6))
        assert orientation_causes(level, q, r, R).cause != "links"
    q, r, R = poses_of(level, lengths=lengths, noise=2e-6)
    assert orientation_causes(level, q, r, R).cause == "links"
    assert orientation_errors(r, R, along=ALONG).by_layers().cause == "links"
    q, r, R = poses_of(level, moved=bent(seed), noise=2e-6)
    assert orientation_errors(r, R, along=ALONG).by_layers().cause in {"guideways", "rest"}


def test_poses_in_one_layer_do_not_tell(level):
    layer = grid()[:, 0] < -1.4 + 1e-9
    found = orientation_causes(level, *(a[layer] for a in poses_of(level, moved=bent(0), noise=2e-6)))
    assert found.cause == "unknown"
    assert found.either == pytest.approx(found.shares["links"], rel=1e-12)
    assert str(found).endswith("cause: unknown")


def test_parts_sum_up_to_the_whole(level):
    q, r, R = poses_of(level, lengths=100e-6 * np.eye(6)[3], moved=rolling(1), noise=1e-6)
    found = orientation_errors(r, R, along=ALONG)
    layers = found.by_layers()
    whole = found.turns - found.turns.mean(axis=0)
    assert layers.links + layers.guideways + layers.rest == pytest.approx(whole, abs=1e-15)
    squares = sum(np.sum(part**2) for part in (layers.links, layers.guideways, layers.rest))
    assert squares == pytest.approx(np.sum(whole**2))  # Pythagoras: one after the other, each orthogonal
    assert sum(layers.shares.values()) == pytest.approx(1.0)
    assert sum(orientation_causes(level, q, r, R).shares.values()) == pytest.approx(1.0)


def test_the_figure_is_written(level, tmp_path):
    q, r, R = poses_of(level, moved=rolling(1))
    orientation_errors(r, R).plot(orientation_causes(level, q, r, R), file=tmp_path / "turns.png")
    assert (tmp_path / "turns.png").stat().st_size > 5000
    assert "guideways" in str(orientation_causes(level, q, r, R))


# messages


def test_euler_angles_near_their_singularity_are_refused():
    found = orientation_errors(np.zeros((3, 3)), np.eye(3))
    with pytest.raises(ModelError, match="euler: found orientations with beta near 0 or pi"):
        _ = found.euler


def test_one_layer_cannot_tell(level):
    _, _, R = poses_of(level)
    layer = np.abs(grid()[:, 0] - grid()[0, 0]) < 1e-9
    with pytest.raises(CalibrationError, match="by_layers: found all poses at one place along the guideways"):
        orientation_errors(grid()[layer], R[layer]).by_layers()


def test_too_few_poses_are_refused(level):
    q, r, R = poses_of(level)
    with pytest.raises(CalibrationError, match=r"orientation: found 12 poses for \d+ unknowns") as caught:
        orientation_causes(level, q[::15], r[::15], R[::15], degree=8)
    assert caught.value.rows.tolist() == list(range(12))
    some = np.random.default_rng(0).permutation(180)[:25]
    with pytest.raises(CalibrationError, match=r"25 poses for \d+ unknowns, .* lower the degree"):
        orientation_errors(r[some], R[some]).by_layers()


def test_what_is_wrong_is_told(level):
    q, r, R = poses_of(level)
    with refused("along"):
        orientation_errors(r, R, along=[0.0, 0.0, 0.0])
    with pytest.raises(ModelError, match="found poses without orientation or with NaN"):
        orientation_errors(r, None)
    with refused("degree"):
        orientation_errors(r, R, along=ALONG).by_layers(0)
    with pytest.raises(ModelError, match="found 179 rows of q and 180 poses"):
        orientation_causes(level, q[1:], r, R)
    with pytest.raises(ModelError, match="found 3 links and 0 turntables, expected six links"):
        orientation_causes(GantryTau(prototypes.D1), q, r, R)
    q[3, 1] = np.nan
    with pytest.raises(CalibrationError, match="rows that are not finite") as caught:
        orientation_causes(level, q, r, R)
    assert caught.value.rows.tolist() == [3]


def test_shares_of_nothing_are_zero():
    nothing = Causes(np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((4, 3)), 1.0)
    assert set(nothing.shares.values()) == {0.0}
