"""Picard's sweeps over many pieces of a phase at once, from a guess to rounding.

    x(s) <- x(0) + h int_0^s f(x, z) ds,  z <- z - J^-1 g(x, z),  J = dg/dz at the guess

Errors fall by a factor of h |df/dx| a sweep. What has settled solves the equations; whether polynomials through the places
resolve it is told by the highest of them.
"""

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

# Chebyshev's extremes: interpolation between them converges
PLACES = 0.5 - 0.5 * np.cos(np.pi * np.arange(17) / 16)
CLOSE = 0.1  # of its size: by how much a first sweep may change a state
SETTLED = 1e-12  # of its size: the last change of a state that is left to rounding
STILL = 1e-8  # the same of an algebraic, by its largest value
RESOLVED = 1e-12  # of its size: what the highest polynomials have of the rate of a state
AT_ONCE = 64  # pieces whose Jacobians are inverted together


def _partial_integrals(places: np.ndarray) -> np.ndarray:
    """Weights (n, n) of the integrals from 0 to each place, exact for polynomials through the places."""
    primitives = np.polynomial.legendre.legint(np.eye(places.size), lbnd=-1, axis=0)
    return (np.polynomial.legendre.legval(2 * places - 1, primitives).T / 2) @ _transform(places)


def _transform(places: np.ndarray) -> np.ndarray:
    """From values at places to shares of the polynomials of Legendre, (n, n)."""
    return np.linalg.inv(np.polynomial.legendre.legvander(2 * places - 1, places.size - 1))


INTEGRALS, HIGHEST = _partial_integrals(PLACES), _transform(PLACES)[-2:]


@dataclass(frozen=True, eq=False)
class Swept:
    """States (n, 17, nx) and algebraics found by iteration (n, 17, m) of n pieces; settled (n,): whether they solve the
    equations; rough (n,): whether 17 places do not resolve their rates; inverse (n, 17, m, nz): rows of the inverse Jacobian
    for these algebraics.
    """

    x: np.ndarray
    kept: np.ndarray
    settled: np.ndarray
    rough: np.ndarray
    inverse: np.ndarray


@dataclass(frozen=True, eq=False)
class Sweeps:
    """The equations of a phase over a piece, as functions of (place, x, kept z, p).

    rates: of states by the place; residuals, matrix: all residuals and their Jacobian by all algebraics; algebraics: all of
    them, by closed forms where they are not `kept`; sizes: of states.
    """

    rates: ca.Function
    residuals: ca.Function
    matrix: ca.Function
    algebraics: ca.Function
    kept: np.ndarray
    sizes: np.ndarray

    def from_guess(self, x: np.ndarray, kept: np.ndarray, p: np.ndarray) -> Swept:
        """Pieces with parameters p (n, k) from a guess, whose first states stay."""
        inverse = np.zeros((*kept.shape, self.matrix.size1_out(0) if self.kept.size else 0))
        for part in range(0, len(x) if self.kept.size else 0, AT_ONCE):
            here = slice(part, part + AT_ONCE)
            found = self.values(self.matrix, x[here], kept[here], p[here])
            matrices = found.reshape(*found.shape[:2], *self.matrix.size_out(0)).swapaxes(2, 3)
            try:
                inverse[here] = np.linalg.inv(matrices)[:, :, self.kept]
            except np.linalg.LinAlgError:  # singular at one of the places
                inverse[here] = np.nan
        return self.swept(x, kept, inverse, p)

    def swept(self, x: np.ndarray, kept: np.ndarray, inverse: np.ndarray, p: np.ndarray) -> Swept:
        """`from_guess` with known Jacobians; sweeps end where they do not halve the change of states any more."""
        x, kept = x.copy(), kept.copy()
        settled, rough = np.zeros((2, len(p)), bool)
        open_ones, last = np.arange(len(p)), np.full(len(p), CLOSE)
        while open_ones.size:
            here, still = open_ones, np.ones(open_ones.size, bool)
            if self.kept.size:
                residuals = self.values(self.residuals, x[here], kept[here], p[here])
                step = np.einsum("nsij,nsj->nsi", inverse[here], residuals)
                kept[here] -= step
                largest = np.max(np.abs(kept[here]), axis=1, keepdims=True)
                still = np.all(np.abs(step) <= STILL * largest, axis=(1, 2))
            rates = self.values(self.rates, x[here], kept[here], p[here])
            moved = x[here, :1] + INTEGRALS @ rates
            change = np.max(np.abs(moved - x[here]) / np.maximum(self.sizes, np.abs(moved)), axis=(1, 2))
            halved = change < last[here] / 2
            resolved = np.max(np.abs(HIGHEST @ rates) / self.sizes, axis=(1, 2)) < RESOLVED
            ended = ~halved & (last[here] <= SETTLED)
            settled[here], rough[here] = ended & resolved & still, ended & ~resolved
            open_ones = here[halved]
            x[open_ones], last[open_ones] = moved[halved], change[halved]
        return Swept(x, kept, settled, rough, inverse)

    def values(self, function: ca.Function, x: np.ndarray, kept: np.ndarray, p: np.ndarray) -> np.ndarray:
        """A function of x, kept and p at all places of pieces, (n, 17, k)."""
        if len(x) == 1:
            return self._one_piece[function.name()](PLACES[:, None], x[0], kept[0], p)[None]
        every = np.tile(PLACES, len(x))[:, None], x, kept, np.repeat(p, PLACES.size, axis=0)
        columns = (one.reshape(PLACES.size * len(x), one.shape[-1]).T for one in every)
        found = np.array(function(*columns))
        rows = found.reshape(function.size1_out(0), len(x), PLACES.size, function.size2_out(0))
        return rows.transpose(1, 2, 3, 0).reshape(len(x), PLACES.size, rows.shape[0] * rows.shape[3])

    @cached_property
    def _one_piece(self) -> dict[str, "InPlace"]:
        return {
            one.name(): InPlace(one) for one in (self.rates, self.residuals, self.matrix, self.algebraics)
        }


class InPlace:
    """A function at the places of one piece, on arrays that CasADi reads and writes in place."""

    def __init__(self, function: ca.Function):
        whole = function.map(PLACES.size)
        self.arguments = [np.zeros((PLACES.size, function.size1_in(i))) for i in range(function.n_in())]
        self.result = np.zeros((PLACES.size, function.numel_out(0)))
        self.buffer, self.evaluate = whole.buffer()
        for i, argument in enumerate(self.arguments):
            self.buffer.set_arg(i, argument.data)
        self.buffer.set_res(0, self.result.data)

    def __call__(self, *arguments: np.ndarray) -> np.ndarray:
        """The result, overwritten by the next call; one row of an argument stands for all places."""
        for own, argument in zip(self.arguments, arguments, strict=True):
            own[:] = argument
        self.evaluate()
        return self.result
