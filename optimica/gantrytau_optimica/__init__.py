"""Optimisation of models written with gantrytau, in the style of Optimica, and calibration of robots."""

from gantrytau import Samples
from gantrytau_optimica.answers.archive.optimum_files import load_optimum, save_optimum
from gantrytau_optimica.answers.archive.run_record import compare_records, run_record, write_record
from gantrytau_optimica.answers.archive.saved_optimum import MissingGuess, SavedOptimum
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.calibration.assessment.calibration_acceptance import (
    CalibrationVerdict,
    judge,
    told_by_tool,
)
from gantrytau_optimica.calibration.assessment.cross_validation import (
    CrossValidation,
    cross_validate,
    held_out,
)
from gantrytau_optimica.calibration.assessment.parameter_rows import (
    ParameterRow,
    calibrated_geometry,
    parameter_rows,
)
from gantrytau_optimica.calibration.calibrate import calibrate
from gantrytau_optimica.calibration.calibration import Calibration
from gantrytau_optimica.calibration.data.findings import CalibrationError
from gantrytau_optimica.calibration.data.measurements import Measurements
from gantrytau_optimica.calibration.design.identifiability import identifiability
from gantrytau_optimica.calibration.design.pose_selection import enough_poses, predict, select_poses
from gantrytau_optimica.calibration.design.pose_sensitivities import PoseSensitivities, pose_sensitivities
from gantrytau_optimica.calibration.design.sensitivity_table import SensitivityTable, sensitivity_table
from gantrytau_optimica.calibration.devices.accelerometers import Accelerometer
from gantrytau_optimica.calibration.devices.cameras import Camera, Cameras, single_camera, stereo_cameras
from gantrytau_optimica.calibration.devices.devices import LaserTracker, TMac
from gantrytau_optimica.calibration.devices.gauges import LengthGauge
from gantrytau_optimica.calibration.devices.sampled_devices import SampledDevice
from gantrytau_optimica.calibration.devices.sight import Bars
from gantrytau_optimica.calibration.diagnostics.device_frames import frame_words
from gantrytau_optimica.calibration.error_analysis.error_maps import error_map
from gantrytau_optimica.calibration.error_analysis.guideways import linearity
from gantrytau_optimica.calibration.error_analysis.orientation_errors import (
    orientation_causes,
    orientation_errors,
)
from gantrytau_optimica.calibration.fitting.fit_arm import fit_arm
from gantrytau_optimica.calibration.links.arm_closure import read_arms
from gantrytau_optimica.calibration.report.report import About, report_numbers, write_report
from gantrytau_optimica.estimation.estimate import estimate
from gantrytau_optimica.estimation.estimation import Estimate
from gantrytau_optimica.estimation.experiments import Experiment
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification.excitation.design_excitation import design_excitation
from gantrytau_optimica.identification.excitation.excitation_result import Excitation
from gantrytau_optimica.identification.friction.friction_result import Friction
from gantrytau_optimica.identification.friction.identify_friction import identify_friction
from gantrytau_optimica.identification.logs.motion_log import MotionLog
from gantrytau_optimica.identification.logs.robot_checks import check_motion
from gantrytau_optimica.identification.physical.mechanical_form import MechanicalForm
from gantrytau_optimica.identification.physical.physical_form import PhysicalForm, physical_form
from gantrytau_optimica.identification.rigid.identification import Identification
from gantrytau_optimica.identification.rigid.identify import identify
from gantrytau_optimica.identification.rigid.model_comparison import (
    FURTHER_MODELS,
    TABLE_6_3,
    ModelComparison,
    compare,
    printed_models,
)
from gantrytau_optimica.identification.rigid.robot_dynamics import IdentificationError
from gantrytau_optimica.identification.servos.identify_servo import identify_servo
from gantrytau_optimica.identification.servos.servo_model import ServoModel
from gantrytau_optimica.identification.servos.step_response import StepResponse
from gantrytau_optimica.identification.spectra.measured_response import MeasuredResponse, measured_response
from gantrytau_optimica.identification.spectra.resonances import resonances
from gantrytau_optimica.identification.systems.identify_system import IdentifiedSystem, identify_system
from gantrytau_optimica.learning.cases.learnt_cases import LearntCases, learn_cases
from gantrytau_optimica.learning.cases.rig_file import RIG_EXAMPLE, read_rig
from gantrytau_optimica.learning.design.design_q import design_q
from gantrytau_optimica.learning.design.q_pictures import plot_q
from gantrytau_optimica.learning.design.uncertain_modes import uncertain
from gantrytau_optimica.learning.estimators.estimate_pictures import plot_estimates
from gantrytau_optimica.learning.estimators.estimators import Actuators, Complementary, Kinematic, Measured
from gantrytau_optimica.learning.estimators.kalman import Kalman
from gantrytau_optimica.learning.filters.tukey import Tukey
from gantrytau_optimica.learning.filters.zero_phase import ZeroPhase
from gantrytau_optimica.learning.laws.correction_laws import Gradient, NormOptimal
from gantrytau_optimica.learning.laws.learning import Learning
from gantrytau_optimica.learning.pose_maps import StraightAxes
from gantrytau_optimica.learning.rig import Rig
from gantrytau_optimica.learning.run_variation import Scatter
from gantrytau_optimica.learning.runs.corrections_file import read_corrections
from gantrytau_optimica.learning.runs.estimated_response import arm_model, estimated_response
from gantrytau_optimica.learning.runs.history import History
from gantrytau_optimica.learning.runs.history_pictures import plot_learning
from gantrytau_optimica.learning.runs.learn import LearningError, learn
from gantrytau_optimica.learning.runs.reference import Reference, square_reference
from gantrytau_optimica.learning.runs.repeat import Repetitions, repeat
from gantrytau_optimica.learning.runs.simulator_plant import SimulatorPlant
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
from gantrytau_optimica.procedure.calibration_plan import CalibrationPlan, load_plan
from gantrytau_optimica.procedure.cells.cell_example import cell_example
from gantrytau_optimica.procedure.cells.cell_file import Cell, read_cell
from gantrytau_optimica.procedure.cells.planned_cell import (
    PlannedCell,
    is_planned,
    load_planned_cell,
    plan_cell,
)
from gantrytau_optimica.procedure.measured_plan import MeasuredPlan, measured_plan
from gantrytau_optimica.procedure.plan_calibration import plan_calibration
from gantrytau_optimica.studies.pareto import pareto
from gantrytau_optimica.studies.sensitivities import Sensitivities, sensitivities
from gantrytau_optimica.studies.trade_off import TradeOff

