"""A client of the controller that is somewhere else: what came of it over the network, and the way back to it."""

import time
from collections import deque
from threading import Lock
from typing import Protocol

from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.channels import Declaration
from gantrytau_fmu.controller.clients import Sample
from gantrytau_fmu.controller.exchange.messages import NUMBERS, SEQUENCES, Message, MessageKind

KEPT = 4  # answers: those that may be asked for
SILENCE = 1.0  # s without an answer, after which a virtual clock gives a sample up
MISSED = 2  # samples given up one after the other, after which it waits for nothing until there is an answer


class Peer(Protocol):
    """Who is at the other end."""

    def send(self, message: Message) -> bool:
        """Whether it was sent; it never waits."""
        ...


class RemoteClient:
    """A place for a client over the network. name, sends: what it has to declare when it comes, names, units and sizes.

    Until it comes, and when it has gone, it answers nothing, and a virtual clock does not wait for it. Raises ModelError for
    more than 255 numbers.
    """

    def __init__(self, name: str, sends: Declaration | None = None):
        self.name, self.sends = name, sends or Declaration()
        if self.sends.size > NUMBERS:
            raise ModelError(
                f"{name}: found {self.sends.size} numbers, expected {NUMBERS} at most in a message; take two clients"
            )
        self.dropped, self.reason = 0, ""  # why values were dropped, the last time
        self._lock = Lock()
        self._peer: Peer | None = None
        self._answers = deque[Sample](maxlen=KEPT)
        self._newest, self._given = -1, -1
        self._answered = -1  # the newest sample that it has done with, also by an answer that was refused
        self._heard = self._asked = 0.0  # s on the monotonic clock
        self._missed = 0  # samples given up since it was heard

    @property
    def peer(self) -> Peer | None:
        """Who is there, if anybody."""
        return self._peer

    @property
    def connected(self) -> bool:
        """Whether somebody is there."""
        return self._peer is not None

    def met(self, peer: Peer) -> None:
        """Somebody has come, who may answer from the first sample on; nothing changes for one who is there."""
        with self._lock:
            if self._peer is peer:
                return
            self._peer, self._newest, self._answered = peer, -1, -1
            self._heard, self._missed = time.monotonic(), 0
            self._answers.clear()

    def left(self, peer: Peer) -> None:
        """It has gone; what it said stays."""
        with self._lock:
            if self._peer is peer:
                self._peer = None

    def heard(self, message: Message) -> None:
        """A message of its peer; what is no newer answer to a sample that it was given is dropped."""
        with self._lock:
            self._heard, self._missed = time.monotonic(), 0
            k = self._sample(message.sequence)
            answers, self._answered = k > self._newest, max(k, self._answered)
            if refusal := self.sends.refusal(message.values):
                self.reason = refusal
            if not answers or refusal:
                self.dropped += 1
                return
            self._newest = k
            self._answers.append(Sample(k, message.time, message.values))

    def drop(self, words: str, sequence: int | None) -> None:
        """A message of its peer was none, as words say. sequence: that it answers all the same, so that nobody waits on."""
        with self._lock:
            self.dropped += 1
            if sequence is not None:
                self.reason, self._answered = words, max(self._sample(sequence), self._answered)

    def _sample(self, sequence: int) -> int:
        """The last sample given that has this count, as counts of messages begin anew after 2^32; negative if none has."""
        return sequence + (self._given - sequence) // SEQUENCES * SEQUENCES

    def submit(self, sample: Sample, declaration: Declaration) -> None:
        """Send sample k, if somebody is there and the line is free."""
        peer, self._given, self._asked = self._peer, sample.k, time.monotonic()
        if peer is not None and not peer.send(
            Message(MessageKind.SUBMIT, sample.k, sample.time, sample.values)
        ):
            self.dropped += 1

    def answer(self, k: int) -> Sample | None:
        """Its newest answer, of a sample not newer than k - 1."""
        with self._lock:
            return next((found for found in reversed(self._answers) if found.k <= k - 1), None)

    def settled(self, k: int) -> bool:
        """Whether it has answered sample k, has nothing to answer, has gone, or left it without an answer for too long."""
        if self._peer is None or not self.sends.size or self._answered >= k or self._missed >= MISSED:
            return True
        with self._lock:
            late = time.monotonic() - max(self._heard, self._asked) > SILENCE
            if late:
                self._missed, self._answered = self._missed + 1, max(k, self._answered)
        return late

    def close(self) -> None:
        """Say that the run has ended."""
        peer = self._peer
        if peer is not None:
            peer.send(Message(MessageKind.BYE, text="the run has ended"))
