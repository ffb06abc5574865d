"""The nonlinear program: its functions, the limits of rows and unknowns, and what they mean in the model's words."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import casadi as ca
import numpy as np
from scipy import sparse

from gantrytau_optimica.control.control_problem import ControlProblem
from gantrytau_optimica.transcription.assemble import Assembled, Term
from gantrytau_optimica.transcription.layout import Places
from gantrytau_optimica.transcription.mesh import Mesh
from gantrytau_optimica.transcription.point_functions import Place, places_of_points, share_of, single_term
from gantrytau_optimica.transcription.scheme import Collocation

FEW = 1e-5  # of an element, by which a moving point may stand outside of it
FLAT = 1e-6  # of the gradient beside the guess: that at the guess vanishes by accident
CLOSE = 1e-2  # of its margin: what is closer rests on it


@dataclass(frozen=True, eq=False)
class RowGroup:
    """Rows of the program that mean one thing: kind, name in the model's words, phase, and places on [0, 1] (or NaN).

    size: a row of the program times this is the quantity in its unit.
    """

    kind: str  # "dynamics", "algebraic", "path", "continuity", "step", "border", "boundary"
    name: str
    phase: int
    rows: np.ndarray
    moments: np.ndarray
    lower: float
    upper: float
    size: float = 1.0


@dataclass(frozen=True, eq=False)
class Program:
    """The nonlinear program in scaled unknowns, its limits, and what its rows and unknowns mean."""

    problem: ControlProblem
    places: Places
    assembled: Assembled
    groups: tuple[RowGroup, ...]
    lbw: np.ndarray
    ubw: np.ndarray
    lbg: np.ndarray
    ubg: np.ndarray
    points: tuple[Place, ...] = field(default=())

    @property
    def meshes(self) -> list[Mesh]:
        """The elements of every phase; borders that move as they were guessed."""
        return [layout.mesh for layout in self.places.layouts]

    @property
    def scheme(self) -> Collocation:
        """How it was transcribed."""
        return self.places.layouts[0].scheme

    def with_numbers(self, problem: ControlProblem) -> "Program":
        """The same program with other free numbers, first guesses and margins of square roots."""
        lower, upper, places = self.lbw.copy(), self.ubw.copy(), self.places
        for place, number in zip(places.free, problem.free, strict=True):
            lower[place], upper[place] = number.min / places.scale[place], number.max / places.scale[place]
        for layout, before, phase in zip(places.layouts, self.problem.phases, problem.phases, strict=True):
            for k, (old, new) in enumerate(
                zip(before.algebraics, phase.algebraics, strict=True), len(phase.states)
            ):
                mine = layout.of(k)
                mine = mine[lower[mine] == old.min / places.scale[mine]]  # others have limits of the user
                lower[mine] = new.min / places.scale[mine]
        return replace(self, problem=problem, lbw=lower, ubw=upper)

    @cached_property
    def objective_gradient(self) -> tuple[np.ndarray, np.ndarray]:
        """Finite derivatives of the objective by scaled unknowns at the guess, and those that tell its size."""
        x = first_guess(self) / self.places.scale
        beside = np.clip(x + 0.5 * np.sin(1.0 + 7.3 * np.arange(x.size)), self.lbw, self.ubw)
        at_guess, near = (
            np.abs(found[np.isfinite(found)])
            for found in (np.array(self.assembled.grad_f(w, ca.DM(0, 1))[1]).ravel() for w in (x, beside))
        )
        return at_guess, at_guess if np.sum(at_guess) > FLAT * np.sum(near) else near

    def astray(self, w: np.ndarray) -> bool:
        """Whether a point whose time moves has left the element whose polynomials it reads."""
        moved = [one for one in self.points if one.place is None]
        if not moved:
            return False
        borders = [layout.placed(w).borders for layout in self.places.layouts]
        now = places_of_points(self.places, w[self.places.free], borders, inside_only=False)
        for old, new in zip(self.points, now, strict=True):
            here = borders[old.phase]
            left, right = here[old.element], here[old.element + 1]
            share = self._share(old, w)
            if old.place is None and new.element != old.element and not (
                left - FEW * (right - left) <= share <= right + FEW * (right - left)
            ):  # fmt: skip
                return True
        return False

    def require_points(self, w: np.ndarray) -> None:
        """ModelError if a point whose time moves lies outside of the horizon."""
        if any(one.place is None for one in self.points):
            borders = [layout.placed(w).borders for layout in self.places.layouts]
            places_of_points(self.places, w[self.places.free], borders)

    def _share(self, one: Place, w: np.ndarray) -> float:
        if isinstance(one.point.time, str):
            return float(one.point.time == "final")
        share = share_of(self.problem.phases[one.phase], one.point.time)
        return float(ca.Function("share", [self.problem.numbers], [share])(w[self.places.free]))

    @cached_property
    def kinds(self) -> np.ndarray:
        """Number of its group for every row."""
        found = np.zeros(self.assembled.rows, int)
        for number, group in enumerate(self.groups):
            found[group.rows] = number
        return found


def on_margins(program: Program, w: np.ndarray) -> bool:
    """Whether a square root that is kept off zero rests on its margin at unknowns w (unscaled)."""
    return any(
        root.min > 0 and bool(np.any(w[layout.of(k)] < (1 + CLOSE) * root.min))
        for layout, phase in zip(program.places.layouts, program.problem.phases, strict=True)
        for k, root in enumerate(phase.algebraics, len(phase.states))
    )


def first_guess(program: Program) -> np.ndarray:
    """The guess as unknowns of the program, inside of their bounds."""
    places, problem = program.places, program.problem
    w = np.zeros(places.size)
    w[places.free] = [number.guess for number in problem.free]
    for layout, phase in zip(places.layouts, problem.phases, strict=True):
        w[layout.knots] = layout.mesh.borders[list(layout.mesh.moving)]
        for number, signal in enumerate(phase.signals):
            mine = layout.of(number)
            w[mine] = signal.guess(layout.moment[mine - layout.first])
    return np.clip(w, program.lbw * places.scale, program.ubw * places.scale)


def boundary_part(places: Places, where: Sequence[Place], start: int) -> tuple[list[RowGroup], list[Term]]:
    """The conditions on values at single times, the last rows of every program, from row `start` on."""
    boundary = places.problem.boundary
    rows = start + np.arange(len(boundary))
    never = np.array([np.nan])
    groups = [
        RowGroup("boundary", limit.name, -1, np.array([row]), never, limit.lower, limit.upper, limit.size)
        for row, limit in zip(rows, boundary, strict=True)
    ]
    if not boundary:
        return groups, []
    shape = (start + rows.size, rows.size)
    factor = [1.0 / limit.size for limit in boundary]
    scatter = sparse.csr_matrix((factor, (rows, rows - start)), shape=shape)
    return groups, [single_term(places, where, [limit.expression for limit in boundary], scatter)]


def row_limits(groups: Sequence[RowGroup], total: int) -> tuple[np.ndarray, np.ndarray]:
    """Limits of all rows."""
    lower, upper = np.zeros(total), np.zeros(total)
    for group in groups:
        lower[group.rows], upper[group.rows] = group.lower / group.size, group.upper / group.size
    return lower, upper
