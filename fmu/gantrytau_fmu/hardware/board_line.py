"""The host's end of a board's serial line, and a board program that runs on this computer behind a pseudo-terminal."""

import binascii
import os
import select
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Self

import numpy as np

from gantrytau.answers.sampled_code import SampledCode
from gantrytau.border.checks import array, instance, number, whole
from gantrytau.border.refusal import Given, ModelError, SolveError
from gantrytau.kernels import c_compiler
from gantrytau_fmu.hardware.step_code import write_line

SYNC = 0xA5
AROUND = 5  # bytes of a frame besides its payload
PROGRAM = Path(__file__).with_name("board_host.c")


class BoardLine:
    """A board that runs the C of a sampled controller, at a serial port or a file descriptor; a context manager.

    wait: s until a frame is sent again, at most `retries` times. wrong_crc, skipped, repeated: frames with a wrong CRC,
    bytes outside of frames, and frames that were sent again, until now. The board takes a repeated step once.
    The first step resets the board, which may know frames of another host.
    Raises ModelError for a port that cannot be opened, SolveError where no answer comes.
    """

    def __init__(
        self,
        port: str | os.PathLike[str] | int,
        code: SampledCode,
        *,
        baud: int = 115200,
        wait: float = 1.0,
        retries: int = 2,
    ):
        self._wait = number("BoardLine", "wait", wait, unit="s", above=0.0)
        self._retries = whole("BoardLine", "retries", retries, least=0)
        whole("BoardLine", "baud", baud, least=1)
        self._code = instance("BoardLine", "code", code, SampledCode)
        self._name = str(port)
        self._type = np.dtype("<f8" if code.real == "double" else "<f4")
        most = 255 // self._type.itemsize
        if max(len(code.given), len(code.find)) > most:
            counts = f"{len(code.given)} given and {len(code.find)} found"
            raise ModelError(
                f"BoardLine: found {counts} numbers, expected at most {most} in a frame; name fewer"
            )
        self.wrong_crc = self.skipped = self.repeated = 0
        self._sequence, self._bytes, self._begun = 0, b"", False
        self._file = _opened(port, baud)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self._file)
        self._file = -1  # another file may get the number

    def reset(self) -> None:
        """The controller on the board begins anew."""
        self._ask(b"", 0)
        self._begun = True

    def step(self, given: np.ndarray | list[float]) -> np.ndarray:
        """One step of the controller: its outputs (m,) for its inputs (n,), both in the order of the code."""
        values = array("BoardLine.step", "given", given, (len(self._code.given),))
        if not self._begun:
            self.reset()
        size = self._type.itemsize * len(self._code.find)
        return np.frombuffer(self._ask(values.astype(self._type).tobytes(), size), self._type).astype(float)

    def _ask(self, payload: bytes, size: int) -> bytes:
        self._sequence = (self._sequence + 1) % 256
        sent = framed(self._sequence, payload)
        for attempt in range(self._retries + 1):
            self.repeated += attempt > 0
            self._write(sent)
            until = time.monotonic() + self._wait
            while (left := until - time.monotonic()) > 0:
                if select.select([self._file], [], [], left)[0]:
                    self._bytes += self._read()
                    found = self._answer(size)
                    if found is not None:
                        return found
        raise SolveError(
            f"{self._name}: found no answer to frame {self._sequence} in {self._retries + 1} x {self._wait:g} s "
            f"({self.wrong_crc} frames with a wrong CRC, {self.skipped} bytes skipped), expected {size + AROUND} bytes; "
            "check the wiring, the baud rate, and that the board runs the C of the same step_code"
        )

    def _write(self, frame: bytes) -> None:
        try:
            os.write(self._file, frame)
        except BlockingIOError:  # the board reads nothing: a frame that does not fit is lost
            return
        except OSError as error:
            raise self._closed() from error

    def _read(self) -> bytes:
        try:
            found = os.read(self._file, 4096)
        except BlockingIOError:
            return b""
        except OSError as error:  # the other end of a pseudo-terminal is closed, or the board is unplugged
            raise self._closed() from error
        if not found:
            raise self._closed()
        return found

    def _closed(self) -> SolveError:
        return SolveError(
            f"{self._name}: found the line closed, expected an answer to frame {self._sequence}; is the board still there?"
        )

    def _answer(self, size: int) -> bytes | None:
        """The payload of the answer to the last frame, None while it is incomplete."""
        while self._bytes:
            if self._bytes[0] != SYNC or (len(self._bytes) > 2 and self._bytes[2] not in (0, size)):
                self.skipped += 1
                self._bytes = self._bytes[1:]
                continue
            if len(self._bytes) < 3 or len(self._bytes) < self._bytes[2] + AROUND:
                return None
            end = self._bytes[2] + AROUND
            frame = self._bytes[:end]
            if frame != framed(frame[1], frame[3:-2]):
                self.wrong_crc += 1
                self._bytes = self._bytes[1:]
                continue
            self._bytes = self._bytes[end:]
            if frame[1] == self._sequence and frame[2] == size:
                return frame[3:-2]
        return None


