"""Calibration of robots from measured poses."""

from gantrytau_optimica.calibration.calibrating import calibrate
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.findings import CalibrationError, Finding
from gantrytau_optimica.calibration.measurements import Measurements

__all__ = ["Calibration", "CalibrationError", "Finding", "Measurements", "calibrate"]
