"""Friction of the L1 from runs at constant speed: Dressler (2012), section 6.1."""

import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

from gantrytau import ModelError
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, SixLinkGantryTau, prototypes
from gantrytau_optimica import MotionLog, identify_friction
from gantrytau_optimica.identification import friction_over_load
from gantrytau_optimica.identification.friction.carried_mass import carried_mass
from tests.families import NIGHTLY

L1 = prototypes.L1
PARALLEL = replace(L1, arms=tuple(replace(arm, direction=(1.0, 0.0, 0.0)) for arm in L1.arms))
MASS = 22.38  # kg, as printed
TABLE_6_1 = (
    np.array([[189.12, 145.69], [262.59, 119.23], [239.06, 177.22]]),
    np.array([[205.03, 158.01], [190.00, 133.76], [185.94, 197.52]]),
)  # f_c in N and f_v in kg/s, forth and back
TABLE_6_2 = np.array(
    [
        [-176.9, -14.6, 191.5],
        [-159.1, -23.7, 182.8],
        [-180.3, -3.6, 183.9],
        [-261.8, -21.5, 283.3],
        [-201.6, -33.7, 235.3],
    ]
)  # N, one row for each position of the tool
ROBOT = GantryTau(PARALLEL)
TRIES = 20 if NIGHTLY else 10
SPEEDS = np.linspace(1 / 15, 1.0, 15)  # fifteen in each direction, as printed


@functools.cache
def weighing():
    return carried_mass(ROBOT)


@pytest.fixture
def load():
    return weighing()


def carts(y, z, x=1.0):
    """Carts that hold the tool at (x, y, z), the tool ahead of them."""
    found = []
    for arm in PARALLEL.arms:
        a = np.array(arm.offset)
        square = arm.length**2 - (y - a[1]) ** 2 - (z - a[2]) ** 2
        found.append(x - a[0] - np.sqrt(square) if square > 0 else np.nan)
    return np.array(found)


@functools.cache
def poses():
    """Positions (y, z) of the tool at which J^T G is nearest to the columns of Table 6.2."""
    load = weighing()

    def missed(p, row):
        if not np.all(np.isfinite(carts(*p))):
            return np.full(3, 1e3)  # out of reach
        return MASS * load.forces(carts(*p)[None], np.zeros((1, 3)))[0][0] - row

    return [
        least_squares(missed, [2.8, -0.6], args=(row,), bounds=([1.45, -1.3], [4.2, 0.4])).x
        for row in TABLE_6_2
    ]


def runs(places, coulomb, viscous, rng=None, ripple=0.0, drift=0.0, weights=None, mass=MASS, speeds=SPEEDS):
    """Runs of all carts at each speed in both directions, with friction by (6.8) and weight by the model, or as told."""
    load, found = weighing(), []
    for k, place in enumerate(places):
        q = carts(*place)
        slope, known = load.forces(q[None], np.zeros((1, 3)))
        weight = (known + mass * slope)[0] if weights is None else weights[k]
        for v in (*speeds, *-speeds):
            side = 0 if v > 0 else 1
            f = weight + coulomb[:, side] * np.sign(v) + viscous[:, side] * v
            if rng is not None:
                f = f * (1 + drift * rng.standard_normal()) + ripple * rng.standard_normal(3)
            t = np.arange(50) / 250
            found.append(MotionLog(t, q + np.outer(t, [v] * 3), np.tile(f, (50, 1))))
    return found


def test_parallel_guideways_bear_no_weight_along_them(load):
    """The first row of (6.7) at rest: carts push against each other only."""
    q = np.array([carts(y, z) for y in (2.2, 2.8, 3.2) for z in (-1.2, -0.5, 0.1)])
    weights, known = load.forces(q, np.zeros_like(q))
    assert np.all(np.abs(weights).max(axis=1) > 1.0)  # there is something to cancel
    np.testing.assert_allclose(MASS * weights.sum(axis=1), 0.0, atol=1e-9)
    np.testing.assert_allclose(known, 0.0, atol=1e-9)


