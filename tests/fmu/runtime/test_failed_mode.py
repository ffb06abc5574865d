"""After a failure and out of it: failed mode, reset, saved states."""

from ctypes import byref, c_void_p

from tests.fmu.runtime.raw_calls import DISCARD, ERROR, OK
from tests.fmu.runtime.test_calls_out_of_order import steps


def test_a_failed_step_leads_to_failed_mode(instance, names):
    assert instance.start() == OK
    steps(instance, 2)
    state = instance.save()
    before = instance.get(names["x"])
    assert instance.set(names["T"], 0.0) < DISCARD
    assert instance.step(0.2, 0.1) == ERROR
    assert instance.step(0.2, 0.1) == ERROR
    assert "called in failed mode" in instance.message
    assert instance.set(names["u"], 1.0) == ERROR
    assert instance("Get" + instance.word, byref(c_void_p())) == ERROR
    assert instance.restore(state) == OK
    assert instance.get(names["x"]) == before
    assert instance.step(0.2, 0.1) == OK
    assert instance.forget(state) == OK


def test_reset_leads_out_of_failed_mode(instance, names):
    assert instance.start() == OK
    assert instance.set(names["T"], 0.0) < DISCARD
    assert instance.step(0.0, 0.1) == ERROR
    assert instance("Reset") == OK
    assert instance.start() == OK
    assert instance.get(names["T"], names["x"]) == (OK, [1.0, 1.0])
    assert instance.step(0.0, 0.1) == OK


def test_saved_states_are_checked(instance, names, lag):
    assert instance.start() == OK
    steps(instance, 2)
    state = instance.save()
    assert instance.restore(None) == ERROR
    assert "the state is NULL" in instance.message
    data = instance.serialize(state)
    for wrong in (data[:-1], data + b"\0", b""):
        assert instance.deserialize(wrong)[0] == ERROR
        assert f"expected {len(data)}" in instance.message
    for place in range(0, len(data), max(1, len(data) // 50)):
        flipped = bytearray(data)
        flipped[place] ^= 1
        status, damaged = instance.deserialize(bytes(flipped))
        if status == OK:
            status = instance.restore(damaged)
            assert instance.forget(damaged) == OK
        assert status == ERROR
    assert instance.step(0.2, 0.1) == OK
    other = lag[0].instantiate("CoSimulation")
    assert other
    assert other.start() == OK
    status, copy = other.deserialize(data)
    assert status == OK
    assert other.restore(copy) == OK
    assert other.step(0.2, 0.1) == OK
    assert other.get(*names.values()) == instance.get(*names.values())
    assert other.forget(copy) == OK
    assert not copy.value
    assert other.forget(copy) == OK
    assert instance.forget(state) == OK
    other.free()
