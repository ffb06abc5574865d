"""Calls that an FMU must refuse: out of order, with wrong arguments, and what is logged of it. FMI 2.0.4 and 3.0.2."""

import math
from ctypes import byref, c_bool, c_double, c_int, c_size_t, c_void_p

import pytest

from tests.fmu.runtime.raw_calls import ERROR, OK, integers, reals

BOTH = ("ModelExchange", "CoSimulation")


def steps(instance, count=5, size=0.1):
    for k in range(count):
        assert instance.step(k * size, size) == OK


def test_a_step_before_initialisation_ends_names_both_modes(instance):
    assert instance.enter() == OK
    assert instance.step(0.0, 0.1) == ERROR
    v = instance.version
    assert instance.message == (
        f"fmi{v}DoStep: called in initialization mode, expected step mode (after fmi{v}ExitInitializationMode)"
    )
    assert instance.library.messages[-1][0] == "logStatusError"
    assert instance("ExitInitializationMode") == OK
    assert instance.step(0.0, 0.1) == OK


@pytest.mark.parametrize("instance", BOTH, indirect=True)
def test_modes_are_left_and_entered_in_order(instance, names):
    assert instance("ExitInitializationMode") == ERROR
    assert instance("Terminate") == ERROR
    assert "instantiated mode" in instance.message
    assert instance.get(names["x"])[0] == ERROR
    assert instance.start() == OK
    assert instance("ExitInitializationMode") == ERROR
    assert instance.enter() == ERROR
    assert "instantiated mode" in instance.message
    assert instance.get(names["x"]) == (OK, [1.0])
    assert instance("Terminate") == OK
    assert instance("Terminate") == ERROR
    assert instance.set(names["u"], 1.0) == ERROR
    assert "called in terminated mode" in instance.message
    assert instance.get(names["x"]) == (OK, [1.0])
    assert instance("Reset") == OK
    assert instance.start() == OK


def test_fmi_2_needs_the_experiment_first(instance):
    if instance.version == 3:
        pytest.skip("part of entering initialization mode")
    assert instance("EnterInitializationMode") == ERROR
    assert "fmi2SetupExperiment" in instance.message


def test_the_kind_of_the_instance_decides(instance, exchange):
    assert instance.start() == OK
    assert exchange.start() == OK
    assert exchange.step(0.0, 0.1) == ERROR
    assert "is for Model Exchange, expected one for Co-Simulation" in exchange.message
    for name in ("EnterEventMode", "EnterContinuousTimeMode"):
        assert instance(name) == ERROR
        assert "is for Co-Simulation, expected one for Model Exchange" in instance.message
    assert instance("SetTime", c_double(1.0)) == ERROR
    assert instance("GetContinuousStates", reals([0.0]), c_size_t(1)) == ERROR


def test_model_exchange_goes_from_event_to_continuous_mode(exchange):
    assert exchange.start() == OK
    assert exchange("SetContinuousStates", reals([0.5]), c_size_t(1)) == ERROR
    assert "called in event mode, expected continuous-time mode" in exchange.message
    assert exchange.update() == OK
    assert exchange("EnterContinuousTimeMode") == OK
    assert exchange.update() == ERROR
    assert "called in continuous-time mode, expected event mode" in exchange.message
    assert exchange("SetContinuousStates", reals([0.5]), c_size_t(1)) == OK
    rates = reals([0.0])
    name = "GetDerivatives" if exchange.version == 2 else "GetContinuousStateDerivatives"
    assert exchange(name, rates, c_size_t(1)) == OK
    assert rates[0] == -0.5
    assert exchange("SetContinuousStates", reals([0.5, 1.0]), c_size_t(2)) == ERROR
    assert "2 states, expected 1" in exchange.message
    assert exchange(name, None, c_size_t(1)) == ERROR
    assert "NULL" in exchange.message


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_numbers_that_are_not_finite_are_refused(instance, exchange, names, value):
    assert exchange.start() == OK
    assert exchange.update() == OK
    assert exchange("EnterContinuousTimeMode") == OK
    assert exchange("SetTime", c_double(value)) == ERROR
    assert exchange("SetContinuousStates", reals([value]), c_size_t(1)) == ERROR
    assert "x is" in exchange.message
    assert instance.enter(start=value) == ERROR
    assert "start time" in instance.message
    assert instance.enter(stop=value) == ERROR
    assert instance.enter(tolerance=value) == ERROR
    assert instance.enter() == OK
    assert instance.set(names["u"], value) == ERROR
    assert "u" in instance.message
    assert instance("ExitInitializationMode") == OK
    for point, size in ((value, 0.1), (0.0, value)):
        assert instance.step(point, size) == ERROR
    assert instance.get(names["x"]) == (OK, [1.0])


