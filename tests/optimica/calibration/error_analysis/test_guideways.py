"""Guideways with known bends, waves and backlash: what is found of them, and how sure it is."""

import re

import matplotlib
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import ModelError
from gantrytau_optimica.calibration.data.findings import CalibrationError
from gantrytau_optimica.calibration.error_analysis.guideways import Cyclic, Linearity, linearity
from tests.optimica.refusals import refused

matplotlib.use("Agg")

PITCH = 0.0123  # m
DIRECTION = np.array([0.99779, -0.06634, -0.00530])  # of D1, arm 1 (Table 5.8)
START = np.array([-3.13, -4.88, 0.70])
WAVE, BACKLASH, NOISE = 45e-6, 40e-6, 5e-6  # m; 40 um was found on L2 (Figure 4.3)


def bend(q):
    """Smooth errors along, to the side and upwards, (N, 3) in m, of some 50 um."""
    x = 2 * np.pi * q
    return 1e-6 * np.stack([40 * np.sin(x / 2.5), 60 * np.cos(x / 1.8), 30 * np.sin(x / 1.5 + 1)], axis=-1)


def axes():
    along = DIRECTION / np.linalg.norm(DIRECTION)
    side = np.cross([0.0, 0.0, 1.0], along)
    side /= np.linalg.norm(side)
    return np.stack([along, side, np.cross(along, side)])


