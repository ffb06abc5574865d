"""All assembly modes: counts, lengths, symmetries, published hexapods, and Newton as another way to the real ones."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau.kinematics import assembly_modes
from gantrytau_models import prototypes
from tests.families import first_of
from tests.references import f1

# Dietmaier (1998), The Stewart-Gough platform of general geometry can have 40 real postures
DIETMAIER_BASE = [
    [0, 0, 0], [1.107915, 0, 0], [0.549094, 0.756063, 0], [0.735077, -0.223935, 0.525991],
    [0.514188, -0.526063, -0.368418], [0.590473, 0.094733, -0.205018],
]  # fmt: skip
DIETMAIER_PLATFORM = [
    [0, 0, 0], [0.542805, 0, 0], [0.956919, -0.528915, 0], [0.665885, -0.353482, 1.402538],
    [0.478359, 1.158742, 0.107672], [-0.137087, -0.235121, 0.353913],
]  # fmt: skip
DIETMAIER_LENGTHS = [1, 0.645275, 1.086284, 1.503439, 1.281933, 0.771071]

MET = 1e-12  # m: a nanometre of a millimetre, ten thousand roundings of a metre
SAME = 1e-8  # m and 1, of modes found in two ways: rounding by the condition of the links, up to some 1e5
HOME = [0.4, 0, 0, 0, 0, 0]


def random_hexapod(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joints in boxes, and lengths that fit at one pose at least."""
    rng = np.random.default_rng(seed)
    base, platform = rng.uniform(-1, 1, (6, 3)), rng.uniform(-1, 1, (6, 3)) * rng.uniform(0.2, 1)
    R = Rotation.random(rng=rng).as_matrix()
    return base, platform, np.linalg.norm(rng.uniform(-1.5, 1.5, 3) + platform @ R.T - base, axis=1)


