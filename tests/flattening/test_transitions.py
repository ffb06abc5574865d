"""What is no mode, and what is no transition of it."""

import re
from typing import Any

import pytest

from gantrytau import Mode, Model, ModelError, Parameter, Real, der, flatten, fmax, time, transition


class Base(Model):
    """A model with a mode, of which subclasses state transitions."""

    x = Real(unit="1", start=0.0, fixed=True)
    k = Parameter(1.0, unit="1/s")
    mode = Mode("free", "contact", "released")

    def changes(self):
        yield transition(self.mode, "free", "contact", self.x > 1)
        yield transition(self.mode, "contact", "released", self.x > 2)

    def equations(self):
        yield der(self.x) == self.k
        yield from self.changes()


def with_changes(changes):
    return type("Base", (Base,), {"changes": changes})()


def test_transitions_are_one_chain_of_whens():
    flat = flatten(Base())
    assert flat.modes == {"mode": ("free", "contact", "released")}
    assert flat.discretes == ("mode",)
    assert [one.after for one in flat.whens] == [-1, 0]
    assert all(one.initially and not one.failure for one in flat.whens)
    assert flat.whens[0].label == "the model (Base), equation 2, transition of mode from free to contact"


def test_pairs_without_order_come_first_in_the_chain():
    def changes(self):
        yield transition(self.mode, "free", "contact", self.x > 1, priority=2)
        yield transition(self.mode, "free", "released", self.x > 2)
        yield transition(self.mode, "contact", "released", self.x > 2)

    flat = flatten(with_changes(changes))
    assert [bool(one.failure) for one in flat.whens] == [True, False, False, False]


def test_guards_with_a_period_count():
    def changes(self):
        yield transition(self.mode, "free", "contact", self.x > 1, period=0.1)
        yield transition(self.mode, "contact", "released", self.x > 2, period=0.2)

    flat = flatten(with_changes(changes))
    assert [one.name for one in flat.sampled] == ["mode.due[0]", "mode.due[1]"]
    assert set(flat.discretes) == {"mode", "mode.seen[0]", "mode.seen[1]"}


@pytest.mark.parametrize("names", [(), ("one",), ("one", "one"), ("one", "two words"), ("one", 2)])
def test_what_is_no_mode(names):
    with pytest.raises(ModelError, match="expected at least two different words of letters, digits and _"):
        Mode(*names)
    with pytest.raises(ModelError, match=r"Mode: there is no mode 'opne'; did you mean 'open'\?"):
        Mode("shut", "open", start="opne")


NO_TRANSITIONS = {  # statements, each beside what is said of them
    "did you mean 'contact'?": lambda m: [transition(m.mode, "free", "contakt", m.x > 1)],
    "from 'fre', expected one of its modes": lambda m: [transition(m.mode, "fre", "contact", m.x > 1)],
    "from free to itself, expected two modes": lambda m: [transition(m.mode, "free", "free", m.x > 1)],
    "expected a declared Mode of this model": lambda m: [transition(m.x, "free", "contact", m.x > 1)],
    "found True as the condition": lambda m: [transition(m.mode, "free", "contact", True)],
    "a number, expected a comparison": lambda m: [transition(m.mode, "free", "contact", fmax(m.x, time) + 1)],
    "no transition that leads from free, where it starts, to released": lambda m: [
        transition(m.mode, "free", "contact", m.x > 1)
    ],
    "found period=-1, expected a finite number above zero, in s": lambda m: [
        *Base.changes(m), transition(m.mode, "released", "free", m.x > 1, period=-1.0)
    ],
    "mode: found a Mode without transitions, expected some": lambda m: [],
    "mode.is_in: there is no mode 'fixed'; there is free, contact, released.": lambda m: [
        *Base.changes(m), m.mode.is_in("fixed") == 1
    ],
    "mode.choose: found no value for contact, released": lambda m: [m.x == m.mode.choose(free=1.0)],
    "mode.choose: there is no mode 'held'": lambda m: [m.x == m.mode.choose(free=1.0, held=2.0)],
    "mode.is_in: found no name, expected some of free": lambda m: [m.x == m.mode.is_in()],
    "mode: found == on a mode, expected mode.is_in('released')": lambda m: [m.mode == "free"],
}  # fmt: skip


@pytest.mark.parametrize("words", NO_TRANSITIONS)
def test_what_is_no_transition(words):
    with pytest.raises(ModelError, match=re.escape(words)):
        flatten(with_changes(NO_TRANSITIONS[words]))


@pytest.mark.parametrize(
    ("within", "found"),
    [
        ("phases.on", "within='phases.on', expected a mode of another one"),
        ("inner.one", "within='inner.one'"),
        ("phase", "within='phase'"),
        ("phase.onn", "no mode 'onn'"),
        ("mode.free", "that is not within this one; there is phase.on, phase.off."),  # mode is within inner
    ],
)
def test_modes_within_what_is_none(within, found):
    class Charts(Base):
        phase = Mode("on", "off")
        inner = Mode("one", "two", within=within)

        def changes(self):
            yield from super().changes()
            yield transition(self.phase, "on", "off", self.x > 1)
            yield transition(self.inner, "one", "two", self.x > 1)

    if within == "mode.free":
        Charts = type("Charts", (Charts,), {"mode": Mode("free", "contact", "released", within="inner.two")})
    with pytest.raises(ModelError, match=re.escape(found)):
        flatten(Charts())


def test_history_and_within_of_a_mode():
    wrongs: list[dict[str, Any]] = [dict(history=True), dict(within=3)]
    for wrong in wrongs:
        with pytest.raises(ModelError, match="expected a mode of another one"):
            Mode("one", "two", **wrong)
    assert "within='phase.on', history=True" in repr(Mode("one", "two", within="phase.on", history=True))
