"""A tool led along a surface, against what section 8.4 of Dressler (2012) prints: 2 N held, 68 Hz, 7 N without control."""

from typing import Any, cast

import numpy as np
import pytest

from gantrytau import ModelError, simulate, study, translate
from gantrytau_models.leadthrough import SurfaceTracking, operators, surface_disturbances, surfaces

PERIOD = 0.004
STOP, POINTS = 16.0, 4001
PULL = 13.0  # s


def runs(seeds, outputs=("f_n",), surface=surfaces.CARDBOARD, **settings):
    """Values at all instants, of each seed: name -> (seeds, times), and the times."""
    dae = translate(SurfaceTracking(surface, **settings), events=True)
    found = study(
        dae, stop=STOP, points=POINTS, inputs=surface_disturbances(), seeds=seeds, outputs=list(outputs)
    )
    assert not found.failures
    times = np.arange(POINTS) * PERIOD
    rows = {}
    for name in outputs:
        each = [found.result(seed=k) for k in range(seeds)]
        # of the two sides of a jump the later one
        rows[name] = np.array([r[name][np.searchsorted(r.time, times + 1e-9) - 1] for r in each])
    return rows, times


def in_contact(force, times, after=1.0):
    """The times from a while after the first contact to the pull."""
    first = times[np.argmax(force > 0.5)]
    return (times > first + after) & (times < PULL)


def test_with_control_two_newton_are_held():
    rows, times = runs(6, ["f_n", "control.hand.v[2]", "arm.v[2]"])
    for force, hand, speed in zip(*rows.values(), strict=True):
        held = force[in_contact(force, times)]
        assert abs(held.mean() - 2.0) < 0.15
        assert held.std() < 0.1
        assert force.max() < 2.5
        assert held.min() > 0
        # (8.7): what is projected away does not wind up, and the release does not push into the surface
        assert abs(hand[times < PULL][-1]) < 0.05
        assert speed[times > PULL + 0.3].max() < 0.02
        assert force[-1] == 0


def test_without_control_contact_is_lost_and_forces_are_high():
    rows, times = runs(6, tool_control=False)
    forces = rows["f_n"]
    peaks = [force[times < PULL].max() for force in forces]
    lost = [np.mean(force[in_contact(force, times)] <= 0) for force in forces]
    assert 5 < np.median(peaks) < 11
    assert np.median(lost) >= 0.1
    assert np.count_nonzero(lost) >= 5


def test_without_anti_windup_the_hand_flies_into_the_surface():
    """(8.5): 3 N for 10 s on 2 kg, with no damping as the tool does not move along the normal."""
    rows, times = runs(2, ["control.hand.v[2]", "arm.v[2]"], control=dict(hand=dict(anti_windup=False)))
    hand, speed = rows.values()
    assert np.all(hand[:, times < PULL][:, -1] > 5)
    assert np.allclose(speed[:, times > PULL + 0.2].max(axis=1), 0.25, atol=1e-3)


def test_released_tools_come_off_and_without_the_rearm_rule_they_do_not():
    rows, _ = runs(3, ["f_n", "control.contact"])
    assert not np.any(rows["f_n"][:, -1])
    # the mutant: contact may begin anew at any force
    rows, times = runs(3, ["control.contact"], control=dict(state=dict(rearm=1e9)))
    assert np.mean(rows["control.contact"][:, (times > PULL + 0.1) & (times < PULL + 0.5)]) > 0.2


@pytest.mark.parametrize(
    ("operator", "limit", "mistakes", "released"),
    [
        (operators.SKILLED, 4.0, (0, 0), True),
        (operators.SKILLED, 12.0, (0, 0), True),
        (operators.SKILLED, 20.0, (0, 0), False),  # more than it pulls with
        (operators.ROUGH, 2.0, (3, 4), True),  # a tremor is enough
        (operators.ROUGH, 8.0, (0, 0), True),
    ],
)
def test_a_release_needs_a_limit_between_the_tremor_and_the_pull(operator, limit, mistakes, released):
    rows, times = runs(
        4, ["control.contact", "f_n"], operator=operator, control=dict(state=dict(release=limit))
    )
    lost = [np.any(c[(times > times[np.argmax(c)]) & (times < PULL)] < 0.5) for c in rows["control.contact"]]
    assert mistakes[0] <= np.count_nonzero(lost) <= mistakes[1]
    if not any(lost):
        assert np.all((rows["f_n"][:, -1] == 0) == released)


def test_a_gain_of_the_wrong_sign_is_refused():
    """It would lift the tool off: forces are those of the tool on the workpiece, so that positive gains hold them."""
    with pytest.raises(ModelError, match=r"control.tool.K"):
        translate(SurfaceTracking(surfaces.METAL, control=dict(tool=dict(K=[-0.03] * 3))), events=True)


