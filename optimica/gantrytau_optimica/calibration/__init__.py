"""Calibration of robots from measured poses."""

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
from gantrytau_optimica.calibration.devices.cameras import (
    Cameras,
    PlacedCamera,
    single_camera,
    stereo_cameras,
)
from gantrytau_optimica.calibration.devices.devices import LaserTracker, TMac
from gantrytau_optimica.calibration.devices.gauges import LengthGauge
from gantrytau_optimica.calibration.devices.placement import Placement, place_device
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

__all__ = [
    "About",
    "Accelerometer",
    "Bars",
    "Calibration",
    "CalibrationError",
    "CalibrationVerdict",
    "Cameras",
    "CrossValidation",
    "LaserTracker",
    "LengthGauge",
    "Measurements",
    "ParameterRow",
    "PlacedCamera",
    "Placement",
    "PoseSensitivities",
    "SampledDevice",
    "SensitivityTable",
    "TMac",
    "calibrate",
    "calibrated_geometry",
    "cross_validate",
    "enough_poses",
    "error_map",
    "fit_arm",
    "frame_words",
    "held_out",
    "identifiability",
    "judge",
    "linearity",
    "orientation_causes",
    "orientation_errors",
    "parameter_rows",
    "place_device",
    "pose_sensitivities",
    "predict",
    "read_arms",
    "report_numbers",
    "select_poses",
    "sensitivity_table",
    "single_camera",
    "stereo_cameras",
    "told_by_tool",
    "write_report",
]
