"""Controllers on boards: C for a microcontroller, and the serial line to it."""

from gantrytau_fmu.hardware.board_line import BoardLine, emulated_board
from gantrytau_fmu.hardware.step_code import StepCode, step_code

__all__ = ["BoardLine", "StepCode", "emulated_board", "step_code"]
