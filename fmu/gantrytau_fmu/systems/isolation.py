"""A component in a process of its own: if its binary crashes or hangs, only that process is lost.

Parent and child exchange pickles, each after its length, over the child's standard input and output, which the child
takes away from the FMU first. What the FMU prints appears on standard error.
"""

import os
import pickle
import queue
import signal
import struct
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import Any, BinaryIO

from gantrytau.border.refusal import GantryTauError, InitializationError, SolveError
from gantrytau_fmu.systems.component import Component
from gantrytau_fmu.systems.slave import Slave

_START = "import sys; sys.path[:] = {path!r}; from gantrytau_fmu.systems.isolation import serve; serve()"
_LENGTH = struct.Struct("<Q")
FAREWELL = 5.0  # s for the process to end by itself


class Isolated:
    """A `Slave` in a process of its own; timeout: s that one call may take."""

    def __init__(self, component: Component, timeout: float):
        self.component, self.timeout, self.time, self.running = component, timeout, 0.0, False
        path = [entry or os.getcwd() for entry in sys.path]
        self.process = subprocess.Popen(
            [sys.executable, "-c", _START.format(path=path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
        )
        self.answers: queue.Queue[Any] = queue.Queue()
        threading.Thread(target=self._listen, daemon=True).start()
        try:
            self._ask("Slave", component)
        except BaseException:
            self._end()
            raise

    def begin(
        self, start: Mapping[str, float | str], begin: float, stop: float, tolerance: float | None
    ) -> None:
        """See `Slave.begin`."""
        self.time = begin
        self._ask("begin", start, begin, stop, tolerance)

    def started(self) -> None:
        """See `Slave.started`."""
        self._ask("started")
        self.running = True

    def get(self, names: tuple[str, ...]) -> list[float]:
        """See `Slave.get`."""
        return self._ask("get", names)

    def set(self, names: tuple[str, ...], values: Sequence[float]) -> None:
        """See `Slave.set`."""
        self._ask("set", names, list(values))

    def step(
        self,
        time: float,
        size: float,
        known: tuple[str, ...],
        values: Sequence[float],
        wanted: tuple[str, ...],
    ) -> list[float]:
        """See `Slave.step`."""
        self.time = time
        return self._ask("step", time, size, known, list(values), wanted)

    def save(self) -> None:
        """See `Slave.save`."""
        self._ask("save")

    def restore(self) -> None:
        """See `Slave.restore`."""
        self._ask("restore")

    def close(self) -> None:
        """Free the instance and end the process, by force if need be."""
        if self.process.poll() is None:
            with suppress(GantryTauError, OSError):
                self.timeout = min(self.timeout, FAREWELL)
                self._ask("close")
        self._end()

    def _ask(self, call: str, *arguments: Any) -> Any:
        try:
            _write(self.process.stdin, (call, arguments))
            answer = self.answers.get(timeout=self.timeout)
        except queue.Empty:
            self.process.kill()
            raise self._lost(call, f"did not answer within {self.timeout:g} s and was stopped") from None
        except OSError:
            answer = None
        if answer is None:
            raise self._lost(call, f"crashed ({self._how()})")
        good, value = answer
        if not good:
            raise value
        return value

    def _lost(self, call: str, words: str) -> GantryTauError:
        message = (
            f"{self.component.name}: the process of {self.component.file} {words} in the call '{call}' "
            f"at t = {self.time:.6g} s; `gantrytau fmu check --run` looks for the reason"
        )
        if self.running:
            return SolveError(message, time=self.time)
        return InitializationError(message)

    def _how(self) -> str:
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(FAREWELL)
        code = self.process.returncode
        if code is not None and code < 0:
            with suppress(ValueError):
                return signal.Signals(-code).name
        return f"exit code {code}"

    def _listen(self) -> None:
        """Carry answers from the pipe to the queue; None when the process has gone."""
        with suppress(OSError, EOFError, ValueError):
            while True:
                self.answers.put(_read(self.process.stdout))
        self.answers.put(None)

    def _end(self) -> None:
        with suppress(OSError):
            if self.process.stdin:
                self.process.stdin.close()
        try:
            self.process.wait(FAREWELL)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def serve() -> None:
    """The child: answer calls until the parent hangs up."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent, which ends this process
    source, sink = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)
    slave: Any = None
    with suppress(EOFError, OSError):
        while True:
            call, arguments = _read(source)
            try:
                if call == "Slave":
                    slave, value = Slave(*arguments), None
                else:
                    value = getattr(slave, call)(*arguments)
                answer = (True, value)
            except Exception as error:
                answer = (False, _plain(error))
            _write(sink, answer)


def _plain(error: Exception) -> Exception:
    """The error without what cannot be carried over."""
    error.__cause__ = error.__context__ = None
    return error if isinstance(error, GantryTauError) else GantryTauError(f"{type(error).__name__}: {error}")


def _write(stream: BinaryIO | Any, value: Any) -> None:
    text = pickle.dumps(value)
    stream.write(_LENGTH.pack(len(text)) + text)
    stream.flush()


def _read(stream: BinaryIO | Any) -> Any:
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        raise EOFError
    (length,) = _LENGTH.unpack(head)
    text = stream.read(length)
    if len(text) < length:
        raise EOFError
    return pickle.loads(text)
