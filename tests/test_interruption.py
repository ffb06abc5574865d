"""Ctrl-C is acted upon, wherever it arrives."""

import signal
import time

import casadi as ca
import numpy as np
import pytest

from gantrytau.interruption import heeding_interrupts, uninterrupted
from gantrytau.whole_files import replacing

ASKED = "DM_from_array"  # by which CasADi asks for an argument


@pytest.fixture
def interrupted_in_casadi(monkeypatch):
    """A Ctrl-C as CasADi asks Python for an argument, once."""
    left = [signal.SIGINT]
    inside: dict = {"__name__": "casadi.casadi", "left": left, "before": getattr(ca, ASKED), "signal": signal}
    exec(
        "def asked(*a, **k):\n    if left:\n        signal.raise_signal(left.pop())\n    return before(*a, **k)",
        inside,
    )
    monkeypatch.setattr(ca, ASKED, inside["asked"])
    return left


def test_casadi_drops_what_is_raised_as_it_asks_for_an_argument(interrupted_in_casadi):
    ca.vertcat(ca.SX.sym("x"), np.ones(2))  # without an exception: the reason for what follows
    assert not interrupted_in_casadi


def test_an_interruption_is_not_lost_in_casadi(interrupted_in_casadi):
    def work():
        ca.vertcat(ca.SX.sym("x"), np.ones(2))
        assert not interrupted_in_casadi
        time.sleep(10)

    with pytest.raises(KeyboardInterrupt), heeding_interrupts():
        work()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_elsewhere_an_interruption_comes_at_once():
    with pytest.raises(KeyboardInterrupt), heeding_interrupts():
        signal.raise_signal(signal.SIGINT)


def test_files_are_finished_before_an_interruption_is_heeded(tmp_path):
    def write():
        with replacing(tmp_path / "whole.txt") as partial:
            partial.write_text("the beginning")
            signal.raise_signal(signal.SIGINT)
            partial.write_text("the beginning and the end")

    with pytest.raises(KeyboardInterrupt):
        write()
    assert [file.name for file in tmp_path.iterdir()] == ["whole.txt"]
    assert (tmp_path / "whole.txt").read_text() == "the beginning and the end"


def test_errors_go_before_interruptions():
    def fail():
        with uninterrupted():
            signal.raise_signal(signal.SIGINT)
            raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        fail()


def pressed_in_compiled_code():
    try:
        raise KeyboardInterrupt
    except KeyboardInterrupt as cause:
        raise SystemError("returned a result with an exception set") from cause


def broken():
    raise SystemError("of its own")


def test_what_python_makes_of_ctrl_c_inside_of_compiled_code_is_one():
    with pytest.raises(KeyboardInterrupt), heeding_interrupts():
        pressed_in_compiled_code()
    with pytest.raises(SystemError, match="of its own"), heeding_interrupts():
        broken()
