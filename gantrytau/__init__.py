"""gantrytau: acausal modelling on CasADi, for robots with closed kinematic loops and everything else."""

from gantrytau.answers.c_code import c_source
from gantrytau.answers.diagnosis import Diagnosis, check
from gantrytau.answers.extraction.extraction import Mechanism, extract_mechanism
from gantrytau.answers.linearization import Linearization, linearize
from gantrytau.dae import Dae, translate
from gantrytau.errors import (
    GantryTauError,
    InitializationError,
    ModelError,
    SolveError,
    StructureError,
)
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.flattening.flatten import flatten
from gantrytau.language.declarations import (
    Array,
    Bounds,
    Fixed,
    Flow,
    Input,
    Output,
    Parameter,
    Propagated,
    Real,
    Start,
    StateSelect,
)
from gantrytau.language.events import sampled, stick_slip
from gantrytau.language.functions import (
    acos,
    asin,
    atan,
    atan2,
    between,
    cos,
    cross,
    dot,
    exp,
    fabs,
    if_else,
    log,
    norm_2,
    sin,
    sqrt,
    tan,
    tanh,
)
from gantrytau.language.model import Connector, Model, outer
from gantrytau.language.statements import branch, connect, constraint, require, root
from gantrytau.language.symbols import der, time
from gantrytau.results.result import Result
from gantrytau.simulation.simulate import simulate

__all__ = [
    "Array",
    "Bounds",
    "Connector",
    "Dae",
    "Diagnosis",
    "Fixed",
    "FlatModel",
    "Flow",
    "GantryTauError",
    "InitializationError",
    "Input",
    "Linearization",
    "Mechanism",
    "Model",
    "ModelError",
    "Output",
    "Parameter",
    "Propagated",
    "Real",
    "Result",
    "SolveError",
    "Start",
    "StateSelect",
    "StructureError",
    "acos",
    "asin",
    "atan",
    "atan2",
    "between",
    "branch",
    "c_source",
    "check",
    "connect",
    "constraint",
    "cos",
    "cross",
    "der",
    "dot",
    "exp",
    "extract_mechanism",
    "fabs",
    "flatten",
    "if_else",
    "linearize",
    "log",
    "norm_2",
    "outer",
    "require",
    "root",
    "sampled",
    "simulate",
    "sin",
    "sqrt",
    "stick_slip",
    "tan",
    "tanh",
    "time",
    "translate",
]
