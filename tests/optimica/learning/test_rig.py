"""The rig: at rest it rests, its servos have the poles of (6.11), and seeds draw friction and noise."""

import re

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau.mechanics.translational import DahlFriction, TanhFriction
from gantrytau_models import (
    CartServo,
    F1GantryTau,
    FlexibleGantryTau,
    GantryTau,
    PreslidingFriction,
    cart_servos,
    prototypes,
)
from gantrytau_optimica import Rig, StepResponse, identify_servo
from gantrytau_optimica.learning import Scatter

RECORD = prototypes.L1_flexible
POLES = np.array([0.9647, 0.9656, 0.9728])  # (6.11)
QUIET = Scatter(encoder=0.0, gauge=0.0, accelerometer=0.0)


def new_rig(friction, noise=None, **servo) -> Rig:
    return Rig(
        FlexibleGantryTau(RECORD, friction=friction), cart_servos(RECORD, **servo), period=0.004, noise=noise
    )


@pytest.fixture(scope="module")
def rubbed() -> Rig:
    return new_rig(PreslidingFriction, Scatter())


@pytest.fixture(scope="module")
def quiet() -> Rig:
    return new_rig(PreslidingFriction, QUIET)


@pytest.fixture(scope="module")
def start(rubbed) -> np.ndarray:
    return np.array([rubbed.robot.start[f"arms[{k}].rail.s"] for k in range(3)])


def steps(rig, start, seed, rows=300) -> list[StepResponse]:
    """Steps of each cart up and down, by sizes as in the thesis."""
    found = []
    for k, size in enumerate((0.001, 0.0015, 0.002, -0.001, -0.0015, -0.002)):
        reference = np.tile(start, (rows, 1))
        reference[25:, k % 3] += size
        run = rig.run(reference, seed=100 * seed + k)
        found.append(StepResponse(run.time, run["q_ref"], run["measured.q"]))
    return found


def test_it_rests_where_friction_holds_it(quiet, start):
    still = quiet.run(np.tile(start + 0.05, (100, 1)), seed=3)
    for name in ("tool.r", "gauge.r", "frame.s", *quiet.joints):
        # m: a thousandth of an encoder's noise
        assert np.ptp(still[name], axis=0) == pytest.approx(0, abs=1e-9)
    assert still["measured.q"] == pytest.approx(
        np.column_stack([still[name] for name in quiet.joints]), abs=0
    )
    friction = np.array([still.final(f"carts[{k}].friction") for k in range(3)])
    assert np.all(np.abs(friction) < 0.6 * 1.1 * np.array(RECORD.coulomb))
    assert np.all(np.abs(friction) > 1.0)  # N: drawn, not zero
    links = np.array([still.final(f"carts[{k}].f") for k in range(3)]) - friction
    other = new_rig(None).run(np.tile(start + 0.05, (3, 1)))
    assert links == pytest.approx([other.final(f"carts[{k}].f") for k in range(3)], abs=1e-5)  # the weight, N


def test_steps_without_friction_have_the_poles_of_the_servos(start):
    model = identify_servo(steps(new_rig(None), start, seed=0)[:3])
    assert model.pole == pytest.approx(POLES, abs=2e-4)
    # the transport, and one of the speed's loop
    assert model.delay == pytest.approx(np.full(3, 3 + 1), abs=0)
    prompt = identify_servo(steps(new_rig(None, delay=0), start, seed=0)[:3])
    assert prompt.delay == pytest.approx(np.full(3, 1), abs=0)


def test_a_rigid_robot_follows_steps_alike(start):
    stiff = GantryTau(RECORD, friction=None, tool=dict(r=dict(start=[0.9, 2.7, -0.7])))
    rigid = Rig(stiff, cart_servos(RECORD), period=0.004)
    model = identify_servo(steps(rigid, start, seed=0)[:3])
    assert model.pole == pytest.approx(POLES, abs=3e-4)
    assert model.delay == pytest.approx(np.full(3, 4), abs=0)
    assert repr(rigid) == "<Rig: GantryTau under 3 servos, every 0.004 s>"


@pytest.mark.parametrize("seed", [1, 2])
def test_steps_with_friction_come_later_and_keep_their_poles(rubbed, start, seed):
    model = identify_servo(steps(rubbed, start, seed))
    assert model.pole == pytest.approx(POLES, abs=2e-3)
    assert np.all((model.delay >= 5) & (model.delay <= 6))  # the transport, the loop of the speed, friction
    assert model.gain == pytest.approx([0.03527, 0.03425, 0.02748], rel=0.05)  # (6.11)