def test_weight_is_that_of_virtual_work(load):
    """Two routes: the model's forces, and m g dz/dq_i by differences of the closed-form position."""
    q, h = carts(2.7, -0.6), 1e-6

    def tool_z(q):
        def closed(r):
            ends = [
                np.array(arm.offset) + s * np.array([1.0, 0, 0])
                for arm, s in zip(PARALLEL.arms, q, strict=True)
            ]
            return [np.linalg.norm(r - e) - arm.length for e, arm in zip(ends, PARALLEL.arms, strict=True)]

        return least_squares(closed, [1.0, 2.7, -0.6], xtol=1e-15, ftol=1e-15, gtol=1e-15).x[2]

    slopes = [(tool_z(q + h * e) - tool_z(q - h * e)) / (2 * h) for e in np.eye(3)]
    weights = load.forces(q[None], np.zeros((1, 3)))[0][0]
    np.testing.assert_allclose(
        weights, 9.81 * np.array(slopes), atol=1e-3
    )  # differences of closed links, 1e-12 / h


def test_positions_of_table_6_2_are_found_in_the_workspace(load):
    """Two unknowns meet three printed digits that sum to zero; for the diamond the assumed guideways leave 17 N."""
    for k, (place, row) in enumerate(zip(poses(), TABLE_6_2, strict=True)):
        weights = MASS * load.forces(carts(*place)[None], np.zeros((1, 3)))[0][0]
        np.testing.assert_allclose(
            weights, row, atol=20.0 if k == 3 else 1e-4
        )  # N; the solver's own tolerance


def test_printed_tables_have_masses_by_norm():
    """22.72 kg by least squares and 22.02 by log ratio, where 22.38 is printed."""
    found = identify_friction(ROBOT, runs(poses()[:1], *TABLE_6_1))
    assert found.symmetric["least squares"] == pytest.approx(22.72, abs=0.01)
    assert found.symmetric["log ratio"] == pytest.approx(22.02, abs=0.02)
    assert found.mass == found.symmetric["least squares"]
    assert [finding.kind for finding in found.findings] == ["one position"]


def test_known_mass_gives_back_table_6_1():
    found = identify_friction(ROBOT, runs(poses()[:1], *TABLE_6_1), mass=MASS)
    np.testing.assert_allclose(found.coulomb, TABLE_6_1[0], atol=1e-8)
    np.testing.assert_allclose(found.viscous, TABLE_6_1[1], atol=1e-8)
    assert found.deviations["mass"] == 0.0
    assert not found.findings


def test_positions_tell_the_mass_whatever_friction_is():
    found = identify_friction(ROBOT, runs(poses(), *TABLE_6_1), mass="positions")
    assert found.mass == pytest.approx(MASS, abs=1e-9)
    np.testing.assert_allclose(found.coulomb, TABLE_6_1[0], atol=1e-8)
    np.testing.assert_allclose(found.gravity(carts(*poses()[0])[None])[0], TABLE_6_2[0], atol=0.11)


@pytest.mark.parametrize("mass", ["symmetric", "positions"])
def test_predicted_deviations_are_those_of_repeated_experiments(mass):
    coulomb = np.repeat(TABLE_6_1[0].mean(axis=1)[:, None], 2, axis=1)  # truth that both can find
    places, rng = poses(), np.random.default_rng(1)
    some = places[:1] if mass == "symmetric" else places
    tries = [
        identify_friction(ROBOT, runs(some, coulomb, TABLE_6_1[1], rng, ripple=8.0), mass=mass)
        for _ in range(TRIES)
    ]
    for name, values in (
        ("mass", [each.mass for each in tries]),
        ("coulomb[1][0]", [each.coulomb[1, 0] for each in tries]),
        ("viscous[2][1]", [each.viscous[2, 1] for each in tries]),
    ):
        predicted = np.sqrt(np.mean([each.deviations[name] ** 2 for each in tries]))
        assert 0.45 < np.std(values, ddof=1) / predicted < 1.8  # 10 tries: 99 % within 0.44 and 1.62
    assert np.mean([each.mass for each in tries]) == pytest.approx(MASS, abs=0.7)


def kinds(found):
    return {finding.kind for finding in found.findings}


