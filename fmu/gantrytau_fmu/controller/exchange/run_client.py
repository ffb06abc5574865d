"""The client's side of the exchange: a client of this process at a controller somewhere else."""

import contextlib
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from gantrytau.border.checks import check_words, number
from gantrytau.border.refusal import Given, ModelError
from gantrytau_fmu.controller.channels import Declaration
from gantrytau_fmu.controller.clients import Client, Sample
from gantrytau_fmu.controller.exchange.client_socket import AGAIN, ALIVE, ClientSocket, opened
from gantrytau_fmu.controller.exchange.messages import (
    Introduction,
    Message,
    MessageKind,
    WrongMessage,
    as_text,
    from_text,
)


@dataclass
class Attended:
    """What a client took part in: samples that came, answers that were sent, and why it ended."""

    samples: int = 0
    answers: int = 0
    ended: str = ""


def run_client(
    client: Client,
    address: tuple[str, int],
    *,
    transport: Literal["udp", "tcp"] = "udp",
    token: str = "",
    duration: float | None = None,
    patience: float = 10.0,
) -> Attended:
    """Let a client take part in the exchange of a controller at (host, port) until the run there ends, or at Ctrl-C.

    duration: s after which it leaves; patience: s for which the controller may keep silent, at first and later on. Raises
    ModelError where nobody is there, and where the controller refuses this client, in its words.
    """
    check_words(run_client, {"transport": transport})
    patience = number("run_client", "patience", patience, above=0.0, unit="s")
    if duration is not None:
        duration = number("run_client", "duration", duration, least=0.0, unit="s")
    if not (isinstance(address, Sequence) and len(address) == 2 and isinstance(address[1], int)):
        expected = "expected (host, port), as ('127.0.0.1', 5000)"
        raise ModelError(expected, place="run_client", found=Given("address", address))
    end = None if duration is None else time.monotonic() + duration
    said, place = Introduction(client.name, token, client.sends), f"{address[0]}:{address[1]}"
    own, found = opened(address, transport, patience), Attended()
    try:
        _attend(client, own, said, place, end, patience, found)
    except KeyboardInterrupt:
        found.ended = "interrupted"
    finally:
        own.send(Message(MessageKind.BYE, text="the client ends"))
        own.socket.close()
        client.close()
    return found


def _attend(
    client: Client,
    own: ClientSocket,
    said: Introduction,
    place: str,
    end: float | None,
    patience: float,
    found: Attended,
) -> None:
    declaration = None
    heard = time.monotonic()
    own.send(Message(MessageKind.DECLARE, text=as_text(said)))
    while True:
        now = time.monotonic()
        if end is not None and now > end:
            found.ended = "its duration is over"
            return
        if now - heard > patience:
            raise ModelError(
                f"{said.name}: found nobody who answers at {place} within {patience:g} s, expected a controller; start it "
                "first, or name its port"
            )
        if now - own.sent > (AGAIN if declaration is None else ALIVE):
            own.send(Message(MessageKind.DECLARE, text=as_text(said)))
        for message in own.messages():
            heard = time.monotonic()
            if message.kind == MessageKind.DECLARE:
                with contextlib.suppress(WrongMessage):
                    declaration = from_text(message.text).sends
            elif message.kind == MessageKind.BYE:
                if declaration is None:
                    raise ModelError(f"{said.name}: the controller at {place} refuses it: {message.text}")
                found.ended = message.text or "the controller ended"
                return
            elif message.kind == MessageKind.SUBMIT and declaration is not None:
                _answer(client, own, message, declaration, found)
        if own.ended:
            found.ended = "the connection ended"
            return


def _answer(
    client: Client, own: ClientSocket, message: Message, declaration: Declaration, found: Attended
) -> None:
    """Sample k to the client, and what it says to it."""
    if message.values.size != declaration.size:
        return
    found.samples += 1
    client.submit(Sample(message.sequence, message.time, message.values), declaration)
    answer = client.answer(message.sequence + 1)
    if answer is not None and client.sends.size:
        own.send(Message(MessageKind.OBTAIN, answer.k, answer.time, answer.values))
        found.answers += 1
