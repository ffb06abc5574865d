"""Texts with their units, "5 mm", wherever a controller in the loop takes a quantity."""

from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_optimica import MovingHorizon, Mpc
from tests.optimica.predictive.test_component import There


def mpc(**keywords):
    return Mpc(There, period=0.1, elements=5, **keywords)


def test_a_run_reads_texts():
    texts: Any = {"noise": {"sledge.s": "5 mm"}, "start": {"sledge.s": "900 mm", "sledge.v": "1 mm/s"}}
    numbers: Any = {"noise": {"sledge.s": 5e-3}, "start": {"sledge.s": 0.9, "sledge.v": 1e-3}}
    one, two = (mpc().run(stop=0.3, **given) for given in (texts, numbers))
    np.testing.assert_allclose(one["sledge.s"], two["sledge.s"], rtol=1e-12)


def test_rates_are_in_the_unit_of_the_input_per_second():
    moves = mpc(rates={"sledge.f": ("-2 N/s", "0.001 kN/s")}).moves
    np.testing.assert_allclose([moves.lower, moves.upper], [[-0.2], [0.1]], rtol=1e-12)


def test_an_estimator_reads_texts():
    given: Any = (
        {"measured": {"sledge.s": a}, "prior": {"sledge.v": b}}
        for a, b in (("1 mm", "10 mm/s"), (1e-3, 0.01))
    )
    one, two = (MovingHorizon(There, period=0.1, samples=5, **keywords).observed for keywords in given)
    np.testing.assert_allclose([*one.p, *one.r], [*two.p, *two.r], rtol=1e-12)


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (
            lambda: mpc().run(stop=0.3, noise={"sledge.s": "5 kg"}),
            r"noise\[sledge.s\].*a mass, expected a length in m",
        ),
        (lambda: mpc(rates={"sledge.f": "5 N"}), r"rates\[sledge.f\].*a force, expected a value in N/s"),
    ],
)
def test_another_unit_is_told(make, told):
    with pytest.raises(ModelError, match=told):
        make()
