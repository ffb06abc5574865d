"""The record of a flattened model: what crosses from the language to the compiler."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.border.dimensions import per_second
from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.describing.record import Record
from gantrytau.language.declarations import StateSelect
from gantrytau.language.self_description.appearance import Shape
from gantrytau.language.self_description.rods import Rods
from gantrytau.language.statements import Equation, Requirement, place_of
from gantrytau.language.symbols import Range, derivative_name, split_derivative


@dataclass(frozen=True, eq=False)
class FlatVariable(Record):
    """A declared quantity, vectors whole.

    name: dotted path; shape: (), (n,) or (n, m); elements: names of its scalars, column after column;
    symbol: its SX; start, min, max: SX expressions of parameters per scalar, or None (no opinion);
    chosen: whether its start is said by whoever uses the model, not by its author; owner: path of the component or
    connector that holds it; undetermined: the likely cause where the equations do not determine it; display: the unit in
    which it is shown, "" for its own.
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
    chosen: bool = False
    min: tuple[ca.SX, ...] | None = None
    max: tuple[ca.SX, ...] | None = None
    nominal: tuple[ca.SX, ...] | None = None
    prefer: StateSelect = StateSelect.DEFAULT
    owner: str = ""
    free: bool = False
    undetermined: str = ""
    display: str = ""


@dataclass(frozen=True, eq=False)
class FlatParameter(FlatVariable):
    """A parameter: `value` holds one SX per scalar, a number or an expression of other parameters.

    fold: its value shapes the equations and is folded in at translation; final: no other value may be given; assumed: what
    is said of the value if it is the one of the declaration, which nobody gave.
    """

    value: tuple[ca.SX, ...] = ()
    fold: bool = False
    final: bool = False
    assumed: str = ""


@dataclass(frozen=True, eq=False)
class Loop:
    """A loop of rigid parts and joints.

    a, b: connectors that coincide where it closes; members: components along it, from a round to b.
    """

    a: str
    b: str
    members: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Sampled:
    """A scalar that takes the value of `expression` at t0 + k * period, k = 0, 1, ..., and is held in between.

    name: of the variable; expression: of its value just before the instant, in its unit, of flat symbols;
    period: s, of parameters; path, model: where it is stated.
    """

    name: str
    expression: ca.SX
    period: ca.SX
    path: str
    model: str

    @property
    def label(self) -> str:
        """Where it is stated, and of what."""
        return f"{place_of(self.path, self.model)}, sampled({self.name})"

    @property
    def sides(self) -> tuple[tuple[str, ca.SX], ...]:
        """Its expressions, each with the name of what it is a value of."""
        return (self.name, self.expression), ("time", self.period)


@dataclass(frozen=True, eq=False)
class SampledLaw:
    """Sampled scalars `found` that take what `law(t, values of given)` returns at their instants, in the place of formulas.

    given: sampled scalars, at the same instants; path, model: where it is stated.
    """

    found: tuple[str, ...]
    given: tuple[str, ...]
    law: Callable[[float, np.ndarray], Sequence[float]]
    path: str
    model: str

    @property
    def label(self) -> str:
        """Where it is stated, and of what."""
        return f"{place_of(self.path, self.model)}, by_law({', '.join(self.found)})"

    def obeyed(self, t: float, held: Sequence[str], due: np.ndarray, new: np.ndarray) -> None:
        """Put its values among the new ones (n,) of `held`, if they are due at time t."""
        found, given = ([held.index(name) for name in names] for names in (self.found, self.given))
        if due[found].all():
            new[found] = self.law(t, new[given])


