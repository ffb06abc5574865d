"""Who is at the other end of a socket: a sender of datagrams, or a connection with frames."""

import contextlib
import socket
import time
from threading import Lock

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.exchange.messages import (
    LARGEST,
    LENGTH,
    Frames,
    Message,
    encoded,
    framed,
)

WAITING = 262_144  # bytes that may wait for a slow reader; what comes on top is dropped
Address = tuple[str, int]


class DatagramPeer:
    """Somebody at an address who sends datagrams. heard: s on the monotonic clock at which something came last."""

    def __init__(self, own: socket.socket, address: Address):
        self.socket, self.address = own, address
        self.heard = time.monotonic()

    def send(self, message: Message) -> bool:
        """Whether the system took it."""
        try:
            return self.socket.sendto(encoded(message), self.address) > 0
        except (OSError, ModelError):
            return False

    def close(self) -> None:
        """Nothing is held open."""


class StreamPeer:
    """A connection. `waiting` bytes are sent when it takes them; frames are whole or not at all. heard: as of datagrams."""

    def __init__(self, own: socket.socket, address: Address):
        self.socket, self.address = own, address
        own.setblocking(False)
        own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self.frames, self.heard = Frames(), time.monotonic()
        self._lock, self._out = Lock(), bytearray()

    def send(self, message: Message) -> bool:
        """Whether it was sent, or waits."""
        try:
            data = framed(encoded(message))
        except ModelError:
            return False
        with self._lock:
            if len(self._out) + len(data) > WAITING:
                return False
            self._out += data
        return self.flush()

    def flush(self) -> bool:
        """Send what waits, as far as it is taken; whether the connection stands."""
        with self._lock:
            while self._out:
                try:
                    sent = self.socket.send(self._out)
                except (BlockingIOError, InterruptedError):
                    return True
                except OSError:
                    return False
                del self._out[:sent]
        return True

    @property
    def waits(self) -> bool:
        """Whether something waits to be sent."""
        return bool(self._out)

    def read(self) -> list[bytes] | None:
        """The messages that have come; None where the connection has ended. WrongMessage where the stream is lost."""
        try:
            data = self.socket.recv(LARGEST + LENGTH.size)
        except (BlockingIOError, InterruptedError):
            return []
        except OSError:
            return None
        return self.frames.add(data) if data else None

    def close(self) -> None:
        """End the connection."""
        with contextlib.suppress(OSError):
            self.socket.close()
