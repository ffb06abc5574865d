"""What guides symbolic choices: numbers at the consistent start and around it, and what was solved before.

A pivot that is large at one pose may vanish at another one; such a pivot must not be divided by. The
points are consistent as far as the blocks before have closed forms.
"""

from collections.abc import Collection, Mapping, Sequence, Set
from dataclasses import dataclass

import casadi as ca
import numpy as np

from gantrytau.compiler.symbol_spaces import Substitution, called, values_at

COUNT = 12
TRUSTED = 1e-3  # of a pivot at the start, relative to its row: with less it costs more than three digits
SPREAD = 0.5  # of the points about the start, relative to its values, or absolute in SI where they are small


class Guide:
    """Numbers of expressions at the start and around it, while blocks are solved one after another.

    start: numbers of all symbols; parameters: names among them that stay as they are; states: their rates
    are what equations of motion are solved for in the end (names in `rates`). partners: by equation
    the variable that it was solved for at a lower derivative, "" if in a block without closed order. The
    pivot at all higher derivatives is the same, so dividing by it again adds no singularity. firm: those of
    these equations whose pivot does not vanish where the equations still determine their unknowns.
    modes: names of what jumps at events, and a pivot with it, perhaps to zero: it is not divided by.
    careful: divide only by pivots that do not vanish, and leave the others to be chosen by value.
    """

    def __init__(
        self,
        start: Mapping[str, float],
        parameters: Collection[str],
        states: Sequence[str],
        *,
        modes: Collection[str] = (),
        careful: bool = False,
    ):
        self.start = start
        self.parameters = parameters
        self.modes = modes
        self.careful = careful
        self.rates = frozenset(f"der({name})" for name in states)
        self.partners: dict[int, str] = {}
        self.firm: set[int] = set()
        self._solved: list[tuple[ca.SX, ca.SX]] = []

    def define(self, solved: Sequence[tuple[ca.SX, ca.SX]]) -> None:
        """From now on these symbols follow from others, as (symbol, expression) in order of solution."""
        self._solved += solved

    def at_start(self, expression: ca.SX) -> np.ndarray:
        """The numbers of an expression at the start, as a dense array."""
        return values_at(expression, self.start)

    def around(self, expression: ca.SX) -> np.ndarray:
        """The numbers of an expression at the start, then at points around it, (points, rows, columns)."""
        entries = self.entries_around(expression)
        found = np.zeros((len(entries), *expression.shape))
        found[:, *expression.sparsity().get_triplet()] = entries
        return found

    def entries_around(self, expression: ca.SX) -> np.ndarray:
        """The same of its nonzeros alone, (points, nonzeros)."""
        (resolved,) = Substitution(tuple(self._solved)).inserted([expression])
        leaves = ca.symvar(resolved)
        function = ca.Function("sample", [ca.vertcat(*leaves)], [resolved])
        centre = np.array([self.start[leaf.name()] for leaf in leaves])
        moves = np.array([leaf.name() not in self.parameters for leaf in leaves], dtype=bool)
        steps = np.random.default_rng(0).uniform(-SPREAD, SPREAD, (len(leaves), COUNT))
        points = centre[:, None] + steps * (moves * np.maximum(np.abs(centre), 1.0))[:, None]
        nonzeros = np.array([called(function, point)[0] for point in points.T])
        nonzeros = nonzeros[np.isfinite(nonzeros).all(axis=1)]  # the others are out of reach
        return np.vstack([self.at_start(expression)[tuple(expression.sparsity().get_triplet())], nonzeros])


@dataclass(frozen=True, eq=False)
class Scales:
    """What pivots of a matrix are measured by, which rows and columns may have in any unit.

    columns: their sizes, (n,); rows: sums of the elements without their signs, over the sizes of their columns, (n,), as
    expressions; start: numbers of these.
    """

    columns: np.ndarray
    rows: tuple[ca.SX, ...]
    start: np.ndarray

    @classmethod
    def of(cls, matrix: ca.SX, entries: np.ndarray, needed: Set[int] | None = None) -> "Scales":
        """Those of the rows of a square matrix that are needed (None: all).

        entries: numbers of its nonzeros at the start and around it, (points, nonzeros).
        """
        n = matrix.shape[0]
        i, j = matrix.sparsity().get_triplet()
        found, at_start = np.zeros((n, n)), np.zeros((n, n))
        found[i, j], at_start[i, j] = np.abs(entries).max(axis=0), np.abs(entries[0])
        largest = found.max(axis=1, keepdims=True)
        sizes = (found / np.where(largest > 0, largest, 1.0)).max(axis=0, initial=0.0)
        sizes = np.where(sizes > 0, sizes, 1.0)
        rows = tuple(
            extent(matrix[k, :], sizes) if needed is None or k in needed else ca.SX(0) for k in range(n)
        )
        return cls(sizes, rows, (at_start / sizes).sum(axis=1))

    def at(self, rows: Sequence[int], columns: Sequence[int]) -> "Scales":
        """The same of some rows, as whole as they were, and columns."""
        return Scales(self.columns[list(columns)], tuple(self.rows[i] for i in rows), self.start[list(rows)])

    def left(self, row: Sequence[ca.SX], numbers: np.ndarray, columns: Sequence[int]) -> "Scales":
        """With what elimination left of a row in some columns in the place of all rows."""
        sizes = self.columns[list(columns)]
        whole = extent(ca.horzcat(*(row[j] for j in columns)), sizes)
        start = np.sum(np.abs(numbers[list(columns)]) / sizes)
        return Scales(self.columns, (whole,) * len(self.rows), np.full(len(self.rows), start))

    def margin(self, i: int, j: int, pivot: ca.SX, number: float) -> ca.SX:
        """Positive while a pivot is large enough in its row; number: of the pivot at the start."""
        share = min(abs(number) / self.columns[j] / self.start[i], 1.0)
        return ca.fabs(pivot) / self.columns[j] - TRUSTED * share * self.rows[i]


def extent(row: ca.SX, sizes: np.ndarray) -> ca.SX:
    """The sum of the elements of a row without their signs, over the sizes of the columns."""
    entries = zip(row.sparsity().get_triplet()[1], row.nonzeros(), strict=True)
    return sum((ca.fabs(e) / sizes[j] for j, e in entries), ca.SX(0))


def reliable(entries: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """How large entries stay at all points relative to a reference; 0 where they change sign.

    entries: (points, ...); reference: of a shape that broadcasts with it.
    """
    same_sign = (entries > 0).all(axis=0) | (entries < 0).all(axis=0)
    return same_sign * (np.abs(entries) / np.maximum(reference, 1e-300)).min(axis=0)
