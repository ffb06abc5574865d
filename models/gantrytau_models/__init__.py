"""Complete models: a pendulum, linkages and the Gantry-Tau robots with their parameters."""

from gantrytau_models import prototypes
from gantrytau_models.delta import DeltaRobot
from gantrytau_models.f1 import F1GantryTau
from gantrytau_models.four_bar import FourBar
from gantrytau_models.gantry_tau import GantryTau
from gantrytau_models.pendulum import Pendulum
from gantrytau_models.six_link import SixLinkGantryTau
from gantrytau_models.stewart import StewartPlatform
from gantrytau_models.wrist import F1WithWrist, SerialWrist, SixLinkWithWrist, WithWrist

__all__ = [
    "DeltaRobot",
    "F1GantryTau",
    "F1WithWrist",
    "FourBar",
    "GantryTau",
    "Pendulum",
    "SerialWrist",
    "SixLinkGantryTau",
    "SixLinkWithWrist",
    "StewartPlatform",
    "WithWrist",
    "prototypes",
]
