"""The law that a user's controller is, of whatever kind it is."""

import os
from collections.abc import Mapping
from typing import Any, cast

from gantrytau import Dae, Model
from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.laws.compiled_law import SUFFIXES, CompiledLaw
from gantrytau_fmu.controller.laws.law import FunctionLaw, Law, LawFunction, PartLaw
from gantrytau_fmu.controller.stepped_part import SteppedPart
from gantrytau_fmu.systems.sources.python_component import PythonComponent


def users_law(controller: Any, wires: Mapping[str, str]) -> Law:
    """A function, a model, an FMU file, a shared library or a `PythonComponent` as a law; ModelError for anything else."""
    if isinstance(controller, (str, os.PathLike)) and str(controller).lower().endswith(SUFFIXES):
        found: Law = CompiledLaw(os.fspath(controller))
    elif isinstance(controller, (str, os.PathLike, Model, Dae, PythonComponent)):
        return PartLaw(SteppedPart("controller", controller), wires)
    elif callable(controller):
        found = FunctionLaw(cast(LawFunction, controller))
    else:
        raise ModelError(
            f"controller: found {controller!r}, expected a function of t and values, a model, an FMU file, a shared library "
            f"({', '.join(SUFFIXES)}) or a PythonComponent"
        )
    if wires:
        raise ModelError("wires: found some, expected them with a model or an FMU; others take all by name")
    return found