@dataclass(frozen=True, eq=False)
class StickSlip:
    """Friction: force = mode * coulomb + smooth, mode the sign of the speed; at rest what holds it there.

    force, speed: names of scalar variables; coulomb, smooth, breakaway: in the unit of the force, of flat
    symbols; the speed stays zero while |force| <= breakaway; path, model: where it is stated.
    """

    force: str
    speed: str
    coulomb: ca.SX
    smooth: ca.SX
    breakaway: ca.SX
    path: str
    model: str

    @property
    def label(self) -> str:
        """Where it is stated, and of what."""
        return f"{place_of(self.path, self.model)}, stick_slip({self.force})"

    @property
    def sides(self) -> tuple[tuple[str, ca.SX], ...]:
        """Its expressions, all of them forces."""
        return tuple((self.force, part) for part in (self.coulomb, self.smooth, self.breakaway))


@dataclass(frozen=True, eq=False)
class When:
    """What happens at the instants at which `condition` becomes true, if nothing before it in its chain does.

    reinits: states and their new values; assignments: Discretes and theirs; all in flat symbols, which stand for values
    just before, but those of Discretes for new ones (`FlatModel.before` are the old ones); message: of terminate, "" if the
    run goes on; path, model, number: where it is stated; after: place in `FlatModel.whens` of the one before it in its
    chain, -1 if it is the first; words: what it is, where its condition does not say it; initially: whether it acts at the
    start if its condition holds there; failure: words of the error that ends the run where it would act, "" if it acts;
    waits: whether it acts only in rounds in which no when does that does not wait.
    """

    condition: ca.SX
    reinits: tuple[tuple[str, ca.SX], ...]
    assignments: tuple[tuple[str, ca.SX], ...]
    message: str
    path: str
    model: str
    number: int
    after: int = -1
    words: str = ""
    initially: bool = False
    failure: str = ""
    waits: bool = False

    @property
    def label(self) -> str:
        """Where it is stated, and on what condition."""
        words = str(self.condition)
        when = f"when({words if len(words) <= 60 else words[:57] + '...'})"
        return f"{place_of(self.path, self.model, self.number)}, {self.words or when}"

    @property
    def sides(self) -> tuple[tuple[str, ca.SX], ...]:
        """Its condition, which is a value of nothing, and the new values by name."""
        return ("", self.condition), *self.reinits, *self.assignments


@dataclass(frozen=True, eq=False)
class Delay:
    """A scalar that is what an expression was a time ago, and before that what it is at the start.

    name: of the variable; expression: of flat symbols; time: s, of parameters.
    """

    name: str
    expression: ca.SX
    time: ca.SX
    path = model = ""

    @property
    def label(self) -> str:
        """Its name, which says it."""
        return self.name

    @property
    def sides(self) -> tuple[tuple[str, ca.SX], ...]:
        """Its expressions, each with the name of what it is a value of."""
        return (self.name, self.expression), ("time", self.time)


OnInstants = Sampled | StickSlip | When | Delay