def test_stribeck_and_load_are_seen(load):
    rising, loaded = runs(poses(), *TABLE_6_1), runs(poses(), *TABLE_6_1)
    slow = [
        replace(run, f=run.f + 40 * np.sign(v) * np.exp(-((v / 0.1) ** 2)))
        for run in rising
        for v in [(run.q[-1] - run.q[0]) / (run.t[-1] - run.t[0])]
    ]
    found = identify_friction(ROBOT, slow, mass=MASS)
    stribeck = next(finding for finding in found.findings if finding.kind == "Stribeck")
    assert "Stribeck speed of 0.1" in stribeck.message or "Stribeck speed of 0.09" in stribeck.message
    weights = [MASS * load.forces(carts(*place)[None], np.zeros((1, 3)))[0][0] for place in poses()]
    saddle = [
        replace(run, f=run.f + 0.05 * np.sign(run.q[-1] - run.q[0]) * np.abs(weights[k // 30]))
        for k, run in enumerate(loaded)
    ]
    told = [f.message for f in identify_friction(ROBOT, saddle, mass=MASS).findings if f.kind == "load"]
    assert told
    assert all("by 0.05 N per N" in words for words in told)


def test_friction_that_falls_towards_rest_is_told():
    """A sign that is smoothed by tanh, as simulated robots have it: full friction comes with speed."""
    smooth = [
        replace(
            run,
            f=run.f + np.tile(TABLE_6_1[0].mean(axis=1) * (np.tanh(v / 0.05) - np.sign(v)), (len(run.t), 1)),
        )
        for run in runs(poses(), TABLE_6_1[0].mean(axis=1)[:, None] * [1, 1], TABLE_6_1[1])
        for v in [(run.q[-1] - run.q[0]) / (run.t[-1] - run.t[0])]
    ]
    told = [
        finding
        for finding in identify_friction(ROBOT, smooth, mass=MASS).findings
        if finding.kind == "smoothed"
    ]
    assert len(told) == 3
    assert all(
        "falls by" in finding.message and "leave out runs below 0.2" in finding.message for finding in told
    )


def test_a_mass_that_falls_upwards_is_told():
    upwards = [replace(run, f=-run.f) for run in runs(poses(), TABLE_6_1[0] * 0, TABLE_6_1[1] * 0)]
    found = identify_friction(ROBOT, upwards, mass="positions")
    assert found.mass == pytest.approx(-MASS)
    assert "mass below zero" in kinds(found)
    assert "mass below zero" not in kinds(
        identify_friction(ROBOT, runs(poses(), *TABLE_6_1), mass="positions")
    )


def test_a_known_mass_that_runs_contradict_and_runs_that_come_twice_are_told():
    logs = runs(poses(), *TABLE_6_1, np.random.default_rng(0), ripple=2.0)
    assert "fixed" not in kinds(identify_friction(ROBOT, logs, mass=MASS))
    wrong = {f.kind: f.message for f in identify_friction(ROBOT, logs, mass=3 * MASS).findings}
    assert "mass is fixed at 67.14, data want 22." in wrong["fixed"]
    assert "it would drive" in wrong["friction below zero"]
    assert "run 0 and run" in next(
        f.message
        for f in identify_friction(ROBOT, [*logs, logs[0]], mass=MASS).findings
        if f.kind == "duplicates"
    )


def test_missing_and_unsteady_runs_are_told():
    all_runs = runs(poses(), *TABLE_6_1)
    forth = [run for run in all_runs if run.q[-1, 0] > run.q[0, 0]]
    found = identify_friction(ROBOT, forth, mass=MASS)
    assert kinds(found) == {"direction missing"}
    assert np.all(np.isnan(found.coulomb[:, 1]))
    np.testing.assert_allclose(found.coulomb[:, 0], TABLE_6_1[0][:, 0], atol=1e-8)
    t = all_runs[0].t
    bent = replace(all_runs[0], q=all_runs[0].q + 0.5 * np.outer(t**2, np.ones(3)))
    found = identify_friction(ROBOT, [bent, *all_runs[1:]], mass="positions")
    assert found.findings[0].kind == "not constant"
    assert found.findings[0].rows.tolist() == [0]
    assert found.mass == pytest.approx(MASS, abs=1e-9)


def test_one_friction_for_both_directions_tells_the_mass_at_one_position():
    same = np.repeat(TABLE_6_1[0][:, :1], 2, axis=1), np.repeat(TABLE_6_1[1][:, :1], 2, axis=1)
    found = identify_friction(ROBOT, runs(poses()[:1], *same), asymmetric=False)
    assert found.mass == pytest.approx(MASS, abs=1e-9)
    np.testing.assert_allclose(found.coulomb, same[0], atol=1e-8)
    assert found.names[1] == "coulomb[0]"


def test_what_runs_do_not_tell_is_refused():
    here = runs(poses()[:1], *TABLE_6_1)
    forth = [run for run in here if run.q[-1, 0] > run.q[0, 0]]
    one = here[0]
    cases = [
        (here, dict(mass="positions"), "weights in the actuators that do not change"),
        (forth, {}, "no actuator of carts.0..f, .* with runs forth and back"),
        ([here[0], here[15]], {}, "the single speed of"),
        ([replace(one, q=one.q + np.outer(one.t**2, [9.0] * 3))], {}, "no run of 1 at constant speed"),
        (one, {}, "expected a list of MotionLogs"),
        ([], {}, "expected a list of MotionLogs"),
        ([MotionLog(one.t, one.q[:, :2], one.f[:, :2])], {}, "found run 0 .* MotionLog of the 3 actuators"),
        ([one[:1]], {}, "run 0 with 1 rows"),
        ([replace(one, q=one.q * [1, 1, 1e3])], {}, "its links do not reach"),
        (here, dict(mass="heavy"), "found mass='heavy'"),
        (here, dict(mass=np.nan), "found mass=nan"),
    ]
    for data, options, words in cases:
        with pytest.raises(ModelError, match=words):
            identify_friction(ROBOT, data, **options)


def test_an_unknown_name_of_the_covariance_is_refused():
    found = identify_friction(ROBOT, runs(poses()[:1], *TABLE_6_1))
    with pytest.raises(ModelError, match="found 'coulomb', expected names among mass, coulomb"):
        found.covariance(["coulomb"])
    assert found.covariance(["mass"]).shape == (1, 1)


def test_figure_has_a_panel_for_each_actuator_and_one_of_weight(tmp_path):
    found = identify_friction(ROBOT, runs(poses()[:2], *TABLE_6_1))
    figure = found.plot(file=tmp_path / "friction.png")
    assert len(figure.axes) == 4
    assert (tmp_path / "friction.png").stat().st_size > 1000
    across = found.plot_places(Kinematics(ROBOT)).axes[0].lines[0]
    y, z = np.unique(np.round(np.array(across.get_xydata()), 6), axis=0).T
    assert len(y) == len(z) == 2  # one place of y and z for each pose


def link_forces(place):
    """Sizes of the forces in the links, (3,): three of them hold the weight."""
    ends = np.array([arm.offset for arm in PARALLEL.arms])
    ends[:, 0] += carts(*place)
    u = np.array([1.0, *place]) - ends
    u /= np.linalg.norm(u, axis=1)[:, None]
    return np.abs(np.linalg.solve(u.T, [0.0, 0.0, MASS * 9.81]))


@pytest.mark.parametrize("noise", [0.0, 2.0])
def test_friction_that_grows_with_the_force_in_the_link_is_found(noise):
    grows, rng = np.array([0.05, 0.0, 0.12]), np.random.default_rng(0)
    spread, logs = [(2.2, -0.6), (3.2, -0.6), (2.7, -1.2), (2.7, 0.1), (2.5, -0.3)], []
    for place in spread:
        coulomb = TABLE_6_1[0] + (grows * link_forces(place))[:, None]
        logs += runs([place], coulomb, TABLE_6_1[1], rng, ripple=noise)
    plain = identify_friction(ROBOT, logs, mass="positions")
    assert {f.kind for f in plain.findings} & {"load", "not white", "trend"}
    found = friction_over_load(ROBOT, plain)
    assert found.load[:: 2 * len(SPEEDS)] == pytest.approx(
        np.array([link_forces(p) for p in spread]) * plain.mass / MASS, rel=1e-9
    )
    close = np.full(3, 1e-9) if noise == 0 else 3.5 * found.deviations
    assert np.all(np.abs(found.by_load - grows) < close)
    assert noise == 0 or np.all(found.deviations < 0.02)
    r = np.array([1.0, 2.9, -0.5])
    wanted = TABLE_6_1[0] + (grows * link_forces(r[1:]))[:, None]
    np.testing.assert_allclose(found.at(r)[0], wanted, atol=1e-7 if noise == 0 else 5.0)


def test_a_map_of_friction_asks_for_other_positions_and_for_single_links():
    found = identify_friction(ROBOT, runs(poses()[:1], *TABLE_6_1), mass=MASS)
    with pytest.raises(ModelError, match="other positions") as refusal:
        friction_over_load(ROBOT, found)
    assert refusal.value.argument == "friction"
    with pytest.raises(ModelError) as refusal:
        friction_over_load(SixLinkGantryTau(prototypes.D1), found)
    assert refusal.value.argument == "robot"
