"""Saved states: they continue to the last bit wherever they are restored, and what is damaged is refused."""

import random
import shutil
from ctypes import byref, c_bool, c_double, c_int, c_size_t, c_void_p
from pathlib import Path

import pytest

from tests.fmu.runtime.raw_calls import DISCARD, ERROR, OK, Library, reals
from tests.fmu.runtime.robust_models import Unpacked, unpacked

MODELS = (
    "parallelogram",
    "sledge",
    "explicit_sledge",
    "robot",
    "late",
)  # implicit blocks, events, both solvers, delays
INPUTS = {"parallelogram": "torque", "robot": "carts[0].f"}
STEP = 0.004


def push(name, k):
    """An input that changes at every step; the parallelogram does not get to where it is flat."""
    return 2.0 * ((-1) ** k + 0.04 * k) if name == "parallelogram" else 8.0 * ((-1) ** k + 0.1 * k)


@pytest.fixture(scope="module", params=MODELS)
def model(request):
    return request.param, unpacked(request.param)


def library(found: Unpacked, version, copy=None) -> Library:
    """The library; copy: a path where it is loaded anew, with memory of its own."""
    path = found.library if copy is None else Path(shutil.copy(found.library, copy))
    return Library(path, version, found.token)


def cosimulate(name, found: Unpacked, instance, steps):
    """What all variables that are real are after each step."""
    reference = found.references[INPUTS.get(name, "push")]
    seen = []
    for k in steps:
        assert instance.set(reference, push(name, k)) == OK
        assert instance.step(k * STEP, STEP) == OK, instance.message
        seen.append(everything(found, instance))
    return seen


def everything(found: Unpacked, instance):
    """All variables; those that are integers are left out."""
    references = [r for n, r in found.references.items() if not n.endswith(".mode")]
    status, values = instance.get(*references)
    assert status == OK, instance.message
    return values


def fresh(library, kind="CoSimulation"):
    instance = library.instantiate(kind)
    assert instance
    return instance


@pytest.mark.parametrize("version", [2, 3])
def test_a_state_continues_to_the_last_bit_wherever_it_is_restored(model, version, tmp_path):
    name, found = model
    first = library(found, version)
    run = fresh(first)
    assert run.start() == OK
    cosimulate(name, found, run, range(60))
    state = run.save()
    data = run.serialize(state)
    expected = cosimulate(name, found, run, range(60, 120))
    assert run.restore(state) == OK
    again = cosimulate(name, found, run, range(60, 120))
    other = fresh(first)
    elsewhere = fresh(library(found, version, tmp_path / "copy.so"))
    continued = []
    for one in (other, elsewhere):
        status, copy = one.deserialize(data)
        assert status == OK
        assert one.restore(copy) == OK
        continued.append(cosimulate(name, found, one, range(60, 120)))
        assert one.forget(copy) == OK
    assert again == expected
    assert continued == [expected, expected]
    run.forget(state)
    for one in (run, other, elsewhere):
        one.free()


def vector(instance, name, count):
    values = reals([0.0] * count)
    assert instance(name, values, c_size_t(count)) == OK
    return list(values)


def exchange(found: Unpacked, instance, steps, count):
    """Euler's method from outside, with an event iteration at every fifth point; the derivatives of all steps."""
    rates = "GetDerivatives" if instance.version == 2 else "GetContinuousStateDerivatives"
    boolean = c_int if instance.version == 2 else c_bool
    seen = []
    for k in steps:
        if k % 5 == 0:
            assert instance("EnterEventMode") == OK
            settle(instance)
        slopes = vector(instance, rates, count)
        x = [
            value + 1e-3 * slope
            for value, slope in zip(vector(instance, "GetContinuousStates", count), slopes, strict=True)
        ]
        assert instance("SetTime", c_double(1e-3 * (k + 1))) == OK
        assert instance("SetContinuousStates", reals(x), c_size_t(count)) == OK
        assert instance("CompletedIntegratorStep", boolean(True), byref(boolean()), byref(boolean())) == OK
        seen.append((slopes, x, everything(found, instance)))
    return seen


def settle(instance):
    while instance("EnterContinuousTimeMode") != OK:
        assert instance.update() == OK


@pytest.mark.parametrize("version", [2, 3])
def test_a_state_of_model_exchange_continues_to_the_last_bit(model, version, tmp_path):
    name, found = model
    count = {"robot": 6, "late": 3}.get(name, 2)
    run = fresh(library(found, version), "ModelExchange")
    assert run.start() == OK
    settle(run)
    exchange(found, run, range(1, 42), count)
    state = run.save()
    data = run.serialize(state)
    expected = exchange(found, run, range(42, 90), count)
    other = fresh(library(found, version, tmp_path / "copy.so"), "ModelExchange")
    status, copy = other.deserialize(data)
    assert status == OK
    assert other.restore(copy) == OK
    assert exchange(found, other, range(42, 90), count) == expected
    assert run.restore(state) == OK
    assert exchange(found, run, range(42, 90), count) == expected
    for one, block in ((run, state), (other, copy)):
        one.forget(block)
        one.free()


