"""Who comes, stays, is silent, and has a place at the port of a controller: nobody is locked out, none speaks twice."""

import importlib
import socket
import threading
from types import SimpleNamespace

import numpy as np
import pytest

from gantrytau import ModelError
from gantrytau_fmu import PythonComponent
from gantrytau_fmu.controller import Channel, Controller, Declaration, RemoteClient, Sample
from gantrytau_fmu.controller.exchange import remote_client as remote
from gantrytau_fmu.controller.exchange import server as serving
from gantrytau_fmu.controller.exchange.messages import (
    Introduction,
    Message,
    MessageKind,
    as_text,
    decoded,
    encoded,
    framed,
)
from tests.fmu.controller.conftest import DELTA, Q_REF, slide
from tests.fmu.controller.exchange.test_over_the_network import STREAM, N, Run, connected, raw, until


@pytest.fixture
def impatient(monkeypatch):
    """Called, it makes absent whoever is silent, who else is after 3 s."""
    monkeypatch.setattr(serving, "ABSENT", 600.0)
    return lambda: monkeypatch.setattr(serving, "ABSENT", 0.0)


def test_clients_stay_while_the_controller_is_idle(monkeypatch):
    monkeypatch.setattr(
        importlib.import_module("gantrytau_fmu.controller.exchange.run_client"), "ALIVE", 0.05
    )
    rig = Run(clock="wall")
    rig.start(patience=1.0)
    rig.controller.idle(at=0.1)
    rig.controller.obtain(at=1.3)
    found = rig.run(stop=1.5)
    assert rig.ends[0].ended == "the run has ended"
    assert found.timing.clients["stream"].taken > 0  # a wall clock promises nothing


class Deaf:
    """Takes all that is sent, and says nothing."""

    def send(self, message):
        return True


def test_who_is_silent_is_waited_for_once(monkeypatch):
    """A second for each of two samples, not one for each of all; one who came long before the run has as much time."""
    now, place = [0.0], RemoteClient("stream", Declaration([DELTA]))
    monkeypatch.setattr(remote, "time", SimpleNamespace(monotonic=lambda: now[0]))
    place.met(Deaf())
    waited = []
    for k in range(4):
        now[0] += 100.0
        place.submit(Sample(k, 0, np.zeros(1)), Declaration())
        begin = now[0]
        while not place.settled(k):
            now[0] += 0.25
        waited.append(now[0] - begin)
    assert waited == [1.25, 1.25, 0.0, 0.0]
    place.heard(Message(MessageKind.OBTAIN, 3, 0, np.array([0.1])))
    place.submit(Sample(4, 0, np.zeros(1)), Declaration())
    assert not place.settled(4)  # it speaks again


@pytest.mark.parametrize(
    ("refused", "words"),
    [
        ([5.0], "found delta = 5 m, expected a number in [-1, 1]"),
        ([np.nan], "numbers that are not finite"),
        ([0.1, 0.2], "found values of shape (2,), expected (1,)"),
        ([], "found values of shape (0,), expected (1,)"),
    ],
)
def test_a_refused_answer_is_one_too_and_the_clock_goes_on(refused, words, monkeypatch):
    monkeypatch.setattr(
        remote, "SILENCE", 600.0
    )  # longer than the clock is patient: nobody may be waited for
    rig = Run()
    own = connected(rig)

    def answer():
        while (got := decoded(own.recv(65536))).kind == MessageKind.SUBMIT:
            values = np.array([0.01 * got.sequence] if got.sequence < 20 else refused)
            own.send(encoded(Message(MessageKind.OBTAIN, got.sequence, got.time, values)))

    thread = threading.Thread(target=answer)
    thread.start()
    found = rig.run()
    thread.join(timeout=60.0)
    counts = found.timing.clients["stream"]
    assert (counts.taken, counts.held) == (20, N - 20)
    assert counts.dropped >= N - 20
    assert np.all(found["stream.delta"][21:] == 0.19)
    assert f"refused last: {words}" in str(found.timing)


def test_an_answer_that_is_lost_costs_its_own_sample_and_no_other():
    """Equal runs have equal logs: the clock waits for the answer behind the one that was lost."""
    rig = Run()
    own = connected(rig)

    def answer():
        while (got := decoded(own.recv(65536))).kind == MessageKind.SUBMIT:
            if got.sequence != 9:
                own.send(
                    encoded(
                        Message(MessageKind.OBTAIN, got.sequence, got.time, np.array([0.01 * got.sequence]))
                    )
                )

    thread = threading.Thread(target=answer)
    thread.start()
    found = rig.run()
    thread.join(timeout=60.0)
    counts = found.timing.clients["stream"]
    assert (counts.taken, counts.held) == (N - 1, 1)


def test_those_who_died_lock_nobody_out(impatient):
    rig = Run()
    dead = [raw(rig.server, Introduction(f"looker {k}"))[0] for k in range(16)]
    assert raw(rig.server, STREAM)[1].kind == MessageKind.DECLARE  # a place is no matter of those who look
    assert "16 are there already" in raw(rig.server, Introduction("one more"))[1].text
    impatient()
    assert raw(rig.server, Introduction("one more"))[1].kind == MessageKind.DECLARE
    assert b"others have come, and this one was silent" in dead[0].recv(65536)
    rig.server.close()


def test_connections_that_never_declare_make_room(impatient):
    rig = Run()
    address = ("127.0.0.1", rig.server.port)
    mute = [socket.create_connection(address, timeout=60.0) for _ in range(16)]
    impatient()
    own = socket.create_connection(address, timeout=60.0)
    own.sendall(framed(encoded(Message(MessageKind.DECLARE, text=as_text(STREAM)))))
    assert own.recv(100)[6] == MessageKind.DECLARE
    for each in (*mute, own):
        each.close()
    rig.server.close()