@dataclass(frozen=True, eq=False)
class FlatModel(Record):
    """A model written out: variables, parameters and scalar equations between their symbols.

    derivatives: symbols of derivatives by name, `der(x)`; propagated: quantities, such as orientations, that
    are no unknowns but `definitions`: expressions, by scalar name, of variables and of definitions before
    them; rates: time derivatives of some of them; loops: of rigid parts and joints; inputs: names of the
    scalars known from outside; absent: declared names that this model has no use for, and why;
    requirements: conditions on parameters; sampled, discretes, frictions: scalars that are set at instants, no unknowns
    either, discretes by `whens`; slips: frictions whose forces are unknowns and whose modes are the last of the discretes,
    as simulations have them; before: symbols of the values of discretes just before an instant, by their names;
    modes: names of the values 0, 1, ... of a discrete, by its name; delays: scalars that are known from the past;
    ranges: where tables end that are not defined beyond; laws: functions of Python that set sampled scalars;
    rods: what a robot says of its links, by name; shapes: what its components look like, by names; unchecked: paths of
    components whose units are words only; experiment: what the model says of its simulation, `StopTime`.
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
    absent: Mapping[str, str]
    requirements: tuple[Requirement, ...]
    sampled: tuple[Sampled, ...] = ()
    laws: tuple[SampledLaw, ...] = ()
    frictions: tuple[StickSlip, ...] = ()
    slips: tuple[StickSlip, ...] = ()
    whens: tuple[When, ...] = ()
    discretes: tuple[str, ...] = ()
    before: Mapping[str, ca.SX] = field(default_factory=dict)
    delays: tuple[Delay, ...] = ()
    ranges: tuple[Range, ...] = ()
    modes: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    rods: Rods | None = None
    shapes: tuple[Shape, ...] = ()
    unchecked: frozenset[str] = frozenset()
    experiment: Mapping[str, float] = field(default_factory=dict)

    @cached_property
    def vectors(self) -> Mapping[str, FlatVariable]:
        """Variables, parameters and propagated quantities by their whole names."""
        return {v.name: v for v in (*self.variables, *self.parameters, *self.propagated)}

    @cached_property
    def scalars(self) -> frozenset[str]:
        """Names of all scalars, time among them."""
        return frozenset(n for v in self.vectors.values() for n in v.elements) | {self.time.name()}

    def find(self, name: str) -> FlatVariable | None:
        """The variable, parameter or propagated quantity of that name."""
        return self.vectors.get(name)

    def expand(self, name: str) -> tuple[str, ...]:
        """The scalar names of `name` (a scalar, a vector, or a derivative of one); ModelError if unknown."""
        base, order = split_derivative(name)
        if base in self.vectors:
            return tuple(derivative_name(n, order) for n in self.vectors[base].elements)
        if base in self.scalars:
            return (name,)
        if base in self.absent:
            raise ModelError(f"{self.name}: {base} does not exist: {self.absent[base]}")
        known = dict.fromkeys(n for v in self.vectors.values() for n in (v.name, *v.elements))
        raise ModelError(f"{self.name} has no variable or parameter '{name}'{did_you_mean(base, known)}")

    def refuse_twice(self, place: str, names: Iterable[str]) -> None:
        """ModelError where several of these names give one scalar, as a vector and an element of it do."""
        owners: dict[str, str] = {}
        for name in names:
            for scalar in self.expand(name):
                if owners.setdefault(scalar, name) != name:
                    raise ModelError(
                        f"{place}: found {owners[scalar]} and {name}, which both give {scalar}, expected one value for it; "
                        "leave one of them out",
                    )

    def unit(self, name: str) -> str | None:
        """The unit of what `expand` lists, None where none is declared."""
        base, order = split_derivative(name)
        if base == self.time.name():
            return "s"
        unit = self._units.get(base)
        return per_second(unit, order) if unit else None

    @cached_property
    def _units(self) -> Mapping[str, str | None]:
        return {n: v.unit for v in self.vectors.values() for n in (v.name, *v.elements)}

    def shape(self, name: str) -> tuple[int, ...]:
        """Shape of what `expand` lists: of a whole quantity or a derivative of it, () of a scalar."""
        whole = self.vectors.get(split_derivative(name).root)
        return whole.shape if whole else ()

    @cached_property
    def hints(self) -> Mapping[str, str]:
        """Scalar name -> the likely cause where the equations do not determine it."""
        told = (v for v in (*self.variables, *self.propagated) if v.undetermined)
        return {name: v.undetermined for v in told for name in v.elements}

    @cached_property
    def friction_modes(self) -> tuple[str, ...]:
        """The modes of frictions that stick, 1, -1, or 0 where they do, as results call them: `mode`, where that is free."""
        parts = [f.force.rpartition(".") for f in self.frictions]
        plain = [f"{owner}{dot}mode" for owner, dot, _ in parts]
        taken = {*self.scalars, *(name for name in plain if plain.count(name) > 1)}
        pairs = zip(plain, parts, strict=True)
        return tuple(f"{name}_{own}" if name in taken else name for name, (_, _, own) in pairs)

    @property
    def event_names(self) -> tuple[str, ...]:
        """Scalars that are set at instants: sampled variables, Discretes, forces of friction that sticks, delayed ones."""
        instants = (*(s.name for s in self.sampled), *self.discretes, *(f.force for f in self.frictions))
        return (*instants, *(d.name for d in self.delays))
