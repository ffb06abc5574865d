"""A controller in C at the other end of a pseudo-terminal does what the model does."""

import os
import shutil
import threading
import tty
from typing import Literal

import numpy as np
import pytest

from gantrytau import Model, ModelError, SolveError, connect, simulate
from gantrytau.blocks import DiscretePid, FirstOrder, Step
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
    decay, y, found = np.exp(-PERIOD / 0.15), 0.0, []
    line.reset()
    for _ in range(STEPS):
        (u,) = line.step([1.0, y])
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
        frame = os.read(board, 100)
        os.write(board, change(framed(frame[1], np.array([0.25]).tobytes())))

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
            SolveError, match=r"no answer to frame 1 .*1 frames with a wrong CRC.* expected 13 bytes; check"
        ),
    ):
        line.step([1.0, 0.0])


def test_ports_that_are_none():
    with pytest.raises(ModelError, match=r"found no port /dev/none .*expected a serial port.*plug"):
        BoardLine("/dev/none", code())
    with pytest.raises(ModelError, match="no serial port"):
        BoardLine("/dev/null", code())


def test_what_has_states_is_no_step():
    with pytest.raises(ModelError, match="found states, expected a model of sampled variables"):
        step_code(Loop(), given=[], find=["controller.y"])
