"""Interfaces made by hand, and their descriptions read back by FMPy."""

import io
import zipfile
from dataclasses import replace
from typing import Any

from fmpy.model_description import read_model_description

from gantrytau_fmu.describing.xml_description import build_description, model_description
from gantrytau_fmu.description import Experiment, Interface, Unknown, Variable

VERSIONS = ("2.0", "3.0")
TIME = Variable("time", 0, "independent", "continuous", unit="s", description="time")


def interface(*variables: Variable, **changes) -> Interface:
    """Time and these variables, numbered; every output is listed and depends on nothing."""
    numbered = tuple(replace(v, reference=k) for k, v in enumerate((TIME, *variables)))
    outputs = tuple(Unknown(v.reference, (), ()) for v in numbered if v.causality == "output")
    told = dict(variables=numbered, outputs=outputs, derivatives=()) | changes
    return Interface("Mechanics.Box", "Mechanics_Box", "{a1}", **told)  # pyright: ignore[reportArgumentType]


def oscillator(**changes) -> Interface:
    """A mass on a spring: m s'' = f - c s, with the position as output and state at once."""
    return interface(
        Variable("m", 0, "parameter", "tunable", "exact", 2.5, "kg", "mass", min=0.0),
        Variable("spring.c", 0, "parameter", "fixed", "exact", 1 / 3, "N/m", "stiffness", min=0.0, max=1e6),
        Variable(
            "f", 0, "input", "continuous", start=0.1, unit="N", description="force", min=-60.0, max=60.0
        ),
        Variable("s", 0, "output", "continuous", "exact", 0.1 + 0.2, "m", "position", nominal=0.5),
        Variable("v", 0, "local", "continuous", "exact", -1e-17, "m/s", "speed", derivative=4),
        Variable("der(v)", 0, "local", "continuous", "calculated", None, "m/s2", derivative=5),
        Variable("share", 0, "output", "continuous", unit="1", description="of the force in the spring"),
        **dict(
            outputs=(
                Unknown(4, (4,), ("constant",)),
                Unknown(7, (4, 3, 1), ("dependent", "dependent", "tunable")),
            ),
            derivatives=(Unknown(5, (5,), ("constant",)), Unknown(6, (3, 4), ("tunable", "tunable"))),
            initial_unknowns=(
                Unknown(7, (4, 3, 2), ("dependent", "fixed", "dependent")),
                Unknown(6, (1, 2, 3, 4), ("dependent", "dependent", "constant", "dependent")),
            ),
            experiment=Experiment(0.5, 4.0, 1e-7, 0.002),
            description="A mass & a spring",
            author="A. Author",
            version="1.2",
            license="MIT",
            copyright="© A. Author",
            generated="2026-01-02T03:04:05Z",
            terminals={"flange": {"s": 4, "f": 3, "v": 5}, "inner": {"v": 5}},
        )
        | changes,
    )


def gain() -> Interface:
    """No states, Co-Simulation only."""
    return interface(
        Variable("u", 0, "input", "discrete", start=0.0, unit="rad/s"),
        Variable("gains.k[0]", 0, "parameter", "tunable", "exact", 3.0, "N.m.s/rad"),
        Variable("y", 0, "output", "continuous", "calculated", unit="N.m"),
        Variable("limit", 0, "output", "constant", start=7.0, unit="kg.m2/s3"),
        outputs=(Unknown(3, (1,), ("tunable",)), Unknown(4, (), ())),
        interfaces=("co-simulation",),
    )


def relay() -> Interface:
    """Friction that sticks: a mode, a held variable, event indicators; Model Exchange only."""
    return interface(
        Variable("friction.mode", 0, "output", "discrete", "calculated", type="integer", min=-1, max=1),
        Variable("steps", 0, "parameter", "fixed", start=12, type="integer"),
        Variable("controller.held", 0, "local", "discrete", "exact", 1.5, "N"),
        Variable("v", 0, "local", "continuous", "approx", 0.0, "m/s"),
        Variable("der(v)", 0, "local", "continuous", unit="m/s2", derivative=4),
        Variable("slip", 0, "local", "continuous", unit="N", description="distance from breakaway"),
        outputs=(Unknown(1, (3,), ("constant",)),),
        derivatives=(Unknown(5, (4, 3), ("dependent", "discrete")),),
        initial_unknowns=(Unknown(5, (4,), ("dependent",)),),
        indicators=(6, 4),
        interfaces=("model-exchange",),
    )


INTERFACES = {"oscillator": oscillator, "gain": gain, "relay": relay, "nothing": interface}


def fmu(told: Interface, fmi, sources=()) -> io.BytesIO:
    """An archive with nothing but the descriptions."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("modelDescription.xml", model_description(told, fmi, sources))
        if sources:
            archive.writestr("sources/buildDescription.xml", build_description(told, fmi, sources))
    return file


def read(told: Interface, fmi, sources=()) -> Any:
    """The description as FMPy reads it, after all its checks."""
    return read_model_description(
        fmu(told, fmi, sources), validate=True, validate_variable_names=True, validate_model_structure=True
    )
