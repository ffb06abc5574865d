"""Messages byte for byte, and bytes that are none."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as some

from gantrytau import ModelError
from gantrytau_fmu.controller import Channel, Declaration
from gantrytau_fmu.controller.exchange.messages import (
    LARGEST,
    TEXTS,
    Frames,
    Introduction,
    Message,
    MessageKind,
    WrongMessage,
    as_text,
    decoded,
    encoded,
    framed,
    from_text,
)


def test_bytes_are_those_of_the_page():
    message = Message(MessageKind.OBTAIN, sequence=7, time=28_000_000, values=np.array([1.0, -0.5]))
    assert encoded(message).hex(" ") == (
        "47 54 02 02 07 00 00 00 00 3f ab 01 00 00 00 00 00 00 00 00 00 00 f0 3f 00 00 00 00 00 00 e0 bf"
    )


NUMBERS = some.lists(some.floats(allow_nan=False, allow_infinity=False), max_size=255)


@given(
    some.sampled_from([k for k in MessageKind if k not in TEXTS]),
    some.integers(0, 2**32 - 1),
    some.integers(-(2**63), 2**63 - 1),
    NUMBERS,
)
def test_what_is_written_is_read(kind, sequence, time, values):
    found = decoded(encoded(Message(kind, sequence, time, np.array(values, dtype=float))))
    assert (found.kind, found.sequence, found.time) == (kind, sequence, time)
    assert found.values.tolist() == values


@given(some.binary(max_size=600))
def test_any_bytes_are_a_message_or_refused(data):
    try:
        found = decoded(data)
    except WrongMessage:
        return
    assert encoded(found) == data


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda b: b[:10], "10 bytes, fewer than a header"),
        (lambda b: b"XX" + b[2:], "magic"),
        (lambda b: b[:2] + b"\x09" + b[3:], "unknown kind 9"),
        (lambda b: b[:-1], "15 bytes for 2 numbers"),
        (lambda b: b + b"\x00", "17 bytes for 2 numbers"),
        (lambda b: b[:-8] + struct.pack("<d", np.nan), "not finite"),
        (lambda b: b[:-8] + struct.pack("<d", -np.inf), "not finite"),
    ],
)
def test_what_is_no_message_is_refused_by_name(change, words):
    whole = encoded(Message(MessageKind.OBTAIN, 1, 0, np.array([1.0, 2.0])))
    with pytest.raises(WrongMessage, match=words):
        decoded(change(whole))


def test_too_many_numbers_are_refused_before_they_are_sent():
    with pytest.raises(ModelError, match=r"found 256 numbers, expected 255 at most"):
        encoded(Message(MessageKind.SUBMIT, values=np.zeros(256)))
    with pytest.raises(ModelError, match=r"bytes of names and units, expected 16384 at most"):
        encoded(Message(MessageKind.DECLARE, text="x" * 16_385))


@given(some.lists(some.integers(1, 9), max_size=40))
def test_frames_come_in_pieces_of_any_size(sizes):
    messages = [encoded(Message(MessageKind.SENSOR, k, 0, np.arange(k, dtype=float))) for k in range(5)]
    stream, frames, found = b"".join(map(framed, messages)), Frames(), []
    for size in [*sizes, len(stream)]:
        found += frames.add(stream[:size])
        stream = stream[size:]
    assert found == messages


@pytest.mark.parametrize("length", [0, 15, LARGEST + 1, 2**32 - 1])
def test_a_length_that_no_message_has_loses_the_stream(length):
    with pytest.raises(WrongMessage, match="a frame of"):
        Frames().add(struct.pack("<I", length))


def test_declarations_are_text_with_units_and_limits():
    sends = Declaration([Channel("delta", "m", 3, -0.1, 0.1), Channel("f_n", "N")])
    said = Introduction("stream", "secret", sends, Declaration([Channel("gain", "1", minimum=0.0)]))
    assert as_text(said) == (
        "name\tstream\ntoken\tsecret\nsends\tdelta\tm\t3\t-0.1\t0.1\nsends\tf_n\tN\t1\t-\t-\nparameter\tgain\t1\t1\t0.0\t-\n"
    )
    assert from_text(as_text(said)) == said


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "without a name"),
        ("name\t \n", "without a name"),
        ("name\ta\nname\tb\n", "the line"),
        ("name\ta\nsends\tx\tm\n", "the line"),
        ("name\ta\nsends\tx\tfurlong\t1\t-\t-\n", "the channel 'x'"),
        ("name\ta\nsends\tx\tm\tthree\t-\t-\n", "the channel 'x'"),
        ("name\ta\nsends\tx\tm\t9999\t-\t-\n", "expected 4096 at most"),
        ("name\ta\nsends\tx\tm\t1\t-\t-\nsends\tx\tm\t1\t-\t-\n", "twice"),
    ],
)
def test_texts_that_declare_nothing_are_refused(text, words):
    with pytest.raises(WrongMessage, match=words):
        from_text(text)
