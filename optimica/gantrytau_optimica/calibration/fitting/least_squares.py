"""The least squares of links that share numbers: closure errors, priors and a tape measure."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from gantrytau_optimica.calibration.fitting.gauss_newton import Minimum, gauss_newton
from gantrytau_optimica.calibration.links.closure import condense
from gantrytau_optimica.calibration.links.groups import Group


@dataclass(frozen=True)
class Problem:
    """Squares to be minimised: a group whose chains are condensed and weighted, with its prior as further rows."""

    group: Group
    condensed: tuple
    noise: float  # of a closure error; scales the prior

    def errors(self, x: np.ndarray) -> np.ndarray:
        """All rows."""
        rows = [c.error(x[p]) for c, p in zip(self.condensed, self.group.places, strict=True)]
        rows.append(np.array([self.noise * (x[i] - m) / d for i, (m, d) in self.group.prior.items()]))
        return np.concatenate(rows)

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """Their derivatives by all of x / scale."""
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
        return np.vstack(blocks) * self.group.scale


def problem(group: Group, weights: np.ndarray | None = None, noise: float = 0.0) -> Problem:
    """The least squares of a group; weights: of the poses, (N,); noise of a closure error, for the prior."""
    return Problem(group, tuple(condense(c, weights) for c in group.chains), noise)


def minimise(found: "Problem | Taped", x: np.ndarray, smallest: float = 0.0, **along: Any) -> Minimum:
    """Gauss-Newton from x; along: directions, movable: along which it moves, as `gauss_newton` says."""
    group = found.group
    return gauss_newton(
        found.errors, found.slopes, x, group.free, scale=group.scale, smallest=smallest, **along
    )


@dataclass(frozen=True)
class Taped:
    """The squares of a problem, and those of all its free numbers about the start values, by a weight for each metre."""

    problem: Problem
    weight: float

    @property
    def group(self) -> Group:
        """The links."""
        return self.problem.group

    def errors(self, x: np.ndarray) -> np.ndarray:
        """All rows."""
        moved = (x - self.group.x) / self.group.scale
        return np.concatenate([self.problem.errors(x), self.weight * moved[self.group.free]])

    def slopes(self, x: np.ndarray) -> np.ndarray:
        """Their derivatives by all of x / scale."""
        return np.vstack([self.problem.slopes(x), self.weight * np.eye(len(x))[self.group.free]])
