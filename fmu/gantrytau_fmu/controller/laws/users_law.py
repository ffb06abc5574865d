"""The law that a user's controller is, of whatever kind it is."""

import os
from collections.abc import Mapping
from typing import Any, cast

from numpy.typing import ArrayLike

from gantrytau import Dae, Model
from gantrytau.border.refusal import ModelError
from gantrytau_fmu.controller.board import ACTIVATE
from gantrytau_fmu.controller.channels import Channel, Declaration, Values
from gantrytau_fmu.controller.laws.compiled_law import SUFFIXES, CompiledLaw
from gantrytau_fmu.controller.laws.law import FunctionLaw, Law, LawFunction, PartLaw
from gantrytau_fmu.controller.stepped_part import SteppedPart
from gantrytau_fmu.systems.sources.python_component import PythonComponent


def users_law(controller: Any, wires: Mapping[str, str]) -> Law:
    """A function, a model, an FMU file, a shared library, a `PythonComponent` or None as a law; ModelError for others."""
    if controller is None:  # references stay as they are
        found: Law = FunctionLaw(lambda t, values: {})
    elif isinstance(controller, (str, os.PathLike)) and str(controller).lower().endswith(SUFFIXES):
        found = CompiledLaw(os.fspath(controller))
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


def tunables_of(law: Law, parameters: Mapping[Channel, ArrayLike]) -> tuple[Declaration, Values]:
    """Declaration and values of all tunables: `parameters`, f_activate and the law's own. ModelError for a bad value."""
    own = law.tunables
    channels = [*parameters, *own]
    values: dict[str, ArrayLike] = {channel.name: value for channel, value in parameters.items()}
    values |= {name: law.tuned[place] for name, place in own.slices.items()}
    if ACTIVATE.name not in values:
        channels, values = [ACTIVATE, *channels], {ACTIVATE.name: 0.0} | values
    tunables = Declaration(channels)
    found = tunables.vector(values)
    if refusal := tunables.refusal(found):
        raise ModelError(f"parameters: {refusal}", argument="parameters")
    return tunables, found
