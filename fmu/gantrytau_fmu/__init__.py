"""FMUs of gantrytau models, written and read, and systems of FMUs, models and functions simulated together."""

from gantrytau_fmu.building.archive import check_target
from gantrytau_fmu.controller.channels import Channel
from gantrytau_fmu.description import DefaultExperiment
from gantrytau_fmu.export import SOLVERS, Build, export_code, export_fmu
from gantrytau_fmu.reading.read_fmu import read_fmu
from gantrytau_fmu.reading.safety import no_file
from gantrytau_fmu.systems.checking.check_fmu import check_fmu
from gantrytau_fmu.systems.connected_system import UnconnectedInputs
from gantrytau_fmu.systems.cosimulate import cosimulate
from gantrytau_fmu.systems.master import ORDERS, Master
from gantrytau_fmu.systems.run_fmu import run_fmu
from gantrytau_fmu.systems.sources.python_component import PythonComponent
from gantrytau_fmu.systems.ssp.system_description import check_system, read_system
from gantrytau_fmu.systems.ssp.write_ssp import write_ssp

__all__ = [
    "ORDERS",
    "SOLVERS",
    "Build",
    "Channel",
    "DefaultExperiment",
    "Master",
    "PythonComponent",
    "UnconnectedInputs",
    "check_fmu",
    "check_system",
    "check_target",
    "cosimulate",
    "export_code",
    "export_fmu",
    "no_file",
    "read_fmu",
    "read_system",
    "run_fmu",
    "write_ssp",
]
