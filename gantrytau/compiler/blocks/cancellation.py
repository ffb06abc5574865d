"""Derivatives that cancel between equations, so that structure alone promises more than the equations determine.

The signature method needs a regular Jacobian of the differentiated equations by the highest derivatives. Where constant
factors u make its rows vanish, u^T J = 0, the equation that is differentiated least is replaced by the combination

    sum of u_i d^(c_i - c) f_i / dt^(c_i - c)      c: how often it is differentiated itself

which holds lower derivatives only and has the same solutions together with the others (the linear combination method of Tan,
Nedialkov and Pryce, ACM Trans. Math. Softw. 43, 2017). Whether J is regular is seen at points chosen at random.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, cast

import casadi as ca
import numpy as np

from gantrytau.compiler.aliases import Reduced
from gantrytau.compiler.index_reduction import Indexed, reduce_index
from gantrytau.compiler.refusals import held_together
from gantrytau.compiler.start.balance import balance
from gantrytau.compiler.start.consistency import Level
from gantrytau.compiler.start.start_values import start_values
from gantrytau.errors import InitializationError, StructureError
from gantrytau.flattening.flat_model import FlatModel

POINTS = 3
SPREAD = 0.4  # of values around the start
RANK = 1e-9  # of a row of length one, beyond the span of others, below which it depends on them
NOISE = 1e-10  # of the terms of a derivative, below which they cancel
MOST_ORDERS = 10  # of derivatives, of which each combination takes one away
DENOMINATOR = 1000  # of factors that are meant as fractions


@dataclass(frozen=True, eq=False)
class Combined:
    """Equations in which derivatives cancel no more, or the parameters that decide on it by their values."""

    reduced: Reduced
    decisive: frozenset[str] = frozenset()


def combined(reduced: Reduced, flat: FlatModel, wanted: Sequence[str], error: Exception) -> Combined:
    """The equations with combinations in place of those whose derivatives cancel; raises `error` where none do.

    StructureError where the factors are not constant, or a combination determines nothing.
    """
    found, names, symbols = reduced, [], []
    for _ in range(MOST_ORDERS * len(reduced.unknowns)):
        try:
            indexed = reduce_index(found, flat, wanted)
        except StructureError:
            if isinstance(error, StructureError) or not names:
                raise error from None
            why = "what their combination leaves determines no unknown"
            raise held_together(flat.name, names, symbols, why) from None
        system = _System.of(found, indexed, start_values(flat, found, indexed.symbols(found.known)).values)
        factors = system.constant_factors(vary=True)
        if factors is None:
            factors = system.constant_factors(vary=False)
            decisive = frozenset() if factors is None else system.parameters_of(factors)
            if decisive:
                return Combined(found, decisive)
        if factors is None:
            changing = system.changing_factors()
            if changing is not None and isinstance(error, InitializationError):
                names = [indexed.names[i] for i in np.flatnonzero(changing)]
                symbols = system.symbols_of(changing)
                raise held_together(flat.name, names, symbols, "its factors change with the motion") from None
            if found is reduced:
                raise error
            return Combined(found)
        names, symbols = [indexed.names[i] for i in np.flatnonzero(factors)], system.symbols_of(factors)
        found = _replaced(found, indexed, factors, system.points(vary=False))
    raise error


@dataclass(frozen=True, eq=False)
class _System:
    """The equations that determine the highest derivatives; values: numbers of all symbols around which points lie."""

    level: Level
    counts: tuple[int, ...]
    values: Mapping[str, float]
    parameters: frozenset[str]

    @classmethod
    def of(cls, reduced: Reduced, indexed: Indexed, values: Mapping[str, float]) -> "_System":
        """Of indexed equations."""
        return cls(indexed.levels[-1], indexed.counts, values, frozenset(reduced.table.independent))

    def points(self, vary: bool) -> list[dict[str, float]]:
        """Numbers of all symbols at random, those of parameters only if they vary."""
        random = np.random.default_rng(0)
        found = []
        for _ in range(POINTS):
            share = dict(zip(self.values, random.uniform(-SPREAD, SPREAD, len(self.values)), strict=True))
            found.append(
                {
                    n: x if n in self.parameters and not vary else x * (1 + share[n]) if x else share[n]
                    for n, x in self.values.items()
                }
            )
        return found

    @property
    def _place(self) -> list[int]:
        """Where the highest derivatives stand among the leaves."""
        place = {n: k for k, n in enumerate(self.level.leaves)}
        return [place[n] for n in self.level.unknowns if n in place]

    def _matrices(self, vary: bool) -> list[np.ndarray]:
        """The Jacobian by the highest derivatives at each point where it is finite, without what is rounding."""
        level, found = self.level, []
        for point in self.points(vary):
            numbers = np.array([point[n] for n in level.leaves])
            _, slopes = level.look(numbers)
            if np.all(np.isfinite(slopes)):
                jacobian = np.where(level.certainty(numbers, slopes) < 0, 0.0, level.jacobian(slopes))
                found.append(jacobian[:, self._place])
        return found

    def constant_factors(self, vary: bool) -> np.ndarray | None:
        """Factors with which the rows vanish at all points, one of the least differentiated having 1; or None."""
        matrices = self._matrices(vary)
        return self._factors(np.hstack(matrices)) if matrices else None

    def changing_factors(self) -> np.ndarray | None:
        """Factors with which the rows vanish at a point."""
        matrices = self._matrices(vary=False)
        return self._factors(matrices[0]) if matrices else None

    def _factors(self, matrix: np.ndarray) -> np.ndarray | None:
        from scipy.linalg import qr, solve_triangular

        rows, columns = balance(matrix, 1)  # at such a point nothing is small by accident
        sizes = np.linalg.norm(rows * matrix * columns, axis=1, keepdims=True)
        rows = rows / np.where(sizes > 0, sizes, 1.0)
        r, order = cast(
            tuple[np.ndarray, np.ndarray], qr((rows * matrix * columns).T, mode="r", pivoting=True)
        )
        rank = int(np.count_nonzero(np.abs(np.diag(r)) > RANK))
        if rank == len(matrix):
            return None
        found = np.zeros(len(matrix))
        found[order[:rank]] = -solve_triangular(r[:rank, :rank], r[:rank, rank])
        found[order[rank]] = 1.0
        found[np.abs(found) <= RANK] = 0.0
        there = np.flatnonzero(found)
        least = min(self.counts[i] for i in there)
        first = max((i for i in there if self.counts[i] == least), key=lambda i: abs(found[i]))
        found *= rows.ravel()
        return np.array([_fraction(x) for x in found / found[first]])

    def symbols_of(self, factors: np.ndarray) -> list[str]:
        """The highest derivatives that cancel."""
        there = np.any(self._matrices(vary=False)[0][np.flatnonzero(factors)] != 0, axis=0)
        return [self.level.leaves[k] for k, stands in zip(self._place, there, strict=True) if stands]

    def parameters_of(self, factors: np.ndarray) -> frozenset[str]:
        """Parameters in the coefficients that cancel."""
        rows = ca.vertcat(*(self.level.residuals[i] for i in np.flatnonzero(factors)))
        unknowns = set(self.level.unknowns)
        x = [leaf for leaf in ca.symvar(rows) if leaf.name() in unknowns]
        return frozenset(s.name() for s in ca.symvar(ca.jacobian(rows, ca.vertcat(*x)))) & self.parameters


def _fraction(x: float) -> float:
    """A number without the rounding of the simple fraction that it is meant to be."""
    near = float(Fraction(x).limit_denominator(DENOMINATOR))
    return near if abs(near - x) <= NOISE * abs(x) else x


def _replaced(
    reduced: Reduced, indexed: Indexed, factors: np.ndarray, points: Sequence[Mapping[str, float]]
) -> Reduced:
    """The equations with a combination in place of the one among them that is differentiated least and has the factor 1."""
    there = np.flatnonzero(factors).tolist()
    least = min(indexed.counts[i] for i in there)
    place = next(i for i in there if indexed.counts[i] == least and factors[i] == 1)
    parts = ca.vertcat(*(indexed.residuals[i, indexed.counts[i] - least] for i in there))
    residual = _without_cancelled(parts, factors[there], points)
    names = " and ".join(reduced.equations[i].name for i in there)
    equation = replace(
        reduced.equations[place],
        left=residual,
        right=ca.SX(0),
        label=f"combination of {names}" if len(there) > 1 else names,
    )

    def exchanged(column: Sequence[Any], new: Any) -> tuple[Any, ...]:
        return tuple(new if i == place else old for i, old in enumerate(column))

    return replace(
        reduced,
        residuals=exchanged(reduced.residuals, residual),
        compact=exchanged(reduced.compact, residual),
        equations=exchanged(reduced.equations, equation),
        rates={i: rate for i, rate in reduced.rates.items() if i != place},
    )


def _without_cancelled(parts: ca.SX, factors: np.ndarray, points: Sequence[Mapping[str, float]]) -> ca.SX:
    """The combination of parts, without the symbols on which it does not depend."""
    leaves = ca.symvar(parts)
    x, total = ca.vertcat(*leaves), ca.dot(ca.DM(factors), parts)
    look = ca.Function("slopes", [x], [ca.densify(ca.jacobian(parts, x))])
    cancelled = np.ones(len(leaves), dtype=bool)
    for point in points:
        slopes = np.array(look([point[leaf.name()] for leaf in leaves]))
        cancelled &= np.abs(factors @ slopes) <= NOISE * (np.abs(factors) @ np.abs(slopes))
    gone = [leaf for leaf, zero in zip(leaves, cancelled, strict=True) if zero]
    if not gone:
        return total
    # what does not depend on a symbol may be read at any value of it where it is finite
    zero, one = (ca.substitute(total, ca.vertcat(*gone), ca.DM([value] * len(gone))) for value in (0.0, 1.0))
    finite = ca.Function("at", [x], [zero])([points[0][leaf.name()] for leaf in leaves]).is_regular()
    return zero if finite else one