__all__ = [
    "FURTHER_MODELS",
    "RIG_EXAMPLE",
    "TABLE_6_3",
    "About",
    "Accelerometer",
    "Actuators",
    "Bars",
    "Calibration",
    "CalibrationError",
    "CalibrationPlan",
    "CalibrationVerdict",
    "Camera",
    "Cameras",
    "Cell",
    "Complementary",
    "Corner",
    "CrossValidation",
    "Deviation",
    "Estimate",
    "Excitation",
    "Experiment",
    "Finding",
    "Free",
    "Friction",
    "Gradient",
    "History",
    "Identification",
    "IdentificationError",
    "IdentifiedSystem",
    "Kalman",
    "Kinematic",
    "LaserTracker",
    "Learning",
    "LearningError",
    "LearntCases",
    "LengthGauge",
    "Measured",
    "MeasuredPlan",
    "MeasuredResponse",
    "Measurements",
    "MechanicalForm",
    "MissingGuess",
    "ModelComparison",
    "MotionLog",
    "NormOptimal",
    "Optimization",
    "Optimum",
    "ParameterRow",
    "Path",
    "PhysicalForm",
    "PlannedCell",
    "PoseSensitivities",
    "Prepared",
    "Reference",
    "Repetitions",
    "Rig",
    "SampledDevice",
    "Samples",
    "SavedOptimum",
    "Scatter",
    "Sensitivities",
    "SensitivityTable",
    "ServoModel",
    "SimulatorPlant",
    "StepResponse",
    "StraightAxes",
    "TMac",
    "TradeOff",
    "Tukey",
    "Way",
    "ZeroPhase",
    "arm_model",
    "at",
    "calibrate",
    "calibrated_geometry",
    "cell_example",
    "check_motion",
    "compare",
    "compare_records",
    "cross_validate",
    "design_excitation",
    "design_q",
    "enough_poses",
    "error_map",
    "estimate",
    "estimated_response",
    "final",
    "fit_arm",
    "frame_words",
    "held_out",
    "identifiability",
    "identify",
    "identify_friction",
    "identify_servo",
    "identify_system",
    "initial",
    "integral_of_squares",
    "is_planned",
    "judge",
    "learn",
    "learn_cases",
    "linearity",
    "link",
    "load_optimum",
    "load_plan",
    "load_planned_cell",
    "measured_plan",
    "measured_response",
    "optimize",
    "orientation_causes",
    "orientation_errors",
    "parameter_rows",
    "pareto",
    "physical_form",
    "plan_calibration",
    "plan_cell",
    "plot_estimates",
    "plot_learning",
    "plot_q",
    "pose_sensitivities",
    "predict",
    "prepare",
    "printed_models",
    "read_arms",
    "read_cell",
    "read_corrections",
    "read_rig",
    "repeat",
    "report_numbers",
    "resonances",
    "run_record",
    "save_optimum",
    "select_poses",
    "sensitivities",
    "sensitivity_table",
    "single_camera",
    "square_reference",
    "stereo_cameras",
    "sum_of_squares",
    "told_by_tool",
    "uncertain",
    "write_record",
    "write_report",
]
