"""Equations that are solved together, with their numbers, derivatives and the sizes of their terms."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from gantrytau.compiler.start.newton import Matrix, matrix_of
from gantrytau.compiler.symbol_spaces import called, column
from gantrytau.language.scalar_arithmetic import depending
from gantrytau.language.term_sizes import term_sizes

ROUNDING = 1e-14  # of what unknowns of size one contribute, what is left of equations solved together


@dataclass(frozen=True, eq=False)
class Level:
    """Equations that are solved together: residuals, and unknown symbols; exact: symbols whose numbers are given.

    Derivatives are those by the unknowns: by what earlier levels have found they would be far longer.
    """

    residuals: tuple[ca.SX, ...]
    names: tuple[str, ...]  # of the residuals, for messages
    unknowns: tuple[str, ...]
    exact: frozenset[str] = frozenset()

    @cached_property
    def leaves(self) -> tuple[str, ...]:
        """Names of all symbols in the residuals."""
        return tuple(leaf.name() for leaf in ca.symvar(ca.vertcat(*self.residuals)))

    def curved(self, moving: Sequence[str]) -> bool:
        """Whether the residuals are not linear in what moves."""
        wanted = set(moving)
        residual = ca.vertcat(*self.residuals)
        x = [leaf for leaf in ca.symvar(residual) if leaf.name() in wanted]
        return bool(x) and ca.depends_on(ca.jacobian(residual, ca.vertcat(*x)), ca.vertcat(*x))

    @cached_property
    def symbolic(self) -> tuple[ca.SX, ca.SX, ca.SX]:
        residual = ca.vertcat(*self.residuals)
        leaves = ca.symvar(residual)
        inside = column([leaves[k] for k in self._inside])
        return column(leaves), ca.densify(residual), ca.jacobian(residual, inside)

    @cached_property
    def entries(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows, and places among the leaves, of the derivatives that are not structurally zero."""
        rows, columns = self.symbolic[2].sparsity().get_triplet()
        return np.array(rows, dtype=int), self._inside[np.array(columns, dtype=int)]

    @cached_property
    def _inside(self) -> np.ndarray:
        """Places of the unknowns among the leaves."""
        unknowns = set(self.unknowns)
        return np.array([k for k, n in enumerate(self.leaves) if n in unknowns], dtype=int)

    @cached_property
    def place(self) -> dict[str, int]:
        """Places of the leaves by name."""
        return {n: k for k, n in enumerate(self.leaves)}

    @cached_property
    def _exact_nonzeros(self) -> tuple[np.ndarray, ca.Function]:
        """Indices of the derivatives by exact numbers alone; the function of their values and term sizes."""
        x, _, jacobian = self.symbolic
        nonzeros = jacobian.nonzeros()
        others = [leaf for leaf in x.elements() if leaf.name() not in self.exact]
        places = np.flatnonzero(~np.array(depending(nonzeros, others), dtype=bool))
        exact = [nonzeros[k] for k in places]
        return places, ca.Function("exact", [x], [column(exact), column(term_sizes(exact) if exact else [])])

    def certainty(self, numbers: np.ndarray) -> np.ndarray:
        """For each entry: 1 where a derivative by exact numbers exceeds its rounding, -1 where not, else 0."""
        places, function = self._exact_nonzeros
        nonzeros, sizes = called(function, numbers)
        found = np.zeros(len(self.entries[0]))
        found[places] = np.where(np.abs(nonzeros) > ROUNDING * sizes, 1, -1)
        return found

    @cached_property
    def _function(self) -> ca.Function:
        x, residual, jacobian = self.symbolic
        return ca.Function("level", [x], [residual, column(jacobian.nonzeros())])

    def sizes(self, rows: Sequence[int], numbers: np.ndarray) -> np.ndarray:
        """How large the terms of some residuals are, at numbers of the leaves."""
        key, whole = ("sizes", *rows), ("sizes", *range(len(self.residuals)))
        if key not in self._made and any(other[0] == "sizes" for other in self._made):
            return self._sized(whole, numbers)[
                list(rows)
            ]  # of all at once, rather than of others again and again
        return self._sized(key, numbers)

    def _sized(self, key: tuple[Any, ...], numbers: np.ndarray) -> np.ndarray:
        def made() -> ca.Function:
            terms = ca.vertcat(*term_sizes([self.residuals[i] for i in key[1:]]))
            return ca.Function("sizes", [self.symbolic[0]], [terms])

        return called(self.kept(key, made), numbers)[0]

    def kept(self, key: tuple[Any, ...], make: Callable[[], Any]) -> Any:
        """What does not depend on numbers, made at its first use."""
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    @cached_property
    def _made(self) -> dict[tuple[Any, ...], Any]:
        return {}

    def look(self, numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals, and the entries of their derivatives, at numbers of the leaves."""
        residual, nonzeros = called(self._function, numbers)
        return residual, nonzeros

    def jacobian(self, nonzeros: np.ndarray) -> np.ndarray:
        """The derivatives as a dense matrix with a column for each leaf."""
        found = np.zeros((len(self.residuals), len(self.leaves)))
        found[self.entries] = nonzeros
        return found

    def moving(self, columns: Sequence[int]) -> Callable[[np.ndarray], Matrix]:
        """From the entries, or numbers for these, to the matrix of some columns: dense where it is small."""
        place = np.full(len(self.leaves), -1)
        place[columns] = np.arange(len(columns))
        kept = np.flatnonzero(place[self.entries[1]] >= 0)
        rows, columns_of, shape = *(side[kept] for side in self.entries), (len(self.residuals), len(columns))
        return lambda entries: matrix_of(entries[kept], rows, place[columns_of], shape)


def joined(whole: Sequence[Level]) -> Level:
    """Levels as one."""
    return Level(
        tuple(r for level in whole for r in level.residuals),
        tuple(n for level in whole for n in level.names),
        tuple(n for level in whole for n in level.unknowns),
        whole[0].exact,
    )