def framed(sequence: int, payload: bytes) -> bytes:
    """A frame: sync byte, sequence number, bytes of payload, payload, CRC-16 (polynomial 0x1021, start 0xFFFF)."""
    inside = bytes([sequence, len(payload)]) + payload
    return bytes([SYNC]) + inside + binascii.crc_hqx(inside, 0xFFFF).to_bytes(2, "little")


def emulated_board(
    code: SampledCode, *, wait: float = 1.0, retries: int = 2
) -> AbstractContextManager[BoardLine]:
    """The board's program, compiled by the C compiler of this computer, behind a pseudo-terminal (Linux, macOS).

    Raises ModelError if there is no compiler, or if it fails.
    """
    number("emulated_board", "wait", wait, unit="s", above=0.0)
    whole("emulated_board", "retries", retries, least=0)
    return _emulated(instance("emulated_board", "code", code, SampledCode), wait, retries)


@contextmanager
def _emulated(code: SampledCode, wait: float, retries: int) -> Iterator[BoardLine]:
    command = c_compiler()
    if command is None:
        raise ModelError("emulated_board: found no C compiler, expected cc, gcc or clang; install one")
    with tempfile.TemporaryDirectory(prefix="gantrytau-") as folder:
        code.write(folder)
        write_line(folder)
        program = Path(folder) / "board"
        # a fused multiply-add would round differently from one processor to the next
        flags = ["-std=c99", "-O2", "-ffp-contract=off", "-I", folder, "-o", str(program)]
        made = subprocess.run(
            [*command, *flags, str(PROGRAM), f"{folder}/controller.c", "-lm"], capture_output=True, text=True
        )
        if made.returncode:
            raise ModelError(
                f"emulated_board: {command[0]} ended with code {made.returncode}, expected a program: {made.stderr[:300]}; "
                "the variable CC names another compiler"
            )
        host, board = os.openpty()
        os.set_blocking(host, False)
        _raw(board, None)
        # a session of its own: Ctrl-C at the host does not reach the board
        process = subprocess.Popen([program], stdin=board, stdout=board, start_new_session=True)
        os.close(board)
        try:
            with BoardLine(host, code, wait=wait, retries=retries) as line:
                yield line
        finally:
            process.kill()
            process.wait()


def _opened(port: str | os.PathLike[str] | int, baud: int) -> int:
    instance(
        "BoardLine", "port", port, (str, os.PathLike, int), "the name of a serial port, or a file descriptor"
    )
    if isinstance(port, int):
        return port
    try:
        # without waiting for a carrier, nor for a board that reads nothing
        file = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", error)
        raise ModelError(
            f"BoardLine: found no port {port} ({why}), expected a serial port, as /dev/ttyACM0; plug the board "
            "in, look with `ls /dev/tty*`, and be allowed to use it (Linux: group dialout)"
        ) from error
    try:
        _raw(file, baud)
    except BaseException:
        os.close(file)
        raise
    return file


def _raw(file: int, baud: int | None) -> None:
    """A line without echo, line ends and signals, at a speed."""
    import termios  # not on Windows
    import tty

    try:
        tty.setraw(file)
        if baud is None:
            return
        speed = getattr(termios, f"B{baud}", None)
        if speed is None:
            words = "expected a speed of this system, as 115200"
            raise ModelError(words, place="BoardLine", found=Given("baud", baud))
        settings = termios.tcgetattr(file)
        settings[2] |= termios.CLOCAL | termios.CREAD  # no modem
        settings[2] &= ~(termios.CSTOPB | getattr(termios, "CRTSCTS", 0))
        settings[4] = settings[5] = speed
        termios.tcsetattr(file, termios.TCSANOW, settings)
        termios.tcflush(file, termios.TCIOFLUSH)
    except termios.error as error:
        raise ModelError(
            f"BoardLine: found a file that is no serial port ({error}), expected one; name another"
        ) from error
