"""A panel's line to a controller: what it publishes, as it comes, and what the operator asks for."""

import contextlib
import threading
import time
from collections.abc import Sequence

import numpy as np

from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau_fmu.controller.board import STATES
from gantrytau_fmu.controller.channels import Declaration
from gantrytau_fmu.controller.exchange.client_socket import AGAIN, ALIVE, opened
from gantrytau_fmu.controller.exchange.messages import (
    Introduction,
    Message,
    MessageKind,
    WrongMessage,
    as_text,
    from_text,
)

STALE = 1.0  # s without a sample, after which values are not of now


class PanelLink:
    """Looks at a controller at (host, port). token: of the controller, without which nothing can be set.

    Raises ModelError where nobody answers within `patience`, s, and where the controller refuses, in its words.
    """

    def __init__(self, address: tuple[str, int], *, token: str = "", patience: float = 5.0):
        self.token, self.place = token, f"{address[0]}:{address[1]}"
        self.published, self.parameters = Declaration(), Declaration()
        self.k, self.time, self.ended = -1, 0.0, ""
        self._values = np.zeros(0)
        self._heard = 0.0
        self._hello = Message(MessageKind.DECLARE, text=as_text(Introduction("panel", self.token)))
        self._socket = opened(address, "udp", patience)
        self._end = threading.Event()
        self._lock = threading.Lock()
        self._meet(patience)
        self._thread = threading.Thread(target=self._read, name="panel", daemon=True)
        self._thread.start()

    @property
    def values(self) -> dict[str, list[float]]:
        """What was published last, by name."""
        with self._lock:
            known = self._values.copy()
        if not known.size:
            return {}
        return {name: known[place].tolist() for name, place in self.published.slices.items()}

    @property
    def state(self) -> str:
        """The state of the controller, "" before its first sample."""
        found = self.values.get("state")
        return STATES[int(found[0])] if found else ""

    @property
    def live(self) -> bool:
        """Whether samples come."""
        return not self.ended and time.monotonic() - self._heard < STALE

    def set(self, name: str, values: Sequence[float]) -> None:
        """Ask for a parameter, or as "state" for a state by its number. ModelError for what cannot be, or has no token."""
        if not self.token:
            raise ModelError(
                "panel: found no token, expected that of the controller; without it one may only look"
            )
        if name not in self.parameters:
            raise ModelError(f"there is no parameter '{name}'{did_you_mean(name, self.parameters.names)}")
        channel = self.parameters[name]
        wanted = Declaration([channel]).vector({name: list(values)})
        if refusal := Declaration([channel]).refusal(wanted):
            raise ModelError(refusal)
        number = self.parameters.names.index(name)
        self._socket.send(Message(MessageKind.PARAMETER, values=np.concatenate([[float(number)], wanted])))

    def switch(self, state: str) -> None:
        """Ask for a state. ModelError for one that is none."""
        if state not in STATES:
            raise ModelError(f"there is no state '{state}'{did_you_mean(state, STATES)}")
        self.set("state", [float(STATES.index(state))])

    def close(self) -> None:
        """Leave."""
        self._end.set()
        self._thread.join(timeout=2.0)
        self._socket.send(Message(MessageKind.BYE, text="the panel ends"))
        self._socket.socket.close()

    def __enter__(self) -> "PanelLink":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _meet(self, patience: float) -> None:
        end, asked = time.monotonic() + patience, -AGAIN
        while time.monotonic() < end:
            if time.monotonic() - asked > AGAIN:
                asked = time.monotonic()
                self._socket.send(self._hello)
            for message in self._socket.messages():
                if message.kind == MessageKind.BYE:
                    self._socket.socket.close()
                    raise ModelError(f"panel: the controller at {self.place} refuses it: {message.text}")
                if message.kind == MessageKind.DECLARE:
                    with contextlib.suppress(WrongMessage):
                        said = from_text(message.text)
                        self.published, self.parameters = said.sends, said.parameters
                        return
        self._socket.socket.close()
        raise ModelError(
            f"panel: found nobody who answers at {self.place} within {patience:g} s, expected a controller that serves; "
            "start it with --port, or name its port"
        )

    def _read(self) -> None:
        while not self._end.is_set():
            if time.monotonic() - self._socket.sent > ALIVE:
                self._socket.send(self._hello)
            for message in self._socket.messages():
                if message.kind == MessageKind.BYE:
                    self.ended = message.text or "the controller ended"
                    return
                if message.kind == MessageKind.SUBMIT and message.values.size == self.published.size:
                    with self._lock:
                        self._values = message.values
                    self.k, self.time, self._heard = message.sequence, 1e-9 * message.time, time.monotonic()