GATES = (0, 5, 10)


@pytest.fixture(scope="module")
def on_metal():
    found = {}
    for gate in GATES:
        rows, times = runs(
            4,
            surface=surfaces.METAL,
            control=dict(normal=dict(gate=np.deg2rad(gate))),
            sensor=dict(std_f=0.1),
        )
        found[gate] = [force[in_contact(force, times, after=3.0)] for force in rows["f_n"]]
    return found


def test_metal_sounds_with_68_hertz_at_every_gate(on_metal):
    for gate in GATES:
        for force in on_metal[gate]:
            spectrum = np.abs(np.fft.rfft((force - force.mean()) * np.hanning(force.size)))
            assert 64 < np.fft.rfftfreq(force.size, PERIOD)[np.argmax(spectrum)] < 71


def test_it_grows_slightly_with_the_gate_and_comes_near_to_losing_contact(on_metal):
    rms = {gate: np.array([force.std() for force in on_metal[gate]]) for gate in GATES}
    assert np.all((1.05 < rms[10] / rms[0]) & (rms[10] / rms[0] < 1.8))
    low = [np.quantile(force, 0.01) for force in on_metal[10]]
    assert 0 < np.median(low) < 0.8
    assert max(np.mean(force <= 0) for force in on_metal[10]) < 0.02


def test_it_grows_because_noise_of_the_normal_meets_speed():
    standing = dict(hand=dict(speed=0.0), face=dict(tilt=0.0))
    rms = []
    for gate in (0, 10):
        rows, times = runs(
            2,
            surface=surfaces.METAL,
            control=dict(normal=dict(gate=np.deg2rad(gate))),
            sensor=dict(std_f=0.1),
            **standing,
        )
        rms.append([f[in_contact(f, times, after=3.0)].std() for f in rows["f_n"]])
    assert np.all(np.abs(np.array(rms[1]) / np.array(rms[0]) - 1) < 0.1)


@pytest.mark.parametrize(("share", "least", "most"), [(0.97, 0.0, 1e-3), (1.03, 1.0, 20.0)])
@pytest.mark.filterwarnings("ignore::gantrytau_models.leadthrough.CriticalGain")
def test_the_critical_gain_divides_quiet_from_hopping(share, least, most):
    """Without noise and tremor, as the linear loop foretells: 690.5 1/s."""
    stiffness = share * 690.5 / 0.03
    model = SurfaceTracking(
        surfaces.METAL,
        operator=operators.SKILLED,
        face=dict(stiffness=stiffness, tilt=0.0, rolling=0.0),
        hand=dict(tremor=0.0, speed=0.0),
    )
    run = simulate(translate(model, events=True), stop=8.0, points=2001, outputs=["f_n"])
    settled = run["f_n"][run.time > 7.0] - 2.0
    assert least <= np.abs(settled).max() < most


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (dict(face=dict(tilt=np.pi / 2)), r"face\.tilt: value is 1\.5708, expected at most 0\.523"),
        (dict(face=dict(tilt=np.pi)), r"face\.tilt"),
        (dict(face=dict(tilt=-np.pi / 2)), r"face\.tilt: .* expected at least -0\.523"),
        (dict(face=dict(ripple=0.2)), r"expected flat ripples, 30 degrees at most; are they in m\?"),
        (dict(face=dict(ripple_length=0.0)), "expected ripples longer than nothing"),
        (dict(control=dict(normal=dict(gate=10.0))), r"control\.normal\.gate: value is 10"),
    ],
)
def test_angles_in_degrees_and_lengths_in_millimetres_are_refused(wrong, words):
    with pytest.raises(ModelError, match=words):
        simulate(SurfaceTracking(surfaces.CARDBOARD, **wrong), stop=0.1)


@pytest.mark.parametrize("period", [0.002, 0.004, 0.005])
def test_the_eye_is_as_late_whatever_the_period(period):
    led = SurfaceTracking(surfaces.CARDBOARD, period=period)
    run = simulate(led, stop=1.0, points=1001, outputs=["hand.seen", "hand.height"])
    looks = np.arange(20, 49) * 0.02  # s; what is ten looks old is seen until the next one
    seen = run["hand.seen"][np.searchsorted(run.time, looks + 0.01), 9]
    height = np.interp(looks - 0.18, run.time, run["hand.height"])
    assert np.ptp(height) > 1e-3
    assert np.allclose(seen, height, atol=1e-6)


def test_wrong_records_are_refused():
    with pytest.raises(ModelError, match="SurfaceTracking: found surface='metal', expected a record such as"):
        SurfaceTracking(cast(Any, "metal"))
    with pytest.raises(ModelError, match=r"Operator: found record=.*, expected a record such as operators"):
        SurfaceTracking(surfaces.METAL, operator=cast(Any, surfaces.METAL))
