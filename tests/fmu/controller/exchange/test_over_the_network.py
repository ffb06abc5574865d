"""Clients at the other end of a socket: what they say is what counts, and what they break stays theirs."""

import socket
import threading
import time
from typing import Any

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_fmu.controller import Channel, Controller, Declaration, Sample
from gantrytau_fmu.controller.exchange import FunctionClient, RemoteClient, Server, run_client
from gantrytau_fmu.controller.exchange.messages import (
    Introduction,
    Message,
    MessageKind,
    as_text,
    decoded,
    encoded,
    framed,
)
from tests.fmu.controller.conftest import DELTA, corrected, slide

N = 50
STOP = 0.004 * N


def until(holds):
    """Wait for something that comes; a busy machine has a minute for it."""
    end = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < end, "it did not come"
        time.sleep(0.01)


def answers(name="stream", function=lambda t, values: {"delta": 0.01 * t}):
    return FunctionClient(name, [DELTA], function)


class Run:
    """A controller with a place for `stream`, its server, and clients in threads."""

    def __init__(self, **settings):
        self.place = RemoteClient("stream", Declaration([DELTA]))
        self.controller = Controller(slide(), corrected, clients=[self.place], **settings)
        self.server = self.controller.serve()
        self.ends, self.threads = [], []

    def start(self, client=None, **options):
        def attend():
            try:
                self.ends.append(run_client(client or answers(), ("127.0.0.1", self.server.port), **options))
            except ModelError as error:
                self.ends.append(str(error))

        self.threads.append(threading.Thread(target=attend))
        self.threads[-1].start()
        return self

    def run(self, stop=STOP, wait=True):
        if wait:
            self.server.wait(timeout=60.0)
        found = self.controller.run(stop)
        self.server.close()
        for thread in self.threads:
            thread.join(timeout=60.0)
        return found


@pytest.mark.parametrize("transport", ["udp", "tcp"])
def test_a_client_over_the_network_is_as_one_in_the_process(transport):
    inside = Controller(slide(), corrected, clients=[answers()]).run(STOP)
    rig = Run().start(transport=transport)
    outside = rig.run()
    assert np.array_equal(outside["stream.delta"], inside["stream.delta"])
    assert np.array_equal(outside["q"], inside["q"])
    assert outside.timing.clients["stream"].taken == N
    (attended,) = rig.ends
    assert (attended.samples, attended.answers, attended.ended) == (N + 1, N + 1, "the run has ended")


def test_two_runs_over_the_network_have_equal_logs(tmp_path):
    logs = []
    for k in range(2):
        rig = Run().start(transport="udp")
        rig.server.wait()
        rig.controller.run(STOP, log=tmp_path / f"{k}.jsonl")
        rig.server.close()
        rig.threads[0].join()
        logs.append((tmp_path / f"{k}.jsonl").read_bytes())
    assert logs[0] == logs[1]


def test_one_who_never_comes_holds_nobody():
    found = Run().run(wait=False)
    assert not found["stream.delta"].any()
    assert found.timing.clients["stream"].held == N


def test_one_who_dies_leaves_its_last_values():
    def mortal(t, values):
        if t > 0.1:
            raise OSError("gone")
        return {"delta": 0.01 * t}

    rig = Run()
    rig.start(answers(function=mortal), transport="tcp")
    hook = threading.excepthook
    threading.excepthook = lambda _: None
    try:
        found = rig.run()
    finally:
        threading.excepthook = hook
    assert found.timing.samples == N + 1
    assert 0 < found["stream.delta"][-1] < 0.0011
    assert found.timing.clients["stream"].held > 10


def raw(server, said, transport="udp"):
    own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM if transport == "udp" else socket.SOCK_STREAM)
    own.settimeout(60.0)
    own.connect(("127.0.0.1", server.port))
    own.send(encoded(Message(MessageKind.DECLARE, text=as_text(said))))
    return own, decoded(own.recv(65536))


STREAM = Introduction("stream", sends=Declaration([DELTA]))


def connected(rig):
    """A socket in the place of `stream`, which is given samples from now on: the reply comes shortly before that."""
    own, reply = raw(rig.server, STREAM)
    assert reply.kind == MessageKind.DECLARE
    rig.server.wait()
    return own


def test_wrong_duplicate_and_old_messages_only_count():
    rig = Run()
    own = connected(rig)
    rig.place.submit(Sample(6, 0, np.zeros(3)), Declaration())
    own.recv(65536)
    good = encoded(Message(MessageKind.OBTAIN, 5, 0, np.array([0.5])))
    wrong = [
        b"",
        b"no message at all",
        good[:-1],
        good + b"\x00",
        encoded(Message(MessageKind.OBTAIN, 6, 0, np.array([0.1, 0.2]))),  # two numbers for one
        encoded(Message(MessageKind.OBTAIN, 6, 0, np.array([7.0]))),  # beyond its limits
        good.replace(good[-8:], np.array([np.nan]).tobytes()),
        encoded(Message(MessageKind.OBTAIN, 7, 0, np.array([0.1]))),  # to a sample to come
        encoded(Message(MessageKind.SUBMIT, 6, 0, np.array([0.1]))),
    ]
    own.send(good)
    for each in wrong:
        own.send(each)
    own.send(good)  # once more
    own.send(encoded(Message(MessageKind.OBTAIN, 4, 0, np.array([0.4]))))  # older
    until(lambda: rig.place.dropped == len(wrong) + 2)
    newest = rig.place.answer(10)
    assert newest is not None
    assert newest.values.tolist() == [0.5]
    assert rig.place.answer(5) is None
    rig.server.close()


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (Introduction("stranger", sends=Declaration([DELTA])), "there is no place for 'stranger', which"),
        (Introduction("stream"), r"'stream' declared nothing, expected delta [m]"),
        (Introduction("stream", sends=Declaration([Channel("delta", "N")])), r"declared delta [N], expected"),
        (Introduction("stream", "wrong token", Declaration([DELTA])), "the token is not that of this"),
    ],
)
def test_strangers_are_refused_in_words(said, words):
    rig = Run()
    _, reply = raw(rig.server, said)
    assert reply.kind == MessageKind.BYE
    assert words in reply.text
    rig.start(FunctionClient(said.name, list(said.sends), lambda t, v: {}), token=said.token)
    rig.threads[0].join()
    assert words in rig.ends[0]
    rig.server.close()


