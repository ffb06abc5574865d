"""The small functions of a transcribed problem: what happens at places of a phase, and at single points.

    t = start + share (final - start),  share = left + place (right - left)

left and right are the borders of the element; where they move, they are unknowns beside the signals.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np
from scipy import sparse

from gantrytau import ModelError
from gantrytau.language.piecewise import may_switch
from gantrytau_optimica.control.control_problem import ControlProblem, Course, Phase, PointValue
from gantrytau_optimica.transcription.assemble import Term
from gantrytau_optimica.transcription.layout import Layout, Places, Sparse, polynomials
from gantrytau_optimica.transcription.mesh import Mesh

INSIDE = 1e-9  # share of an element by which a place next to a border keeps to its own side of a jump


def signals(phase: Phase) -> ca.SX:
    """Symbols of all signals, (k,)."""
    return ca.vertcat(ca.SX(0, 1), *(s.symbol for s in phase.signals))


@dataclass(frozen=True, eq=False)
class Running:
    """Symbols with which expressions along a phase are evaluated at places of its elements."""

    places: Places
    layout: Layout
    place: ca.SX
    left: ca.SX  # what the unknowns add to the borders of the element
    right: ca.SX
    ends: ca.SX  # (2,) fixed parts of the borders

    @property
    def width(self) -> ca.SX:
        """Length of the element as a share of the horizon."""
        return self.ends[1] + self.right - self.ends[0] - self.left

    @property
    def horizon(self) -> ca.SX:
        """Length of the phase in s."""
        return self.layout.phase.final_time - self.layout.phase.start_time

    def term(
        self,
        values: ca.SX,
        element: np.ndarray,
        place: np.ndarray,
        scatter: Sparse,
        extra: tuple[Sequence[ca.SX], np.ndarray] | None = None,
    ) -> Term:
        """`values` at places (N,) of elements; extra: symbols (c,) with values (c, N) known there."""
        problem, layout = self.places.problem, self.layout
        values = ca.densify(values)
        if ca.depends_on(values, problem.time):
            inside = INSIDE * (0.5 - self.place) if may_switch(values) else 0.0
            share = self.ends[0] + self.left + (self.place + inside) * self.width
            values = ca.substitute(values, problem.time, layout.phase.start_time + share * self.horizon)
        borders = layout.mesh.shares()[1] if layout.knots.size else layout.mesh.borders
        constants = [self.ends, self.place]
        known = [borders[element][None, :], borders[element + 1][None, :], place[None, :]]
        symbols, courses = self._courses(values, element, place)
        for symbol, value in (
            *zip(symbols, courses, strict=True),
            *(zip(*extra, strict=True) if extra else ()),
        ):
            constants.append(symbol)
            known.append(value[None, :])
        local = [signals(layout.phase), problem.numbers]
        if layout.knots.size:
            local += [self.left, self.right]
        return Term(
            ca.vertcat(*local), ca.SX(0, 1), ca.vertcat(*constants), values, np.vstack(known),
            self.places.gather(layout, element, place), scatter,
        )  # fmt: skip

    def _courses(self, values: ca.SX, element: np.ndarray, place: np.ndarray):
        phase, mesh = self.layout.phase, self.layout.mesh
        wanted = [c for c in phase.courses if ca.depends_on(values, c.symbol)]
        if not wanted:
            return [], []
        start, final = _fixed_horizon(self.places, phase, wanted[0], moves=bool(mesh.moving))
        share = mesh.borders[element] + place * mesh.widths[element]
        inside = INSIDE * mesh.widths[element] * (0.5 - place)
        times = start + (final - start) * (share + inside)
        return [c.symbol for c in wanted], [c.value(times) for c in wanted]


def running(places: Places, layout: Layout) -> Running:
    """Symbols for one phase."""
    moving = layout.knots.size > 0
    left, right = (ca.SX.sym(n) if moving else ca.SX(0) for n in ("left", "right"))
    return Running(places, layout, ca.SX.sym("place"), left, right, ca.SX.sym("ends", 2))


def _fixed_horizon(places: Places, phase: Phase, course: Course, moves: bool) -> tuple[float, float]:
    """Start and end of a phase in s. ModelError where they, or a place in it, change: samples have fixed times."""
    if moves or not (phase.start_time.is_constant() and phase.final_time.is_constant()):
        raise ModelError(
            f"{places.problem.name}: {course.name} is known by samples, which needs fixed times; give start_time and "
            "final_time as numbers, or the course as a function of time"
        )
    return float(phase.start_time), float(phase.final_time)


@dataclass(frozen=True, eq=False)
class Place:
    """Where a point lies: number of its phase and element, and the place in it; None: it moves with free numbers."""

    point: PointValue
    phase: int
    element: int
    place: float | None


def share_of(phase: Phase, time: ca.SX) -> ca.SX:
    """A time as share of the horizon."""
    return (time - phase.start_time) / (phase.final_time - phase.start_time)


def fixed_share(problem: ControlProblem, phase: Phase, time: ca.SX, free: np.ndarray) -> tuple[float, bool]:
    """A time as share of the horizon for these free numbers, and whether it is the same for all others."""
    evaluate = ca.Function("share", [problem.numbers], [share_of(phase, time)])
    value = float(evaluate(free))
    random = np.random.default_rng(1)
    others = (
        free * random.uniform(0.5, 1.5, free.size) + random.uniform(0.1, 0.9, free.size) for _ in range(3)
    )
    return value, all(abs(float(evaluate(other)) - value) <= 1e-12 for other in others)


def places_of_points(
    places: Places, free: np.ndarray, borders: Sequence[np.ndarray], inside_only: bool = True
) -> list[Place]:
    """Where all points lie for these free numbers and borders of elements, by phase.

    Raises ModelError for points outside of the horizon; those that move stay at its end if not inside_only.
    """
    problem, found = places.problem, []
    for number, (layout, here) in enumerate(zip(places.layouts, borders, strict=True)):
        for point in layout.phase.points:
            if isinstance(point.time, str):
                value, fixed = float(point.time == "final"), True
            else:
                value, fixed = fixed_share(problem, layout.phase, point.time, free)
            if not inside_only and not fixed:
                value = min(max(value, 0.0), 1.0)
            if not -1e-6 <= value <= 1 + 1e-6:
                ends = ca.vertcat(layout.phase.start_time, layout.phase.final_time)
                leaves = {leaf.element_hash() for leaf in ca.symvar(ends)}
                numbers = [(n.name, x) for n, x in zip(problem.free, free, strict=True)
                           if n.symbol.element_hash() in leaves and not n.held]  # fmt: skip
                here = ", ".join(f"{name} = {x:.6g}" for name, x in numbers)
                raise ModelError(
                    f"{problem.name}: at({point.time}, ...): lies outside of the horizon, at {value:.6g} of its length"
                    + (
                        f" with the guess {here}; guess it so that the time lies inside, as the first number of Free(...)"
                        if numbers and not fixed
                        else "; choose a time inside of it"
                    )
                )
            (element,), (inside,) = Mesh(here).locate(np.array([value]))
            fixed = fixed and (not layout.knots.size or min(value, 1 - value) < 1e-12)
            found.append(Place(point, number, int(element), float(inside) if fixed else None))
    return found


def single_term(
    places: Places, where: Sequence[Place], expressions: Sequence[ca.SX], scatter: Sparse
) -> Term:
    """Expressions of points and free numbers, once."""
    problem = places.problem
    column = ca.vertcat(*expressions)
    wanted = {leaf.element_hash() for leaf in ca.symvar(column)}
    local, gather = [problem.numbers], [places.numbers()]
    old, new = [], []
    for one in where:
        if not any(element.element_hash() in wanted for element in one.point.symbol.elements()):
            continue
        layout = places.layouts[one.phase]
        if one.place is None:
            here, symbols, matrix, time = _moving(places, layout, one)
        else:
            here, symbols, matrix, time = _fixed(places, layout, one)
        local.append(symbols)
        gather.append(matrix)
        value = one.point.expression
        if ca.depends_on(value, problem.time):
            value = ca.substitute(value, problem.time, time)
        old.append(one.point.symbol)
        value = _with_courses(places, layout, one, value)
        new.append(ca.substitute(value, signals(layout.phase), here))
    if old:
        column = ca.substitute(column, ca.vertcat(*old), ca.vertcat(*new))
    matrix = sparse.vstack(gather).tocsr()
    return Term(
        ca.vertcat(*local), ca.SX(0, 1), ca.SX(0, 1), ca.densify(column), np.zeros((0, 1)), matrix, scatter
    )


def _with_courses(places: Places, layout: Layout, one: Place, value: ca.SX) -> ca.SX:
    """The expression with inputs known by samples as numbers."""
    wanted = [c for c in layout.phase.courses if ca.depends_on(value, c.symbol)]
    if not wanted:
        return value
    phase = layout.phase
    start, final = _fixed_horizon(places, phase, wanted[0], moves=one.place is None)
    borders = layout.mesh.borders[one.element : one.element + 2]
    time = np.array([start + (borders[0] + (one.place or 0.0) * (borders[1] - borders[0])) * (final - start)])
    return ca.substitute(
        value, ca.vertcat(*(c.symbol for c in wanted)), ca.DM([float(c.value(time)[0]) for c in wanted])
    )


def _fixed(places: Places, layout: Layout, one: Place):
    """Signals at a place, their symbols, where they come from, and the time."""
    element, place = np.array([one.element]), np.array([one.place])
    whole = places.gather(layout, element, place)
    here = ca.SX.sym("point", len(layout.tracks))
    if layout.begin.size and one.element == 0 and one.place == 0.0:
        nx, nz = len(layout.phase.states), layout.begin.size
        exact = places.pick([np.arange(nz)], [layout.begin], [np.ones(nz)], nz)
        whole = sparse.vstack([whole[:nx], exact, whole[nx + nz :]]).tocsr()
    share = layout.mesh.borders[one.element] + one.place * layout.mesh.widths[one.element]
    time = layout.phase.start_time + float(share) * (layout.phase.final_time - layout.phase.start_time)
    return here, here, whole[: len(layout.tracks)], time


def _moving(places: Places, layout: Layout, one: Place):
    """Signals at a place that moves: polynomials through the nodes of the element, whose values are the symbols."""
    phase, e = layout.phase, one.element
    time = phase.final_time if one.point.time == "final" else phase.start_time
    if not isinstance(one.point.time, str):
        time = one.point.time
    share = share_of(phase, time)
    symbols, rows, unknowns, values = [], [], [], []
    left, right = (ca.SX(float(b)) for b in layout.mesh.borders[e : e + 2])
    if layout.knots.size:
        matrix, offset = layout.mesh.shares()
        part = matrix[[e, e + 1]].tocoo()
        ends = ca.SX.sym("ends", 2)
        left, right = (ends[i] + float(offset[e + i]) for i in range(2))
        symbols.append(ends)
        rows.append(part.row)
        unknowns.append(layout.knots[part.col])
        values.append(part.data)
    place = (share - left) / (right - left)
    count, here = 2 if layout.knots.size else 0, []
    for track in layout.tracks:
        nodes, size = track.nodes[e], track.nodes.shape[1]
        at_nodes = ca.SX.sym("node", size)
        here.append(ca.dot(polynomials(nodes, place), at_nodes))
        symbols.append(at_nodes)
        rows.append(count + np.arange(size))
        unknowns.append(track.unknowns[e])
        values.append(np.ones(size))
        count += size
    matrix = places.pick(rows, unknowns, values, count) if rows else sparse.csr_matrix((0, places.size))
    return ca.vertcat(ca.SX(0, 1), *here), ca.vertcat(ca.SX(0, 1), *symbols), matrix, time
