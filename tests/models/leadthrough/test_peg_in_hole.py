"""A match is led into its hole by hand: alignment by torque, what prevents it, its law and its records."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gantrytau import ModelError, simulate, study, translate
from gantrytau_models.leadthrough.peg_control import PegControl
from gantrytau_models.leadthrough.peg_figures import plot_peg_forces, plot_peg_orientation, plot_peg_torques
from gantrytau_models.leadthrough.peg_in_hole import PegInHole, peg_disturbances
from gantrytau_models.leadthrough.peg_match import Match

STOP, POINTS, TOLERANCE = 85.0, 426, 1e-6  # forces feed back through samples only, so that errors do not grow
ZERO = [0.0, 0.0, 0.0]
HELD = 79.0  # s, when the hand withdraws
KEPT = ["tool.angle", "tool.r", "tool.axis", "yaw", "f", "t", "control.contact"]


def runs(seeds, **changes):
    """Results of so many seeds, one after the other."""
    dae = translate(PegInHole(**changes), events=True)
    inputs = peg_disturbances()
    return [
        simulate(dae, stop=STOP, inputs=inputs, seed=k, points=POINTS, outputs=KEPT, tolerance=TOLERANCE)
        for k in range(seeds)
    ]


def figures(result):
    """Angle in deg and the greatest depth in mm until the match is withdrawn, and what the angle changes behind it."""
    held = result.time <= HELD
    angle = np.degrees(result["tool.angle"])
    return angle[held][-1], -1e3 * result["tool.r"][held, 2].min(), abs(angle[-1] - angle[held][-1])


@pytest.fixture(scope="module")
def reference():
    return runs(3)


def test_torque_control_aligns_the_match(reference):
    for result in reference:
        angle, depth, change = figures(result)
        assert np.degrees(result["tool.angle"][0]) == pytest.approx(6.0)
        assert angle < 2.2  # deg, twice the spread of earlier trials; two clearances over the depth are 1.15
        assert depth > 28.0
        assert change < 0.3
        assert result["tool.r"][-1, 2] > 0.02  # it came out


def test_rotation_about_the_match_is_free(reference):
    """It drifts by K_tau times the bias of the torque while there is contact, and not without."""
    yaw = np.abs([result.final("yaw") for result in reference])
    touched = np.mean([result["control.contact"].mean() for result in reference]) * STOP
    drift = 3.0 * 5e-4 * touched  # rad, of one standard deviation
    assert 0.1 * drift < np.median(yaw) < 3 * drift
    quiet = simulate(PegInHole(), stop=STOP, points=POINTS)
    assert np.degrees(np.abs(quiet["yaw"])).max() < 0.01
    assert figures(quiet)[0] < 2.2


def test_without_torque_control_it_jams():
    for result in runs(1, control=dict(tool=dict(K_tau=[0.0] * 3))):
        angle, depth, _ = figures(result)
        assert angle > 5.9
        assert 2.0 < depth < 20.0  # it got into the mouth


def test_torque_about_the_clamp_may_turn_the_match_away():
    """Forces across have a lever there, and so has friction along the match: in half of the seeds it does not align."""
    patient = dict(patience=1e9)  # who does not lift it and aim again
    found = np.array([figures(result)[:2] for result in runs(5, tool=dict(tcp=0.095), hand=patient)])
    away = found[:, 0] > 5.9
    assert np.count_nonzero(away) >= 2
    assert found[away, 1].max() < 20.0


def test_it_starts_though_the_sensors_tell_of_contact():
    """The first forces come with noise, through all laws, whose starts are at no force."""
    seen = {"sensor.white_f": [0.3, -0.5, 6.0]}
    started = simulate(PegInHole(), stop=0.01, inputs=seen, points=3)
    assert started["control.contact"][0] == 1
    assert started["control.normal.n"][0] == pytest.approx(np.array([0.3, -0.5, 6.0]) / np.sqrt(36.34))


def test_gains_of_the_other_sign_are_refused():
    with pytest.raises(ModelError, match=r"control\.tool\.K"):
        translate(PegInHole(control=dict(tool=dict(K=[-0.005] * 3))), events=True)


def test_a_gated_normal_leaves_forces_across_the_tool(reference):
    """Within 10 deg of the tool there is no force of a wall, so that nothing controls those."""
    across = {
        name: np.mean([np.abs(r["f"][:, :2]).mean() for r in found])
        for name, found in (("force", reference[:2]), ("gated", runs(2, normal="gated")))
    }
    assert across["gated"] > 1.15 * across["force"]


def test_steel_and_other_clearances_align_too():
    for match in (Match(modulus=210e9, mu=0.6), Match(clearance=1e-4)):
        (result,) = runs(1, match=match)
        angle, depth, _ = figures(result)
        assert angle < 2.2
        assert depth > 28.0


def test_an_upright_match_goes_in_and_stays_upright():
    upright = simulate(PegInHole(tilt=0.0), stop=STOP, inputs=peg_disturbances(), seed=0, points=POINTS)
    angle, depth, _ = figures(upright)
    assert upright["tool.angle"][0] < 1e-11
    assert angle < 1.2  # deg, two clearances over the depth
    assert depth > 28.0


def test_the_same_from_all_sides():
    """With the start tilted about x instead of y, in the exact quarter turn, all turns by that."""
    half = np.radians(3.0)
    about_y = simulate(PegInHole(), stop=30.0, points=61)
    q = dict(q=dict(start=[np.cos(half), -np.sin(half), 0.0, 0.0]))
    about_x = simulate(PegInHole(tool=q), stop=30.0, points=61)
    assert about_x["tool.axis"][:, 1] == pytest.approx(about_y["tool.axis"][:, 0], abs=1e-6)  # tolerance 1e-8
    assert about_x["tool.r"][:, 1] == pytest.approx(about_y["tool.r"][:, 0], abs=1e-8)
    assert np.ptp(about_y["tool.angle"]) > 0.01


def test_angles_are_those_of_the_tool():
    names = ["alpha", "beta", "gamma", "yaw", "tool.angle"]
    of = translate(PegInHole(), events=True).function(["tool.q"], names)
    rng = np.random.default_rng(0)
    for turn in rng.normal(size=(20, 3)):
        x, y, z, s = Rotation.from_rotvec(turn).as_quat()
        alpha, beta, gamma, yaw, angle = (float(v) for v in of([s, x, y, z]))
        tool = Rotation.from_rotvec(turn) * Rotation.from_rotvec([np.pi, 0, 0])
        assert (Rotation.from_euler("ZYZ", [alpha, beta, gamma]).inv() * tool).magnitude() < 1e-7
        assert np.cos(alpha - gamma + np.pi - yaw) == pytest.approx(1.0)
        assert np.cos(angle) == pytest.approx(Rotation.from_rotvec(turn).as_matrix()[2, 2])


def test_contact_begins_and_ends_at_two_forces():
    rising, falling = np.linspace(0, 0.4, 11), np.linspace(0.4, 0, 11)
    times = np.arange(22) * 0.004
    forces = np.concatenate([rising, falling])[:, None] * [0, 0, 1]
    result = simulate(PegControl(), stop=times[-1], inputs={"f_t": (times, forces)}, points=22)
    load, touched = np.linalg.norm(result["f_t"], axis=1), result["contact"]
    up = result.time < 0.042
    assert load[up & (touched > 0)].min() > 0.25
    assert load[~up & (touched > 0)].min() < 0.2


def test_in_contact_hand_and_force_share_directions():
    inputs = {"f_t": [0.0, -0.5, 0.0], "t_t": [0.0, 1e-3, 0.0], "f_h": [1.0, 1.0, 0.0]}
    result = simulate(PegControl(), stop=0.1, inputs=inputs, points=26)
    assert result.final("contact") == 1
    assert result.final("normal.n") == pytest.approx([0, -1, 0])
    assert result.final("w") == pytest.approx([0, -3e-3, 0])
    assert result.final("v")[1] == pytest.approx(0.005 * 0.5)  # away from the wall
    assert abs(result["hand.v"][:, 1]).max() < 0.0021  # no wind-up: never more than T F / M
    assert result.final("v")[0] > 0.04


def test_seeds_make_a_study():
    seeds = study(PegInHole(), stop=2.0, seeds=2, inputs=peg_disturbances(), outputs=["tool.r"], points=3)
    ends = [seeds.result(seed=k).final("tool.r") for k in range(2)]
    assert not seeds.failures
    assert np.linalg.norm(ends[0] - ends[1]) > 1e-6


def test_figures_show_all_of_it(tmp_path):
    result = simulate(PegInHole(), stop=1.0, inputs=peg_disturbances(), seed=0, points=101)
    for plot, panels in ((plot_peg_orientation, 3), (plot_peg_forces, 3), (plot_peg_torques, 2)):
        file = tmp_path / f"{plot.__name__}.png"
        figure = plot(result, file=file)
        assert len(figure.axes) == panels
        assert all(axes.get_ylabel() for axes in figure.axes)
        assert file.stat().st_size > 5000


WRONG: tuple[Any, ...] = (0.0, -1.0, np.nan, np.inf, [1.0, 2.0], "1")


def test_records_say_what_is_wrong():
    assert Match().bending == pytest.approx(236.0, abs=1.0)  # N/m
    for call, words in (
        (lambda: Match(clearance=0.0), "Match: found clearance=0.0"),
        (lambda: Match(mu=-0.1), "Match: found mu=-0.1"),
        (lambda: PegInHole(0.1), "PegInHole: found match=0.1, expected a record such as Match"),  # type: ignore[arg-type]
        (lambda: PegInHole(tilt=6.0), "PegInHole: found tilt=6.0"),
        (lambda: PegInHole(normal="wall"), "PegControl: found normal='wall', expected 'force' or 'gated'"),  # type: ignore[arg-type]
        (lambda: translate(PegInHole(Match(depth=0.1)), events=True), "hole that is less deep than the peg"),
    ):
        with pytest.raises(ModelError) as caught:
            call()
        assert words in str(caught.value)
