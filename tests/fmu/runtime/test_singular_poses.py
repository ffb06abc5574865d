"""Poses that are singular or out of reach: an error and a line that names variables, never a wrong number.

Three equal sides and one that fits, FourBar(1.0, 0.3, 1.0, 0.3), are a parallelogram. Where it falls flat, the other
way to assemble it, with crossed bars, has the same pose; both can be left to either way, and nothing tells which.
"""

import math
from ctypes import byref, c_bool, c_double, c_int, c_size_t
from functools import cache

import numpy as np
import pytest

from gantrytau import simulate, translate
from gantrytau_models import DeltaRobot, StewartPlatform
from tests.families import first_of
from tests.fmu.exported import export
from tests.fmu.runtime.raw_calls import ERROR, OK, Instance, Kind, Library, reals
from tests.fmu.runtime.robust_models import MAKERS, unpacked

VERSIONS = pytest.mark.parametrize("version", [2, 3])
STEP = 0.004


def fresh(model, version, kind: Kind = "CoSimulation"):
    found = unpacked(model)
    instance = Library(found.library, version, found.token).instantiate(kind)
    assert instance
    return found.references, instance


def told(instance: Instance, *words):
    """The last line has all the words."""
    assert all(word in instance.message for word in words), instance.message


@VERSIONS
def test_a_start_in_a_singular_pose_is_refused(version):
    references, instance = fresh("parallelogram", version)
    assert instance.enter() == OK
    assert instance.set(references["crank.phi"], 0.0) == OK
    assert instance("ExitInitializationMode") == ERROR
    told(instance, "rocker.phi", "singular")
    assert instance.step(0.0, STEP) == ERROR
    told(instance, "failed mode")
    instance.free()


@VERSIONS
@pytest.mark.parametrize("kind", ["CoSimulation", "ModelExchange"])
def test_a_start_out_of_reach_is_refused(version, kind):
    references, instance = fresh("robot", version, kind)
    assert instance.enter() == OK
    assert instance.set(references["tool.r[1]"], 50.0) == OK
    assert instance("ExitInitializationMode") == ERROR
    told(instance, "tool.v[0]", "out of reach")
    instance.free()


@VERSIONS
def test_a_value_out_of_reach_is_refused_before_the_start_too(version):
    references, instance = fresh("robot", version)
    assert instance.enter() == OK
    assert instance.set(references["tool.r[1]"], 50.0) == OK
    assert instance.get(references["carts[0].s"])[0] == ERROR
    told(instance, "carts[0].s is not a finite number")
    assert instance.set(references["tool.r[1]"], 2.9) == OK
    assert instance.get(references["carts[0].s"])[0] == OK
    assert instance("ExitInitializationMode") == OK
    instance.free()


@VERSIONS
@pytest.mark.parametrize("step", [1e-3, STEP, 0.05])
def test_a_step_that_falls_flat_is_refused(version, step):
    references, instance = fresh("parallelogram", version)
    assert instance.start() == OK
    where = [references[n] for n in ("crank.phi", "rocker.phi", "coupler.phi")]
    k, status = 0, OK
    while status == OK and k * step < 1.0:
        _, (crank, rocker, coupler) = instance.get(*where)
        assert (rocker, coupler) == pytest.approx((crank, 0.0), abs=1e-6)  # as long as it is a parallelogram
        status = instance.step(k * step, step)
        k += 1
    assert status == ERROR
    told(instance, "become singular", "rocker.phi")
    status, (crank, rocker, coupler) = instance.get(*where)  # where it stopped
    assert status == OK
    assert abs(crank) < 0.01
    assert (rocker, coupler) == pytest.approx((crank, 0.0), abs=1e-2)
    instance.free()


