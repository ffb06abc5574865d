"""The record of a flattened model: what crosses from the language to the compiler."""

from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from gantrytau.language.declarations import StateSelect
from gantrytau.language.events import Sampled, StickSlip
from gantrytau.language.statements import Equation, Requirement


@dataclass(frozen=True, eq=False)
class FlatVariable:
    """A declared quantity, vectors whole.

    name: dotted path; shape: (), (n,) or (n, m); elements: names of its scalars, column after column;
    symbol: its SX; start, min, max: SX expressions of parameters per scalar, or None (no opinion);
    model: class that declares it; owner: path of the component or connector that holds it.
    """

    name: str
    kind: str
    shape: tuple[int, ...]
    elements: tuple[str, ...]
    symbol: ca.SX
    unit: str | None
    description: str
    start: tuple[ca.SX, ...] | None = None
    fixed: bool = False
    min: tuple[ca.SX, ...] | None = None
    max: tuple[ca.SX, ...] | None = None
    nominal: tuple[ca.SX, ...] | None = None
    prefer: StateSelect = StateSelect.DEFAULT
    owner: str = ""
    free: bool = False


@dataclass(frozen=True, eq=False)
class FlatParameter(FlatVariable):
    """A parameter: `value` holds one SX per scalar, a number or an expression of other parameters.

    fold: its value shapes the equations and is folded in at translation.
    """

    value: tuple[ca.SX, ...] = ()
    fold: bool = False


@dataclass(frozen=True, eq=False)
class Loop:
    """A loop of rigid parts and joints.

    a, b: connectors that coincide where it closes; members: components along it, from a round to b.
    """

    a: str
    b: str
    members: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class FlatModel:
    """A model written out: variables, parameters and scalar equations between their symbols.

    derivatives: symbols of derivatives by name, `der(x)`; propagated: quantities, such as orientations, that
    are no unknowns but `definitions`: expressions, by scalar name, of variables and of definitions before
    them; rates: time derivatives of some of them; loops: of rigid parts and joints; inputs: names of the
    scalars known from outside; absent: declared names that this model has no use for, and why;
    requirements: conditions on parameters; sampled, frictions: scalars that are set at instants, no unknowns either.
    """

    name: str
    time: ca.SX
    variables: tuple[FlatVariable, ...]
    parameters: tuple[FlatParameter, ...]
    equations: tuple[Equation, ...]
    initial_equations: tuple[Equation, ...]
    derivatives: Mapping[str, ca.SX]
    propagated: tuple[FlatVariable, ...]
    definitions: Mapping[str, ca.SX]
    rates: Mapping[str, ca.SX]
    loops: tuple[Loop, ...]
    inputs: tuple[str, ...]
    hints: Mapping[str, str]
    absent: Mapping[str, str]
    requirements: tuple[Requirement, ...]
    sampled: tuple[Sampled, ...] = ()
    frictions: tuple[StickSlip, ...] = ()

    def find(self, name: str) -> FlatVariable | None:
        """The variable, parameter or propagated quantity of that name."""
        everything = (*self.variables, *self.parameters, *self.propagated)
        return next((v for v in everything if v.name == name), None)
