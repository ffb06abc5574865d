"""The controller's side of the exchange: who comes, who may write, and what they say, in a thread beside the samples."""

import contextlib
import hmac
import re
import secrets
import selectors
import socket
import threading
import time
from collections.abc import Iterable
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import number, whole
from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.board import STATES
from gantrytau_fmu.controller.channels import Channel, Declaration
from gantrytau_fmu.controller.clients import Client, Sample
from gantrytau_fmu.controller.exchange.messages import (
    LARGEST,
    NUMBERS,
    Introduction,
    Message,
    MessageKind,
    WrongMessage,
    as_text,
    decoded,
    encoded,
    from_text,
)
from gantrytau_fmu.controller.exchange.peers import Address, DatagramPeer, StreamPeer
from gantrytau_fmu.controller.exchange.remote_client import RemoteClient

LOOPBACK = ("127.0.0.1", "::1", "localhost")
PEERS = 16  # at a time: connections, and senders of datagrams who only look
ABSENT = 3.0  # s without a message, after which another may have the place of somebody
WORDS = 1000  # characters of a refusal
LOOK = 0.05  # s between looks whether it is to end
TOKEN = re.compile(r"[!-~]+")  # what a line of a declaration, a header of a page and a command line all carry
STATE = Channel("state", "1", minimum=0.0, maximum=len(STATES) - 1.0)


class Served(Protocol):
    """What a server needs of a controller."""

    @property
    def published(self) -> Declaration: ...
    @property
    def tunables(self) -> Declaration: ...
    def set(self, name: str, value: ArrayLike) -> None: ...
    def idle(self) -> None: ...
    def submit(self) -> None: ...
    def obtain(self) -> None: ...


