"""Components in processes of their own: the same numbers, and crashes and hangs that are errors."""

import numpy as np
import pytest

from gantrytau import InitializationError, SolveError
from gantrytau_fmu import Master, cosimulate
from gantrytau_fmu.systems.isolation import Isolated
from tests.fmu.systems.small_fmus import variable

LINES = [variable("u", "input", 0.0), variable("y", "output", 1.0)]


def test_a_component_in_its_own_process_gives_the_same(build):
    file = build("decay", LINES, advance="v[1] *= exp(-h); v[1] += h * v[0];")
    files, wires = {"a": file, "b": file}, [("a.y", "b.u")]
    found = [
        cosimulate(
            files,
            wires,
            stop=1.0,
            step=0.1,
            inputs={"a.u": 0.0},
            master=Master(order="iterate", isolate=isolated),
        )
        for isolated in ([], ["b"])
    ]
    assert np.array_equal(found[0]["b.y"], found[1]["b.y"])


def test_a_crash_names_the_component_and_keeps_what_there_is(build):
    file = build("crashes", LINES, advance="if (t > 0.25) *(volatile int *)0 = 1; v[1] = t + h;")
    with pytest.raises(SolveError, match=r"a: the process of .*crashes\.fmu crashed .* in the") as caught:
        cosimulate({"a": file}, stop=1.0, step=0.1, master=Master(isolate=["a"]))
    assert caught.value.time == pytest.approx(0.3)
    assert caught.value.result["a.y"][1:] == pytest.approx([0.1, 0.2, 0.3])


def test_a_hang_is_ended(build, monkeypatch):
    file = build("hangs", LINES, advance="if (t > 0.25) for (volatile int k = 0;; k++) {}")
    started = Isolated.started

    def impatiently(part):  # a process starts slowly on a busy machine, and only then may be short of time
        started(part)
        part.timeout = 0.5

    monkeypatch.setattr(Isolated, "started", impatiently)
    with pytest.raises(SolveError, match=r"a: the process of .* did not answer within 0\.5 s and was"):
        cosimulate({"a": file}, stop=1.0, step=0.1, master=Master(isolate=["a"]))


def test_a_failure_in_the_process_has_its_words(build):
    file = build("fails", LINES, advance="return 3;")
    with pytest.raises(SolveError, match=r"a: step: status 'error' at t = 0 s; its log says: the spring"):
        cosimulate({"a": file}, stop=1.0, step=0.1, master=Master(isolate=["a"]))


def test_a_crash_before_the_start_is_no_failed_step(build):
    file = build("early", LINES, derive="*(volatile int *)0 = 1;")
    with pytest.raises(InitializationError, match=r"a: the process of .*early\.fmu crashed"):
        cosimulate({"a": file}, stop=1.0, step=0.1, master=Master(isolate=["a"]))


def test_a_fatal_status_names_the_file_and_proposes_isolation(build):
    quiet = build("dies", LINES, advance="if (t > 0.25) return 4; v[1] = t + h;")
    with pytest.raises(SolveError, match=r"a: step: status 'fatal' at t = 0\.3 s.*; dies\.fmu cannot go on"):
        cosimulate({"a": quiet}, stop=1.0, step=0.1)
