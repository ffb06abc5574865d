"""The variables of an FMU, made of the formulas of a model: who they are to the outside and to the runtime."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.dimensions import per_second
from gantrytau.flattening.flat_model import FlatVariable
from gantrytau.language.symbols import split_derivative
from gantrytau_fmu.code.arrays import numbers_of
from gantrytau_fmu.code.dependencies import Dependencies
from gantrytau_fmu.code.formulas import Formulas
from gantrytau_fmu.code.model_graph import ModelGraph
from gantrytau_fmu.description import FmuTerminal, FmuVariable, ModelStructure, Unknown


@dataclass(frozen=True)
class Entry:
    """A row of the table of variables: kind as in core.h, without GT_; index within the kind."""

    kind: str
    index: int
    fixed: bool
    name: str


@dataclass(frozen=True, eq=False)
class Contents:
    """Variables and model structure of an FMU (see FmuDescription), and the tables of the runtime, in the same order."""

    variables: tuple[FmuVariable, ...]
    entries: tuple[Entry, ...]
    constants: tuple[float, ...]
    nominals: tuple[float, ...]
    z_nominals: tuple[float, ...]
    structure: ModelStructure
    terminals: tuple[FmuTerminal, ...]

    def renamed(self, names: Mapping[str, str], units: Mapping[str, str]) -> "Contents":
        """The same with other names of variables, and with units by these."""

        def known(unknown: Unknown) -> Unknown:
            on = unknown.dependencies and tuple(names.get(n, n) for n in unknown.dependencies)
            return replace(unknown, name=names.get(unknown.name, unknown.name), dependencies=on)

        structure = ModelStructure(
            *(tuple(map(known, part)) for part in (self.structure.outputs, self.structure.derivatives)),
            initial_unknowns=tuple(map(known, self.structure.initial_unknowns)),
        )
        return replace(
            self,
            variables=tuple(
                replace(v, name=names[v.name], unit=units.get(names[v.name], "")) if v.name in names else v
                for v in self.variables
            ),
            entries=tuple(replace(e, name=names.get(e.name, e.name)) for e in self.entries),
            structure=structure,
            terminals=(),
        )

    @property
    def limited(self) -> tuple[FmuVariable, ...]:
        """The variables with a min or max."""
        return tuple(v for v in self.variables if v.min is not None or v.max is not None)


def fmi_name(name: str) -> str:
    """`der(der(x))` is `der(x,2)` in the structured naming convention (FMI 3.0.2, section 2.4.7.5.1)."""
    base, order = split_derivative(name)
    return name if order < 2 else f"der({base},{order})"


@dataclass(eq=False)
class _Listed:
    """The variables while they are collected; places: of outputs among those that differ."""

    formulas: Formulas
    places: Mapping[str, int]
    outputs: frozenset[str]
    variables: list[FmuVariable] = field(default_factory=list)
    entries: list[Entry] = field(default_factory=list)
    constants: list[float] = field(default_factory=list)
    places_of: dict[str, int] = field(default_factory=dict)
    rates: list[int] = field(default_factory=list)  # references of the derivatives of the states

    def __post_init__(self) -> None:
        self.dae = self.formulas.dae
        flat = self.dae.flat
        everything = (*flat.parameters, *flat.variables, *flat.propagated)
        self.declared = {n: (v, k) for v in everything for k, n in enumerate(v.elements)}
        self.taken: set[str] = set()

    def add(
        self, name: str, kind: str, index: int, *, fixed: bool = False, limited: bool = False, **more: Any
    ) -> int:
        """A variable of the model by its name there; limited: with the limits that its declaration gives."""
        base, order = split_derivative(name)
        declaration, place = self.declared.get(base, (None, 0))
        reference = len(self.variables)
        unit, words, display = "", "", ""
        if declaration is not None:
            unit, words, display = declaration.unit or "", declaration.description, declaration.display
            if order:
                unit, display = per_second(unit, order), per_second(display, order)
                words = (
                    f"{'second ' if order == 2 else ''}time derivative of {base}"
                    if order < 3
                    else f"time derivative {order} of {base}"
                )
            elif limited:
                more = {**self.limits(declaration, place), **more}
        more.setdefault("unit", unit)
        more.setdefault("display", display if more["unit"] == unit else "")
        more.setdefault("description", words)
        found, width = fmi_name(name), int(order > 1)
        if name in self.formulas.delays:
            found = f"'{name}'"  # no structured name by itself
        # a state may be the derivative of another: der(x), der(x,1), and der(x,2), der(x,02)
        while found in self.taken:
            width += 1
            found = f"der({base},{order:0{width}})" if order else found + "_"
        self.taken.add(found)
        self.variables.append(FmuVariable(name=found, reference=reference, **more))
        self.entries.append(Entry(kind, index, fixed, found))
        self.places_of.setdefault(name, reference)
        return reference

    def causality(self, name: str) -> str:
        """Output or local."""
        return "output" if name in self.outputs else "local"

    def limits(self, declaration: FlatVariable, place: int) -> dict[str, float]:
        """min, max and nominal as numbers, where they are declared and finite."""
        found = {}
        for word in ("min", "max", "nominal"):
            values = getattr(declaration, word)
            if values is not None:
                number = self.dae.number(values[place])
                if np.isfinite(number) and (word != "nominal" or number > 0):
                    found[word] = number
        return found


def contents_of(model: ModelGraph, outputs: Sequence[str], others: Sequence[str] = ()) -> Contents:
    """What an FMU of a model holds; scalar names of its outputs, and of what else can be read from it."""
    formulas = model.formulas
    listed = _Listed(formulas, model.places, frozenset(outputs))
    listed.add(
        "time", "TIME", 0, causality="independent", variability="continuous", unit="s", description="time"
    )
    _parameters(listed)
    _inputs(listed)
    _states(listed)
    _outputs(listed, [*outputs, *others])
    indicators = (*_frictions(listed), *_switches(listed))
    return Contents(
        variables=tuple(listed.variables),
        entries=tuple(listed.entries),
        constants=tuple(listed.constants),
        nominals=tuple(_nominal(listed, n) for n in formulas.states),
        z_nominals=tuple(1.0 if n.startswith("der(") else _nominal(listed, n) for n in formulas.z_names),
        structure=_structure(listed, Dependencies(formulas, model.outputs), outputs, indicators),
        terminals=_terminals(listed),
    )


def _nominal(listed: _Listed, name: str) -> float:
    declaration, place = listed.declared.get(split_derivative(name)[0], (None, 0))
    return listed.limits(declaration, place).get("nominal", 1.0) if declaration is not None else 1.0


def _parameters(listed: _Listed) -> None:
    table, formulas = listed.dae.table, listed.formulas
    early = formulas.start_parameters
    for place, name in enumerate(table.independent):
        fixed = name in early
        listed.add(
            name,
            "PARAMETER",
            place,
            fixed=fixed,
            limited=True,
            causality="parameter",
            variability="fixed" if fixed else "tunable",
            initial="exact",
            start=table.values[name],
        )
    for name, expression in table.expressions.items():
        if expression.is_constant():
            _constant(listed, name, table.values[name], "local")
            continue
        tunable = any(s.name() not in early for s in ca.symvar(expression))
        more: dict[str, Any] = dict(variability="tunable" if tunable else "fixed", initial="calculated")
        listed.add(name, "OUTPUT", listed.places[name], causality="local", **more)


def _constant(listed: _Listed, name: str, value: float, causality: str) -> None:
    more: dict[str, Any] = dict(causality=causality, variability="constant", initial="exact", start=value)
    listed.add(name, "CONSTANT", len(listed.constants), **more)
    listed.constants.append(value)


def _inputs(listed: _Listed) -> None:
    start = numbers_of(listed.dae, listed.formulas.arrays)["u"]
    for place, name in enumerate(listed.formulas.inputs):
        listed.add(
            name,
            "INPUT",
            place,
            limited=True,
            causality="input",
            variability="continuous",
            initial="exact",
            start=float(start[place]),
        )


def _states(listed: _Listed) -> None:
    formulas = listed.formulas
    starts = numbers_of(listed.dae, formulas.arrays)["x"]
    references = []
    for place, name in enumerate(formulas.states):
        solved = place in formulas.starts.solved
        more: dict[str, Any] = {} if solved else dict(start=float(starts[place]))
        references.append(
            listed.add(
                name,
                "STATE",
                place,
                fixed=solved,
                limited=True,
                causality=listed.causality(name),
                variability="continuous",
                initial="calculated" if solved else "exact",
                **more,
            )
        )
    for place, name in enumerate(formulas.states):
        rate = f"der({name})"
        own = rate not in listed.places_of  # else a state of that name is shown
        listed.rates.append(
            listed.add(
                rate,
                "DERIVATIVE",
                place,
                causality=listed.causality(rate) if own else "local",
                variability="continuous",
                initial="calculated",
                derivative=listed.variables[references[place]].name,
            )
        )


def _outputs(listed: _Listed, names: Sequence[str]) -> None:
    """What is computed, shown as output or not."""
    formulas, dae = listed.formulas, listed.dae
    held = (*formulas.held, *formulas.discretes)
    for place, name in enumerate(held):
        more: dict[str, Any] = dict(
            causality=listed.causality(name), variability="discrete", initial="calculated"
        )
        listed.add(name, "HELD", len(formulas.inputs) + place, **more)
    for name in names:
        if name in listed.places_of:
            continue
        expression = dae.expression(name)
        if expression.is_constant():
            _constant(listed, name, float(expression), listed.causality(name))
            continue
        leaves = {leaf.name() for leaf in ca.symvar(formulas.outputs[name])}
        steps = leaves <= {*held, *formulas.parameters} and leaves & set(held)
        variability = "discrete" if steps else "continuous"
        more = dict(causality=listed.causality(name), variability=variability, initial="calculated")
        listed.add(name, "OUTPUT", listed.places[name], limited=True, **more)
        listed.places_of[name] = len(listed.variables) - 1


def _frictions(listed: _Listed) -> tuple[str, ...]:
    """Mode and event indicator of each friction with exact stick-slip; names of the indicators."""
    indicators = []
    modes = listed.formulas.dae.flat.friction_modes
    for place, (name, mode) in enumerate(zip(listed.formulas.frictions, modes, strict=True)):
        owner, dot, _ = name.rpartition(".")
        indicator = f"{owner}{dot}indicator" + mode[len(f"{owner}{dot}mode") :]
        words = f"{owner or name}: 1 slides forward, -1 slides backward, 0 sticks"
        more: dict[str, Any] = dict(
            causality="local", variability="discrete", initial="calculated", type="Int32"
        )
        listed.add(mode, "MODE", place, unit="", description=words, **more)
        words = f"{owner or name}: an event where it falls through zero"
        more = dict(causality="local", variability="continuous", initial="calculated")
        reference = listed.add(indicator, "INDICATOR", place, unit="", description=words, **more)
        indicators.append(listed.variables[reference].name)
    return tuple(indicators)


def _switches(listed: _Listed) -> tuple[str, ...]:
    """Event indicators of what switches: how far each condition is from its next turn; two of what counts."""
    turns, conditions = listed.formulas.switching.turns, listed.formulas.switching.conditions
    gaps = [*conditions, *(c for turn, c in zip(turns, conditions, strict=True) if turn.counts)]
    indicators = []
    for place, condition in enumerate(gaps):
        words = f"how far {condition} is from its next turn: an event where it falls through zero"
        more: dict[str, Any] = dict(causality="local", variability="continuous", initial="calculated")
        index = len(listed.formulas.frictions) + place
        reference = listed.add(f"margins[{place}]", "INDICATOR", index, unit="", description=words, **more)
        indicators.append(listed.variables[reference].name)
    return tuple(indicators)


def _terminals(listed: _Listed) -> tuple[FmuTerminal, ...]:
    """Components that have inputs, each with its own inputs and outputs by their names there."""
    found: dict[str, dict[str, str]] = {}
    owners = {n.rpartition(".")[0] for n in listed.formulas.inputs if not n.startswith("der(")}
    for variable in listed.variables:
        owner, _, member = variable.name.rpartition(".")
        if owner in owners and owner and variable.causality in ("input", "output"):
            found.setdefault(owner, {})[member] = variable.name
    return tuple(FmuTerminal(owner, members) for owner, members in found.items())


def _row(listed: _Listed, depends: Dependencies, name: str) -> np.ndarray:
    """What an output depends on."""
    formulas, entry = listed.formulas, listed.entries[listed.places_of[name]]
    if entry.kind == "OUTPUT":
        return depends.outputs[entry.index]
    if entry.kind == "DERIVATIVE":
        return depends.rates[entry.index]
    if entry.kind == "HELD":
        return depends.samples[entry.index - len(formulas.inputs)]
    row = np.zeros(depends.outputs.shape[1], dtype=bool)
    if entry.kind == "STATE":
        row[1 + entry.index] = True
    return row


def _structure(
    listed: _Listed, depends: Dependencies, outputs: Sequence[str], indicators: tuple[str, ...]
) -> ModelStructure:
    """Outputs, derivatives and initial unknowns, each with what it depends on."""
    formulas, found, variables = listed.formulas, listed.places_of, listed.variables
    names = ("time", *formulas.states, *formulas.inputs, *formulas.parameters)
    references = np.array([found[n] for n in names], dtype=int)
    solved = {formulas.states[k] for k in formulas.starts.solved}
    first = np.array([n not in solved for n in names], dtype=bool)
    shown = [n for n in outputs if variables[found[n]].causality == "output"]
    by_output = {found[n]: _row(listed, depends, n) for n in shown}
    rates = dict(zip(listed.rates, depends.rates, strict=True))

    def unknown(reference: int, chosen: np.ndarray) -> Unknown:
        known = sorted(references[np.flatnonzero(chosen)].tolist())
        return Unknown(variables[reference].name, tuple(variables[k].name for k in known))

    # what initial equations determine depends on all that they may hold
    # and what is delayed begins as what it looks back at
    entries = listed.entries
    late = {r for r, is_late in zip(listed.rates, depends.delayed_rates, strict=True) if is_late}
    late |= {
        r for r in by_output if entries[r].kind == "OUTPUT" and depends.delayed_outputs[entries[r].index]
    }
    late |= {
        r for r in by_output if entries[r].kind == "DERIVATIVE" and depends.delayed_rates[entries[r].index]
    }
    at_start = {
        r: (row | first) if r in late or (row & ~first).any() else row & first
        for r, row in {**by_output, **rates}.items()
    }
    at_start |= {found[n]: first for n in solved}
    calculated = [r for r in at_start if variables[r].initial == "calculated"]
    return ModelStructure(
        outputs=tuple(unknown(r, row) for r, row in by_output.items()),
        derivatives=tuple(unknown(r, row) for r, row in rates.items()),
        initial_unknowns=tuple(unknown(r, at_start[r] & first) for r in sorted(calculated)),
        indicators=indicators,
    )
