"""Learning control of robots: runs of a robot with its servos."""

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

__all__ = [
    "RIG_EXAMPLE",
    "Actuators",
    "Complementary",
    "Gradient",
    "History",
    "Kalman",
    "Kinematic",
    "Learning",
    "LearningError",
    "LearntCases",
    "Measured",
    "NormOptimal",
    "Reference",
    "Repetitions",
    "Rig",
    "Scatter",
    "SimulatorPlant",
    "StraightAxes",
    "Tukey",
    "ZeroPhase",
    "arm_model",
    "design_q",
    "estimated_response",
    "learn",
    "learn_cases",
    "plot_estimates",
    "plot_learning",
    "plot_q",
    "read_corrections",
    "read_rig",
    "repeat",
    "square_reference",
    "uncertain",
]
