"""A component in a process of its own: if its binary crashes or hangs, only that process is lost.

Parent and child call each other over a pipe of `multiprocessing.connection`. The child has no standard input, and what
the FMU prints appears on standard error.
"""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from multiprocessing import Pipe
from typing import Any

from gantrytau.border.refusal import GantryTauError, InitializationError, SolveError
from gantrytau_fmu.systems.component import Component
from gantrytau_fmu.systems.slave import Slave

# a plain process: one of `multiprocessing` would import the user's script once more
_START = (
    "import sys; sys.path[:] = {path!r}; from gantrytau_fmu.systems.isolation import serve; serve({handle})"
)
FAREWELL = 5.0  # s for the process to end by itself


class Isolated:
    """A `Slave` in a process of its own; timeout: s that one call may take."""

    def __init__(self, component: Component, timeout: float):
        self.component, self.timeout, self.time, self.running = component, timeout, 0.0, False
        self.line, childs = Pipe()
        with childs:
            self.process = _started(childs.fileno())
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
            self.line.send((call, arguments))
            if not self.line.poll(self.timeout):
                self.process.kill()
                raise self._lost(call, f"did not answer within {self.timeout:g} s and was stopped")
            good, value = self.line.recv()
        except (OSError, EOFError):
            raise self._lost(call, f"crashed ({self._how()})") from None
        if not good:
            raise value
        return value

    def _lost(self, call: str, words: str) -> GantryTauError:
        message = (
            f"{self.component.title}: the process of {self.component.file} {words} in the call '{call}' "
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

    def _end(self) -> None:
        self.line.close()
        try:
            self.process.wait(FAREWELL)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def _started(handle: int) -> "subprocess.Popen[bytes]":
    """The child, which inherits its end of the pipe and nothing else."""
    path = [entry or os.getcwd() for entry in sys.path]
    command = [sys.executable, "-c", _START.format(path=path, handle=handle)]
    if sys.platform == "win32":
        os.set_handle_inheritable(handle, True)
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=2, close_fds=False)
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=2, pass_fds=[handle])


def serve(handle: int) -> None:
    """The child: answer calls until the parent hangs up."""
    if sys.platform == "win32":
        from multiprocessing.connection import PipeConnection as Connection
    else:
        from multiprocessing.connection import Connection
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the parent, which ends this process
    slave: Any = None
    with suppress(EOFError, OSError), Connection(handle) as line:
        while True:
            call, arguments = line.recv()
            try:
                if call == "Slave":
                    slave, value = Slave(*arguments), None
                else:
                    value = getattr(slave, call)(*arguments)
                answer = (True, value)
            except Exception as error:
                answer = (False, _plain(error))
            line.send(answer)


def _plain(error: Exception) -> Exception:
    """The error without what cannot be carried over."""
    error.__cause__ = error.__context__ = None
    return error if isinstance(error, GantryTauError) else GantryTauError(f"{type(error).__name__}: {error}")
