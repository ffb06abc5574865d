"""Targets of many points through solved blocks: closed forms by NumPy, blocks without along their branches."""

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, reduce

import casadi as ca
import numpy as np

from gantrytau.answers.function_through import Question, parted
from gantrytau.answers.implicit_blocks import SINGULAR, linear_parts, picked, which_stand_in
from gantrytau.answers.many_points.array_program import ArrayProgram, NotForArrays
from gantrytau.answers.many_points.elimination import solved
from gantrytau.answers.many_points.followed_branches import FollowedBranch
from gantrytau.answers.many_points.kept_unknowns import ReducedBranch, reduced
from gantrytau.compiler.blocks.solution import SolvedBlocks
from gantrytau.language.piecewise import switched

# of one, or of an argument where it is larger: how far from the start unknowns are looked at
AROUND = (0.02, 0.1)
LOOKED_AT = 16  # points at each of these distances


class LinearSolution:
    """A block of linear equations that are solved point by point: NaN where they are singular."""

    direct = True

    def __init__(self, parts: tuple[ca.Function, ca.Function, ca.DM, np.ndarray]):
        matrix, rows, self._other, self._columns = parts
        self._matrix, self._rows = ArrayProgram(matrix), ArrayProgram(rows)

    def __call__(self, known: np.ndarray) -> np.ndarray:
        """Unknowns (n, N) of arguments and unknowns before, (k, N)."""
        (matrix, right), (row,) = self._matrix(known), self._rows(known)
        n = len(right)
        left = (matrix.reshape(n, n, -1) * row).transpose(2, 1, 0)
        other = np.broadcast_to(np.array(self._other), (len(left), n, 1))
        with np.errstate(all="ignore"):
            both = solved(left, np.concatenate([(row * right).T[:, :, None], other], axis=2))
            both[~(np.sum(both[:, :, 1] ** 2, axis=1) <= SINGULAR**-2)] = np.nan
        return (both[:, :, 0] / self._columns).T

    def beside(self, known: np.ndarray, begin: np.ndarray, start: np.ndarray) -> np.ndarray:
        """The same: linear equations have one solution, from wherever it is led."""
        return self(known)

    def solutions(self, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The same for one point, without signs."""
        return self(known[:, None]), np.zeros((0, 1))


class ThroughBlocks:
    """Targets through blocks as they are solved; trusted: expressions that hold where the closed forms can be trusted."""

    def __init__(self, question: Question, blocks: SolvedBlocks, start: Mapping[str, float], careful: bool):
        residuals, extents, targets, margins = parted(question, blocks)
        trusted = [] if careful else [m > 0 for m in margins if not m.is_constant()]
        q, tears = ca.vertcat(*question.arguments), ca.vertcat(ca.SX(0, 1), *blocks.tears)
        self._start = np.array(question.start()).ravel()
        self._steps: list[tuple[list[int], LinearSolution | FollowedBranch | ReducedBranch]] = []
        self._places: list[tuple[int, int]] = []  # of the unknowns of each step behind the arguments
        near = _around(self._start)
        before, place = ca.SX(0, 1), 0
        self.count = len(self._start)  # of arguments
        self.leads = False  # whether unknowns are followed along branches
        self.start = np.concatenate([self._start, [start[leaf.name()] for leaf in tears.elements()]])
        for block in blocks.implicit:
            begin, place = place, place + len(block.tears)
            self._places.append((len(self._start) + begin, len(self._start) + place))
            y, every, residual = ca.vertcat(*block.tears), ca.vertcat(q, before), residuals[begin:place]
            used = which_stand_in([residual, extents[begin:place]], every)
            known = picked(every, used)
            if switched([residual], {leaf.name() for leaf in y.elements()}).switches:
                raise NotForArrays("equations that switch, in a block without closed form")
            if block.scales is not None:
                parts = linear_parts(residual, extents[begin:place], block.scales, y, known)
                step = LinearSolution(parts)
            else:
                function = ca.Function("residual", [y, known], [residual], {"cse": True})
                numbers = np.array([start[leaf.name()] for leaf in tears[:place].elements()])
                known_at_start = np.concatenate([self._start, numbers[:begin]])[used]
                branch = FollowedBranch(function, numbers[begin:], known_at_start)
                step = reduced(branch, branch(near[used]))
            self._steps.append((used, step))
            self.leads = self.leads or block.scales is None
            before = ca.vertcat(before, y)
            near = np.vstack([near, step(near[used])])
        everything = [q, tears]
        whole = [ca.densify(ca.vec(t)) for t in targets]
        holds = [reduce(ca.logic_and, trusted)] if trusted else [ca.SX(1)]
        self._rest = ArrayProgram(ca.Function("rest", everything, [*whole, *holds], {"cse": True}))
        self._jacobian = lambda: _jacobian_of(everything, residuals, ca.vertcat(*whole))

    @property
    def direct(self) -> bool:
        """Whether all that would be led from one point to another is known without."""
        return all(step.direct for _, step in self._steps)

    def tears(self, q: np.ndarray) -> np.ndarray:
        """Unknowns without closed form (n, N) of arguments (k, N)."""
        known = q
        for used, step in self._steps:
            known = np.vstack([known, step(known[used])])
        return known[len(q) :]

    def tears_beside(self, q: np.ndarray, there: np.ndarray) -> np.ndarray:
        """The same (n, N), each led from another point: there (k + n, N), arguments and unknowns on the branch."""
        known = q
        for (used, step), (first, end) in zip(self._steps, self._places, strict=True):
            known = np.vstack([known, step.beside(known[used], there[used], there[first:end])])
        return known[len(q) :]

    def solutions(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Unknowns (n, m) of all m branches at one point (k,), and the signs (s, m) of each branch."""
        known, signs = q[:, None], np.zeros((0, 1))
        for used, step in self._steps:
            ways = [
                (known[:, k], signs[:, k], *step.solutions(known[used, k])) for k in range(known.shape[1])
            ]
            parts = [
                [np.repeat(old[:, None], y.shape[1], axis=1) for old in (x, s)] + [y, sign]
                for x, s, y, sign in ways
            ]
            known, signs = (
                np.hstack([np.vstack([part[i], part[i + 2]]) for part in parts] or [np.zeros((0, 0))])
                for i in (0, 1)
            )
        return known[len(q) :], signs

    def targets(self, q: np.ndarray, tears: np.ndarray) -> tuple[list[np.ndarray], np.ndarray]:
        """Targets (m, N) and whether they can be trusted, (N,)."""
        *found, holds = self._rest(q, tears)
        return found, holds[0] != 0

    @cached_property
    def jacobian(self) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
        """(arguments, tears) -> the Jacobian of all targets, (N, m, k)."""
        return self._jacobian()


def _around(start: np.ndarray) -> np.ndarray:
    """Points about the start, (k, N)."""
    random = np.random.default_rng(0)
    sizes = np.maximum(1.0, np.abs(start))[:, None]
    return np.hstack([
        start[:, None] + share * sizes * random.uniform(-1, 1, (len(start), LOOKED_AT)) for share in AROUND
    ])  # fmt: skip


def _jacobian_of(everything: Sequence[ca.SX], residuals: ca.SX, targets: ca.SX):
    """(arguments, tears) -> dtargets/darguments, by the theorem of implicit functions."""
    q, y = everything
    n, m, k = y.numel(), targets.numel(), q.numel()
    parts = [ca.densify(ca.jacobian(f, x)) for f in (targets, residuals) for x in (q, y)]
    program = ArrayProgram(ca.Function("jacobian", [q, y], parts, {"cse": True}))

    def of(q: np.ndarray, y: np.ndarray) -> np.ndarray:
        sizes = ((m, k), (m, n), (n, k), (n, n))
        found = [
            part.reshape(across, down, q.shape[1]).transpose(2, 1, 0)
            for part, (down, across) in zip(program(q, y), sizes, strict=True)
        ]
        by_q, by_y, left_q, left_y = found
        return by_q - by_y @ solved(left_y, left_q) if n else np.array(by_q)

    return of