def euler(instance, step, stop):
    """Euler's method from outside, until a call is refused; (status, state, time)."""
    rates, boolean = (
        ("GetDerivatives", c_int) if instance.version == 2 else ("GetContinuousStateDerivatives", c_bool)
    )
    x, slopes, k = reals([0.0, 0.0]), reals([0.0, 0.0]), 0
    assert instance("GetContinuousStates", x, c_size_t(2)) == OK
    while k * step < stop:
        if instance(rates, slopes, c_size_t(2)) != OK:
            break
        x = reals([a + step * b for a, b in zip(x, slopes, strict=True)])
        k += 1
        assert instance("SetTime", c_double(k * step)) == OK
        assert instance("SetContinuousStates", x, c_size_t(2)) == OK
        if instance("CompletedIntegratorStep", boolean(True), byref(boolean()), byref(boolean())) != OK:
            break
    else:
        return OK, list(x), k * step
    return ERROR, list(x), k * step


def exchanging(model, version):
    references, instance = fresh(model, version, "ModelExchange")
    assert instance.start() == OK
    while instance("EnterContinuousTimeMode") != OK:
        assert instance.update() == OK
    return references, instance


@VERSIONS
def test_model_exchange_does_not_pass_a_flat_pose_whatever_the_steps(version):
    """Where two ways to assemble cross, determinants need not change their signs; steps fall on all sides of it."""
    for step in 3e-4 * 1.09 ** np.arange(50):
        _, instance = exchanging("parallelogram", version)
        status, x, _ = euler(instance, float(step), 0.5)
        assert status == ERROR, step
        assert x[0] > -12.0 * step  # not after the step that passes it, at 8 rad/s
        told(instance, "rocker.phi", "singular pose")
        instance.free()


def test_next_to_a_singular_pose_there_is_no_false_alarm():
    """The crank goes round and the loop is almost straight twice a turn: in Co-Simulation and in Model Exchange."""
    names = ("crank.phi", "rocker.phi")
    expected = simulate(MAKERS["nearly_flat"]()[0], stop=2.0, tolerance=1e-10)
    for step in (0.01, 0.1):
        references, instance = fresh("nearly_flat", 3)
        assert instance.start() == OK
        for k in range(round(2.0 / step)):
            assert instance.step(k * step, step) == OK, instance.message
        _, found = instance.get(*(references[n] for n in names))
        # a thousand times the tolerance of the integrator: it is fast and close to where it would be chaotic
        assert found == pytest.approx([expected[n][-1] for n in names], abs=1e-3)
        instance.free()
    for step in (1e-3, 3e-3):
        references, instance = exchanging("nearly_flat", 3)
        assert euler(instance, step, 2.0)[0] == OK, instance.message
        _, (crank, rocker) = instance.get(*(references[n] for n in names))
        across = np.array(
            [
                1.0 + 0.302 * math.cos(rocker) - 0.3 * math.cos(crank),
                0.302 * math.sin(rocker) - 0.3 * math.sin(crank),
            ]
        )
        assert np.hypot(*across) == pytest.approx(1.001, abs=1e-9)  # the length of the coupler
        instance.free()


@VERSIONS
def test_a_robot_that_is_pushed_out_of_reach_stops_with_an_error(version):
    references, instance = fresh("robot", version)
    assert instance.start() == OK
    status, k = OK, 0
    while status == OK and k < 200:
        for cart, force in ((0, 500.0), (1, -500.0)):
            assert instance.set(references[f"carts[{cart}].f"], force) == OK
        status = instance.step(k * 0.01, 0.01)
        k += 1
    assert status == ERROR
    told(instance, "carts[", "out of reach")
    status, place = instance.get(*(references[f"tool.r[{i}]"] for i in range(3)))
    assert status == OK  # the last pose within reach
    assert np.isfinite(place).all()
    instance.free()


