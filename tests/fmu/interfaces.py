"""Descriptions made by hand, and read back by FMPy."""

import io
import zipfile
from dataclasses import replace
from typing import Any

from fmpy.model_description import read_model_description

from gantrytau_fmu.describing.fmi2_description import in_fmi_2
from gantrytau_fmu.describing.model_description import build_description, model_description
from gantrytau_fmu.description import (
    DefaultExperiment,
    FmuDescription,
    FmuInterface,
    FmuTerminal,
    FmuVariable,
    ModelStructure,
    Unknown,
)

VERSIONS = ("2.0", "3.0")
BOTH = ("model-exchange", "co-simulation")
STRUCTURE = ("outputs", "derivatives", "initial_unknowns", "indicators")
TIME = FmuVariable("time", 0, "independent", "continuous", unit="s", description="time")


def description(*variables: FmuVariable, interfaces: Any = BOTH, **changes: Any) -> FmuDescription:
    """Time and these variables, numbered; every output is listed and depends on nothing."""
    numbered = tuple(replace(v, reference=k) for k, v in enumerate((TIME, *variables)))
    lists: dict[str, Any] = dict(
        outputs=tuple(Unknown(v.name, ()) for v in numbered if v.causality == "output")
    )
    lists |= {name: changes.pop(name) for name in STRUCTURE if name in changes}
    told: dict[str, Any] = dict(variables=numbered, structure=ModelStructure(**lists)) | changes
    kinds = tuple(FmuInterface(kind, "Mechanics_Box") for kind in interfaces)
    return FmuDescription(name="Mechanics.Box", token="{a1}", interfaces=kinds, **told)


def oscillator(**changes) -> FmuDescription:
    """A mass on a spring: m s'' = f - c s, with the position as output and state at once."""
    return description(
        FmuVariable("m", 0, "parameter", "tunable", "exact", 2.5, "kg", "mass", min=0.0),
        FmuVariable(
            "spring.c", 0, "parameter", "fixed", "exact", 1 / 3, "N/m", "stiffness", min=0.0, max=1e6
        ),
        FmuVariable(
            "f", 0, "input", "continuous", start=0.1, unit="N", description="force", min=-60.0, max=60.0
        ),
        FmuVariable("s", 0, "output", "continuous", "exact", 0.1 + 0.2, "m", "position", nominal=0.5),
        FmuVariable("v", 0, "local", "continuous", "exact", -1e-17, "m/s", "speed", derivative="s"),
        FmuVariable("der(v)", 0, "local", "continuous", "calculated", None, "m/s2", derivative="v"),
        FmuVariable("share", 0, "output", "continuous", unit="1", description="of the force in the spring"),
        **dict(
            outputs=(
                Unknown("s", ("s",), ("constant",)),
                Unknown("share", ("s", "f", "m"), ("dependent", "dependent", "tunable")),
            ),
            derivatives=(
                Unknown("v", ("v",), ("constant",)),
                Unknown("der(v)", ("f", "s"), ("tunable", "tunable")),
            ),
            initial_unknowns=(
                Unknown("share", ("s", "f", "spring.c"), ("dependent", "fixed", "dependent")),
                Unknown(
                    "der(v)", ("m", "spring.c", "f", "s"), ("dependent", "dependent", "constant", "dependent")
                ),
            ),
            experiment=DefaultExperiment(0.5, 4.0, 1e-7, 0.002),
            description="A mass & a spring",
            author="A. Author",
            version="1.2",
            license="MIT",
            copyright="© A. Author",
            generated="2026-01-02T03:04:05Z",
            terminals=(
                FmuTerminal("flange", {"s": "s", "f": "f", "v": "v"}),
                FmuTerminal("inner", {"v": "v"}),
            ),
        )
        | changes,
    )


def gain() -> FmuDescription:
    """No states, Co-Simulation only."""
    return description(
        FmuVariable("u", 0, "input", "discrete", start=0.0, unit="rad/s"),
        FmuVariable("gains.k[0]", 0, "parameter", "tunable", "exact", 3.0, "N.m.s/rad"),
        FmuVariable("y", 0, "output", "continuous", "calculated", unit="N.m"),
        FmuVariable("limit", 0, "output", "constant", start=7.0, unit="kg.m2/s3"),
        outputs=(Unknown("y", ("u",), ("tunable",)), Unknown("limit", (), ())),
        interfaces=("co-simulation",),
    )


def relay() -> FmuDescription:
    """Friction that sticks: a mode, a held variable, event indicators; Model Exchange only."""
    return description(
        FmuVariable("friction.mode", 0, "output", "discrete", "calculated", type="Int32", min=-1, max=1),
        FmuVariable("steps", 0, "parameter", "fixed", start=12, type="Int32"),
        FmuVariable("controller.held", 0, "local", "discrete", "exact", 1.5, "N"),
        FmuVariable("v", 0, "local", "continuous", "approx", 0.0, "m/s"),
        FmuVariable("der(v)", 0, "local", "continuous", unit="m/s2", derivative="v"),
        FmuVariable("slip", 0, "local", "continuous", unit="N", description="distance from breakaway"),
        outputs=(Unknown("friction.mode", ("controller.held",), ("constant",)),),
        derivatives=(Unknown("der(v)", ("v", "controller.held"), ("dependent", "discrete")),),
        initial_unknowns=(Unknown("der(v)", ("v",), ("dependent",)),),
        indicators=("slip", "v"),
        interfaces=("model-exchange",),
    )


DESCRIPTIONS = {"oscillator": oscillator, "gain": gain, "relay": relay, "nothing": description}


def said(told: FmuDescription, fmi="3.0", sources=()) -> FmuDescription:
    """The same for a version, with sources."""
    compiled = ("sources/fmu.c",) if sources else ()
    return replace(in_fmi_2(told) if fmi == "2.0" else told, sources=compiled)


def fmu(told: FmuDescription, fmi, sources=()) -> io.BytesIO:
    """An archive with nothing but the descriptions."""
    file, told = io.BytesIO(), said(told, fmi, sources)
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", model_description(told))
        if sources:
            archive.writestr("sources/buildDescription.xml", build_description(told, sources))
    return file


def read(told: FmuDescription, fmi, sources=()) -> Any:
    """The description as FMPy reads it, after all its checks."""
    return read_model_description(
        fmu(told, fmi, sources), validate=True, validate_variable_names=True, validate_model_structure=True
    )
