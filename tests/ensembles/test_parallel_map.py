"""One function for many arguments within a longer call: alike here and in processes, with its own errors."""

import os

import pytest

from gantrytau import GantryTauError, SolveError
from gantrytau.ensembles import parallel_map as parts
from gantrytau.ensembles.parallel_map import each


@pytest.mark.parametrize("worth", [0.0, float("inf")], ids=["processes", "here"])
def test_every_argument_has_its_value(worth, monkeypatch):
    monkeypatch.setattr(parts, "WORTH", worth)
    found = dict(each(lambda a: (a**2, os.getpid()), iter(range(5)), 5))
    assert [found[k][0] for k in range(5)] == [0, 1, 4, 9, 16]
    assert ({process for _, process in found.values()} == {os.getpid()}) == (worth > 0)


@pytest.mark.parametrize("worth", [0.0, float("inf")], ids=["processes", "here"])
def test_errors_of_the_toolkit_are_those_of_the_function(worth, monkeypatch):
    monkeypatch.setattr(parts, "WORTH", worth)

    def refusing(a):
        if a == 2:
            raise SolveError("too far", time=1.5)
        return a

    with pytest.raises(SolveError, match=r"^too far$") as caught:
        list(each(refusing, range(4), 4))
    assert caught.value.time == 1.5


def test_other_errors_are_told_in_their_words(monkeypatch):
    monkeypatch.setattr(parts, "WORTH", 0.0)
    with pytest.raises(GantryTauError, match=r"^ZeroDivisionError: .*by zero$"):
        list(each(lambda a: 1 // a, [1, 0], 2))


def test_nothing_has_no_values():
    assert list(each(abs, [], 0)) == []
