"""Complete models and robots, built from the components of gantrytau."""

from gantrytau_models import prototypes
from gantrytau_models.gantry_tau import GantryTau
from gantrytau_models.pendulum import Pendulum

__all__ = ["GantryTau", "Pendulum", "prototypes"]
