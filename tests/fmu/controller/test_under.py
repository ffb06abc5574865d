"""`Controller.under`: a law that is called every few samples, at once or as a client that may be late."""

import threading
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, SolveError
from gantrytau_fmu.controller import Controller, Declaration, Sample
from gantrytau_fmu.controller.controller_checks import check_step
from gantrytau_fmu.controller.exchange.periodic_client import PeriodicClient
from gantrytau_fmu.controller.stepped_part import SteppedPart
from tests.fmu.controller.conftest import Q_REF, slide

GIVEN: Any = dict(every=5, known=["q"], stop=0.08)


def test_a_law_gives_references_at_once_and_holds_them(plant):
    asked = []

    def law(t, values):
        asked.append((round(t / 0.004), values["q"]))
        return {"q_ref": 0.1 * len(asked)}

    controller = Controller(plant)
    assert (controller.plant_inputs, controller.plant_outputs) == ({"q_ref": "m"}, {"q": "m"})
    found = controller.under(law, gives={"q_ref": "m"}, **GIVEN)
    assert [k for k, _ in asked] == [0, 5, 10, 15, 20]
    np.testing.assert_allclose(found["applied.q_ref"], 0.1 * (1 + np.arange(21) // 5))
    assert [q for _, q in asked] == found["q"][::5].tolist()


def test_a_client_gives_its_answer_to_sample_k_for_sample_k_and_every(plant):
    controller = Controller(plant, lambda t, values: {"q_ref": values["mpc.x"]})
    found = controller.under(lambda t, values: {"x": 1.0 + round(t / 0.02)}, gives={"x": "m"}, **GIVEN)
    np.testing.assert_array_equal(found["mpc.x"], np.arange(21) // 5)
    assert controller.plant_inputs is None


def test_a_client_that_fails_is_told(plant):
    with pytest.raises(SolveError, match="the client mpc raised ZeroDivisionError") as raised:
        Controller(plant, lambda t, values: {}).under(
            lambda t, values: {"x": 1 / 0}, gives={"x": "m"}, **GIVEN
        )
    assert len(raised.value.result.time) == 21


def test_a_client_that_is_busy_is_not_asked_again():
    go, channels = threading.Event(), Declaration([Q_REF])

    def slow(t, values):
        go.wait(10.0)
        return {"x": values["q_ref"]}

    client = PeriodicClient("mpc", slow, 2, ["q_ref"], {"x": "m"})
    for k in range(4):
        client.submit(Sample(k, 0, np.array([float(k)])), channels)
        assert client.answer(k + 1) is None
    assert not client.settled(2)
    go.set()
    client.close()
    late = client.answer(5)
    assert (client.dropped, late and late.k, late and late.values.tolist()) == (1, 4, [0.0])


def test_an_fmu_of_steps_of_one_length_wants_a_multiple_of_them():
    """Its declaration is that of a function, which takes any."""
    stiff = replace(SteppedPart("plant", slide()).component, variable_step=False, step=0.004)
    check_step(stiff, 0.02)
    for period in (0.001, 0.01):
        with pytest.raises(ModelError, match=r"steps of 0.004 s, which alone .* expected a multiple of"):
            check_step(stiff, period)