def test_friction_of_other_runs_is_repeated_to_a_tenth_of_the_error(rubbed, start):
    t = 0.004 * np.arange(500)
    rise = np.clip((t - 0.4) / 0.22, 0, 1)
    reference = start + 0.01 * (rise - np.sin(2 * np.pi * rise) / (2 * np.pi))[:, None]
    velocity = np.diff(reference, axis=0, append=reference[-1:]) / 0.004
    first, same, other = (rubbed.run(reference, velocity, seed) for seed in (7, 7, 8))
    assert first["carts[0].s"] == pytest.approx(same["carts[0].s"], abs=0)
    assert first["measured.a"] == pytest.approx(same["measured.a"], abs=0)
    for k in range(3):
        error = first["q_ref"][:, k] - first[f"carts[{k}].s"]
        changed = first[f"carts[{k}].s"] - other[f"carts[{k}].s"]
        assert 0 < np.std(changed) < 0.1 * np.std(error)
        assert np.std(error) < 1e-3
    without = rubbed.run(reference, seed=7)
    error = without["q_ref"][:, 0] - without["carts[0].s"]
    # what the speed fed forward is for
    assert np.std(error) > 3 * np.std(first["q_ref"][:, 0] - first["carts[0].s"])


def test_accelerations_are_those_of_the_motion_although_servos_shake_with_the_clock(quiet, start):
    """Means over a period lead to second differences of positions; single values have the ripple of 250 Hz at one phase."""
    t = 0.004 * np.arange(400)
    rise = np.clip((t - 0.2) / 0.22, 0, 1)
    reference = start + 0.01 * (rise - np.sin(2 * np.pi * rise) / (2 * np.pi))[:, None]
    run = quiet.run(reference, np.diff(reference, axis=0, append=reference[-1:]) / 0.004)
    second = np.diff(run["tool.r"], 2, axis=0) / 0.004**2
    read, single = run["measured.a"][1:-1], run["accelerometer.a"][1:-1]
    # the difference of means over one period and over two is 1/24 of what changes between
    assert np.std(read - second, axis=0).max() < 2e-3 * np.std(second, axis=0).max()
    assert np.std(single - second, axis=0).max() > 2e-2 * np.std(second, axis=0).max()


def test_readings_have_the_noise_of_their_devices(rubbed, start):
    run = rubbed.run(np.tile(start, (1000, 1)), seed=11)
    true = np.column_stack([run[name] for name in rubbed.joints])
    for read, exact, deviation in (
        ("q", true, 1e-6),
        ("r", run["gauge.r"], 1e-6),
        ("a", run["accelerometer.a"], 0.07),
    ):
        noise = run[f"measured.{read}"] - exact
        # of 1000, three in 1/sqrt(2000)
        assert np.std(noise, axis=0) == pytest.approx(np.full(3, deviation), rel=0.1)
        assert abs(np.corrcoef(noise.T)[0, 1]) < 0.15
    assert run.unit("measured.a") == "m/s2"
    assert run.unit("carts[0].f") == "N"


def wrong(words: str):
    return pytest.raises(ModelError, match=re.escape(words))


def test_wrong_rigs_are_told(start):
    robot = FlexibleGantryTau(RECORD, friction=None)
    servos = cart_servos(RECORD)
    with wrong("Rig: found 2 controllers, expected one for each joint: carts[0].s, carts[1].s, carts[2].s"):
        Rig(robot, servos[:2], period=0.004)
    with wrong(
        "Rig: controllers[1]: found 3.0 without q_ref, v_ref, q, v, f_ff, f, expected a component such as CartServo"
    ):
        Rig(robot, [servos[0], 3.0, servos[2]], period=0.004)  # pyright: ignore[reportArgumentType]
    with pytest.raises(ModelError, match=r"found the joints .*phi, expected joints that all slide, x.s, or"):
        Rig(F1GantryTau(prototypes.F1, friction=None), [CartServo()] * 6, period=0.004)
    for law in (TanhFriction, DahlFriction):
        with wrong(
            "Rig: found friction carts[0].law without the inputs level and z_0, expected such as Presliding"
        ):
            Rig(FlexibleGantryTau(RECORD, friction=law), servos, period=0.004, noise=Scatter())
    plain = Scatter(level=0.0, rest=0.0)
    assert new_rig(TanhFriction, plain).run(np.tile(start, (3, 1))).final(
        "carts[0].friction"
    ) == pytest.approx(0, abs=1e-9)


def test_servos_of_another_period_are_told(start):
    with wrong("Rig: found controllers[0] with the period 0.002 s, expected that of the rig, 0.004 s"):
        new_rig(None, period=0.002)


def test_wrong_references_are_told(rubbed, start):
    reference = np.tile(start, (10, 1))
    for argument, call in (
        ("position", lambda: rubbed.run(reference[:, :2])),
        ("position", lambda: rubbed.run(reference[:1])),
        ("velocity", lambda: rubbed.run(reference, reference[:9])),
        ("push", lambda: rubbed.run(reference, push=reference[:9])),
        ("q", lambda: rubbed.at_rest(reference[:2])),
    ):
        with pytest.raises(ModelError) as refusal:
            call()
        assert refusal.value.argument == argument


@pytest.mark.parametrize(("name", "value"), [("gauge", -1e-6), ("level", 1.0)])
def test_scatter_keeps_its_limits(name, value):
    with pytest.raises(ModelError) as refusal:
        Scatter(**{name: value})
    assert refusal.value.argument == name
