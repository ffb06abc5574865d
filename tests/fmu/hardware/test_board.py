"""A controller in C at the other end of a pseudo-terminal does what the model does."""

import os
import shutil
import threading
import tty
from typing import Literal

import numpy as np
import pytest

from gantrytau import Input, Model, ModelError, Parameter, Real, SolveError, connect, limit, sampled, simulate
from gantrytau.blocks import DiscretePid, FirstOrder, Gain, Step
from gantrytau_fmu.hardware import BoardLine, emulated_board, step_code
from gantrytau_fmu.hardware.board_line import framed

pytestmark = pytest.mark.skipif(
    os.name != "posix" or not shutil.which("cc"), reason="needs pseudo-terminals and a C compiler"
)
PERIOD = 0.01
STEPS = 60


def pid():
    return DiscretePid(k=3.0, T_i=0.2, T_d=0.02, limits=(-1.5, 1.5), period=PERIOD)


def code(real: Literal["double", "float"] = "double"):
    return step_code(pid(), given=["u_s", "u_m"], find=["y"], real=real)


class Loop(Model):
    """The controller around a slow plant, with a set point that drives it into its limit."""

    controller, plant, target = pid(), FirstOrder(T=0.15), Step(height=1.0)

    def equations(self):
        yield connect(self.target.y, self.controller.u_s)
        yield connect(self.controller.y, self.plant.u)
        yield connect(self.plant.y, self.controller.u_m)


def in_the_loop(line):
    """Outputs of the plant at the instants, and those of the controller behind them."""
    line.reset()
    return closed_loop(line.step)


def closed_loop(step):
    decay, y, found = np.exp(-PERIOD / 0.15), 0.0, []
    for _ in range(STEPS):
        (u,) = step([1.0, y])
        found.append((y, u))
        y = decay * y + (1 - decay) * u
    return np.array(found)


@pytest.mark.parametrize(("real", "close"), [("double", 1e-9), ("float", 1e-5)])
def test_the_loop_with_the_board_is_the_simulated_one(real, close):
    with emulated_board(code(real)) as line:
        found = in_the_loop(line)
        again = in_the_loop(line)
    wanted = simulate(Loop(), stop=STEPS * PERIOD, tolerance=1e-12)
    u = [wanted.at((k + 0.5) * PERIOD, "controller.y") for k in range(STEPS)]
    assert found[0, 1] == 1.5  # the limit
    np.testing.assert_allclose(found[:, 1], u, rtol=0, atol=close)
    np.testing.assert_array_equal(found, again)


@pytest.mark.parametrize(("real", "close"), [("double", 1e-12), ("float", 3e-6)])
def test_the_board_computes_what_python_computes(real, close):
    written = code(real)
    held = np.array(written.start)

    def pure(given):
        nonlocal held
        found, held = (np.array(part).ravel() for part in written.function(given, held))
        return found

    with emulated_board(written) as line:
        np.testing.assert_allclose(in_the_loop(line), closed_loop(pure), rtol=0, atol=close)


def test_a_second_host_gets_no_answer_to_the_first():
    with emulated_board(code()) as first, BoardLine(os.dup(first._file), code()) as second:
        assert first.step([0.3, 0.0]) == -second.step([-0.3, 0.0])


def test_a_board_that_reads_nothing_is_told():
    host, board = os.openpty()
    tty.setraw(board)
    os.set_blocking(host, False)
    with (
        BoardLine(host, code(), wait=1e-4, retries=5000) as line,
        pytest.raises(SolveError, match="found no answer"),
    ):
        line.step([1.0, 0.0])
    os.close(board)
    with pytest.raises(SolveError, match=r"found the line closed.* is the board still there"):
        line.step([1.0, 0.0])


def test_lost_and_wrong_bytes_are_counted_and_a_step_is_taken_once():
    with emulated_board(code(), wait=0.1) as line:
        undisturbed = in_the_loop(line)
        write = os.write
        spoilt = iter(
            [
                lambda b: b,
                lambda b: b[:7] + b[8:],
                lambda b: b[:9] + bytes([b[9] ^ 1]) + b[10:],
                lambda b: b"\xa5\x00" + b,
            ]
        )

        def lossy(file, data):
            return write(file, next(spoilt, lambda b: b)(data))

        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("gantrytau_fmu.hardware.board_line.os.write", lossy)
            disturbed = in_the_loop(line)
        assert line.repeated == 2  # the lost byte and the wrong one; noise before a frame costs none
    np.testing.assert_array_equal(disturbed, undisturbed)


def answering(change):
    """A line whose other end answers frames by their changed bytes."""
    host, board = os.openpty()
    tty.setraw(board)

    def answer():
        os.write(board, framed(os.read(board, 100)[1], b""))
        os.write(board, change(framed(os.read(board, 100)[1], np.array([0.25]).tobytes())))

    threading.Thread(target=answer, daemon=True).start()
    return BoardLine(host, code(), wait=0.1, retries=0)


def test_the_host_finds_the_answer_behind_noise():
    with answering(lambda b: b"\x00\xa5\x01" + b) as line:
        assert line.step([1.0, 0.0]) == [0.25]
        assert line.skipped == 3


def test_a_wrong_crc_is_told():
    with (
        answering(lambda b: b[:-1] + bytes([b[-1] ^ 1])) as line,
        pytest.raises(
            SolveError, match=r"no answer to frame 2 .*1 frames with a wrong CRC.* expected 13 bytes; check"
        ),
    ):
        line.step([1.0, 0.0])


def test_ports_that_are_none():
    with pytest.raises(ModelError, match=r"found no port /dev/none .*expected a serial port.*plug"):
        BoardLine("/dev/none", code())
    with pytest.raises(ModelError, match="no serial port"):
        BoardLine("/dev/null", code())


class Proportional(Model):
    """A sampled gain between limits."""

    r, m, k, y = Input(unit="1"), Input(unit="1"), Parameter(2.0, unit="1"), Real(unit="1")

    def equations(self):
        yield sampled(self.y, limit(self.k * (self.r - self.m), -1, 1), period=PERIOD)


class TwoRates(Proportional):
    slow = Real(unit="1")

    def equations(self):
        yield from super().equations()
        yield sampled(self.slow, self.y, period=3 * PERIOD)


def test_a_parameter_is_given_over_the_line_and_limits_are_exact():
    gains = step_code(Proportional(), given=["r", "m", "k"], find=["y"])
    with emulated_board(gains) as line:
        assert [line.step([0.5, m, k])[0] for m, k in ((0.0, 2.0), (1.0, 2.0), (0.0, 1.0))] == [
            1.0,
            -1.0,
            0.5,
        ]
        with pytest.raises(ModelError, match=r"given\[1\] = nan, expected finite numbers"):
            line.step([0.5, np.nan, 2.0])


def test_what_is_not_one_sampled_step_is_told():
    with pytest.raises(ModelError, match=r"found periods=\[0.01, 0.03\], expected one; make a model for"):
        step_code(TwoRates(), given=["r", "m"], find=["y"])
    with pytest.raises(ModelError, match=r"find=.*expected at least one name"):
        step_code(Proportional(), given=["r", "m"], find=[])
    with pytest.raises(ModelError, match="found nothing sampled, expected sampled"):
        step_code(Gain(), given=["u"], find=["y"])
    with pytest.raises(ModelError, match="found states, expected a model of sampled variables"):
        step_code(Loop(), given=["controller.k"], find=["controller.y"])
