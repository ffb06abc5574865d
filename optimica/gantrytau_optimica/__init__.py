"""Optimisation of models written with gantrytau, in the style of Optimica, and calibration of robots."""

from gantrytau import Samples
from gantrytau_optimica.answers.archive.optimum_files import load_optimum, save_optimum
from gantrytau_optimica.answers.archive.run_record import compare_records, run_record, write_record
from gantrytau_optimica.answers.archive.saved_optimum import MissingGuess, SavedOptimum
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.calibration import (
    Calibration,
    CalibrationError,
    LaserTracker,
    Measurements,
    calibrate,
    cross_validate,
    identifiability,
    judge,
    predict,
    select_poses,
)
from gantrytau_optimica.estimation import Estimate, Experiment, estimate
from gantrytau_optimica.fitting.finding import Finding
from gantrytau_optimica.identification import (
    Excitation,
    Friction,
    Identification,
    IdentifiedSystem,
    MotionLog,
    StepResponse,
    design_excitation,
    identify,
    identify_friction,
    identify_servo,
    identify_system,
    physical_form,
    resonances,
)
from gantrytau_optimica.learning import (
    Complementary,
    Gradient,
    History,
    Kalman,
    Kinematic,
    Learning,
    Measured,
    NormOptimal,
    Rig,
    Tukey,
    ZeroPhase,
    design_q,
    learn,
    learn_cases,
    read_rig,
    square_reference,
)
from gantrytau_optimica.optimize import optimize, prepare
from gantrytau_optimica.paths.path import Corner, Deviation, Path
from gantrytau_optimica.paths.way import Way
from gantrytau_optimica.predictive.estimators.extended_kalman import ExtendedKalman
from gantrytau_optimica.predictive.estimators.moving_horizon import MovingHorizon
from gantrytau_optimica.predictive.mpc import Mpc
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
from gantrytau_optimica.procedure import CalibrationPlan, Cell, load_plan, plan_calibration, read_cell
from gantrytau_optimica.studies.pareto import pareto
from gantrytau_optimica.studies.sensitivities import Sensitivities, sensitivities
from gantrytau_optimica.studies.trade_off import TradeOff
from gantrytau_optimica.text.load_optimica import load_optimica

__all__ = [
    "Calibration",
    "CalibrationError",
    "CalibrationPlan",
    "Cell",
    "Complementary",
    "Corner",
    "Deviation",
    "Estimate",
    "Excitation",
    "Experiment",
    "ExtendedKalman",
    "Finding",
    "Free",
    "Friction",
    "Gradient",
    "History",
    "Identification",
    "IdentifiedSystem",
    "Kalman",
    "Kinematic",
    "LaserTracker",
    "Learning",
    "Measured",
    "Measurements",
    "MissingGuess",
    "MotionLog",
    "MovingHorizon",
    "Mpc",
    "NormOptimal",
    "Optimization",
    "Optimum",
    "Path",
    "Prepared",
    "Rig",
    "Samples",
    "SavedOptimum",
    "Sensitivities",
    "StepResponse",
    "TradeOff",
    "Tukey",
    "Way",
    "ZeroPhase",
    "at",
    "calibrate",
    "compare_records",
    "cross_validate",
    "design_excitation",
    "design_q",
    "estimate",
    "final",
    "identifiability",
    "identify",
    "identify_friction",
    "identify_servo",
    "identify_system",
    "initial",
    "integral_of_squares",
    "judge",
    "learn",
    "learn_cases",
    "link",
    "load_optimica",
    "load_optimum",
    "load_plan",
    "optimize",
    "pareto",
    "physical_form",
    "plan_calibration",
    "predict",
    "prepare",
    "read_cell",
    "read_rig",
    "resonances",
    "run_record",
    "save_optimum",
    "select_poses",
    "sensitivities",
    "square_reference",
    "sum_of_squares",
    "write_record",
]
