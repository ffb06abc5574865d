"""A function of a model for arrays: many points at once, with the answers of `Dae.function` point by point.

Closed forms are computed instruction by instruction, blocks without are followed along their branches; where pivots
are too small for the closed forms that divide by them, the careful blocks answer, for these points alone. Few points, and
models with tables or functions from outside, go point by point.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from gantrytau.answers.causality import composed, function
from gantrytau.answers.function_through import Question, parted
from gantrytau.answers.many_points.array_program import NotForArrays
from gantrytau.answers.many_points.grown_branch import GrownBranch
from gantrytau.answers.many_points.point_by_point import PointByPoint
from gantrytau.answers.many_points.through_blocks import ThroughBlocks
from gantrytau.border.refusal import ModelError
from gantrytau.compiler.blocks.solution import SolvedBlocks
from gantrytau.compiler.translated import Translated

FEW = 256  # points that are answered sooner one by one than arrays are made ready
TOGETHER = 32768  # points whose unknowns stay in memory that is near


@dataclass(frozen=True, eq=False)
class _Arrays:
    """Arguments (k, N) and results (m, N) through blocks that are quick, and through those of `slow` where they must be."""

    question: Question
    quick: SolvedBlocks
    slow: Callable[[], SolvedBlocks]
    start: Mapping[str, float]

    def __call__(self, q: np.ndarray) -> list[np.ndarray]:
        return self._answered(q)[0]

    def jacobian(self, q: np.ndarray) -> np.ndarray:
        """Jacobian of all results, below each other, by all arguments, (N, m, k)."""
        _, tears, doubtful = self._answered(q)
        found = self.first.jacobian(q, tears)
        if doubtful.size:
            there = q[:, doubtful]
            found[doubtful] = self.second.jacobian(there, self.second.tears(there))
        return found

    def _answered(self, q: np.ndarray) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """Results, tears, and where the careful way is taken."""
        tears = self.first.tears(q)
        found, trusted = self.first.targets(q, tears)
        doubtful = np.flatnonzero(~trusted)
        if doubtful.size:
            there = q[:, doubtful]
            some, _ = self.second.targets(there, self.second.tears(there))
            for whole, part in zip(found, some, strict=True):
                whole[:, doubtful] = part
        return found, tears, doubtful

    def around(self, q: np.ndarray) -> list[np.ndarray]:
        """Results at arguments to which the straight way from the start does not lead, by the ways that others took."""
        return self.second.targets(q, self._led(q))[0]

    def jacobian_around(self, q: np.ndarray) -> np.ndarray:
        """Their Jacobian."""
        return self.second.jacobian(q, self._led(q))

    def _led(self, q: np.ndarray) -> np.ndarray:
        """Unknowns by ways around, where they are followed at all."""
        if not self.second.direct:
            return self.grown(q)
        return self.second.tears_beside(q, np.repeat(self.second.start[:, None], q.shape[1], axis=1))

    @cached_property
    def grown(self) -> GrownBranch:
        """The branch as far as it goes."""
        grown = GrownBranch(self.second.start, self.second.count, self.second.tears_beside)
        grown.grow()
        return grown

    @cached_property
    def first(self) -> ThroughBlocks:
        """The way through blocks that are quick."""
        return ThroughBlocks(self.question, self.quick, self.start, careful=False)

    @cached_property
    def second(self) -> ThroughBlocks:
        """The way that is taken where the first cannot be trusted."""
        return ThroughBlocks(self.question, self.slow(), self.start, careful=True)


class ArrayFunction:
    """From arrays (N, k) of what is given to arrays (N, m) of what is found, matrices column after column; one row a point.

    A scalar may be (N,). Rows are NaN where there is no solution on the branch of the start, or an argument is NaN.
    Raises ModelError for arrays of other shapes.
    """

    def __init__(self, dae: Translated, given: Sequence[str], find: Sequence[str]):
        self.given, self.find = tuple(given), tuple(find)
        self._dae = dae
        self._sizes = [len(dae.expand(name)) for name in self.given]
        self._suited = True
        self._points = PointByPoint(function(dae, self.given, self.find))

    def __repr__(self) -> str:
        return f"<ArrayFunction of {self._dae.name}: {', '.join(self.given)} to {', '.join(self.find)}>"

    def __call__(self, *arguments: np.ndarray) -> list[np.ndarray]:
        """Results in the order of the names."""
        return self._everywhere(self._checked(arguments), self._some)

    def jacobian(self, *arguments: np.ndarray) -> np.ndarray:
        """Jacobian of all results, below each other, by all arguments, (N, m, k)."""
        return self._everywhere(self._checked(arguments), self._jacobian_of_some)[0]

    def around(self, *arguments: np.ndarray) -> list[np.ndarray]:
        """Results, where the straight way from the start ends by ways around: as far as the branch goes."""
        q = self._checked(arguments)
        return self._completed(q, self._some, lambda arrays, rows: [x.T for x in arrays.around(rows)])

    def jacobian_around(self, *arguments: np.ndarray) -> np.ndarray:
        """Jacobian of these, (N, m, k)."""
        q = self._checked(arguments)
        return self._completed(
            q, self._jacobian_of_some, lambda arrays, rows: [arrays.jacobian_around(rows)]
        )[0]

    def solutions(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Results (m, n) of all branches at arguments (k,) and signs that tell them apart, (s, m)."""
        tears, signs = self._arrays.second.solutions(q)
        found, _ = self._arrays.second.targets(np.repeat(q[:, None], tears.shape[1], axis=1), tears)
        return np.vstack(found).T, signs

    @cached_property
    def closed_form(self) -> ca.Function | None:
        """All results below each other by all arguments, where no unknowns are followed along branches."""
        return composed(self._dae, self.given, self.find, _in_closed_form, lambda _: None)

    def _completed(
        self,
        q: np.ndarray,
        straight: Callable[[np.ndarray], list[np.ndarray]],
        around: Callable[[_Arrays, np.ndarray], list[np.ndarray]],
    ) -> list[np.ndarray]:
        """Results by straight ways, and by ways around where these end; the latter at once where nothing is followed."""
        if len(q) >= FEW and self._grows and self._arrays.second.direct:
            return self._everywhere(q, lambda rows: around(self._arrays, rows.T))
        found = self._everywhere(q, straight)
        lost = np.isfinite(q).all(axis=1) & ~_finite(found)
        if lost.any() and self._grows:
            for whole, part in zip(found, around(self._arrays, q[lost].T), strict=True):
                whole[lost] = part
        return found

    @cached_property
    def _grows(self) -> bool:
        try:
            return self._arrays.second.leads
        except NotForArrays:
            return False

    def _checked(self, arguments: Sequence[np.ndarray]) -> np.ndarray:
        """All arguments beside each other, (N, k)."""
        arrays = [np.asarray(a, dtype=float) for a in arguments]
        scalar = [k == 1 for k in self._sizes] + [False] * len(arrays)
        arrays = [a[:, None] if a.ndim == 1 and one else a for a, one in zip(arrays, scalar, strict=False)]
        found = [a.shape for a in arrays]
        count = found[0][0] if found and found[0] else 0
        if found != [(count, k) for k in self._sizes]:
            raise ModelError(
                f"{self._dae.name}: found arrays of shapes {', '.join(map(str, found)) or 'none'}, expected "
                f"{', '.join(f'{n} (N, {k})' for n, k in zip(self.given, self._sizes, strict=True))}; one row a point"
            )
        return np.concatenate(arrays, axis=1)

    def _everywhere(self, q: np.ndarray, some: Callable[[np.ndarray], list[np.ndarray]]) -> list[np.ndarray]:
        """What `some` finds of arguments that are numbers; NaN elsewhere."""
        known = np.isfinite(q).all(axis=1)
        rows = np.flatnonzero(known)
        parts = [rows[k : k + TOGETHER] for k in range(0, len(rows), TOGETHER)] or [rows]
        found: list[np.ndarray] = []
        for part in parts:
            results = some(q[part])
            found = found or [np.full((len(q), *x.shape[1:]), np.nan) for x in results]
            for whole, result in zip(found, results, strict=True):
                whole[part] = result
        return found

    def _some(self, q: np.ndarray) -> list[np.ndarray]:
        found = self._by_arrays(q, lambda arrays: [x.T for x in arrays(q.T)])
        return self._points(q) if found is None else found

    def _jacobian_of_some(self, q: np.ndarray) -> list[np.ndarray]:
        found = self._by_arrays(q, lambda arrays: [arrays.jacobian(q.T)])
        return [self._points.jacobian(q)] if found is None else found

    def _by_arrays(
        self, q: np.ndarray, answer: Callable[[_Arrays], list[np.ndarray]]
    ) -> list[np.ndarray] | None:
        """What arrays answer; None where points go one by one."""
        if len(q) < FEW or not self._suited:
            return None
        try:
            return answer(self._arrays)
        except NotForArrays:
            self._suited = False
            return None

    @cached_property
    def _arrays(self) -> _Arrays:
        return composed(self._dae, self.given, self.find, _through, _open)


def _finite(found: Sequence[np.ndarray]) -> np.ndarray:
    """Rows in which all results are numbers, (N,)."""
    return np.all([np.isfinite(x).all(axis=tuple(range(1, x.ndim))) for x in found], axis=0)


def _in_closed_form(name: str, question: Question, quick: SolvedBlocks, careful, start: Mapping[str, float]):
    blocks = quick if quick.implicit else careful()
    if blocks.implicit:
        return None
    targets = [ca.densify(ca.vec(t)) for t in parted(question, blocks)[2]]
    return ca.Function(name, [ca.vertcat(*question.arguments)], [ca.vertcat(*targets)])


def _through(
    name: str, question: Question, quick: SolvedBlocks, careful, start: Mapping[str, float]
) -> _Arrays:
    return _Arrays(question, quick, careful, start)


def _open(function: _Arrays) -> _Arrays:
    raise NotForArrays("loops that the given parameters may open")