def test_parameters_and_states_are_set_with_the_token_only():
    rig = Run()
    own, reply = raw(rig.server, Introduction("panel"))
    own.send(encoded(Message(MessageKind.PARAMETER, values=np.array([0.0, 1.0]))))
    assert "with the token of this controller only" in decoded(own.recv(65536)).text
    own, reply = raw(rig.server, Introduction("panel", rig.server.token))
    names = [line.split("\t")[1] for line in reply.text.splitlines() if line.startswith("parameter")]
    assert names == ["f_activate", "state"]
    for values in (
        [0.0, 7.0],
        [0.5, 1.0],
        [9.0, 1.0],
        [-1.0, 1.0],
        [0.0],
        [],
        [1.0, 1.5],
    ):  # none of them a parameter
        own.send(encoded(Message(MessageKind.PARAMETER, values=np.array(values))))
    own.send(encoded(Message(MessageKind.PARAMETER, values=np.array([0.0, 1.0]))))
    own.send(encoded(Message(MessageKind.PARAMETER, values=np.array([1.0, 1.0]))))
    own.send(encoded(Message(MessageKind.PARAMETER, values=np.array([9.0, 1.0]))))  # the last to be read
    until(lambda: rig.server.dropped == 8)
    found = rig.run(wait=False)
    assert found["f_activate"][-1] == 1.0
    assert found.mode("state")[-1] == "submit"


def test_whoever_looks_is_given_samples():
    rig = Run()
    own, _ = raw(rig.server, Introduction("looker"))
    found = rig.run(wait=False)
    samples = []
    while (message := decoded(own.recv(65536))).kind == MessageKind.SUBMIT:
        samples.append(message)
    assert [m.sequence for m in samples] == list(range(N + 1))
    place = rig.controller.published.slices["q"]
    assert np.array_equal([m.values[place][0] for m in samples], found["q"])
    assert message.kind == MessageKind.BYE


def test_a_stream_out_of_step_is_closed():
    rig = Run()
    own = socket.create_connection(("127.0.0.1", rig.server.port), timeout=60.0)
    own.sendall(b"\xff" * 64)
    assert own.recv(100) == b""
    own = socket.create_connection(("127.0.0.1", rig.server.port), timeout=60.0)
    own.sendall(framed(encoded(Message(MessageKind.OBTAIN, 1, 0, np.array([1.0])))))  # before a declaration
    own.sendall(framed(encoded(Message(MessageKind.DECLARE, text=as_text(STREAM)))))
    assert own.recv(100)[4:6] == b"GT"
    assert rig.server.dropped == 2
    rig.server.close()


def test_a_slow_reader_holds_nobody():
    rig = Run()
    own = socket.create_connection(("127.0.0.1", rig.server.port), timeout=60.0)
    own.sendall(framed(encoded(Message(MessageKind.DECLARE, text=as_text(Introduction("sleeper"))))))
    found = rig.run(stop=4.0, wait=False)
    assert found.timing.samples == 1001
    own.close()


def test_ports_in_use_and_hosts_elsewhere_are_told():
    rig = Run()
    with pytest.raises(ModelError, match=r"serve: 127\.0\.0\.1:\d+ cannot be opened .* take another one, or"):
        Server(rig.controller, port=rig.server.port)
    with pytest.raises(ModelError, match=r"found a token of 4 characters for host 0\.0\.0\.0, expected 16"):
        Server(rig.controller, host="0.0.0.0", token="1234")
    with pytest.raises(ModelError, match="found port=70000"):
        Server(rig.controller, port=70_000)
    with pytest.raises(ModelError, match="there is no place for 'nobody', expected one of stream"):
        rig.server.wait(["nobody"])
    with pytest.raises(ModelError, match=r"stream did not come within 0\.05 s"):
        rig.server.wait(timeout=0.05)
    rig.server.close()


def test_nobody_there_is_told():
    free = socket.socket()
    free.bind(("127.0.0.1", 0))
    port = free.getsockname()[1]
    free.close()
    with pytest.raises(ModelError, match=rf"127\.0\.0\.1:{port}: found nobody there .* start it first"):
        run_client(answers(), ("127.0.0.1", port), transport="tcp", patience=0.3)
    with pytest.raises(ModelError, match=r"found nobody who answers .* within 0\.3 s"):
        run_client(answers(), ("127.0.0.1", port), patience=0.3)
    for address in (5000, ("127.0.0.1", "5000"), "127.0.0.1:5000"):
        anything: Any = address
        with pytest.raises(ModelError, match=r"run_client: found address=.*, expected \(host, port\)"):
            run_client(answers(), anything, patience=0.3)
    wrong: Any = "pigeon"
    with pytest.raises(ModelError, match="found transport='pigeon'"):
        run_client(answers(), ("127.0.0.1", port), transport=wrong)
