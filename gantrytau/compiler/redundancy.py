"""Constraints that repeat others: found by numerical rank at poses where the loops are closed.

A planar loop in space closes with three of its six residuals; which three depends on the plane. The rows
of all equations between positions are orthogonalised, those that cannot be dropped first; of the others
the most independent are taken one after another, and what is left over repeats them. A pose may be
special, such as a parallelogram stretched flat, so poses around it are looked at too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import casadi as ca
import numpy as np

from gantrytau.border.refusal import InitializationError, StructureError
from gantrytau.compiler.aliases import Reduced, eliminate_aliases
from gantrytau.compiler.parameters import ParameterTable
from gantrytau.compiler.refusals import more_held, nearest_words, open_loops
from gantrytau.compiler.start.balance import balance
from gantrytau.compiler.start.consistency import solve_levels
from gantrytau.compiler.start.level import Level
from gantrytau.compiler.start.start_values import StartValues, start_values
from gantrytau.flattening.flat_model import FlatModel
from gantrytau.language.statements import Equation
from gantrytau.language.symbols import time

RANK = 1e-7  # of a row of length one, beyond the span of others, below which it repeats them
CLOSED = 1e-12  # residual of a pose beyond which ranks seen there are not trusted
POSES = 8  # besides the start
FIRM = 1e4  # weight of equations that hold where it is told how far a loop is from closed
EXACT = 1e-14  # of that
TRIES = 6  # from other positions, the nearest to closed being told
STEP = 0.6  # of a move to the next pose, in rad, or relative to the size of the coordinates


@dataclass(frozen=True, eq=False)
class Constraints:
    """What constrains positions: rows, of which those with a dual may be dropped, and unknowns.

    equations: of the droppable rows, which come last; known: names of what is given as a function of time.
    """

    level: Level
    equations: tuple[Equation, ...]
    known: frozenset[str]

    @property
    def moving(self) -> list[str]:
        """The unknowns that occur."""
        leaves = set(self.level.leaves)
        return [n for n in self.level.unknowns if n in leaves and n not in self.known]

    @property
    def firm(self) -> int:
        """Number of rows that cannot be dropped."""
        return len(self.level.residuals) - len(self.equations)


@dataclass(frozen=True, eq=False)
class Settled:
    """A model without redundant constraints, and start values where its loops are closed.

    redundant: the constraints left out, whose forces are zero; guess: numbers of positions by symbol.
    """

    flat: FlatModel
    redundant: tuple[Equation, ...] = ()
    guess: Mapping[str, float] = field(default_factory=dict)


def without_redundant(
    flat: FlatModel,
    table: ParameterTable,
    known: frozenset[str],
    course: Sequence[Mapping[str, float]] = (),
) -> Settled:
    """Leave out the constraints that repeat others. InitializationError if the loops cannot be closed.

    course: poses of a motion, numbers of positions by symbol: at the last of them the constraints to keep are chosen, by
    their sizes over all, instead of at poses around the start.
    """
    duals = [e for e in flat.equations if e.dual]
    if not duals:
        return Settled(flat)
    constraints, guess = _read(flat, table, known, duals)
    if course:
        guess = replace(guess, values={n: course[-1].get(n, value) for n, value in guess.values.items()})
    try:
        closed = _close(constraints, guess, guess.values, flat.name)
    except InitializationError as error:
        _refuse_drives(flat, table, constraints, guess)
        near = _refuse_starts(flat, constraints, guess)
        raise open_loops(flat, error, _nearest(constraints, guess), near) from None
    if course:
        matrices = [_over_course(constraints, course)[-1]]
    else:
        poses = [closed, *_poses(constraints, guess, closed, flat.name)]
        matrices = [_matrix(_jacobian(constraints, pose)) for pose in poses]
    kept = _independent(matrices, constraints.firm)
    _refuse_conflicts(flat, constraints, closed, kept)
    redundant = tuple(e for k, e in enumerate(constraints.equations) if k not in kept)
    return Settled(_with_zero_forces(flat, redundant), redundant, closed)


def soundness(
    flat: FlatModel,
    table: ParameterTable,
    known: frozenset[str],
    redundant: Sequence[Equation],
    course: Sequence[Mapping[str, float]],
) -> np.ndarray:
    """How independent the constraints are that were kept, at poses of a motion: 1 as all of them are, 0 not at all."""
    duals = [e for e in flat.equations if e.dual]
    constraints, _ = _read(flat, table, known, duals)
    left_out = {e.name for e in redundant}
    kept = [k for k, e in enumerate(duals) if e.name not in left_out]
    found = np.ones(len(course))
    for k, matrix in enumerate(_over_course(constraints, course) if kept else ()):
        rest = _beyond(matrix[constraints.firm :], matrix[: constraints.firm])
        every, own = (np.linalg.svd(rows, compute_uv=False)[len(kept) - 1] for rows in (rest, rest[kept]))
        found[k] = own / max(every, RANK)
    return found


def _over_course(constraints: Constraints, course: Sequence[Mapping[str, float]]) -> np.ndarray:
    """The rows at poses of a motion, (poses, rows, unknowns), each of length one where it is longest.

    A row may shrink to nothing at a pose, where others do not: of length one it would look as good as these.
    """
    each = np.array([_jacobian(constraints, pose) for pose in course])
    found = each * np.median([balance(jacobian)[1] for jacobian in each], axis=0)
    sizes = np.max(np.linalg.norm(found, axis=2, keepdims=True), axis=0)
    return np.where(sizes > RANK, found / np.maximum(sizes, RANK), 0.0)


def _read(
    flat: FlatModel, table: ParameterTable, known: frozenset[str], duals: Sequence[Equation]
) -> tuple[Constraints, StartValues]:
    """The constraints of positions, and the start values of what occurs in them."""
    bare = replace(flat, equations=tuple(e for e in flat.equations if not e.dual))
    constraints = _constraints(flat, reduced := eliminate_aliases(bare, table, known), duals)
    return constraints, start_values(flat, reduced, list(constraints.level.leaves))


def _constraints(flat: FlatModel, reduced: Reduced, duals: Sequence[Equation]) -> Constraints:
    """The equations between positions on which the droppable ones depend.

    Positions and forces are told apart by the connectors: an equation with a flow in it is one of forces.
    """
    forces = {n for v in flat.variables if v.kind == "flow" for n in v.elements} | {e.dual for e in duals}
    roots = {reduced.aliases[n].root for n in forces}
    closing = reduced.to_reduced(ca.vertcat(*(e.residual for e in duals)))
    positions = {}
    for i, residual in enumerate(reduced.residuals):
        names = [leaf.name() for leaf in ca.symvar(residual)]
        if not any(n in roots or n.startswith("der(") for n in names):
            positions[i] = [n for n in names if n in reduced.aliases and n not in reduced.known]
    unknown = _unknowns(closing, reduced)
    rows: list[int] = []
    while new := [i for i, names in positions.items() if i not in rows and unknown & set(names)]:
        rows += new
        unknown |= {n for i in new for n in positions[i]}
    level = Level(
        (*(reduced.residuals[i] for i in rows), *closing.elements()),
        (*(reduced.equations[i].name for i in rows), *(e.name for e in duals)),
        (*(n for n in reduced.unknowns if n in unknown), *sorted(reduced.known)),
    )
    return Constraints(level, tuple(duals), reduced.known)


def _unknowns(expression: ca.SX, reduced: Reduced) -> set[str]:
    names = {leaf.name() for leaf in ca.symvar(expression)}
    return {n for n in names if n in reduced.aliases and n not in reduced.known}


def _close(
    constraints: Constraints, guess: StartValues, values: Mapping[str, float], title: str
) -> dict[str, float]:
    return solve_levels(
        [constraints.level],
        values,
        held=guess.fixed | constraints.known,
        started=guess.started,
        chosen=guess.chosen,
        title=title,
        thorough=True,
    )


def _nearest(constraints: Constraints, guess: StartValues) -> dict[str, float]:
    """What is left of the closing equations, by name, where they are nearest to closed and all others hold."""
    from scipy.optimize import least_squares

    level = constraints.level
    place = [level.leaves.index(n) for n in constraints.moving if n not in guess.fixed]
    start = np.array([guess.values[n] for n in level.leaves])
    weights = np.ones(len(level.residuals))
    weights[: constraints.firm] = FIRM

    def residuals(x: np.ndarray) -> np.ndarray:
        return weights * level.look(_at(start, place, x))[0]

    def jacobian(x: np.ndarray) -> np.ndarray:
        return weights[:, None] * level.jacobian(level.look(_at(start, place, x))[1])[:, place]

    random, found = np.random.default_rng(0), residuals(start[place])
    for attempt in range(TRIES if place else 0):
        x = start[place] + (random.uniform(-np.pi, np.pi, len(place)) if attempt else 0.0)
        reached = least_squares(residuals, x, jacobian, x_scale="jac", ftol=EXACT, xtol=EXACT, gtol=EXACT).fun
        found = min(found, reached, key=np.linalg.norm)
    return dict(zip(level.names[constraints.firm :], found[constraints.firm :].tolist(), strict=True))


def _at(numbers: np.ndarray, place: Sequence[int], values: np.ndarray) -> np.ndarray:
    found = numbers.copy()
    found[list(place)] = values
    return found


def _jacobian(constraints: Constraints, values: Mapping[str, float], known: Sequence[str] = ()) -> np.ndarray:
    """Jacobian of the rows by unknowns and `known`."""
    level = constraints.level
    _, nonzeros = level.look(np.array([values[n] for n in level.leaves]))
    place = {n: k for k, n in enumerate(level.leaves)}
    return level.jacobian(nonzeros)[:, [place[n] for n in (*constraints.moving, *known)]]


def _matrix(jacobian: np.ndarray) -> np.ndarray:
    """The rows by unknowns in sizes of their own, each row of length one; what is zero stays zero."""
    rows, columns = balance(jacobian)
    found = rows * jacobian * columns
    sizes = np.linalg.norm(found, axis=1, keepdims=True)
    return np.where(sizes > RANK, found / np.maximum(sizes, RANK), 0.0)


def _poses(
    constraints: Constraints, guess: StartValues, closed: Mapping[str, float], title: str
) -> list[dict[str, float]]:
    """Other poses, on a walk in random directions that the constraints leave free."""
    found: list[dict[str, float]] = []
    random = np.random.default_rng(0)
    names = constraints.moving
    loose = replace(guess, fixed=frozenset(), started=frozenset(), chosen=frozenset())
    here = dict(closed)
    for _ in range(POSES):
        jacobian = _jacobian(constraints, here)
        rows, columns = balance(jacobian)
        _, sizes, right = np.linalg.svd(_matrix(jacobian))
        free = right[np.count_nonzero(sizes > RANK) :]
        if not len(free):
            break
        point = np.array([here[n] for n in names])
        move = random.standard_normal(len(free)) @ free
        move *= STEP * max(1.0, float(np.abs(point / columns).max())) / np.abs(move).max() * columns
        try:
            here = _close(
                constraints, loose, {**here, **dict(zip(names, (point + move).tolist(), strict=True))}, title
            )
        except InitializationError:
            continue
        residual, _ = constraints.level.look(np.array([here[n] for n in constraints.level.leaves]))
        if np.abs(rows.ravel() * residual).max() < CLOSED:
            found.append(here)
    return found


def _independent(matrices: Sequence[np.ndarray], firm: int) -> set[int]:
    """Which of the rows after the firm ones to keep; poses of lower rank than others have no say."""
    ranks = [np.linalg.matrix_rank(m, tol=RANK) for m in matrices]
    rests = [_beyond(m[firm:], m[:firm]) for m, r in zip(matrices, ranks, strict=True) if r == max(ranks)]
    kept: set[int] = set()
    while True:
        sizes = np.min([np.linalg.norm(rest, axis=1) for rest in rests], axis=0, initial=np.inf)
        if sizes.size == 0 or sizes.max() <= RANK:
            return kept
        best = int(np.argmax(sizes))
        kept.add(best)
        for rest in rests:
            direction = rest[best] / np.linalg.norm(rest[best])
            rest -= np.outer(rest @ direction, direction)
            rest[best] = 0.0


def _refuse_conflicts(
    flat: FlatModel, constraints: Constraints, closed: Mapping[str, float], kept: set[int]
) -> None:
    """StructureError where a constraint repeats others only as long as the inputs happen to agree."""
    inputs = [n for n in constraints.level.leaves if n in constraints.known]
    if not inputs:
        return
    matrix = _matrix(_jacobian(constraints, closed, inputs))
    firm = constraints.firm
    rows = [*range(firm), *(firm + k for k in sorted(kept))]
    rest = np.linalg.norm(_beyond(matrix[firm:], matrix[rows]), axis=1)
    against = [e.name for k, e in enumerate(constraints.equations) if k not in kept and rest[k] > RANK]
    if against:
        raise StructureError(
            f"{flat.name}: more is driven than can move: with the inputs {', '.join(inputs)} given, {'; '.join(against)} "
            "can only hold if they agree by chance. Expected as many driven joints as the mechanism has freedoms: leave "
            "one drive out, or drive by a force"
        )


def _refuse_drives(
    flat: FlatModel, table: ParameterTable, constraints: Constraints, guess: StartValues
) -> None:
    """StructureError where loops stay open because more is driven than can move, seen where they close without drives."""
    if not constraints.known:
        return
    free, loose = _read(flat, table, frozenset(), constraints.equations)
    try:
        closed = {**guess.values, **_close(free, loose, loose.values, flat.name)}
    except InitializationError:
        return
    kept = _independent([_matrix(_jacobian(constraints, closed))], constraints.firm)
    _refuse_conflicts(flat, constraints, closed, kept)


def _refuse_starts(flat: FlatModel, constraints: Constraints, guess: StartValues) -> str:
    """StructureError where loops stay open because more starts are fixed, or joints driven, than can move, seen where they
    close without. Otherwise the nearest starts with which they close, "" where there are none.
    """
    level = constraints.level
    fixed = [n for n in constraints.moving if n in guess.fixed]
    driven: dict[int, str] = {}  # row of an equation of one joint and the time: the joint
    for row, residual in enumerate(level.residuals[: constraints.firm]):
        leaves = {leaf.name() for leaf in ca.symvar(residual)}
        own = leaves.intersection(constraints.moving)
        if time.name() in leaves and len(own) == 1:
            driven[row] = own.pop()
    if not fixed and not driven:
        return ""
    rest = [row for row in range(len(level.residuals)) if row not in driven]
    rows, titles = (tuple(part[row] for row in rest) for part in (level.residuals, level.names))
    loose = replace(constraints, level=Level(rows, titles, level.unknowns))
    try:
        closed = _close(loose, replace(guess, fixed=frozenset()), guess.values, flat.name)
    except InitializationError:
        return ""
    held = [*fixed, *driven.values()]
    _, sizes, right = np.linalg.svd(_matrix(_jacobian(loose, closed)))
    free = right[np.count_nonzero(sizes > RANK) :, [loose.moving.index(n) for n in held]]
    mobility = int(np.linalg.matrix_rank(free, tol=RANK)) if len(free) else 0
    if mobility < len(held):
        raise more_held(flat.name, fixed, {level.names[row]: n for row, n in driven.items()}, mobility)
    return nearest_words({n: (guess.values[n], closed[n]) for n in fixed})


def _beyond(rows: np.ndarray, others: np.ndarray) -> np.ndarray:
    """What of the rows lies beyond the span of the others."""
    if not len(others):
        return rows.copy()
    _, sizes, right = np.linalg.svd(others, full_matrices=False)
    span = right[sizes > RANK * sizes[0]]
    rest = rows - (rows @ span.T) @ span
    return rest - (rest @ span.T) @ span


def _with_zero_forces(flat: FlatModel, redundant: Sequence[Equation]) -> FlatModel:
    """The forces of redundant constraints are zero; the constraints are gone."""
    symbols = {n: s for v in flat.variables for n, s in zip(v.elements, v.symbol.elements(), strict=True)}
    left_out = {id(e) for e in redundant}
    equations = tuple(
        replace(e, left=symbols[e.dual], right=ca.SX(0), label=f"no force for {e.name}")
        if id(e) in left_out
        else e
        for e in flat.equations
    )
    return replace(flat, equations=equations)
