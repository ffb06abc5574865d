"""gantrytau: acausal modelling on CasADi, for robots with closed kinematic loops and everything else."""

from typing import TYPE_CHECKING

from gantrytau.door import door

if TYPE_CHECKING:
    from gantrytau.answers.c_code import c_source
    from gantrytau.answers.diagnosis import Diagnosis, check
    from gantrytau.answers.extraction.extraction import Mechanism, extract_mechanism
    from gantrytau.answers.linear_systems.linear_system import LinearSystem
    from gantrytau.answers.linear_systems.state_space import StateSpace
    from gantrytau.answers.linear_systems.tune_pid import PidGains, tune_pid
    from gantrytau.answers.linearization import Linearization, linearize
    from gantrytau.border.columns import Columns
    from gantrytau.border.refusal import (
        DoubtfulResult,
        GantryTauError,
        InitializationError,
        ModelError,
        SolveError,
        StructureError,
        did_you_mean,
    )
    from gantrytau.border.schema import read_toml
    from gantrytau.border.units import in_unit, si
    from gantrytau.dae import Dae, translate
    from gantrytau.describing.describe import describe
    from gantrytau.describing.described import Description
    from gantrytau.ensembles.study import study
    from gantrytau.ensembles.study_record import Study
    from gantrytau.flattening.flat_model import FlatModel
    from gantrytau.flattening.flatten import flatten
    from gantrytau.inputs.deterministic_signals import chirp, multisine, steps
    from gantrytau.inputs.input_signal import InputSignal
    from gantrytau.inputs.random_signals import prbs, white_noise
    from gantrytau.inputs.samples import Samples
    from gantrytau.interruption import heeding_interrupts
    from gantrytau.language.declarations import (
        Array,
        Bounds,
        Discrete,
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
    from gantrytau.language.events import (
        Mode,
        delay,
        reinit,
        sampled,
        stick_slip,
        terminate,
        transition,
        when,
    )
    from gantrytau.language.functions import (
        acos,
        asin,
        atan,
        atan2,
        between,
        ceil,
        cos,
        cross,
        dot,
        exp,
        fabs,
        floor,
        fmax,
        fmin,
        if_else,
        limit,
        log,
        logic_and,
        logic_not,
        logic_or,
        mod,
        norm_2,
        sign,
        sin,
        sqrt,
        tan,
        tanh,
    )
    from gantrytau.language.model import Connector, Declared, Model, check_member, outer
    from gantrytau.language.parameter_files import parameter_text, parameters_of, read_parameters
    from gantrytau.language.settings import with_setting
    from gantrytau.language.statements import branch, connect, constraint, require, root
    from gantrytau.language.symbols import der, pre, split_derivative, time
    from gantrytau.language.tables.read_table import read_table
    from gantrytau.language.tables.tables import table
    from gantrytau.modelica.elaboration.library import ModelicaLibrary, load_modelica
    from gantrytau.results.figures import has_windows
    from gantrytau.results.result import Result
    from gantrytau.simulation.simulate import simulate
    from gantrytau.viewing.animate import animate, view
    from gantrytau.viewing.browse import browse
    from gantrytau.whole_files import replacing
else:
    __getattr__, __dir__ = door(__name__)

__all__ = [
    "Array",
    "Bounds",
    "Columns",
    "Connector",
    "Dae",
    "Declared",
    "Description",
    "Diagnosis",
    "Discrete",
    "DoubtfulResult",
    "Fixed",
    "FlatModel",
    "Flow",
    "GantryTauError",
    "InitializationError",
    "Input",
    "InputSignal",
    "LinearSystem",
    "Linearization",
    "Mechanism",
    "Mode",
    "Model",
    "ModelError",
    "ModelicaLibrary",
    "Output",
    "Parameter",
    "PidGains",
    "Propagated",
    "Real",
    "Result",
    "Samples",
    "SolveError",
    "Start",
    "StateSelect",
    "StateSpace",
    "StructureError",
    "Study",
    "acos",
    "animate",
    "asin",
    "atan",
    "atan2",
    "between",
    "branch",
    "browse",
    "c_source",
    "ceil",
    "check",
    "check_member",
    "chirp",
    "connect",
    "constraint",
    "cos",
    "cross",
    "delay",
    "der",
    "describe",
    "did_you_mean",
    "dot",
    "exp",
    "extract_mechanism",
    "fabs",
    "flatten",
    "floor",
    "fmax",
    "fmin",
    "has_windows",
    "heeding_interrupts",
    "if_else",
    "in_unit",
    "limit",
    "linearize",
    "load_modelica",
    "log",
    "logic_and",
    "logic_not",
    "logic_or",
    "mod",
    "multisine",
    "norm_2",
    "outer",
    "parameter_text",
    "parameters_of",
    "prbs",
    "pre",
    "read_parameters",
    "read_table",
    "read_toml",
    "reinit",
    "replacing",
    "require",
    "root",
    "sampled",
    "si",
    "sign",
    "simulate",
    "sin",
    "split_derivative",
    "sqrt",
    "steps",
    "stick_slip",
    "study",
    "table",
    "tan",
    "tanh",
    "terminate",
    "time",
    "transition",
    "translate",
    "tune_pid",
    "view",
    "when",
    "white_noise",
    "with_setting",
]