@VERSIONS
def test_inverse_kinematics_out_of_reach_give_no_number(version):
    references, instance = fresh("inverse", version)
    assert instance.start() == OK
    carts = [references[f"carts[{i}].s"] for i in range(3)]
    status, before = instance.get(*carts)
    assert status == OK
    height = references["tool.r[2]"]
    _, (good,) = instance.get(height)
    assert instance.set(height, 50.0) == OK
    status, values = instance.get(*carts)
    assert status == ERROR
    assert not np.isfinite(values).any()  # untouched, or not a number
    told(instance, "carts[0].s is not a finite number", "out of reach")
    assert instance.set(height, good) == OK  # back within reach, the pose is that of before
    assert instance.get(*carts) == (OK, before)
    instance.free()


def test_too_many_steps_of_the_integrator_are_an_error():
    """A time constant of 1e-9 s in a step of 1 s, with a solver that is not for stiff models."""
    references, instance = fresh("lags", 3)
    assert instance.enter() == OK
    assert instance.set(references["T"], 1e-9) == OK
    assert instance("ExitInitializationMode") == OK
    assert instance.set(references["u"], 2.0) == OK
    assert instance.step(0.0, 1.0) == ERROR
    told(instance, "more than 20000 steps of the integrator", "fastest state is ")
    instance.free()


def test_a_step_holds_as_many_samples_as_there_are():
    references, instance = fresh("sledge", 3)
    assert instance.enter() == OK
    assert instance.set(references["period"], 1e-5) == OK
    assert instance("ExitInitializationMode") == OK
    assert instance.step(0.0, 0.1) == OK
    instance.free()


@VERSIONS
def test_what_follows_from_others_is_not_set(version):
    """An output, a derivative, a state while stepping: a pose cannot be forced upon the mechanism."""
    references, instance = fresh("parallelogram", version)
    assert instance.start() == OK
    before = instance.get(*references.values())
    for name in ("rocker.phi", "der(crank.w)", "crank.phi"):
        assert instance.set(references[name], 0.5) == ERROR
        told(instance, f"{name} cannot be set: it is ")
    assert instance.get(*references.values()) == before
    instance.free()


@pytest.mark.parametrize("solver", first_of(["rodas4", "dopri5"]))
@pytest.mark.parametrize("step", [0.001, 0.01, 0.1])
def test_arms_that_stretch_stop_a_robot_whose_states_cannot_go_through(mechanisms, solver, step):
    """A delta robot that falls: `simulate` passes the stretched pose, where the states tool.r and tool.v stand still."""
    with mechanisms(DeltaRobot, solver).new() as run:
        run.begin()
        k, status = 0, OK
        while status == OK and k * step < 1.0:
            status = run.instance.step(k * step, step)
            k += 1
        assert status == ERROR
        assert "the equations for arms[1].phi" in run.instance.message
        assert "become singular" in run.instance.message
        # the stretched pose is met at 0.3205 s, at 8.9 rad/s
        assert float(run.instance.message.split("time = ")[1].split(" s")[0]) == pytest.approx(
            0.3205, abs=3e-4
        )


@pytest.mark.parametrize("solver", first_of(["dopri5", "rodas4"]))
@pytest.mark.parametrize("step", [0.01, 0.1, 0.5])
def test_large_blocks_far_from_singular_poses_raise_no_alarm(mechanisms, solver, step):
    """A falling platform, whose 57 equations for accelerations have determinants from 1e-224 to 1e-61 on the way."""
    with mechanisms(StewartPlatform, solver).new() as run:
        run.begin()
        for k in range(round(0.5 / step)):
            run.time = k * step
            run.step(step)
        assert run["platform.r[2]"] == pytest.approx(fallen(), abs=1e-4)


@cache
def fallen() -> float:
    """Where the platform is after half a second."""
    return simulate(translated(StewartPlatform), stop=0.5, points=6, tolerance=1e-10)["platform.r"][-1, 2]


@cache
def translated(model):
    return translate(model(), events=True)


@pytest.fixture(scope="module")
def mechanisms(tmp_path_factory):
    @cache
    def made(model, solver):
        return export(translated(model), tmp_path_factory.mktemp("mechanisms") / "m.fmu", solver=solver)

    return made