class Server:
    """Serves a controller on a port, by datagrams and by connections; itself a client of it, for those who only look.

    places: the clients that may come, by their names; others may look, if they send nothing. port: 0 takes a free one, which
    `port` tells. host: this machine alone unless told otherwise; beyond it everybody who sends values needs the token, and
    everywhere whoever sets parameters and states does. token: text; made up where none is given, `token` tells it.
    Raises ModelError for a port in use, a host that is none, more than 255 published numbers or 16 kB of names, a token
    that is not of printable ASCII without spaces, and one of less than 16 characters beyond this machine.
    """

    name = "server"
    sends = Declaration()

    def __init__(
        self,
        controller: Served,
        places: Iterable[Client] = (),
        *,
        port: int = 0,
        host: str = "127.0.0.1",
        token: str | None = None,
    ):
        whole("serve", "port", port, least=0, most=65_535)
        self.controller, self.dropped, self.refused = controller, 0, 0
        self.places = {place.name: place for place in places if isinstance(place, RemoteClient)}
        self._beyond = host not in LOOPBACK
        if token is not None and not (isinstance(token, str) and TOKEN.fullmatch(token)):
            raise ModelError(
                "serve: found a token with spaces, signs that are not ASCII, or nothing in it, expected letters, digits and "
                "signs; leave it out, and one is made",
                argument="token",
            )
        if self._beyond and token is not None and len(token) < 16:
            raise ModelError(
                f"serve: found a token of {len(token)} characters for host {host}, expected 16 and more, as others can "
                "reach it"
            )
        self.token = secrets.token_urlsafe(24) if token is None else token
        if controller.published.size > NUMBERS:
            raise ModelError(
                f"serve: found {controller.published.size} published numbers, expected {NUMBERS} at most in a message; "
                "give the plant fewer outputs"
            )
        parameters = Declaration([*controller.tunables, STATE])
        self._own = Message(
            MessageKind.DECLARE,
            text=as_text(Introduction("controller", "", controller.published, parameters)),
        )
        encoded(self._own)  # raises for more names than a message holds
        self._datagrams, self._listener = _sockets(host, port)
        self.host, self.port = host, int(self._listener.getsockname()[1])
        self._known: dict[Address, DatagramPeer] = {}
        self._slots: dict[Any, RemoteClient | None] = {}  # peer -> its place, None for one who only looks
        self._writers: set[Any] = set()
        self._lock, self._end = threading.Lock(), threading.Event()
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._datagrams, selectors.EVENT_READ)
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._serve, name="exchange", daemon=True)
        self._thread.start()

    def keep(self, place: RemoteClient) -> None:
        """One more place, for a client who may come from now on."""
        self.places[place.name] = place

    def submit(self, sample: Sample, declaration: Declaration) -> None:
        """Sample k to those who only look."""
        message = Message(MessageKind.SUBMIT, sample.k, sample.time, sample.values)
        with self._lock:
            lookers = [peer for peer, place in self._slots.items() if place is None]
        for peer in lookers:
            if not peer.send(message):
                self.dropped += 1

    def answer(self, k: int) -> None:
        """It answers nothing."""

    def settled(self, k: int) -> bool:
        """Nobody waits for those who only look."""
        return True

    def close(self) -> None:
        """The run has ended: say so, and take the port down."""
        if self._end.is_set():
            return
        self._end.set()
        self._thread.join(timeout=5.0)
        with self._lock:
            peers = list(self._slots)
        for peer in peers:
            peer.send(Message(MessageKind.BYE, text="the run has ended"))
            peer.close()
        for own in (self._datagrams, self._listener):
            own.close()
        self._selector.close()

    def __enter__(self) -> "Server":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def wait(self, names: Iterable[str] | None = None, timeout: float = 30.0) -> None:
        """Until these clients have come, all unless named. ModelError for an unknown name, and after the timeout, s."""
        wanted = list(self.places if names is None else names)
        for name in wanted:
            if name not in self.places:
                raise ModelError(
                    f"wait: there is no place for '{name}', expected one of {', '.join(self.places) or 'none'}"
                )
        timeout = number("wait", "timeout", timeout, least=0.0, unit="s", most=np.inf)
        pause, end = threading.Event(), time.monotonic() + timeout
        while missing := [name for name in wanted if not self.places[name].connected]:
            if time.monotonic() > end:
                raise ModelError(
                    f"wait: {', '.join(missing)} did not come within {timeout:g} s, expected at {self.host}:{self.port}; "
                    "start them"
                )
            pause.wait(0.01)

    def _serve(self) -> None:
        while not self._end.is_set():
            for key, _ in self._selector.select(LOOK):
                if key.fileobj is self._datagrams:
                    self._read_datagrams()
                elif key.fileobj is self._listener:
                    self._accept()
                else:
                    self._read_stream(key.data)
            for peer in [p for p in list(self._slots) if isinstance(p, StreamPeer) and p.waits]:
                if not peer.flush():
                    self._forget(peer)

    def _read_datagrams(self) -> None:
        for _ in range(100):  # then look at others
            try:
                data, address = self._datagrams.recvfrom(LARGEST + 1)
            except OSError:
                return
            self._take(self._known.get(address) or DatagramPeer(self._datagrams, address), data)

    def _accept(self) -> None:
        try:
            own, address = self._listener.accept()
        except OSError:
            return
        peer = StreamPeer(own, address)
        there = [key.data for key in self._selector.get_map().values() if isinstance(key.data, StreamPeer)]
        if not self._room(there):
            peer.send(Message(MessageKind.BYE, text=f"{PEERS} are connected already"))
            peer.close()
            return
        self._selector.register(own, selectors.EVENT_READ, peer)

    def _read_stream(self, peer: StreamPeer) -> None:
        try:
            messages = peer.read()
        except WrongMessage:
            self.dropped += 1
            messages = None
        if messages is None:
            self._forget(peer)
            return
        for data in messages:
            self._take(peer, data)

    def _take(self, peer: Any, data: bytes) -> None:
        try:
            message = decoded(data)
            peer.heard = time.monotonic()
            if message.kind == MessageKind.DECLARE:
                self._meet(peer, from_text(message.text))
            elif peer not in self._slots:
                raise WrongMessage("values before a declaration")
            else:
                self._hear(peer, message)
        except WrongMessage as error:
            place = self._slots.get(peer)
            if place is None:
                self.dropped += 1
            else:
                place.drop(str(error), error.sequence)

    def _meet(self, peer: Any, said: Introduction) -> None:
        """Somebody says who he is: he gets his place, or hears why not."""
        writes = bool(said.token) and hmac.compare_digest(said.token.encode(), self.token.encode())
        place = self.places.get(said.name)
        if refusal := self._refusal(said, place, writes, peer):
            self.refused += 1
            peer.send(Message(MessageKind.BYE, text=refusal[:WORDS]))
            return
        if place is not None and place.peer not in (None, peer):
            self._dismiss(place.peer, f"another '{place.name}' has come, as this one was silent")
        before = self._slots.get(peer)
        with self._lock:
            if isinstance(peer, DatagramPeer):
                self._known[peer.address] = peer
            self._slots[peer] = place
            (self._writers.add if writes else self._writers.discard)(peer)
        if before is not None and before is not place:
            before.left(peer)
        peer.send(self._own)
        if place is not None:
            place.met(peer)

    def _room(self, there: list[Any]) -> bool:
        """Whether one more may come beside these, of whom the one who was silent for longest goes if need be."""
        if len(there) < PEERS:
            return True
        silent = min((peer for peer in there if self._slots.get(peer) is None), key=_heard, default=None)
        if silent is None or not _absent(silent):
            return False
        self._dismiss(silent, "others have come, and this one was silent")
        return True

    def _dismiss(self, peer: Any, words: str) -> None:
        peer.send(Message(MessageKind.BYE, text=words))
        self._forget(peer)

    def _refusal(self, said: Introduction, place: RemoteClient | None, writes: bool, peer: Any) -> str:
        if said.token and not writes:
            return "the token is not that of this controller; the one who started it knows it"
        if place is None and said.sends.size:
            there = ", ".join(self.places) or "nobody"
            return f"there is no place for '{said.name}', which sends values; expected {there}"
        if place is not None and _meaning(said.sends) != _meaning(place.sends):
            return f"'{said.name}' declared {_words(said.sends)}, expected {_words(place.sends)}"
        if place is not None and self._beyond and not writes:
            return f"'{said.name}' sends values from elsewhere, expected the token of this controller"
        if place is not None and place.peer not in (None, peer) and not _absent(place.peer):
            return f"'{said.name}' is there already; expected another name, or that it is silent for {ABSENT:g} s"
        if place is None and isinstance(peer, DatagramPeer) and peer.address not in self._known:
            looking = [known for known in self._known.values() if self._slots.get(known) is None]
            return "" if self._room(looking) else f"{PEERS} are there already"
        return ""

    def _hear(self, peer: Any, message: Message) -> None:
        place = self._slots[peer]
        if message.kind == MessageKind.BYE:
            self._forget(peer)
        elif message.kind in (MessageKind.OBTAIN, MessageKind.SENSOR):
            if place is None:
                raise WrongMessage("values of one who declared none")
            place.heard(message)
        elif message.kind == MessageKind.PARAMETER:
            self._set(peer, message)
        else:
            raise WrongMessage(f"{message.kind.name} of a client")

    def _set(self, peer: Any, message: Message) -> None:
        """A parameter or the state: its number in the declaration, then its values."""
        if peer not in self._writers:
            self.refused += 1
            peer.send(
                Message(
                    MessageKind.BYE,
                    text="parameters and states are set with the token of this controller only",
                )
            )
            self._forget(peer)
            return
        channels = [*self.controller.tunables, STATE]
        number = message.values[0] if message.values.size else np.nan
        if not (number == np.floor(number) and 0 <= number < len(channels)):
            raise WrongMessage("no parameter of this number")
        channel, values = channels[int(number)], message.values[1:]
        if refusal := Declaration([channel]).refusal(values):
            raise WrongMessage(refusal)
        if channel is STATE:
            if values[0] != np.floor(values[0]):
                raise WrongMessage("no state of this number")
            (self.controller.idle, self.controller.submit, self.controller.obtain)[int(values[0])]()
            return
        try:
            self.controller.set(channel.name, values if channel.size > 1 else float(values[0]))
        except ModelError as error:
            raise WrongMessage(str(error)) from None

    def _forget(self, peer: Any) -> None:
        with self._lock:
            place = self._slots.pop(peer, None)
            self._writers.discard(peer)
            if isinstance(peer, DatagramPeer):
                self._known.pop(peer.address, None)
        if place is not None:
            place.left(peer)
        if isinstance(peer, StreamPeer):
            with contextlib.suppress(KeyError, ValueError):
                self._selector.unregister(peer.socket)
            peer.close()


def _sockets(host: str, port: int) -> tuple[socket.socket, socket.socket]:
    """A socket for datagrams and one that listens, on one port."""
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    datagrams = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen(PEERS)
        datagrams.bind((host, listener.getsockname()[1]))
    except (OSError, UnicodeError, TypeError) as error:
        listener.close()
        datagrams.close()
        reason = getattr(error, "strerror", None) or error
        raise ModelError(
            f"serve: {host}:{port} cannot be opened ({reason}), expected a free port of this machine; take another one, or "
            "0 for any",
            argument="port",
        ) from None
    for own in (listener, datagrams):
        own.setblocking(False)
    return datagrams, listener


def _meaning(sends: Declaration) -> list[tuple[str, str, int]]:
    return [(c.name, c.unit, c.size) for c in sends]


def _words(sends: Declaration) -> str:
    return (
        ", ".join(f"{c.name} [{c.unit}]" + (f" x {c.size}" if c.size > 1 else "") for c in sends) or "nothing"
    )


def _heard(peer: Any) -> float:
    return peer.heard


def _absent(peer: Any) -> bool:
    """Whether nothing has come of somebody for long."""
    return time.monotonic() - peer.heard > ABSENT
