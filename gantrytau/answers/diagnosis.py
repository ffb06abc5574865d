"""Findings of translation about a model, in words: `check(model)` and `dae.diagnosis`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import casadi as ca

from gantrytau.answers.other_assemblies import Assembly, assemblies
from gantrytau.border.refusal import InitializationError, StructureError
from gantrytau.compiler.request import Request
from gantrytau.compiler.symbol_spaces import values_at
from gantrytau.compiler.translated import Translated
from gantrytau.compiler.translation import translate_flat
from gantrytau.describing.record import Record
from gantrytau.flattening.check_units import check_units
from gantrytau.flattening.flat_model import FlatModel, Loop, When
from gantrytau.flattening.flatten import flatten
from gantrytau.language.model import Model
from gantrytau.progress import timed

LISTED = 8  # items of a list that are printed
POOR = 1e4  # condition of the choice of states from which it deserves a remark
FAR = 1e-6  # how far a start value moves, relative to the sizes there are, before that is worth a line


@dataclass(frozen=True)
class Moved:
    """A start value that could not be kept: what was asked for, and what is consistent with the others."""

    name: str
    asked: float
    found: float


@dataclass(frozen=True)
class Diagnosis(Record):
    """Structure of a model, found by translation: sizes, loops, states and their conditioning, blocks, start. Prints itself.

    mobility: degrees of freedom of the positions; redundant: equations that repeat others; assumed: parameters without a
    given value, with the value assumed; moved: start values that were moved, the farthest first; assemblies: the assembly
    taken, and others at the same states; ambiguous: unknowns of switching equations with several solutions at the start,
    of which the nearest is taken; conditions: conditions of whens with their actions; missing: the fault that prevents
    translation, else ""; timing: seconds of the processor by stage of translation, of `check`.
    """

    model: str
    unknowns: int
    equations: int
    aliases: int = 0
    differentiated: int = 0
    mobility: int | None = None
    redundant: tuple[str, ...] = ()
    loops: tuple[Loop, ...] = ()
    states: tuple[str, ...] = ()
    condition: float = 1.0
    blocks: tuple[tuple[str, int, int], ...] = ()  # kind, unknowns, torn unknowns
    assumed: tuple[str, ...] = ()
    moved: tuple[Moved, ...] = ()
    assemblies: tuple[Assembly, ...] = ()
    ambiguous: tuple[str, ...] = ()
    conditions: tuple[str, ...] = ()
    missing: str = ""
    timing: Mapping[str, float] = field(default_factory=dict, compare=False)

    def __str__(self) -> str:
        lines = [f"{self.model}: {self.equations} equations, {self.unknowns} unknowns"]
        lines += [f"  loop from {x.a} to {x.b} through {', '.join(x.members)}" for x in self.loops]
        if self.missing:
            return "\n".join([*lines, f"  cannot be translated: {self.missing}"])
        several = [
            f"{kind} {size}" + (f" -> {torn}" if torn < size else "")
            for kind, size, torn in self.blocks
            if size > 1
        ]
        poor = "; they are nearly dependent here, name others in states=" if self.condition > POOR else ""
        lines += [
            f"  {_counted(self.aliases, 'alias', 'es')} removed, {_counted(self.differentiated, 'equation')} differentiated",
            f"  mobility {self.mobility}",
            *_listed("redundant constraints", self.redundant, always=True),
            f"  states (condition {self.condition:.3g}{poor}): {', '.join(self.states) or 'none'}",
            f"  {_counted(len(self.blocks), 'block')}, of them with several unknowns: {', '.join(several) or 'none'}",
            *_listed("assumed", self.assumed),
            *_listed(
                "start values moved", [f"{m.name} {m.asked:.6g} -> {m.found:.6g}" for m in self.moved], True
            ),
            *(f"  {assembly}" for assembly in self.assemblies),
            *_listed("several solutions at the start, of which the nearest is taken", self.ambiguous),
            *_listed("conditions", self.conditions),
        ]
        return "\n".join(lines)


def _counted(count: int, word: str, ending: str = "s") -> str:
    return f"{count} {word}{'' if count == 1 else ending}"


def _listed(title: str, items: Sequence[str], always: bool = False) -> list[str]:
    """Lines of a list, cut where it is long; always: also of an empty one."""
    if not items:
        return [f"  {title}: none"] if always else []
    more = [f"    and {len(items) - LISTED} others"] if len(items) > LISTED else []
    return [f"  {title}:", *(f"    {item}" for item in items[:LISTED]), *more]


def check(model: Model) -> Diagnosis:
    """Examine a model: do its equations determine its unknowns, how can it move, where does it start?

    The diagnosis of a model that cannot be translated has the reason in `missing`. Raises ModelError for invalid
    declarations.
    """
    flat: FlatModel | None = None
    try:
        with timed("checking") as timing:
            flat = flatten(model)
            check_units(flat)
            translated = translate_flat(flat, Request())
        return replace(diagnose(translated), timing=timing)
    except (StructureError, InitializationError) as error:
        if flat is None:
            cls = model if isinstance(model, type) else type(model)
            return Diagnosis(cls.__name__, 0, 0, missing=str(error))
        unknowns, equations = _sizes(flat, len(flat.inputs) + len(flat.event_names))
        return Diagnosis(flat.name, unknowns, equations, loops=flat.loops, missing=str(error))


def diagnose(dae: Translated) -> Diagnosis:
    """The diagnosis of a translated model."""
    unknowns, equations = _sizes(dae.flat, len(dae.known))
    return Diagnosis(
        model=dae.name,
        unknowns=unknowns,
        equations=equations,
        aliases=equations - len(dae.reduced.residuals),
        differentiated=sum(1 for c in dae.indexed.counts if c),
        mobility=dae.mobility,
        redundant=tuple(e.name for e in (*dae.redundant, *dae.reduced.redundant)),
        loops=dae.flat.loops,
        states=dae.states,
        condition=dae.choice.condition,
        blocks=tuple((b.kind, len(b.unknowns), len(b.tears)) for b in dae.blocks),
        assumed=tuple(f"{p.name}: {p.assumed}" for p in dae.flat.parameters if p.assumed),
        moved=_moved(dae),
        assemblies=assemblies(dae),
        ambiguous=_ambiguous(dae),
        conditions=tuple(_condition(one) for one in dae.flat.whens),
    )


def _sizes(flat: FlatModel, known: int) -> tuple[int, int]:
    return sum(len(v.elements) for v in flat.variables) - known, len(flat.equations)


def _ambiguous(dae: Translated) -> tuple[str, ...]:
    """Unknowns of piecewise equations with several solutions at the start."""
    piecewise = [(block, block.held) for block in dae.blocks if block.held is not None]
    counts = [float(values_at(held, {**dae.start, **dae.table.values})[0, 0]) for _, held in piecewise]
    return tuple(
        f"{', '.join(map(dae.spoken, block.unknowns))} ({count:.0f})"
        for (block, _), count in zip(piecewise, counts, strict=True)
        if count > 1
    )


def _condition(one: When) -> str:
    """A when in words: where it stands, its condition, and what its actions set."""
    done = [f"reinit {n}" for n, _ in one.reinits] + [n for n, _ in one.assignments]
    done += [f"terminate: {one.message}"] if one.message else []
    return f"{one.label}: {', '.join(done)}"


def _moved(dae: Translated) -> tuple[Moved, ...]:
    """Start values that the start does not have, of aliases too; far is relative to the largest of the same unit."""
    started = [v for v in dae.flat.variables if v.start is not None]
    names = [n for v in started for n in v.elements]
    asked = [x for v in started for x in dae.table.numbers(ca.vertcat(*(v.start or ()))).tolist()]
    found = dae.numbers(names, dae.start).tolist() if names else []
    units = [v.unit or v.name for v in started for _ in v.elements]
    sizes: dict[str, float] = {}
    for unit, a, f in zip(units, asked, found, strict=True):
        sizes[unit] = max(sizes.get(unit, 0.0), abs(a), abs(f))
    moved = [
        Moved(n, a, f)
        for n, unit, a, f in zip(names, units, asked, found, strict=True)
        if abs(f - a) > FAR * sizes[unit] and dae.reduced.aliases[n].root not in dae.known
    ]
    return tuple(sorted(moved, key=lambda m: -abs(m.found - m.asked)))
