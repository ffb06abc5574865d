"""What a function names in the modules of its user counts: constants, helpers of helpers, modules, classes of models."""

import importlib
import sys

import pytest

from gantrytau.ensembles.digests import digest

JOB = """
import functools
import math
import other
from gantrytau import Model, Real, der
GAIN = 1.0
SEEN = {}
def inner(a):
    return a * GAIN
@functools.cache
def helper(a):
    return inner(a) + other.offset()
class Wheel(Model):
    x = Real(start=1.0)
    def equations(self):
        yield der(self.x) == -self.x
class Car(Model):
    wheel = Wheel()
def f(a):
    SEEN[a] = object()
    return helper(a) + math.sin(a) + len(repr(Car()))
"""
OTHER = "SHIFT = 2.0\ndef offset():\n    return SHIFT\n"


def loaded(folder, job=JOB, other=OTHER):
    """The function f of a module of this text, beside another, under the same names each time."""
    (folder / "other.py").write_text(other)
    (folder / "job.py").write_text(job)
    for name in ("job", "other"):
        sys.modules.pop(name, None)
    importlib.invalidate_caches()
    return importlib.import_module("job").f


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    return tmp_path


CHANGES = {
    "a constant": ("GAIN = 1.0", "GAIN = 3.0"),
    "a helper of a helper": ("return a * GAIN", "return a + GAIN"),
    "a component of a model": ("== -self.x", "== -2 * self.x"),
}


@pytest.mark.parametrize("name", CHANGES)
def test_what_a_function_names_counts(folder, name):
    before, after = CHANGES[name]
    changed = JOB.replace(before, after)
    assert changed != JOB
    assert digest(loaded(folder)) != digest(loaded(folder, job=changed))


def test_what_a_module_of_the_user_says_counts(folder):
    assert digest(loaded(folder)) != digest(loaded(folder, other=OTHER.replace("2.0", "4.0")))


def test_what_a_function_fills_as_it_runs_does_not_count(folder):
    f = loaded(folder)
    before = digest(f)
    f(1.0)
    assert digest(f) == before == digest(loaded(folder))
