"""What every row and every unknown of a program is: words of the model, time, unit and typical size."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.simulation.to_result import labels
from gantrytau_optimica.control.built import Built
from gantrytau_optimica.control.control_problem import Phase
from gantrytau_optimica.transcription.program import Program, RowGroup
from gantrytau_optimica.transcription.trajectory import Trajectory

MEANING = {
    "dynamics": "the motion of {}",
    "algebraic": "{}",
    "continuity": "the continuity of {}",
    "path": "`{}`",
    "boundary": "`{}`",
    "step": "the largest step of {}",
    "border": "{}",
}


@dataclass(frozen=True)
class Meaning:
    """What a row or unknown is; time in s, None where it has none; size: what 1 in the program is in `unit`."""

    words: str
    time: float | None
    unit: str
    size: float

    @property
    def when(self) -> str:
        """` at t = 0.41 s`, or nothing."""
        return "" if self.time is None else f" at t = {self.time:.4g} s"


@dataclass(frozen=True, eq=False)
class Meanings:
    """Words for the rows and unknowns of a program; `phases`: the trajectories that say when their places are."""

    built: Built
    program: Program
    phases: Sequence[Trajectory]

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Units of signals and numbers by name, and of limits on one of them by their text."""
        read = self.built.read
        found = dict(labels(read.dae)[0])
        for parameter in read.dae.flat.parameters:
            found.update(dict.fromkeys(parameter.elements, parameter.unit or ""))
        meaning = {
            s.element_hash(): e
            for p in self.built.points
            for s, e in zip(p.symbol.elements(), p.expression.elements(), strict=True)
        }
        for constraint in self.built.constraints:
            value = meaning.get(constraint.expression.element_hash(), constraint.expression)
            if value.is_symbolic() and value.name() in found:
                found[constraint.name] = found[value.name()]
        return {name: "" if unit == "1" else unit for name, unit in found.items()}

    def group(self, group: RowGroup, which: int) -> Meaning:
        """The row `which` of a group."""
        moment = group.moments[which]
        time = None if np.isnan(moment) else float(self.phases[group.phase].times(moment))
        name = group.name.removesuffix(",") if group.kind == "algebraic" else group.name
        return Meaning(MEANING[group.kind].format(name), time, self.units.get(group.name, ""), group.size)

    def row(self, number: int) -> Meaning:
        """A row of the program."""
        group = self.program.groups[self.program.kinds[number]]
        return self.group(group, int(np.flatnonzero(group.rows == number)[0]))

    def unknown(self, number: int) -> Meaning:
        """An unknown of the program."""
        places = self.program.places
        size = float(places.scale[number])
        if number < places.free.size:
            name = self.program.problem.free[number].name
            return Meaning(name, None, self.units.get(name, ""), size)
        phase = next(k for k, one in enumerate(places.layouts) if number < one.first + one.size)
        layout = places.layouts[phase]
        owner, moment = layout.owner[number - layout.first], layout.moment[number - layout.first]
        time = float(self.phases[phase].times(moment))
        if owner < 0:
            return Meaning("a border of the mesh", time, "", size)
        name = layout.phase.signals[owner].name
        return Meaning(signal_words(layout.phase, owner), time, self.units.get(name, ""), size)


def signal_words(phase: Phase, number: int) -> str:
    """What the model calls a signal; a square root that only the optimiser knows is told by its equation."""
    signal = phase.signals[number]
    k = number - len(phase.states)
    if signal.name.startswith("sqrt(") and 0 <= k < len(phase.algebraics):
        return f"the root in {phase.residual_names[k].removesuffix(',')}"
    return signal.name


def intervals(reached: np.ndarray, times: np.ndarray) -> str:
    """The stretches of time in which something is reached: 'from t = 0.1 s to 0.3 s'."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], reached.astype(int), [0]])))
    spans = [(times[a], times[b - 1]) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    words = [f"at t = {a:.4g} s" if a == b else f"from t = {a:.4g} s to {b:.4g} s" for a, b in spans[:4]]
    return ", ".join(words) + (f" and {len(spans) - 4} more times" if len(spans) > 4 else "")


def row_sizes(program: Program, w: np.ndarray) -> np.ndarray:
    """How much each row changes when its most telling unknown changes by its typical size, (rows,); 1 where unknown."""
    _, jacobian = program.assembled.jac_g(w / program.places.scale, ca.DM(0, 1))
    row, _ = (np.array(part, dtype=int) for part in jacobian.sparsity().get_triplet())
    value = np.abs(np.array(jacobian.nonzeros()))
    found = np.zeros(program.assembled.rows)
    np.maximum.at(found, row, np.where(np.isfinite(value), value, 0.0))
    return np.where(found > 0, found, 1.0)
