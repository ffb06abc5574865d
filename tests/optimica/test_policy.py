"""The policy of a solve: its keywords are those of `optimize`, and every verb takes its own of them."""

import inspect
import math
from dataclasses import fields
from fractions import Fraction

import pytest

from gantrytau import Model, ModelError
from gantrytau_optimica import estimate, optimize, pareto, prepare
from gantrytau_optimica.policy import MeshKeywords, Policy, PolicyKeywords, TranscriptionKeywords
from tests.optimica.problems import FastestMass


def test_the_record_has_the_keywords_and_defaults_of_optimize():
    said = inspect.signature(optimize).parameters.values()
    expected = {p.name: p.default for p in said if p.name not in ("problem", "record")}
    assert {f.name: f.default for f in fields(Policy)} == expected
    assert set(PolicyKeywords.__annotations__) == set(expected)


def test_the_keywords_of_other_verbs_are_some_of_these():
    everything = set(PolicyKeywords.__annotations__)
    assert everything - set(TranscriptionKeywords.__annotations__) == {"refine", "starts", "compile"}
    assert everything - set(MeshKeywords.__annotations__) == {
        "refine",
        "starts",
        "compile",
        "lengths",
        "guess",
        "causality",
        "controls",
    }


@pytest.mark.parametrize(
    ("ask", "keyword"),
    [
        (lambda **more: prepare(FastestMass, **more), "record"),
        (lambda **more: pareto(FastestMass, "weight", [1.0], **more), "refine"),
        (lambda **more: estimate(Model, {}, [], **more), "guess"),
    ],
)
def test_keywords_of_other_verbs_are_refused(ask, keyword):
    with pytest.raises(TypeError, match=rf"\w+\(\) got an unexpected keyword argument '{keyword}'"):
        ask(**{keyword: None})
    with pytest.raises(TypeError, match="unexpected keyword argument 'point'; did you mean 'points'"):
        ask(point=3)


@pytest.mark.parametrize(
    "wrong",
    [
        dict(tolerance=2.0), dict(max_iterations=0), dict(max_time=-1.0), dict(progress="bar"), dict(refine=1),
        dict(refine=1e-12), dict(starts=True), dict(lengths="none"), dict(causality="both"),
        dict(points=10), dict(points=2.5),
        dict(scheme="euler"), dict(points=1, scheme="lobatto"), dict(points=1, refine=1e-6),
        dict(refine=1e-6, scheme="shooting"), dict(lengths="free", scheme="shooting"),
        dict(elements=0), dict(elements=10.0), dict(elements=[0.1, 0.0]), dict(elements=[]), dict(elements="5"),
        dict(elements=[1, -2]), dict(elements=[[1, 2]]), dict(elements=["long"]), dict(elements=None),
    ],
)  # fmt: skip
def test_an_error_names_its_argument(wrong):
    with pytest.raises(ModelError, match="prepare: found") as caught:
        prepare(FastestMass, **wrong)
    assert caught.value.argument == next(iter(wrong))


def test_estimations_do_not_shoot():
    with pytest.raises(ModelError, match="estimate: found scheme='shooting', expected 'radau'") as caught:
        estimate(Model, {}, [], scheme="shooting")
    assert caught.value.argument == "scheme"


def test_infinite_time_is_no_limit_and_what_is_called_a_number_becomes_one():
    policy = Policy(max_time=math.inf, tolerance=Fraction(1, 1000))  # type: ignore[arg-type]
    assert (policy.max_time, policy.tolerance) == (math.inf, 0.001)
    assert type(policy.tolerance) is float