def test_experiments_that_make_no_sense_are_refused(instance):
    assert instance.enter(tolerance=-1e-6) == ERROR
    assert "expected more than 0" in instance.message
    assert instance.enter(start=2.0, stop=1.0) == ERROR
    assert "no less than the start time" in instance.message
    assert instance.enter(start=1.0, stop=2.0) == OK


def test_wrong_steps_are_refused_and_leave_no_trace(instance, names):
    assert instance.start(stop=0.5) == OK
    for point, size, said in (
        (0.0, 0.0, "advances the time"),
        (0.0, -0.1, "advances the time"),
        (0.1, 0.1, "expected 0 s, where the last step ended"),
        (-0.1, 0.1, "where the last step ended"),
        (0.0, 0.6, "stop time"),
    ):
        assert instance.step(point, size) == ERROR
        assert said in instance.message
    steps(instance)
    assert instance.step(0.5, 0.1) == ERROR
    assert "stop time" in instance.message
    # an integrator at its default tolerance, 1e-6; the error is bounded by a few times that
    assert instance.get(names["x"])[1][0] == pytest.approx(math.exp(-0.5), abs=1e-5)


def test_refused_calls_change_nothing(instance, lag, names):
    library, _ = lag
    clean = library.instantiate("CoSimulation")
    assert clean
    assert clean.start() == OK
    assert instance.start() == OK
    for k in range(5):
        instance.set(names["u"], math.nan)
        instance.set(names["y"], 3.0)
        instance.set(9999, 3.0)
        instance.step(7.0, 0.1)
        instance.enter()
        assert instance.step(0.1 * k, 0.1) == OK
        assert clean.step(0.1 * k, 0.1) == OK
    assert instance.get(*names.values()) == clean.get(*names.values())
    clean.free()


def test_references_and_arrays_are_checked(instance, names):
    assert instance.start() == OK
    assert instance.get(9999)[0] == ERROR
    assert "value reference 9999 is unknown" in instance.message
    assert instance.set(9999, 1.0) == ERROR
    real = "Real" if instance.version == 2 else "Float64"
    extra = () if instance.version == 2 else (c_size_t(1),)
    one, reference, value = c_size_t(1), integers([names["x"]]), reals([0.0])
    for verb in ("Get", "Set"):
        assert instance(verb + real, None, one, value, *extra) == ERROR
        assert "references is NULL" in instance.message
        assert instance(verb + real, reference, one, None, *extra) == ERROR
        assert "values is NULL" in instance.message
        if extra:
            assert instance(verb + real, reference, one, value, c_size_t(2)) == ERROR
            assert "2 values, expected 1" in instance.message
    empty = c_size_t(0)
    assert instance("Get" + real, None, empty, None, *([empty] if extra else [])) == OK


def test_variables_of_other_types_do_not_exist(instance, names):
    assert instance.start() == OK
    types = ["Integer", "Boolean", "String"]
    if instance.version == 3:
        types = [
            "Float32",
            "Int8",
            "UInt8",
            "Int16",
            "UInt16",
            "Int32",
            "UInt32",
            "Int64",
            "UInt64",
            "Boolean",
            "String",
        ]
    for kind in types:
        for verb in ("Get", "Set"):
            extra = () if instance.version == 2 else (c_size_t(1),)
            space = reals([0.0])
            assert instance(verb + kind, integers([names["x"]]), c_size_t(1), space, *extra) == ERROR
            assert instance.message.startswith(f"fmi{instance.version}{verb}{kind}: x is ")
            empty = () if instance.version == 2 else (c_size_t(0),)
            assert instance(verb + kind, None, c_size_t(0), None, *empty) == OK


@pytest.mark.parametrize("kind", BOTH)
def test_an_instance_needs_token_and_name(lag, kind):
    library, _ = lag
    assert library.instantiate(kind, token="{of-another-model}") is None
    assert "{of-another-model}" in library.messages[-1][1]
    assert library.instantiate(kind, name="") is None
    assert library.instantiate(kind, name=None) is None
    assert "name" in library.messages[-1][1]