def test_who_comes_back_from_silence_does_not_speak_for_the_one_who_took_its_place(impatient):
    rig = Run()
    first, _ = raw(rig.server, STREAM)
    assert "'stream' is there already" in raw(rig.server, STREAM)[1].text
    impatient()
    second, reply = raw(rig.server, STREAM)
    assert reply.kind == MessageKind.DECLARE
    assert b"another 'stream' has come" in first.recv(65536)
    rig.place.submit(Sample(6, 0, np.zeros(3)), Declaration())
    first.send(encoded(Message(MessageKind.OBTAIN, 6, 0, np.array([0.7]))))
    second.send(encoded(Message(MessageKind.OBTAIN, 5, 0, np.array([0.2]))))
    until(lambda: rig.place.answer(10) is not None and rig.server.dropped == 1)
    newest = rig.place.answer(10)
    assert newest is not None
    assert newest.values.tolist() == [0.2]
    rig.server.close()


def test_one_who_declares_under_another_name_leaves_its_first_place():
    places = [RemoteClient(name, Declaration([DELTA])) for name in ("left", "right")]
    controller = Controller(slide(), lambda t, values: {}, clients=places)
    with controller.serve() as server:
        own, _ = raw(server, Introduction("left", sends=Declaration([DELTA])))
        again = Introduction("right", sends=Declaration([DELTA]))
        own.send(encoded(Message(MessageKind.DECLARE, text=as_text(again))))
        until(lambda: places[1].connected)
        assert not places[0].connected


def test_a_declaration_once_more_forgets_no_answer():
    rig = Run()
    own = connected(rig)
    rig.place.submit(Sample(6, 0, np.zeros(3)), Declaration())
    own.send(encoded(Message(MessageKind.OBTAIN, 5, 0, np.array([0.5]))))
    until(lambda: rig.place.answer(10) is not None)
    own.recv(65536)
    own.send(encoded(Message(MessageKind.DECLARE, text=as_text(STREAM))))
    own.recv(65536)
    assert rig.place.answer(10) is not None
    own.send(encoded(Message(MessageKind.OBTAIN, 5, 0, np.array([0.9]))))  # the same sample, once more
    until(lambda: rig.place.dropped == 1)
    rig.server.close()


def test_counts_of_messages_begin_anew_after_all_that_they_have():
    place, turn = RemoteClient("stream", Declaration([DELTA])), 2**32
    for given, count, taken in (
        (turn - 1, turn - 1, turn - 1),
        (turn, turn - 1, None),  # twice
        (turn, 1, None),  # a sample to come
        (turn, 0, turn),
        (turn + 7, 5, turn + 5),
        (turn + 7, 4, None),  # older
        (turn + 7, 8, None),  # to come
    ):
        place.submit(Sample(given, 0, np.zeros(1)), Declaration())
        dropped = place.dropped
        place.heard(Message(MessageKind.OBTAIN, count, 0, np.array([0.1])))
        newest = place.answer(given + 1)
        assert newest is not None
        assert place.dropped - dropped == (taken is None)
        assert taken is None or newest.k == taken


def test_a_place_that_is_made_while_it_serves_is_one():
    controller = Controller(slide(), lambda t, values: {})
    with controller.serve() as server:
        controller.attach(RemoteClient("stream", Declaration([DELTA])))
        assert raw(server, STREAM)[1].kind == MessageKind.DECLARE


def test_a_port_that_is_refused_stays_closed():
    before = threading.active_count()
    controller = Controller(slide(), lambda t, values: {})
    with controller.serve(), pytest.raises(ModelError, match="found a client named 'server', expected none"):
        controller.serve()
    controller.run(0.04)
    with pytest.raises(ModelError, match="found a controller that has run, expected it before; serve first"):
        controller.serve()
    assert threading.active_count() == before


@pytest.mark.parametrize("token", ["", " ", "two\tparts", "line\n", "schlüssel", "\udc80", 5, b"bytes"])
def test_tokens_that_do_not_travel_are_refused(token):
    with pytest.raises(ModelError, match="serve: found a token with spaces, signs that are not ASCII, or"):
        Controller(slide(), lambda t, values: {}).serve(token=token)


@pytest.mark.parametrize("name", ["two\tparts", "line\n", "\x1b[31m", "a\u2028b", "\udc80", ""])
def test_names_that_are_no_line_are_refused_before_they_are_sent(name):
    if name:
        with pytest.raises(ModelError, match=r"declaration: found the name .*, expected a text that can be"):
            as_text(Introduction(name))
    else:
        assert as_text(Introduction(name)) == "name\t\ntoken\t\n"


def test_refusals_of_long_names_arrive():
    with Controller(slide(), lambda t, values: {}).serve() as server:
        reply = raw(server, Introduction("x" * 16_000, sends=Declaration([DELTA])))[1]
        assert reply.kind == MessageKind.BYE
        assert reply.text.startswith("there is no place for 'xxx")


def test_more_names_than_a_message_holds_are_told_at_once():
    many = [
        Channel(f"robot.arms[{k}].joint.of_the_plate.frame_b.force_as_measured.of_{k}", "N")
        for k in range(250)
    ]
    plant = PythonComponent(
        lambda t, values: {c.name: 0.0 for c in many}, inputs=[Q_REF], outputs=many, sampled=False
    )
    with pytest.raises(ModelError, match=r"found \d+ bytes of names and units, expected 16384 at most"):
        Controller(plant, lambda t, values: {}).serve()
