"""FMUs of gantrytau models, written and read, and systems of FMUs simulated together."""

from gantrytau_fmu.export import export_fmu
from gantrytau_fmu.interface import Experiment

__all__ = ["Experiment", "export_fmu"]
