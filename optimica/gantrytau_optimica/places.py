"""Where the unknowns of a transcribed problem stand, and the constant matrices that pick them out."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse

from gantrytau_optimica.records import ControlProblem
from gantrytau_optimica.scheme import Collocation, interpolation

Sparse = Any  # a matrix of scipy.sparse


@dataclass(frozen=True, eq=False)
class Places:
    """Index of every unknown of n elements with k points.

    free: numbers; starts (n + 1, nx): states at the borders; states (n, k, nx), algebraics and inputs (n, k, .) at
    the points. With Radau points the last point of an element is the start of the next. size: of all unknowns.
    """

    problem: ControlProblem
    mesh: np.ndarray
    scheme: Collocation
    free: np.ndarray
    starts: np.ndarray
    states: np.ndarray
    algebraics: np.ndarray
    inputs: np.ndarray
    size: int

    @cached_property
    def fractions(self) -> np.ndarray:
        """Where on [0, 1] the points lie, (n k,)."""
        return (self.mesh[:-1, None] + np.diff(self.mesh)[:, None] * self.scheme.points).ravel()

    @cached_property
    def scale(self) -> np.ndarray:
        """Typical size of every unknown."""
        scale = np.ones(self.size)
        for signals, table in self.tables():
            for column, signal in enumerate(signals):
                scale[table[..., column]] = signal.nominal
        for place, number in zip(self.free, self.problem.free, strict=True):
            scale[place] = max(abs(number.guess), 1e-3)
        return scale

    def tables(self):
        """Signals with the table of their places."""
        problem = self.problem
        return (
            (problem.states, self.starts),
            (problem.states, self.states),
            (problem.algebraics, self.algebraics),
            (problem.inputs, self.inputs),
        )

    def at_points(self) -> Sparse:
        """Matrix from the scaled unknowns to signals and free numbers at all points, one point after another."""
        count = self.fractions.size
        columns = [
            table.reshape(count, table.shape[2]) for table in (self.states, self.algebraics, self.inputs)
        ]
        columns.append(np.tile(self.free, (count, 1)))
        place = np.hstack(columns).ravel()
        return sparse.csr_matrix(
            (self.scale[place], (np.arange(place.size), place)), shape=(place.size, self.size)
        )

    def at_fraction(self, fraction: float) -> Sparse:
        """Matrix from the scaled unknowns to the signals at one place of [0, 1], by the element's polynomials."""
        e = int(np.clip(np.searchsorted(self.mesh, fraction, side="right") - 1, 0, self.mesh.size - 2))
        local = np.array([(fraction - self.mesh[e]) / (self.mesh[e + 1] - self.mesh[e])])
        nodes = np.vstack([self.starts[e], self.states[e]])
        parts = [(nodes, interpolation(self.scheme.nodes, local)[0])]
        parts += [
            (table[e], interpolation(self.scheme.points, local)[0])
            for table in (self.algebraics, self.inputs)
        ]
        rows, places, values = [], [], []
        row = 0
        for table, weights in parts:
            for column in table.T:
                used = np.abs(weights) > 1e-14  # at a node all weights but one are zero
                rows += [row] * int(used.sum())
                places += column[used].tolist()
                values += (weights[used] * self.scale[column[used]]).tolist()
                row += 1
        return sparse.csr_matrix((values, (rows, places)), shape=(row, self.size))

    def numbers(self) -> Sparse:
        """Matrix from the scaled unknowns to the free numbers."""
        count = self.free.size
        return sparse.csr_matrix(
            (self.scale[self.free], (np.arange(count), self.free)), shape=(count, self.size)
        )

    def slopes(self) -> Sparse:
        """Matrix to the derivatives, with respect to the share of its element, of all states at all points."""
        differentiation, sizes = (
            self.scheme.differentiation,
            np.array([s.nominal for s in self.problem.states]),
        )
        n, k, nx = self.states.shape
        nodes = np.concatenate([self.starts[:-1, None, :], self.states], axis=1)  # (n, k + 1, nx)
        place = np.broadcast_to(nodes[:, None], (n, k, k + 1, nx))
        value = np.broadcast_to(differentiation.T[None, :, :, None] / sizes, place.shape) * self.scale[place]
        row = np.broadcast_to(np.arange(n * k * nx).reshape(n, k, 1, nx), place.shape)
        return sparse.csr_matrix((value.ravel(), (row.ravel(), place.ravel())), shape=(n * k * nx, self.size))

    def jumps(self) -> Sparse:
        """Matrix to the end of each element less the start of the next; no rows where the two are one unknown."""
        sizes = np.array([s.nominal for s in self.problem.states])
        n, _, nx = self.states.shape
        if self.scheme.points[-1] == 1.0:
            return sparse.csr_matrix((0, self.size))
        nodes = np.concatenate([self.starts[:-1, None, :], self.states, self.starts[1:, None, :]], axis=1)
        weights = np.concatenate([self.scheme.end, [-1.0]])
        value = weights[None, :, None] / sizes * self.scale[nodes]
        row = np.broadcast_to(np.arange(n * nx).reshape(n, 1, nx), nodes.shape)
        return sparse.csr_matrix((value.ravel(), (row.ravel(), nodes.ravel())), shape=(n * nx, self.size))


def lay_out(problem: ControlProblem, mesh: np.ndarray, scheme: Collocation) -> Places:
    """Free numbers first, then element after element, so that what belongs together stands together."""
    n, k = mesh.size - 1, scheme.points.size
    nx, nz, nu = (len(signals) for signals in (problem.states, problem.algebraics, problem.inputs))
    nf, per_point = len(problem.free), nx + nz + nu
    shared = scheme.points[-1] == 1.0
    per_element = k * per_point + (0 if shared else nx)
    first = nf + nx
    point = first + per_element * np.arange(n)[:, None] + per_point * np.arange(k)[None, :]
    states, algebraics, inputs = (
        point[..., None] + offset + np.arange(size) for offset, size in ((0, nx), (nx, nz), (nx + nz, nu))
    )
    ends = (
        states[:, -1] if shared else (first + per_element * np.arange(1, n + 1) - nx)[:, None] + np.arange(nx)
    )
    starts = np.vstack([nf + np.arange(nx), ends])
    size = first + per_element * n
    return Places(problem, mesh, scheme, np.arange(nf), starts, states, algebraics, inputs, size)
