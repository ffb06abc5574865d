"""Calibration of robots from measured poses."""

from gantrytau_optimica.calibration.calibrate import calibrate
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.data.findings import CalibrationError
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.fitting.finding import Finding

__all__ = ["Calibration", "CalibrationError", "Finding", "Measurements", "calibrate"]