def test_event_mode_and_scheduled_execution_are_refused(lag):
    library, _ = lag
    if library.version == 2:
        pytest.skip("FMI 3 only")
    assert library.instantiate("CoSimulation", event_mode=True) is None
    assert "eventModeUsed" in library.messages[-1][1]
    create = library.function("InstantiateScheduledExecution")
    create.restype = c_void_p
    arguments = (b"test", library.token.encode(), b"", c_bool(False), c_bool(False), None, library.logger)
    assert create(*arguments, None, None, None) is None
    assert "Scheduled Execution" in library.messages[-1][1]


def test_null_and_the_other_version_are_refused(lag, instance):
    library, _ = lag
    v = library.version
    assert getattr(library.library, f"fmi{v}Reset")(None) == ERROR
    assert getattr(library.library, f"fmi{5 - v}Reset")(instance.pointer) == ERROR
    assert instance.start() == OK


def test_what_is_not_supported_says_so(instance):
    assert instance.start() == OK
    if instance.version == 2:
        assert instance("CancelStep") == ERROR
        assert "background" in instance.message
        value = c_double(-1.0)
        assert instance("GetRealStatus", 2, byref(value)) == OK
        assert value.value == 0.0
        assert instance("GetIntegerStatus", 0, byref(c_int())) == ERROR
        return
    assert instance("EnterConfigurationMode") == ERROR
    assert "structural" in instance.message
    for name in ("ExitConfigurationMode", "EnterStepMode", "EnterEventMode"):
        assert instance(name) == ERROR
    assert instance("ActivateModelPartition", 0, c_double(0.0)) == ERROR
    assert instance("GetClock", integers([0]), c_size_t(1), (c_bool * 1)()) == ERROR
    assert "Clock" in instance.message
    assert instance("GetNumberOfVariableDependencies", 0, byref(c_size_t())) == ERROR
    assert "not supported" in instance.message


def test_derivatives_are_checked(instance, names):
    assert instance.start() == OK
    name, v = "GetDirectionalDerivative", instance.version
    one, x, y, seed, product = (
        c_size_t(1),
        integers([names["x"]]),
        integers([names["y"]]),
        reals([3.0]),
        reals([0.0]),
    )
    counts = () if v == 2 else (one,)
    assert instance(name, y, one, x, one, seed, *counts, product, *counts) == OK
    assert product[0] == 6.0
    assert instance(name, integers([9999]), one, x, one, seed, *counts, product, *counts) == ERROR
    assert "9999" in instance.message
    assert instance(name, y, one, x, one, reals([math.nan]), *counts, product, *counts) == ERROR
    assert "x is nan" in instance.message
    assert instance(name, y, one, x, one, None, *counts, product, *counts) == ERROR
    if v == 3:
        assert instance(name, y, one, x, one, reals([1.0, 1.0]), c_size_t(2), product, one) == ERROR
        assert "2 seeds, expected 1" in instance.message
        assert instance("GetAdjointDerivative", y, one, x, one, seed, one, product, c_size_t(2)) == ERROR
        assert "2 sensitivities, expected 1" in instance.message


def test_categories_select_what_is_told(instance):
    told = instance.library.messages
    assert instance.logging(True, "logCalls") == OK
    assert instance.start() == OK
    assert {category for category, _ in told} == {"logCalls"}
    assert instance.logging(False) == OK
    told.clear()
    assert instance.step(0.0, 0.1) == OK
    assert not told
    assert instance.step(5.0, 0.1) == ERROR
    assert [category for category, _ in told] == ["logStatusError"]
    assert instance.logging(False, "logStatusError") == OK
    assert instance.step(5.0, 0.1) == ERROR
    assert len(told) == 1
    assert instance.logging(True) == OK
    assert instance.logging(True, "logNothing") == ERROR
    assert "logNothing is unknown, expected logEvents" in instance.message


def test_an_instance_made_with_logging_does_not_tell_every_call(lag):
    library, _ = lag
    made = library.instantiate("CoSimulation", logging=True)
    assert made
    library.messages.clear()
    assert made.start() == OK
    assert "logCalls" not in {category for category, _ in library.messages}
    made.free()


def test_logging_outlives_a_reset(instance):
    assert instance.logging(False, "logStatusError") == OK
    assert instance("Reset") == OK
    assert instance("Terminate") == ERROR
    assert not instance.library.messages