def f1_hexapod(q, record=None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The links of the F1 with its actuators at q."""
    record = record or prototypes.F1
    state = f1.State(np.zeros(3), np.eye(3), np.array(q), np.zeros(f1.SPEEDS))
    base = np.array([a.r for a, _ in f1.links(record, state)])
    platform = np.array([link.plate_offset for arm in record.arms for link in arm.links])
    return base, platform, f1.lengths(record)


def flat(modes) -> np.ndarray:
    return np.concatenate([modes.r, modes.R.reshape(-1, 9)], axis=1)


def assert_same_poses(found: np.ndarray, expected: np.ndarray, tolerance: float) -> None:
    """The same rows in any order, each within a tolerance by its size."""
    assert len(found) == len(expected)
    distance = np.linalg.norm(found[:, None] - expected, axis=2) / (1 + np.linalg.norm(expected, axis=1))
    assert (distance.min(0) < tolerance).all()
    assert len(set(distance.argmin(0))) == len(expected)


def link_errors(modes, base, platform, lengths) -> np.ndarray:
    """||r + R B - A| - L|, (k, 6), in numbers that are longer than doubles where the machine has such."""
    r, R = modes.r.astype(np.clongdouble), modes.R.astype(np.clongdouble)
    gaps = np.einsum("kij,nj->kni", R, platform) + r[:, None] - base
    return np.abs(np.sqrt((gaps**2).sum(2)) - lengths)


def test_all_40_modes_of_dietmaiers_hexapod_are_real():
    modes = assembly_modes(DIETMAIER_BASE, DIETMAIER_PLATFORM, DIETMAIER_LENGTHS)
    assert modes.complete
    assert modes.real.sum() == 40
    assert (
        link_errors(modes, *map(np.array, (DIETMAIER_BASE, DIETMAIER_PLATFORM, DIETMAIER_LENGTHS))).max()
        < MET
    )
    assert not np.imag(modes.r).any()
    assert not np.imag(modes.R).any()
    rows = np.real(flat(modes))
    assert np.linalg.norm(rows[:, None] - rows, axis=2)[~np.eye(40, dtype=bool)].min() > 0.01


@pytest.mark.parametrize("kind", first_of(["F1", "random"]))
def test_40_of_40_in_a_hundred_hexapods(kind):
    if kind == "F1":
        spread = np.array([0.3, 0.3, 0.3, 0.4, 0.4, 0.5])  # m, rad
        hexapods = [f1_hexapod(HOME + spread * q) for q in np.random.default_rng(5).uniform(-1, 1, (100, 6))]
    else:
        hexapods = [random_hexapod(seed) for seed in range(100)]
    found = [(assembly_modes(*hexapod), hexapod) for hexapod in hexapods]
    assert sum(modes.complete and len(modes) == 40 for modes, _ in found) >= 98
    if np.finfo(np.longdouble).eps < 1e-18:  # all 40 in the numbers of x86, but for those a kilometre away
        met = [link_errors(modes.exact, *hexapod).max() < MET for modes, hexapod in found]
        assert sum(met) >= 97
    for modes, hexapod in found:
        errors = link_errors(modes, *hexapod).max(1)
        assert errors[modes.real].max() < MET
        # squares of d = r + R B - A are rounded by 1e-16 |d|^2, some thirty times in all
        far = (np.abs(modes.r).max(1) + np.abs(modes.R).max((1, 2))) ** 2
        assert (errors < MET + 3e-15 * far / hexapod[2].min()).all()
        rounding = 30 * np.finfo(np.longdouble).eps * far.max() / hexapod[2].min()
        np.testing.assert_allclose(modes.error, errors, atol=1e-16 + rounding, rtol=0)
        exact = link_errors(modes.exact, *hexapod).max(1)
        assert (exact < 1e-15 + rounding).all()
        np.testing.assert_allclose(modes.exact.error, exact, atol=1e-16 + rounding)
        turned = modes.poses[1]
        assert np.abs(turned @ turned.swapaxes(1, 2) - np.eye(3)).max() < 1e-14  # rounding
        assert (np.linalg.det(turned) > 0).all()


@pytest.mark.parametrize("seed", [3, 6, 14])
def test_real_modes_are_those_that_newton_finds_from_many_starts(seed):
    base, platform, lengths = random_hexapod(seed)
    rng = np.random.default_rng(seed)
    r, R = rng.uniform(-2, 2, (800, 3)), Rotation.random(800, rng=rng).as_matrix()
    for _ in range(40):
        arms = platform @ R.swapaxes(1, 2)
        gaps = r[:, None] + arms - base
        left = ((gaps**2).sum(2) - lengths**2) / 2
        step = -np.linalg.solve(np.concatenate([gaps, np.cross(arms, gaps)], 2), left[..., None])[..., 0]
        step /= np.maximum(1.0, 2 * np.linalg.norm(step, axis=1))[:, None]
        r, R = r + step[:, :3], Rotation.from_rotvec(step[:, 3:]).as_matrix() @ R
    there = (
        np.abs(np.linalg.norm(r[:, None] + platform @ R.swapaxes(1, 2) - base, axis=2) - lengths).max(1)
        < 1e-12
    )
    rows = np.concatenate([r, R.reshape(-1, 9)], axis=1)[there]
    near = np.linalg.norm(rows[:, None] - rows, axis=2) < 1e-6
    distinct = rows[~np.tril(near, -1).any(1)]
    modes = assembly_modes(base, platform, lengths)
    assert_same_poses(np.real(flat(modes)[modes.real]), distinct, SAME)


@pytest.mark.parametrize(
    ("q", "count"),
    [(HOME, 8), ([0.61, -0.28, 0.14, -0.35, 0.43, 0.04], 6), ([0.66, -0.07, -0.2, 0.49, -0.41, -0.45], 4)],
    ids=["8", "6", "4"],
)
def test_the_f1_has_8_or_fewer_real_modes(q, count):
    modes = assembly_modes(*f1_hexapod(q))
    assert modes.complete
    assert modes.real.sum() == count


def test_real_modes_of_the_f1_are_two_groups_of_four():
    # Dressler (2012), section 4.5: above and below the carts, as the three-link robot has two modes
    modes = assembly_modes(*f1_hexapod(np.zeros(6)))
    height = np.real(modes.r[modes.real, 2])
    carts = f1_hexapod(np.zeros(6))[0][:, 2].mean()
    assert sorted(modes.group[modes.real]) == [-1] * 4 + [1] * 4
    assert ((height > carts) == (modes.group[modes.real] > 0)).all()
    assert (modes.group[~modes.real] == 0).all()


@pytest.mark.parametrize("name", ["F1", "F1_ideal"])
def test_the_pose_of_the_robot_is_among_its_feasible_modes(name):
    record = getattr(prototypes, name)
    alone = 0
    for state in f1.consistent_states(record, 8, seed=11):
        modes = assembly_modes(*f1_hexapod(state.q, record))
        near = np.linalg.norm(modes.r - state.T, axis=1) + np.abs(modes.R - state.R).max((1, 2))
        k = int(near.argmin())
        assert near[k] < SAME
        assert modes.feasible[k]
        alone += modes.feasible[modes.group == modes.group[k]].sum() == 1
    assert alone >= 7  # of the four of its group the others have crossed links, but near singular poses


def test_modes_do_not_depend_on_the_order_of_links():
    base, platform, lengths = random_hexapod(8)
    order = np.random.default_rng(0).permutation(6)
    here, there = (
        assembly_modes(base, platform, lengths),
        assembly_modes(base[order], platform[order], lengths[order]),
    )
    assert_same_poses(flat(there), flat(here), SAME)


def test_modes_move_with_the_base_and_scale_with_the_unit():
    base, platform, lengths = random_hexapod(9)
    turn, shift = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix(), np.array([5.0, -2.0, 1.0])
    here = assembly_modes(base, platform, lengths)
    there = assembly_modes(1000 * (base @ turn.T + shift), 1000 * platform, 1000 * lengths)  # in mm
    moved = np.concatenate([here.r @ turn.T + shift, (turn @ here.R).reshape(-1, 9)], axis=1)
    found = flat(there)
    found[:, :3] /= 1000
    assert_same_poses(found, moved, SAME)
    assert here.real.sum() == there.real.sum()


def test_exchanged_base_and_platform_have_the_inverse_modes():
    base, platform, lengths = random_hexapod(10)
    here, there = assembly_modes(base, platform, lengths), assembly_modes(platform, base, lengths)
    back = here.R.swapaxes(1, 2)
    inverse = np.concatenate([-(back @ here.r[:, :, None])[:, :, 0], back.reshape(-1, 9)], axis=1)
    assert_same_poses(flat(there), inverse, SAME)


def test_complex_modes_are_conjugate_pairs_and_come_last():
    modes = assembly_modes(*random_hexapod(11))
    count = int(modes.real.sum())
    assert modes.real[:count].all()
    rest = flat(modes)[count:]
    assert_same_poses(rest.conj(), rest, SAME)


def test_sign_is_that_of_the_change_of_lengths_with_the_pose():
    base, platform, lengths = f1_hexapod(HOME)
    modes = assembly_modes(base, platform, lengths)
    step = 1e-6  # m, rad
    for k in np.flatnonzero(modes.real):
        r, R = modes.r[k].real, modes.R[k].real
        slopes = []
        for direction in np.eye(6):
            turn = Rotation.from_rotvec(step * direction[3:]).as_matrix()
            moved = r + step * direction[:3] + platform @ (turn @ R).T
            slopes.append((np.linalg.norm(moved - base, axis=1) - lengths) / step)
        assert np.sign(np.linalg.det(slopes)) == modes.sign[k]


def test_clearance_is_the_least_distance_of_points_on_two_links():
    base, platform, lengths = f1_hexapod(HOME)
    modes = assembly_modes(base, platform, lengths)
    share = np.linspace(0, 1, 301)[:, None]
    for k in np.flatnonzero(modes.real):
        ends = modes.r[k].real + platform @ modes.R[k].real.T
        points = [a + share * (b - a) for a, b in zip(base, ends, strict=True)]
        pairs = [(i, j) for i in range(6) for j in range(i)]
        sampled = min(np.linalg.norm(points[i][:, None] - points[j], axis=2).min() for i, j in pairs)
        # sampled points are up to half a spacing from the nearest ones, on either link
        assert -1e-12 < sampled - modes.clearance[k] < lengths.max() / 300
    assert np.isnan(modes.clearance[~modes.real]).all()


def test_thick_links_need_clearance():
    thin = assembly_modes(*f1_hexapod(HOME))
    middle = float(np.mean(np.sort(thin.clearance[thin.feasible])[:2]))
    thick = assembly_modes(*f1_hexapod(HOME), diameter=middle)
    assert thick.feasible.sum() == thin.feasible.sum() - 1
    assert (thick.clearance[thick.feasible] >= middle).all()


def test_two_calls_give_the_same_numbers():
    first, second = assembly_modes(*random_hexapod(12)), assembly_modes(*random_hexapod(12))
    np.testing.assert_array_equal(first.r, second.r)
    np.testing.assert_array_equal(first.R, second.R)


def test_the_record_prints_its_real_modes_and_gives_them_as_real_arrays():
    modes = assembly_modes(*f1_hexapod(HOME))
    r, R = modes.poses
    assert r.dtype == R.dtype == float
    assert r.shape == (8, 3)
    assert R.shape == (8, 3, 3)
    text = str(modes)
    assert text.startswith("40 assembly modes, 8 real, ")
    assert text.count("  r = (") == 8
    assert "crossed" in text
