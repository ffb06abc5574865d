"""The virtual clock waits and names who keeps it waiting; the wall clock goes on, counts, and promises nothing."""

import json
import os
import signal
import threading
import time
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError, SolveError
from gantrytau_fmu.controller import Controller
from tests.fmu.controller.conftest import InProcess, corrected, slide

STOP = 0.2


class Slow(InProcess):
    """Has done with a sample when it was asked `times` times."""

    def __init__(self, times, **options):
        super().__init__(**options)
        self.times, self.asked = times, 0

    def answer(self, k):
        return super().answer(k) if self.asked >= self.times else None

    def settled(self, k):
        self.asked += 1
        return self.asked % self.times == 0


def test_the_virtual_clock_waits_for_slow_clients(plant):
    found = Controller(plant, corrected, clients=[Slow(5, answers=lambda k: [0.01 * k])]).run(STOP)
    assert np.array_equal(found["stream.delta"], 0.01 * np.maximum(np.arange(51) - 1, 0))
    assert found.timing.missed == 0


def test_a_client_that_never_answers_is_named_after_a_while(plant, tmp_path):
    client = Slow(10**9, name="haptic")
    controller = Controller(plant, lambda t, v: {}, clients=[client, InProcess()], patience=0.05)
    with pytest.raises(SolveError, match=r"controller: haptic did not answer sample 0 within 0.05") as error:
        controller.run(STOP, log=tmp_path / "log.jsonl")
    assert error.value.result.time.size == 1
    assert "haptic did not" in json.loads((tmp_path / "log.jsonl").read_text().splitlines()[-1])["ended"]
    assert client.closed == 1


def test_the_wall_clock_takes_as_long_as_the_samples_and_counts_a_stall(plant):
    def law(t, v):
        if controller.k == 20:
            time.sleep(0.010)
        return {}

    controller = Controller(plant, law, clock="wall")
    begin = time.perf_counter()
    found = controller.run(STOP)
    assert time.perf_counter() - begin >= STOP
    timing = found.timing
    assert timing.lateness.size == timing.samples == 51
    assert timing.lateness[21] >= 0.006  # 10 ms less the period
    assert timing.missed >= 1
    assert timing.percentile(100) == timing.lateness.max()
    assert "missed" in str(timing)
    assert timing.as_record()["lateness"]["p50"] == np.median(timing.lateness)


def test_a_client_that_stalls_changes_nothing_but_lateness():
    class Stalls(InProcess):
        def submit(self, sample, declaration):
            if sample.k == 20:
                time.sleep(0.010)
            super().submit(sample, declaration)

    answers = lambda k: [0.01 * k]  # noqa: E731
    wall = Controller(slide(), corrected, clients=[Stalls(answers=answers)], clock="wall").run(STOP)
    virtual = Controller(slide(), corrected, clients=[InProcess(answers=answers)]).run(STOP)
    assert np.array_equal(wall["q"], virtual["q"])
    assert wall.timing.lateness[21] >= 0.006


@pytest.mark.parametrize("clock", ["virtual", "wall"])
def test_an_interrupt_ends_the_run_with_everything_logged(clock, plant, tmp_path):
    def law(t, v):
        if controller.k == 20:
            os.kill(os.getpid(), signal.SIGINT)
        return {}

    client = InProcess()
    controller = Controller(plant, law, clients=[client], clock=clock)
    found = controller.run(STOP, log=tmp_path / "log.jsonl")
    assert found.ended == "interrupted"
    assert found.time.size == 21
    lines = [json.loads(line) for line in (tmp_path / "log.jsonl").read_text().splitlines()]
    assert [line["k"] for line in lines if line["type"] == "sample"] == list(range(21))
    assert lines[-1]["ended"] == "interrupted"
    assert client.closed == 1
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_an_interrupt_pressed_twice_leaves_what_does_not_come_back(plant):
    def law(t, v):
        if controller.k == 20:
            os.kill(os.getpid(), signal.SIGINT)
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(60)
        return {}

    controller = Controller(plant, law)
    found = controller.run(STOP)
    assert found.ended == "interrupted"
    assert found.time.size == 20