def there_and_back(seed: int, count: int = 400):
    """Positions forth and back, and points of a guideway with all errors."""
    random = np.random.default_rng(seed)
    q = np.sort(random.uniform(0.0, 2.0, count))
    q = np.concatenate([q[1::2], q[::2][::-1]])  # the cart turns at the largest q
    rising = np.repeat([1.0, -1.0], count // 2)
    error = bend(q) + NOISE * random.standard_normal((count, 3))
    error[:, 0] += WAVE * np.cos(2 * np.pi * q / PITCH - 0.7) - BACKLASH / 2 * rising
    return q, START + q[:, None] * DIRECTION + error @ axes(), rising


@pytest.fixture(scope="module")
def found():
    q, points, _ = there_and_back(1)
    return linearity(q, points, pitch=PITCH)


@pytest.fixture(scope="module")
def many():
    return [linearity(*there_and_back(seed)[:2], pitch=PITCH) for seed in range(60)]


def waves(found: Linearity) -> Cyclic:
    assert found.cyclic is not None
    return found.cyclic


def standardised(values, errors, truth) -> np.ndarray:
    return (np.asarray(values) - truth) / np.asarray(errors)


def test_the_linear_model_leaves_errors_that_are_orthogonal_to_it(found):
    """(4.10): least squares; (4.11) and (4.12) split the error without loss."""
    design = np.column_stack([np.ones(len(found.q)), found.q])
    assert np.abs(design.T @ found.error).max() < 1e-12
    assert found.axes @ found.axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert found.along**2 + found.across**2 == pytest.approx(found.size**2, abs=1e-18)
    points = there_and_back(1)[1]
    e = points - found.start - found.q[:, None] * found.direction
    v = found.direction / np.linalg.norm(found.direction)
    assert found.along == pytest.approx(e @ v, abs=1e-15)
    assert found.across == pytest.approx(np.linalg.norm(e - np.outer(e @ v, v), axis=1), abs=1e-12)


def test_axis_of_a_straight_guideway():
    q = np.linspace(0.0, 2.0, 41)
    exact = linearity(q, START + q[:, None] * DIRECTION)
    assert exact.start == pytest.approx(START, abs=1e-12)
    assert exact.direction == pytest.approx(DIRECTION, abs=1e-12)
    assert exact.size.max() < 1e-12


def test_backlash_is_found_within_its_standard_error(many):
    z = standardised([f.backlash for f in many], [f.backlash_error for f in many], BACKLASH)
    assert np.abs(z).max() < 4
    assert z.std() == pytest.approx(1.0, abs=0.3)  # of 60: three standard deviations of it
    assert abs(z.mean()) < 4 / np.sqrt(60)


def test_the_cyclic_part_is_found_within_its_standard_error(many):
    z = standardised(
        [waves(f).amplitude[0, 0] for f in many], [waves(f).amplitude_error[0, 0] for f in many], WAVE
    )
    assert np.abs(z).max() < 4
    assert z.std() == pytest.approx(1.0, abs=0.3)
    phases = np.array([waves(f).phase[0, 0] for f in many])
    assert phases == pytest.approx(np.full(60, 0.7), abs=4 * 5e-6 * np.sqrt(2 / 380) / WAVE * 1.1)
    assert all(np.all(waves(f).amplitude[0, 1:] < 5 * waves(f).amplitude_error[0, 1:]) for f in many)


def test_the_bend_is_found_within_its_standard_error(many):
    """A straight line, which the linear model takes, is no bend: it is taken out of the difference."""
    q = np.linspace(0.05, 1.95, 50)
    line = np.column_stack([np.ones(50), q])
    worst, usual = [], []
    for f in many:
        profile, doubt = f.profile(q)
        difference = profile - bend(q)
        difference -= line @ np.linalg.lstsq(line, difference, rcond=None)[0]
        worst.append(np.abs(difference / doubt).max())
        usual.append(np.sqrt(np.mean((difference / doubt) ** 2)))
    assert max(worst) < 5
    assert np.mean(usual) == pytest.approx(1.0, abs=0.15)  # the line takes two of some fifteen directions


def test_noise_is_what_is_left(many):
    assert np.mean([f.noise for f in many], axis=0) == pytest.approx(np.full(3, NOISE), rel=0.03)


def test_the_straightness_is_the_height_of_the_bend(found):
    q = np.linspace(0.0, 2.0, 2001)
    line = np.column_stack([np.ones(2001), q])
    true = bend(q) - line @ np.linalg.lstsq(line, bend(q), rcond=None)[0]
    # three standard errors at the ends
    assert found.straightness == pytest.approx(np.ptp(true, axis=0), abs=8e-6)


def test_the_direction_of_motion_follows_from_the_order():
    q, points, rising = there_and_back(3)
    assert np.array_equal(linearity(q, points).rising, rising)
    assert linearity(q, points, rising=rising).backlash == linearity(q, points).backlash


def test_repeated_points_keep_their_direction():
    q, points, rising = there_and_back(4, 40)
    twice = linearity(np.repeat(q, 2), np.repeat(points, 2, axis=0))
    assert np.array_equal(twice.rising, np.repeat(rising, 2))


def test_from_one_side_there_is_no_backlash_to_be_found():
    q, points, rising = there_and_back(5)
    alone = linearity(q[rising > 0], points[rising > 0], pitch=PITCH)
    assert alone.backlash is None
    with pytest.raises(ModelError, match="plot_backlash: found points from one direction of motion only"):
        alone.plot_backlash()


def test_lengths_along_the_axis_are_enough():
    """As with a length gauge; the same numbers as from points in space."""
    q, points, _ = there_and_back(6)
    along = (points - START) @ axes()[0]
    whole, lengths = linearity(q, points, pitch=PITCH), linearity(q, along, pitch=PITCH)
    # the axis that was found is tilted by some 1e-5 against the true one: the lengths differ in second order
    assert lengths.backlash == pytest.approx(whole.backlash, abs=1e-8)
    assert waves(lengths).amplitude[0, 0] == pytest.approx(waves(whole).amplitude[0, 0], abs=1e-8)
    assert np.array_equal(lengths.across, np.zeros(len(q)))


def test_harmonics_are_told_apart():
    q, points, _ = there_and_back(7)
    points = points + 10e-6 * np.outer(np.sin(4 * np.pi * q / PITCH), axes()[0])
    both = waves(linearity(q, points, pitch=PITCH, harmonics=2))
    assert np.abs(standardised(both.amplitude[:, 0], both.amplitude_error[:, 0], [WAVE, 10e-6])).max() < 4
    assert both.phase[1, 0] == pytest.approx(np.pi / 2, abs=0.2)


def test_the_spectrum_has_its_peak_at_the_pitch(found):
    q, points, _ = there_and_back(8)
    blind = linearity(q, points)  # does not know of the pitch
    periods = 1 / np.linspace(1 / 0.05, 1 / 0.008, 2000)
    amplitude = blind.spectrum(periods)
    # a quarter of its width, 1 / 162
    assert periods[np.argmax(amplitude[:, 0])] == pytest.approx(PITCH, rel=2e-3)
    assert blind.spectrum(PITCH)[0] == pytest.approx(waves(found).amplitude[0], abs=4 * 5e-7)
    assert np.max(amplitude[:, 1:]) < WAVE / 10


def test_the_spectrum_is_the_fit_of_the_wave(found):
    """Two routes: projection for each period alone, and the columns of the whole fit."""
    assert found.spectrum(PITCH)[0] == pytest.approx(waves(found).amplitude[0], abs=1e-12)
    assert np.isnan(found.spectrum(8.0)).all()  # a wave that is longer than the guideway is a bend


@pytest.mark.parametrize("lash", [-BACKLASH, 5e-6])
@pytest.mark.parametrize("pitch", [0.005, 0.05])
def test_other_pitches_and_backlash_of_either_sign(lash, pitch):
    off = []
    for seed in range(12):
        q, points, rising = there_and_back(seed)
        wave = np.cos(2 * np.pi * q / pitch - 0.7) - np.cos(2 * np.pi * q / PITCH - 0.7)
        points = points + np.outer(WAVE * wave - (lash - BACKLASH) / 2 * rising, axes()[0])
        f = linearity(q, points, pitch=pitch)
        off.append(standardised([f.backlash], [f.backlash_error], lash))
        off.append(standardised(waves(f).amplitude[0, :1], waves(f).amplitude_error[0, :1], WAVE))
    assert np.abs(off).max() < 4
    assert np.std(off) == pytest.approx(1.0, abs=0.45)  # of 24: three standard deviations of it


def test_the_frame_of_the_points_is_of_no_matter():
    q, points, _ = there_and_back(3)
    R = Rotation.from_rotvec([0.3, -1.2, 2.0]).as_matrix()
    here, there = linearity(q, points, pitch=PITCH), linearity(q, points @ R.T + 5.0, pitch=PITCH, up=R[:, 2])
    assert there.error == pytest.approx(here.error, abs=1e-13)  # rounding of metres
    assert there.backlash == pytest.approx(here.backlash, abs=1e-13)


def test_repeated_points_keep_their_direction_though_the_encoder_jitters():
    q, points, rising = there_and_back(4)
    q = np.repeat(q, 3)
    jitter = q + 1e-7 * np.random.default_rng(0).standard_normal(len(q))
    found = linearity(jitter, np.repeat(points, 3, axis=0), pitch=PITCH)
    assert np.array_equal(found.rising, np.repeat(rising, 3))
    assert found.backlash == pytest.approx(BACKLASH, abs=4 * 5e-7)  # of 400 points of 5 um


def test_a_third_of_stray_points_is_found():
    q, points, _ = there_and_back(2)
    stray = np.sort(np.random.default_rng(1).permutation(400)[:120])
    points[stray] += 1e-3
    found = linearity(q, points, pitch=PITCH, loss="robust")
    assert [f.rows.tolist() for f in found.findings] == [stray.tolist()]
    assert found.noise == pytest.approx(np.full(3, NOISE), rel=0.15)  # 280 points: 4 %


def test_a_gap_is_no_bend(tmp_path):
    q, points, _ = there_and_back(6)
    measured = (q < 0.5) | (q > 1.5)
    found = linearity(q[measured], points[measured], pitch=PITCH)
    assert found.noise == pytest.approx(np.full(3, NOISE), rel=0.2)  # some 200 points
    assert found.straightness.max() < 200e-6
    found.plot(file=tmp_path / "gap.png")


# what data do not hold


def test_points_at_every_50_mm_cannot_know_a_pitch_of_12_mm():
    """The resolution of thesis section 4.2: 50 mm are 4.065 pitches, a wave of 769 mm."""
    q = np.arange(0.0, 4.0, 0.050)
    points = START + q[:, None] * DIRECTION + NOISE * np.random.default_rng(0).standard_normal((len(q), 3))
    with pytest.raises(CalibrationError, match=r"a wave of 0.0123 m looks like the bend of the") as caught:
        linearity(q, points, pitch=PITCH)
    assert caught.value.kind == "cyclic"
    aliased = linearity(q, points, pitch=PITCH, intervals=1)
    (finding,) = aliased.findings
    assert finding.kind == "aliased"
    found = re.search(r"looks like one of (\d+) mm", finding.message)
    assert found is not None
    assert float(found[1]) == pytest.approx(769.0, rel=0.01)  # waves are tried every 2.4 %


def test_uneven_points_know_it():
    q, points, _ = there_and_back(1, 100)
    assert linearity(q, points, pitch=PITCH).findings == ()


def test_nan_outliers_and_scale_are_found_with_their_rows():
    q, points, _ = there_and_back(9)
    points[17, 1] = np.nan
    points[40] += [0.0, 0.0, 1e-3]
    found = linearity(q, points, pitch=PITCH)
    assert [(f.kind, f.rows.tolist()) for f in found.findings] == [("nan", [17]), ("outliers", [40])]
    assert len(found.q) == 399
    assert found.noise[2] > 5 * NOISE
    assert linearity(q, points, pitch=PITCH, loss="robust").noise == pytest.approx(
        np.full(3, NOISE), rel=0.15
    )
    scaled = linearity(1.1 * q, points)
    assert "scale" in [f.kind for f in scaled.findings]


@pytest.mark.parametrize(
    ("argument", "call"),
    [
        ("points", lambda q, p: linearity(q, p[:-1])),
        ("q", lambda q, p: linearity("q", p)),
        ("rising", lambda q, p: linearity(q, p, rising=np.full(400, 2))),
        ("rising", lambda q, p: linearity(q, p, rising=np.ones(401))),
        ("up", lambda q, p: linearity(q, p, up=(0.0, 1.0))),
        ("up", lambda q, p: linearity(q, p, up=(0.0, 0.0, 0.0))),
        ("pitch", lambda q, p: linearity(q, p, pitch=0.0)),
        ("harmonics", lambda q, p: linearity(q, p, harmonics=0)),
        ("intervals", lambda q, p: linearity(q, p, intervals=0)),
        ("q", lambda q, p: linearity(q, p).profile([np.nan])),
        ("q", lambda q, p: linearity(q, p).profile([2.5])),
        ("periods", lambda q, p: linearity(q, p).spectrum([0.0])),
    ],
)
def test_a_wrong_argument_is_refused(argument, call):
    with refused(argument):
        call(*there_and_back(1)[:2])


@pytest.mark.parametrize(
    ("kind", "rows", "call"),
    [
        ("too few points", 5, lambda q, p: linearity(q[:5], p[:5])),
        ("too few points", 20, lambda q, p: linearity(q[:20], p[:20], intervals=30)),
        ("millimetres", 400, lambda q, p: linearity(1000 * q, p)),
        ("millimetres", 400, lambda q, p: linearity(1000 * q, 1000 * p, pitch=1000 * PITCH)),
        ("outliers", 1, lambda q, p: linearity(np.where(np.arange(400) == 7, 50.0, q), p, pitch=PITCH)),
    ],
)
def test_data_that_do_not_hold_what_is_asked_are_refused(kind, rows, call):
    with pytest.raises(CalibrationError) as caught:
        call(*there_and_back(1)[:2])
    assert (caught.value.kind, len(caught.value.rows)) == (kind, rows)


def test_figures_are_written(found, tmp_path):
    for name, draw in (("errors.png", found.plot), ("backlash.png", found.plot_backlash)):
        draw(file=tmp_path / name)
        assert (tmp_path / name).stat().st_size > 5000
    with pytest.raises(ModelError, match="expected one of"):
        found.plot(file=tmp_path / "errors.xyz")


def test_the_record_speaks(found):
    words = str(found)
    assert "backlash 4" in words
    assert "pitch of 12.300 mm along the axis: 4" in words
