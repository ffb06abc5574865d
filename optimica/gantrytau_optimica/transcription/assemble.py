"""Many copies of a small function, summed into one nonlinear program with exact sparse derivatives.

A term evaluates `values(local, parameters, constants)` for N columns of local variables. It is tied to the
program by two constant sparse matrices:

    local = gather w              w: variables of the program, (n,); local: (m N,)
    g     = linear w + sum over the terms of scatter values

Hence the nonzeros of Jacobian and Hessian are linear in the nonzeros of the small functions' derivatives,
and the matrices of these relations are computed once. Nothing is differentiated at the size of the program.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gantrytau.kernels import Kernel, kernel_for

EVALUATIONS = 100  # of the functions of a program, that a solve is expected to take

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Sparse = Any  # a matrix of scipy.sparse
Entries = tuple[Indices, Indices, Indices, Array]  # row, column, number of the nonzero in its term, factor


@dataclass(frozen=True, eq=False)
class Term:
    """N copies of a small function, and where they stand in the program."""

    local: ca.SX  # (m,)
    parameters: ca.SX
    constants: ca.SX  # (c,), differ from copy to copy
    values: ca.SX  # (k,)
    constant_values: Array  # (c, N)
    gather: Sparse  # (m N, n)
    scatter: Sparse  # (rows, k N)

    @property
    def copies(self) -> int:
        """N."""
        return self.constant_values.shape[1]

    def call(
        self,
        name: str,
        result: ca.SX,
        w: ca.MX,
        p: ca.MX,
        weights: ca.SX | None = None,
        weight_values: ca.MX | None = None,
        kernels: list[Kernel] | None = None,
    ) -> ca.MX:
        """All copies of an expression of the local variables, stacked into one column; kernels: where one is to be noted."""
        symbols = [self.local, self.parameters, self.constants]
        local = ca.reshape(ca.mtimes(to_dm(self.gather), w), self.local.numel(), self.copies)
        arguments = [local, ca.repmat(p, 1, self.copies), ca.MX(ca.DM(self.constant_values))]
        if weights is not None and weight_values is not None:
            symbols.append(weights)
            arguments.append(ca.reshape(weight_values, weights.numel(), self.copies))
        function = ca.Function(name, symbols, [result])
        if kernels is not None:
            kernels.append(kernel_for(function, calls=EVALUATIONS * self.copies))
            function = kernels[-1].function
        return ca.vec(function.map(self.copies)(*arguments))


@dataclass(frozen=True, eq=False)
class Assembled:
    """The program in the form that CasADi's nlpsol takes: minimise the objective terms' sum; the rows are linear w + the
    constraint terms' sum. Its functions are made when they are first asked for, and not sent to other processes.

    compiled: whether small Jacobians and Hessians are kernels where that pays; nlpsol differentiates `nlp` itself.
    """

    objective: Sequence[Term]
    constraints: Sequence[Term]
    linear: Sparse
    compiled: bool

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @property
    def variables(self) -> int:
        """Their number."""
        return self.linear.shape[1]

    @property
    def rows(self) -> int:
        """Their number."""
        return self.linear.shape[0]

    @cached_property
    def _kernels(self) -> list[Kernel] | None:
        """Of its functions; None if there are to be none."""
        return [] if self.compiled else None

    @property
    def awaited(self) -> bool:
        """Whether kernels may be there by now that its functions do not use."""
        return any(kernel.awaited for kernel in self._kernels or ())

    @cached_property
    def _symbols(self) -> tuple[ca.MX, ca.MX]:
        """Variables, and parameters, of which there are none."""
        return ca.MX.sym("x", self.variables), ca.MX.sym("p", 0)

    @cached_property
    def nlp(self) -> ca.Function:
        """(x, p) -> (f, g)"""
        w, p = self._symbols
        f = sum((self._values(term) for term in self.objective), ca.MX(0))
        g = sum((self._values(term) for term in self.constraints), ca.mtimes(to_dm(self.linear), w))
        return ca.Function("nlp", [w, p], [ca.densify(f), ca.densify(g)], ["x", "p"], ["f", "g"])

    @cached_property
    def grad_f(self) -> ca.Function:
        """(x, p) -> (f, gradient); nlpsol asks for the second result only: the first is a structural zero."""
        gradient = self._jacobian(self.objective, sparse.csr_matrix((1, self.variables)))
        found = [ca.MX(1, 1), ca.densify(gradient.T)]
        return ca.Function("nlp_grad_f", [*self._symbols], found, ["x", "p"], ["f", "grad_f_x"])

    @cached_property
    def jac_g(self) -> ca.Function:
        """(x, p) -> (g, Jacobian), the first a structural zero again."""
        found = [ca.MX(self.rows, 1), self._jacobian(self.constraints, self.linear)]
        return ca.Function("nlp_jac_g", [*self._symbols], found, ["x", "p"], ["g", "jac_g_x"])

    @cached_property
    def hess_lag(self) -> ca.Function:
        """(x, p, lam_f, lam_g) -> upper triangle of the Hessian of the Lagrangian."""
        lam_f, lam_g = ca.MX.sym("lam_f"), ca.MX.sym("lam_g", self.rows)
        weighted = [(term, lam_f) for term in self.objective] + [(term, lam_g) for term in self.constraints]
        names = ["x", "p", "lam_f", "lam_g"]
        found = [self._hessian(weighted)]
        return ca.Function(
            "nlp_hess_l", [*self._symbols, lam_f, lam_g], found, names, ["triu_hess_gamma_x_x"]
        )

    def _values(self, term: Term) -> ca.MX:
        values = term.call("values", term.values, *self._symbols)
        return ca.mtimes(to_dm(term.scatter), values)

    def _jacobian(self, terms: Sequence[Term], linear: Sparse) -> ca.MX:
        """Jacobian of the rows: nonzeros of the small Jacobians times their scatter and gather factors."""
        nonzeros, entries = [], []
        for term in terms:
            small = ca.jacobian(term.values, term.local)
            if small.nnz() == 0:
                continue
            nonzeros.append(term.call("jacobian", small.nz[:], *self._symbols, kernels=self._kernels))
            row, column = (np.array(part) for part in small.sparsity().get_triplet())
            copy = np.arange(term.copies)[:, None]
            source, rows, up = _expand(term.scatter.tocsc(), (copy * term.values.numel() + row).ravel())
            inner, columns, down = _expand(term.gather, (copy * term.local.numel() + column).ravel()[source])
            entries.append((rows[inner], columns, source[inner], up[inner] * down))
        return _sum_into(entries, nonzeros, linear.tocoo())

    def _hessian(self, terms: Sequence[tuple[Term, ca.MX]]) -> ca.MX:
        """Upper triangle of the Hessian of the sum of multiplier * row."""
        nonzeros, entries = [], []
        for term, multipliers in terms:
            weights = ca.SX.sym("weights", term.values.numel())
            small = ca.triu(ca.hessian(ca.dot(weights, term.values), term.local)[0])
            if small.nnz() == 0:
                continue
            values = ca.mtimes(to_dm(term.scatter.T.tocsr()), multipliers)
            nonzeros.append(term.call("hessian", small.nz[:], *self._symbols, weights, values, self._kernels))
            row, column = (np.array(part) for part in small.sparsity().get_triplet())
            # the other triangle of a small Hessian may reach the upper one of the large
            mirrored = np.flatnonzero(row != column)
            number = np.concatenate([np.arange(len(row)), mirrored])
            row, column = np.concatenate([row, column[mirrored]]), np.concatenate([column, row[mirrored]])
            copy = np.arange(term.copies)[:, None]
            source, rows, up = _expand(term.gather, (copy * term.local.numel() + row).ravel())
            inner, columns, down = _expand(term.gather, (copy * term.local.numel() + column).ravel()[source])
            rows, factor = rows[inner], up[inner] * down
            place = (copy * small.nnz() + number).ravel()[source][inner]
            keep = rows <= columns
            entries.append((rows[keep], columns[keep], place[keep], factor[keep]))
        return _sum_into(entries, nonzeros, sparse.coo_matrix((self.variables,) * 2))


def _expand(matrix: Sparse, lines: Indices) -> tuple[Indices, Indices, Array]:
    """The nonzeros of the named lines (rows of csr, columns of csc): position in `lines`, index, value."""
    first, count = matrix.indptr[lines], np.diff(matrix.indptr)[lines]
    source = np.repeat(np.arange(len(lines)), count)
    within = np.arange(len(source)) - np.repeat(np.cumsum(count) - count, count)
    place = first[source] + within
    return source, matrix.indices[place], matrix.data[place]


def _sum_into(entries: Sequence[Entries], nonzeros: Sequence[ca.MX], fixed: Sparse) -> ca.MX:
    """The constant matrix `fixed` (coo) and, on top of it, the nonzeros of the terms times their factors."""
    shape = fixed.shape
    offsets = np.cumsum([0] + [part.numel() for part in nonzeros])
    parts = [
        (r, c, place + offset, factor)
        for (r, c, place, factor), offset in zip(entries, offsets, strict=False)
    ]
    fixed_row, fixed_column, fixed_value = fixed.row, fixed.col, fixed.data
    row = np.concatenate([part[0] for part in parts] + [fixed_row]).astype(np.int64)
    column = np.concatenate([part[1] for part in parts] + [fixed_column]).astype(np.int64)
    keys, slot = np.unique(column * shape[0] + row, return_inverse=True)
    pattern = ca.Sparsity.triplet(shape[0], shape[1], (keys % shape[0]).tolist(), (keys // shape[0]).tolist())
    moving = len(row) - len(fixed_row)
    values = ca.MX(ca.DM(np.bincount(slot[moving:], weights=fixed_value, minlength=len(keys))))
    if nonzeros:
        place, factor = (np.concatenate([part[i] for part in parts]) for i in (2, 3))
        total = sparse.csr_matrix((factor, (slot[:moving], place)), shape=(len(keys), int(offsets[-1])))
        values = values + ca.mtimes(to_dm(total), ca.vertcat(*nonzeros))
    return ca.MX(pattern, values)


def to_dm(matrix: Sparse) -> ca.DM:
    """A constant sparse matrix for CasADi; zeros stay structural."""
    columns = matrix.tocsc()
    columns.sum_duplicates()
    columns.sort_indices()
    pattern = ca.Sparsity(matrix.shape[0], matrix.shape[1], columns.indptr.tolist(), columns.indices.tolist())
    return ca.DM(pattern, columns.data)


def scipy_matrix(matrix: ca.DM) -> Sparse:
    """A matrix of CasADi as one of SciPy; `DM.sparse` is None where Ctrl-C is pressed while it asks Python for SciPy."""
    pattern = matrix.sparsity()
    return sparse.csc_matrix(
        (np.array(matrix.nonzeros()), pattern.row(), pattern.colind()), shape=matrix.shape
    )
