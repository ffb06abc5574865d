"""What an FMU shows to the outside: its variables, how they depend on each other, and what it can do.

The record between the model and the files: the model description, the C tables and the checks are written
from it. FMI 3.0.2, sections 2.2 and 2.4; FMI 2.0.4, section 2.2.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

Causality = Literal["independent", "parameter", "input", "output", "local"]
Variability = Literal["constant", "fixed", "tunable", "discrete", "continuous"]
Initial = Literal["exact", "approx", "calculated"]
Interfaces = Literal["model-exchange", "co-simulation"]


@dataclass(frozen=True)
class Variable:
    """A scalar variable of an FMU.

    name: in the structured naming convention; reference: its value reference, which is its place in
    `Interface.variables`; start: None unless it has one; type: "real" (Float64) or "integer" (Int32);
    derivative: reference of the state whose derivative it is; unit: "" if none was declared, "1" if it has none.
    """

    name: str
    reference: int
    causality: Causality
    variability: Variability
    initial: Initial | None = None
    start: float | int | None = None
    unit: str = ""
    description: str = ""
    min: float | None = None
    max: float | None = None
    nominal: float | None = None
    type: Literal["real", "integer"] = "real"
    derivative: int | None = None


@dataclass(frozen=True)
class Unknown:
    """An entry of the model structure: a reference, and on which references it depends and how."""

    reference: int
    dependencies: tuple[int, ...]
    kinds: tuple[Literal["dependent", "constant", "fixed", "tunable", "discrete"], ...]


@dataclass(frozen=True)
class Experiment:
    """The default experiment, s; step: of Co-Simulation."""

    start: float = 0.0
    stop: float = 1.0
    tolerance: float = 1e-6
    step: float = 0.004


@dataclass(frozen=True)
class Interface:
    """All that a model description says.

    token: GUID or instantiation token; identifier: model identifier, a C name; outputs, derivatives,
    initial_unknowns: the model structure; indicators: references of event indicators; terminals: groups of
    variables that belong together, by the name of the component, references by member name; watches: singular poses
    are looked for at the end of each step, also of an importer's integrator.
    """

    name: str
    identifier: str
    token: str
    variables: tuple[Variable, ...]
    outputs: tuple[Unknown, ...]
    derivatives: tuple[Unknown, ...]
    initial_unknowns: tuple[Unknown, ...] = ()
    indicators: tuple[int, ...] = ()
    interfaces: Sequence[Interfaces] = ("model-exchange", "co-simulation")
    experiment: Experiment = field(default_factory=Experiment)
    description: str = ""
    author: str = ""
    copyright: str = ""
    license: str = ""
    version: str = ""
    generated: str = ""  # date and time, ISO 8601 in UTC
    tool: str = "gantrytau"
    terminals: dict[str, dict[str, int]] = field(default_factory=dict)
    solver: str = "dopri5"
    watches: bool = False
