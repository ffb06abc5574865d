"""`gantrytau calibrate`: from measured poses to parameters, and before that the plan of what to measure."""

from gantrytau.commands.calibrate.calibrate_command import calibrate

__all__ = ["calibrate"]
