"""Links that share numbers, as one problem of least squares."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from gantrytau_optimica.calibration.fitting.gauss_newton import Minimum, gauss_newton
from gantrytau_optimica.calibration.rods.closure import Chain, condense


@dataclass(frozen=True)
class Group:
    """Chains and where in the vector x of the group their numbers stand.

    x: start values (n,); names: of the numbers, (n,); free: which of them are identified; places: for each chain the
    indices in x of its numbers; prior: deviation of a number about its start value, by index.
    """

    chains: tuple[Chain, ...]
    places: tuple[np.ndarray, ...]
    names: tuple[str, ...]
    x: np.ndarray
    free: np.ndarray
    prior: Mapping[int, tuple[float, float]] = field(default_factory=dict)

    def numbers(self, k: int, x: np.ndarray) -> np.ndarray:
        """The numbers of chain k."""
        return x[self.places[k]]

    def errors(self, x: np.ndarray) -> np.ndarray:
        """Closure errors of all poses, (N, chains) in m2."""
        return np.column_stack([c.error(x[p]) for c, p in zip(self.chains, self.places, strict=True)])

    def slopes(self, x: np.ndarray, k: int) -> np.ndarray:
        """Derivatives of the errors of chain k by the free numbers, (N, free)."""
        whole = np.zeros((len(self.chains[k].q), len(x)))
        whole[:, self.places[k]] = self.chains[k].slopes(x[self.places[k]])
        return whole[:, self.free]

    def started(self, x: np.ndarray) -> "Group":
        """The same with other start values."""
        return replace(self, x=x.copy())


@dataclass(frozen=True)
class Problem:
    """Squares to be minimised: a group whose chains are condensed and weighted, with its prior as further rows."""

    group: Group
    condensed: tuple
    noise: float  # of a closure error, m2; scales the prior

    def errors(self, x: np.ndarray) -> np.ndarray:
        """All rows."""
        rows = [c.error(x[p]) for c, p in zip(self.condensed, self.group.places, strict=True)]
        rows.append(np.array([self.noise * (x[i] - m) / d for i, (m, d) in self.group.prior.items()]))
        return np.concatenate(rows)

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """Their derivatives by all of x."""
        blocks = []
        for chain, places in zip(self.condensed, self.group.places, strict=True):
            small = chain.slopes(x[places])
            block = np.zeros((len(small), len(x)))
            block[:, places] = small
            blocks.append(block)
        for i, (_, deviation) in self.group.prior.items():
            row = np.zeros((1, len(x)))
            row[0, i] = self.noise / deviation
            blocks.append(row)
        return np.vstack(blocks)


def problem(group: Group, weights: Sequence[np.ndarray] | None = None, noise: float = 0.0) -> Problem:
    """The least squares of a group; weights: (N,) for each chain; noise of a closure error in m2, for the prior."""
    condensed = tuple(
        condense(c, None if weights is None else weights[k]) for k, c in enumerate(group.chains)
    )
    return Problem(group, condensed, noise)


def minimise(
    found: Problem, x: np.ndarray, *, directions: np.ndarray | None = None, movable: int | None = None
) -> Minimum:
    """Gauss-Newton from x; directions, movable: along which it moves, as `gauss_newton` says."""
    return gauss_newton(
        found.errors, found.slopes, x, found.group.free, directions=directions, movable=movable
    )


@dataclass(frozen=True)
class Taped:
    """The squares of a problem, and those of all its free numbers about the start values, by a weight in m2 for each m."""

    problem: Problem
    weight: float

    def errors(self, x: np.ndarray) -> np.ndarray:
        """All rows."""
        free = self.problem.group.free
        return np.concatenate([self.problem.errors(x), self.weight * (x - self.problem.group.x)[free]])

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """Their derivatives by all of x."""
        return np.vstack([self.problem.slopes(x), self.weight * np.eye(len(x))[self.problem.group.free]])
