"""Derivatives that cancel between equations: the incidence of the system is regular, its Jacobian is not.

The signature method needs a regular Jacobian of the differentiated equations by the highest derivatives. Where constant
factors u make its rows vanish, u^T J = 0, the equation that is differentiated least is replaced by the combination

    sum of u_i d^(c_i - c) f_i / dt^(c_i - c)      c: how often it is differentiated itself

which holds lower derivatives only and has the same solutions together with the others (the linear combination method of Tan,
Nedialkov and Pryce, ACM Trans. Math. Softw. 43, 2017). Whether J is regular is seen at points chosen at random.
"""

from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from fractions import Fraction
from typing import Any, cast

import casadi as ca
import numpy as np

from gantrytau.border.refusal import InitializationError, StructureError
from gantrytau.compiler.aliases import Reduced
from gantrytau.compiler.index_reduction import Indexed, reduce_index
from gantrytau.compiler.refusals import held_together
from gantrytau.compiler.start.balance import balance
from gantrytau.compiler.start.start_values import start_values
from gantrytau.flattening.flat_model import FlatModel

POINTS = 3
SPREAD = 0.4  # of values around the start
RANK = 1e-9  # of a row of length one, beyond the span of others, below which it depends on them
NOISE = 1e-10  # of the terms of a derivative, below which they cancel
MOST_ORDERS = 10  # of derivatives, of which each combination takes one away
DENOMINATOR = 1000  # of factors that are meant as fractions


def combined(
    reduced: Reduced, flat: FlatModel, wanted: Sequence[str], error: Exception
) -> tuple[Reduced, frozenset[str]]:
    """Equations, linearly combined where derivatives cancel, and the parameters whose values make derivatives cancel.

    With such parameters the equations come back unchanged. Raises `error` where no derivatives cancel, StructureError
    where the factors of a combination are not constant or the combination determines no unknown.
    """
    found, names, parameters = reduced, [], set(reduced.table.independent)
    for _ in range(MOST_ORDERS * len(reduced.unknowns)):
        try:
            indexed = reduce_index(found, flat, wanted)
        except StructureError:
            if isinstance(error, StructureError) or not names:
                raise error from None
            raise held_together(flat.name, names, "what it leaves determines no unknown") from None
        values = start_values(flat, found, indexed.symbols(found.known)).values
        points = _points(values, parameters)
        factors = _factors(indexed, _points(values, set()))
        if factors is None:
            factors = _factors(indexed, points)
            decisive = frozenset() if factors is None else _coefficients(indexed, factors) & parameters
            if decisive:
                return found, decisive
        if factors is None:
            changing = _factors(indexed, points[:1])
            if changing is not None and isinstance(error, InitializationError):
                names = [indexed.names[i] for i in np.flatnonzero(changing)]
                raise held_together(flat.name, names, "its factors change with the motion") from None
            if found is reduced:
                raise error
            return found, frozenset()
        names = [indexed.names[i] for i in np.flatnonzero(factors)]
        found = _replaced(found, indexed, factors, points)
    raise error


def _points(values: Mapping[str, float], held: Set[str]) -> list[dict[str, float]]:
    """Random values of all symbols around the given ones; the symbols `held` keep their values."""
    random = np.random.default_rng(0)
    moves = ((n, x, random.uniform(-SPREAD, SPREAD)) for _ in range(POINTS) for n, x in values.items())
    moved = [(n, x if n in held else x * (1 + share) if x else share) for n, x, share in moves]
    return [dict(moved[k * len(values) : (k + 1) * len(values)]) for k in range(POINTS)]


def _factors(indexed: Indexed, points: Sequence[Mapping[str, float]]) -> np.ndarray | None:
    """Factors (n,) of a sum of rows of the Jacobian by the highest derivatives, zero at all points; None if regular.

    An equation that is differentiated least has the factor 1.
    """
    from scipy.linalg import qr, solve_triangular

    level, found = indexed.levels[-1], []
    place = [k for k, n in enumerate(level.leaves) if n in set(level.unknowns)]
    for point in points:
        numbers = np.array([point[n] for n in level.leaves])
        entries = np.where(level.certainty(numbers) < 0, 0.0, level.look(numbers)[1])
        found.append(level.jacobian(entries)[:, place])
    matrix = np.hstack(found)
    if not np.all(np.isfinite(matrix)):
        return None
    rows, columns = balance(matrix, 1)  # at such points nothing is small by accident
    sizes = np.linalg.norm(rows * matrix * columns, axis=1, keepdims=True)
    rows = rows / np.where(sizes > 0, sizes, 1.0)
    transposed = (rows * matrix * columns).T
    r, order = cast(tuple[np.ndarray, np.ndarray], qr(transposed, mode="r", pivoting=True))
    rank = int(np.count_nonzero(np.abs(np.diag(r)) > RANK))
    if rank == len(matrix):
        return None
    factors = np.zeros(len(matrix))
    factors[order[:rank]] = -solve_triangular(r[:rank, :rank], r[:rank, rank])
    factors[order[rank]] = 1.0
    factors[np.abs(factors) <= RANK] = 0.0
    there = np.flatnonzero(factors)
    first = min(there, key=lambda i: (indexed.counts[i], -abs(factors[i])))
    factors *= rows.ravel()
    return np.array([_fraction(x) for x in factors / factors[first]])


def _coefficients(indexed: Indexed, factors: np.ndarray) -> frozenset[str]:
    """Names of all symbols in the entries of the rows with a factor."""
    level = indexed.levels[-1]
    rows = ca.vertcat(*(level.residuals[i] for i in np.flatnonzero(factors)))
    x = [leaf for leaf in ca.symvar(rows) if leaf.name() in set(level.unknowns)]
    return frozenset(leaf.name() for leaf in ca.symvar(ca.jacobian(rows, ca.vertcat(*x))))


def _fraction(x: float) -> float:
    """The simple fraction within rounding of a number, else the number."""
    near = float(Fraction(x).limit_denominator(DENOMINATOR))
    return near if abs(near - x) <= NOISE * abs(x) else x


def _replaced(
    reduced: Reduced, indexed: Indexed, factors: np.ndarray, points: Sequence[Mapping[str, float]]
) -> Reduced:
    """The equations; the combination replaces the equation of factor 1 that is differentiated least."""
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
    look = ca.Function("jacobian", [x], [ca.densify(ca.jacobian(parts, x))])
    cancelled = np.ones(len(leaves), dtype=bool)
    for point in points:
        jacobian = np.array(look([point[leaf.name()] for leaf in leaves]))
        cancelled &= np.abs(factors @ jacobian) <= NOISE * (np.abs(factors) @ np.abs(jacobian))
    gone = [leaf for leaf, zero in zip(leaves, cancelled, strict=True) if zero]
    return ca.substitute(total, ca.vertcat(*gone), ca.SX.zeros(len(gone))) if gone else total