def test_a_state_from_before_the_start_brings_its_settings_along():
    found = unpacked("lags")
    first = fresh(library(found, 2))
    boolean, zero = c_int(0), c_double(0.0)
    assert first("SetupExperiment", boolean, zero, c_double(2.0), c_int(1), c_double(3.0)) == OK
    assert first.set(found.references["u"], 2.0) == OK
    state = first.save()
    other = fresh(library(found, 2))
    assert other.restore(state) == OK
    assert other("EnterInitializationMode") == OK  # refused without SetupExperiment
    assert other("ExitInitializationMode") == OK
    status, (u, x, y) = other.get(*(found.references[n] for n in ("u", "x", "y")))
    assert (status, u) == (OK, 2.0)
    assert abs(x + x**3 - 2.0) < 1e-12  # the initial equations, to which Newton's method converges
    assert abs(y - x) < 1e-12
    assert other.step(2.0, 0.5) == OK
    assert other.step(2.5, 1.0) == ERROR
    assert "expected no later than the stop time, 3 s" in other.message
    first.forget(state)
    first.free()
    other.free()


def test_a_state_saved_between_event_iterations_knows_that_they_go_on():
    found = unpacked("sledge")
    first = fresh(library(found, 3), "ModelExchange")
    assert first.start() == OK
    assert first.update() == OK  # takes the first sample
    state = first.save()
    other = fresh(library(found, 3), "ModelExchange")
    assert other.restore(state) == OK
    assert other("EnterContinuousTimeMode") == ERROR
    assert "the event iteration has not ended" in other.message
    settle(other)
    first.forget(state)
    first.free()
    other.free()


@pytest.fixture
def running():
    """A sledge that has run for a while, the bytes of its state, and what it shows."""
    found = unpacked("sledge")
    instance = fresh(library(found, 3))
    assert instance.start() == OK
    cosimulate("sledge", found, instance, range(30))
    state = instance.save()
    yield found, instance, instance.serialize(state)
    instance.forget(state)
    instance.free()


def refused(instance, data, words):
    """What is read from the bytes may be refused at once, or when it is restored."""
    status, state = instance.deserialize(data)
    if status == OK:
        status = instance.restore(state)
        instance.forget(state)
    assert status == ERROR
    assert any(word in instance.message for word in words), instance.message


def test_a_flipped_bit_is_refused_wherever_it_is(running):
    found, instance, data = running
    before = everything(found, instance)
    bits = random.Random(1)
    header = range(40)  # null, model, checksum, size, time
    places = [*header, *bits.sample(range(len(header), len(data)), 300), len(data) - 1]
    for place in places:
        damaged = bytearray(data)
        damaged[place] ^= 1 << bits.randrange(8)
        words = (
            "another model or is damaged",
            "the checksum of the saved state does not fit",
            "no state of this FMU",
        )
        refused(instance, bytes(damaged), words)
    assert everything(found, instance) == before
    cosimulate("sledge", found, instance, range(30, 35))


def test_states_of_other_models_and_sizes_are_refused(running):
    found, instance, data = running
    before = everything(found, instance)
    other = unpacked("explicit_sledge")  # of the same size
    stranger = fresh(library(other, 3))
    state = stranger.save()
    foreign = stranger.serialize(state)
    assert len(foreign) == len(data)
    refused(instance, foreign, ["FMUState: the saved state belongs to another model"])
    for wrong in (data[:-1], data + b"\0", b"", data[:8]):
        refused(instance, wrong, [f"{len(wrong)} bytes, expected {len(data)}", "NULL"])
    assert everything(found, instance) == before
    stranger.forget(state)
    stranger.free()


@pytest.mark.parametrize("kinds", [("CoSimulation", "ModelExchange"), ("ModelExchange", "CoSimulation")])
def test_a_state_goes_into_its_own_kind_of_instance_only(kinds):
    shared = library(unpacked("sledge"), 3)
    first, other = (fresh(shared, kind) for kind in kinds)
    assert first.start() == OK
    state = first.save()
    assert other.restore(state) == ERROR
    assert "fmi3SetFMUState: the saved state is that of an instance for " in other.message
    first.forget(state)
    first.free()
    other.free()


def test_null_is_no_state(running):
    _, instance, _ = running
    assert instance.restore(None) == ERROR
    assert "the state is NULL" in instance.message
    assert instance("SerializeFMUState", None, None, c_size_t(8)) == ERROR
    assert instance("FreeFMUState", None) == ERROR
    assert instance("FreeFMUState", byref(c_void_p())) == OK


@pytest.mark.parametrize("version", [2, 3])
def test_a_saved_state_leads_out_of_failed_mode(version):
    found = unpacked("root")
    instance = fresh(library(found, version))
    assert instance.start() == OK
    assert instance.step(0.0, 1.0) == OK
    state = instance.save()
    before = everything(found, instance)
    assert instance.step(1.0, 5.0) >= DISCARD  # the state comes to zero at 2 s
    failed = c_void_p()
    assert instance("Get" + instance.word, byref(failed)) == ERROR
    assert "failed mode" in instance.message
    assert not failed.value
    assert instance.step(1.0, 0.5) == ERROR
    assert instance.restore(state) == OK
    assert everything(found, instance) == before
    assert instance.step(1.0, 0.5) == OK
    _, (x,) = instance.get(found.references["x"])
    assert abs(x - 0.25**2) < 1e-6  # sqrt(x) = 1 - t / 2; the tolerance of the integrator
    instance.forget(state)
    instance.free()
