"""Messages of the exchange: 16 bytes of header and numbers, little endian. fmu/PROTOCOL.md is the page for users.

    magic u16 | kind u8 | count u8 | sequence u32 | time i64, ns | count values of 8 bytes

One message is one datagram, or one frame behind its length as u32 on a stream. Declarations and farewells have text in
place of numbers. Not wire compatible with LabComm, whose idea it follows: what is exchanged is declared first.
"""

import struct
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.channels import Channel, Declaration, Values

MAGIC = 0x5447  # "GT" in memory
HEADER = struct.Struct("<HBBIq")
LENGTH = struct.Struct("<I")
NUMBERS = 255  # in one message
TEXT = 16_384  # bytes of a declaration
LARGEST = HEADER.size + TEXT
SEQUENCES = 2**32


class MessageKind(IntEnum):
    """What a message is."""

    SUBMIT = 1  # controller -> client: sample `sequence`
    OBTAIN = 2  # client -> controller: values for the sample that it answers, `sequence`
    SENSOR = 3  # client -> controller: the same, of a sensor that answers nothing; stamped with the last sample it saw
    PARAMETER = 4  # client -> controller: a number of the declaration, and its new value
    DECLARE = 5  # both ways, before all else
    BYE = 6  # both ways: nothing more comes, and why


TEXTS = (MessageKind.DECLARE, MessageKind.BYE)


class WrongMessage(ValueError):
    """Bytes that are no message; its text says why. sequence: of the sample that it answers, where that much is clear."""

    def __init__(self, words: str, sequence: int | None = None):
        super().__init__(words)
        self.sequence = sequence


@dataclass(frozen=True, eq=False)
class Message:
    """A message: sequence, the number of a sample; time in ns; values (n,), or a text."""

    kind: MessageKind
    sequence: int = 0
    time: int = 0
    values: Values = field(default_factory=lambda: np.zeros(0))
    text: str = ""


def encoded(message: Message) -> bytes:
    """The bytes of a message. ModelError for more than 255 numbers, and for a declaration above 16 kB."""
    if message.kind in TEXTS:
        body, count = message.text.encode(), 0
        if len(body) > TEXT:
            raise ModelError(
                f"declaration: found {len(body)} bytes of names and units, expected {TEXT} at most; declare less"
            )
    else:
        values = np.ascontiguousarray(message.values, dtype="<f8")
        if values.size > NUMBERS:
            raise ModelError(
                f"message: found {values.size} numbers, expected {NUMBERS} at most; exchange less, or in two clients"
            )
        body, count = values.tobytes(), values.size
    return HEADER.pack(MAGIC, message.kind, count, message.sequence % SEQUENCES, message.time) + body


def decoded(data: bytes | memoryview) -> Message:
    """The message in some bytes. WrongMessage for wrong magic, kind, length, numbers that are not finite, broken text."""
    if len(data) < HEADER.size:
        raise WrongMessage(f"{len(data)} bytes, fewer than a header")
    magic, kind, count, sequence, time = HEADER.unpack_from(data)
    if magic != MAGIC:
        raise WrongMessage(f"magic {magic:#06x}, not {MAGIC:#06x}")
    if kind not in MessageKind.__members__.values():
        raise WrongMessage(f"unknown kind {kind}")
    body, answered = bytes(data[HEADER.size :]), sequence if kind == MessageKind.OBTAIN else None
    if kind in TEXTS:
        if count or len(body) > TEXT:
            raise WrongMessage(f"a text of {len(body)} bytes and {count} numbers")
        try:
            return Message(MessageKind(kind), sequence, time, text=body.decode())
        except UnicodeDecodeError:
            raise WrongMessage("a text that is none") from None
    if len(body) != 8 * count:
        raise WrongMessage(f"{len(body)} bytes for {count} numbers", answered)
    values = np.frombuffer(body, dtype="<f8").astype(np.float64)
    if not np.isfinite(values).all():
        raise WrongMessage("numbers that are not finite", answered)
    return Message(MessageKind(kind), sequence, time, values)


def framed(data: bytes) -> bytes:
    """A message behind its length, for a stream."""
    return LENGTH.pack(len(data)) + data


class Frames:
    """Messages out of the bytes of a stream, as they come, in pieces of any size."""

    def __init__(self) -> None:
        self._kept = bytearray()

    def add(self, data: bytes) -> list[bytes]:
        """The messages that are whole by now. WrongMessage for a length that no message has: the stream is lost."""
        self._kept += data
        found = []
        while len(self._kept) >= LENGTH.size:
            (length,) = LENGTH.unpack_from(self._kept)
            if not HEADER.size <= length <= LARGEST:
                raise WrongMessage(f"a frame of {length} bytes")
            end = LENGTH.size + length
            if len(self._kept) < end:
                break
            found.append(bytes(self._kept[LENGTH.size : end]))
            del self._kept[:end]
        return found


@dataclass(frozen=True)
class Introduction:
    """What a declaration says: who it is, its token if it has one, what is sent; of a controller also its parameters."""

    name: str
    token: str = ""
    sends: Declaration = field(default_factory=Declaration)
    parameters: Declaration = field(default_factory=Declaration)


def as_text(introduction: Introduction) -> str:
    """Lines `name`, `token`, and one for each channel: sends or parameter, name, unit, size, minimum, maximum.

    ModelError for a name or a token that is not printable, as tabs and line ends are not: it would break the lines.
    """
    for role, text in (("name", introduction.name), ("token", introduction.token)):
        if not isinstance(text, str) or not text.isprintable():
            raise ModelError(f"declaration: found the {role} {text!r}, expected a text that can be printed")
    lines = [f"name\t{introduction.name}", f"token\t{introduction.token}"]
    for role, channels in (("sends", introduction.sends), ("parameter", introduction.parameters)):
        for c in channels:
            limits = ("-" if limit is None else repr(float(limit)) for limit in (c.minimum, c.maximum))
            lines.append("\t".join([role, c.name, c.unit, str(c.size), *limits]))
    return "".join(f"{line}\n" for line in lines)


def from_text(text: str) -> Introduction:
    """What a declaration says. WrongMessage for what says nothing of the kind."""
    said: dict[str, str] = {}
    channels: dict[str, list[Channel]] = {"sends": [], "parameter": []}
    for line in text.removesuffix("\n").split("\n") if text else ():
        role, *rest = line.split("\t")
        if role in ("name", "token") and len(rest) == 1 and role not in said:
            said[role] = rest[0]
        elif role in channels and len(rest) == 5:
            channels[role].append(_channel(*rest))
        else:
            raise WrongMessage(f"the line {line[:80]!r}")
    if not said.get("name", "").strip() or not said["name"].isprintable():
        raise WrongMessage("a declaration without a name that can be printed")
    try:
        sends, parameters = (Declaration(channels[role]) for role in ("sends", "parameter"))
    except ModelError as error:
        raise WrongMessage(str(error)) from None
    return Introduction(said["name"], said.get("token", ""), sends, parameters)


def _channel(name: str, unit: str, size: str, *limits: str) -> Channel:
    numbers: list[Any] = []
    try:
        numbers = [None if limit == "-" else float(limit) for limit in limits]
        return Channel(name, unit, int(size), *numbers)
    except (ModelError, ValueError) as error:
        raise WrongMessage(f"the channel {name[:40]!r}: {error}") from None
