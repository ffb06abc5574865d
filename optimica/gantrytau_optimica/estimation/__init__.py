"""Parameters of dynamic models from measured data."""

from gantrytau_optimica.estimation.estimate import estimate
from gantrytau_optimica.estimation.estimation import Estimate
from gantrytau_optimica.estimation.experiments import Experiment

__all__ = [
    "Estimate",
    "Experiment",
    "estimate",
]