def made(*parts: Any, **options: Any) -> Controller:
    return Controller(*parts, **options)


REFUSED = [  # what is asked for, the argument and words of the refusal
    (lambda c: c.run(0.0), "stop", "above 0"),
    (lambda c: (c.run(STOP), c.run(STOP)), None, "found a second run, expected one"),
    (lambda c: (c.run(STOP), c.attach(InProcess("b"))), None, "found a client that comes while it runs"),
    (lambda c: c.attach(InProcess()), None, "clients: found 'stream' twice"),
    (lambda c: c.attach(3), None, "clients: found 3, expected name, sends, submit, answer, settled and"),
    (lambda c: c.attach(InProcess("q\n")), "name", "that can be printed"),
    (lambda c: c.set("f_activte", 1.0), None, "there is no parameter 'f_activte'; did you mean"),
    (lambda c: c.set("f_activate", 1.5), None, "found f_activate = 1.5 1, expected a number in [0, 1]"),
    (lambda c: c.set("f_activate", float("nan")), None, "found f_activate = nan 1"),
    (lambda c: c.set("f_activate", [0.0, 1.0]), None, "found [0.0, 1.0], expected one number in 1"),
    (lambda c: c.set("f_activate", 1.0, at=-1.0), "at", "at least 0"),
    (lambda c: c.run(STOP, log="/nowhere/log.jsonl"), "log", "cannot write /nowhere/log.jsonl"),
    (lambda c: made(slide(), corrected, period=0), "period", "above 0"),
    (lambda c: made(slide(), corrected, patience=-1), "patience", "above 0"),
    (lambda c: made(lambda t, v: {}, corrected), None, "plant: found <function"),
    (lambda c: made(slide(), corrected, limits={"q_ref": (0, 1)}), "limits", "{input: AxisLimits(...)}"),
    (lambda c: made(slide(), corrected, references=[1]), "references", "{name: value}"),
    (
        lambda c: made(slide(), corrected, parameters={"gain": 1}),
        "parameters",
        "{Channel(name, unit): value}",
    ),
    (lambda c: made(slide(), corrected, kinematics=abs), "kinematics", "ExternalKinematics(function, poses"),
    (lambda c: made(slide(), corrected, clients=InProcess()), "clients", "clients in a list"),
]


@pytest.mark.parametrize(("call", "argument", "words"), REFUSED)
def test_what_cannot_be_asked_for_is_refused_by_name(call, argument, words, plant):
    controller = Controller(plant, corrected, clients=[InProcess()])
    with pytest.raises(ModelError) as error:
        call(controller)
    assert error.value.argument == argument
    assert words in str(error.value)


def test_another_thread_may_switch_and_set_while_samples_run(plant):
    fifth, changed, found = threading.Event(), threading.Event(), []

    def law(t, v):
        if controller.k == 5:
            fifth.set()
            changed.wait(60)
        return {}

    controller = Controller(plant, law)
    thread = threading.Thread(target=lambda: found.append(controller.run(STOP)))
    thread.start()
    assert fifth.wait(60)
    controller.set("f_activate", 1.0)
    controller.idle()
    assert controller.latest["q"] == 0.0
    assert controller.timing.samples == 6
    changed.set()
    thread.join()
    state, activate = found[0]["state"], found[0]["f_activate"]
    assert np.array_equal(activate, np.arange(51) > 5)
    assert np.array_equal(state, np.where(np.arange(51) > 5, 0, 2))


def test_names_that_two_have_are_refused():
    from gantrytau_fmu import Channel

    with pytest.raises(ModelError, match="found 'q' in the parameters and in the plant, expected each name"):
        Controller(slide(), corrected, parameters={Channel("q", "m"): 0.0})
    with pytest.raises(ModelError, match=r"parameters: found gain = 3 1, expected a number in \[0, 2\]"):
        Controller(slide(), corrected, parameters={Channel("gain", "1", 1, 0.0, 2.0): 3.0})
