"""Optimisation of models written with gantrytau, in the style of Optimica, and calibration of robots."""

from gantrytau_optimica.archive.run_record import compare_records, run_record, write_record
from gantrytau_optimica.archive.saved import MissingGuess, SavedOptimum
from gantrytau_optimica.archive.saving import load_optimum, save_optimum
from gantrytau_optimica.calibration.calibrating import calibrate
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.findings import CalibrationError
from gantrytau_optimica.calibration.measurements import Measurements
from gantrytau_optimica.estimation.estimate import Estimate
from gantrytau_optimica.estimation.estimating import estimate
from gantrytau_optimica.estimation.experiments import Experiment
from gantrytau_optimica.measurements import Samples
from gantrytau_optimica.optimization import (
    Free,
    Optimization,
    at,
    final,
    initial,
    integral_of_squares,
    link,
    sum_of_squares,
)
from gantrytau_optimica.optimize import Prepared, optimize, prepare
from gantrytau_optimica.optimum import Optimum
from gantrytau_optimica.paths.path import Corner, Deviation, Path, Way
from gantrytau_optimica.studies.pareto import TradeOff, pareto
from gantrytau_optimica.studies.sensitivities import Sensitivities, sensitivities

__all__ = [
    "Calibration",
    "CalibrationError",
    "Corner",
    "Deviation",
    "Estimate",
    "Experiment",
    "Free",
    "Measurements",
    "MissingGuess",
    "Optimization",
    "Optimum",
    "Path",
    "Prepared",
    "Samples",
    "SavedOptimum",
    "Sensitivities",
    "TradeOff",
    "Way",
    "at",
    "calibrate",
    "compare_records",
    "estimate",
    "final",
    "initial",
    "integral_of_squares",
    "link",
    "load_optimum",
    "optimize",
    "pareto",
    "prepare",
    "run_record",
    "save_optimum",
    "sensitivities",
    "sum_of_squares",
    "write_record",
]
