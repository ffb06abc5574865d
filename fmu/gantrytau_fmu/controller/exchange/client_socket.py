"""A socket of a client, by datagrams or a connection: messages out of it and into it."""

import socket
import time
from collections.abc import Iterator

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.exchange.messages import (
    LARGEST,
    LENGTH,
    Frames,
    Message,
    WrongMessage,
    decoded,
    encoded,
    framed,
)

LOOK = 0.1  # s that `messages` waits for something
AGAIN = 0.2  # s after which a declaration is sent anew until it is answered, as datagrams may be lost
ALIVE = 1.0  # s after which it is by one who has sent nothing since: so that each side knows that the other is there


class ClientSocket:
    """A socket of either kind; frames: of a connection. `ended` where nothing more comes; `sent`: s on the monotonic clock
    at which something was sent last.
    """

    def __init__(self, own: socket.socket, frames: Frames | None):
        self.socket, self.frames, self.ended = own, frames, False
        self.sent = time.monotonic()

    def send(self, message: Message) -> None:
        """Send a message; `ended` tells where nobody takes it."""
        data, self.sent = encoded(message), time.monotonic()
        try:
            self.socket.sendall(data if self.frames is None else framed(data))
        except OSError:
            self.ended = True

    def messages(self) -> Iterator[Message]:
        """What has come; waits a while for something."""
        try:
            data = self.socket.recv(LARGEST + LENGTH.size)
        except TimeoutError:
            return
        except OSError:  # a datagram to a port that nobody has opened yet, or a connection that broke
            self.ended = self.frames is not None
            time.sleep(0 if self.ended else LOOK)
            return
        if not data and self.frames is not None:
            self.ended = True
            return
        try:
            for each in [data] if self.frames is None else self.frames.add(data):
                yield decoded(each)
        except WrongMessage:
            self.ended = self.frames is not None


def opened(address: tuple[str, int], transport: str, patience: float) -> ClientSocket:
    """A socket to (host, port), by "udp" or "tcp". ModelError where nobody takes the connection within `patience`, s."""
    host, port = address
    try:
        if transport == "tcp":
            own = socket.create_connection((host, port), timeout=patience)
            own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        else:
            own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            own.connect((host, port))
    except (OSError, OverflowError, UnicodeError) as error:  # nobody, or no port, or no host
        reason = getattr(error, "strerror", None) or error
        raise ModelError(
            f"{host}:{port}: found nobody there ({reason}), expected a controller; start it first, or name its port"
        ) from None
    own.settimeout(LOOK)
    return ClientSocket(own, Frames() if transport == "tcp" else None)
