"""Optimisation of models written with gantrytau, in the style of Optimica, and calibration of robots."""

from gantrytau_optimica.answers.archive.optimum_files import load_optimum, save_optimum
from gantrytau_optimica.answers.archive.run_record import compare_records, run_record, write_record
from gantrytau_optimica.answers.archive.saved_optimum import MissingGuess, SavedOptimum
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.calibration.calibrate import calibrate
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.data.findings import CalibrationError
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.design.identifiability import identifiability
from gantrytau_optimica.calibration.design.pose_selection import enough_poses, predict, select_poses
from gantrytau_optimica.calibration.design.sensitivity_table import SensitivityTable, sensitivity_table
from gantrytau_optimica.calibration.devices.cameras import Camera, Cameras, single_camera, stereo_cameras
from gantrytau_optimica.calibration.devices.devices import LaserTracker, TMac
from gantrytau_optimica.calibration.devices.gauges import LengthGauge, Wires
from gantrytau_optimica.calibration.devices.sight import Bars
from gantrytau_optimica.calibration.fitting.arm_fit import fit_arm
from gantrytau_optimica.calibration.rods.arms import read_arms
from gantrytau_optimica.calibration.surveys.error_maps import error_map
from gantrytau_optimica.calibration.surveys.guideways import linearity
from gantrytau_optimica.calibration.surveys.orientation_errors import orientation_causes, orientation_errors
from gantrytau_optimica.estimation.estimate import estimate
from gantrytau_optimica.estimation.estimation import Estimate
from gantrytau_optimica.estimation.experiments import Experiment
from gantrytau_optimica.optimize import optimize, prepare
from gantrytau_optimica.paths.path import Corner, Deviation, Path, Way
from gantrytau_optimica.prepared import Prepared
from gantrytau_optimica.problem.optimization import (
    Free,
    Optimization,
    at,
    final,
    initial,
    integral_of_squares,
    link,
    sum_of_squares,
)
from gantrytau_optimica.problem.samples import Samples
from gantrytau_optimica.procedure.calibration_plan import CalibrationPlan, load_plan
from gantrytau_optimica.procedure.plan_calibration import plan_calibration
from gantrytau_optimica.studies.pareto import pareto
from gantrytau_optimica.studies.sensitivities import Sensitivities, sensitivities
from gantrytau_optimica.studies.trade_off import TradeOff

__all__ = [
    "Bars",
    "Calibration",
    "CalibrationError",
    "CalibrationPlan",
    "Camera",
    "Cameras",
    "Corner",
    "Deviation",
    "Estimate",
    "Experiment",
    "Free",
    "LaserTracker",
    "LengthGauge",
    "Measurements",
    "MissingGuess",
    "Optimization",
    "Optimum",
    "Path",
    "Prepared",
    "Samples",
    "SavedOptimum",
    "Sensitivities",
    "SensitivityTable",
    "TMac",
    "TradeOff",
    "Way",
    "Wires",
    "at",
    "calibrate",
    "compare_records",
    "enough_poses",
    "error_map",
    "estimate",
    "final",
    "fit_arm",
    "identifiability",
    "initial",
    "integral_of_squares",
    "linearity",
    "link",
    "load_optimum",
    "load_plan",
    "optimize",
    "orientation_causes",
    "orientation_errors",
    "pareto",
    "plan_calibration",
    "predict",
    "prepare",
    "read_arms",
    "run_record",
    "save_optimum",
    "select_poses",
    "sensitivities",
    "sensitivity_table",
    "single_camera",
    "stereo_cameras",
    "sum_of_squares",
    "write_record",
]
