"""Links that share parameters, and the least squares of their closure errors."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from gantrytau.describing.record import Record
from gantrytau_optimica.calibration.links.arm_links import ArmLink, ArmOverPoses
from gantrytau_optimica.calibration.links.closure import Chain, condense
from gantrytau_optimica.fitting.least_squares import Minimum, Prior, least_squares

TAPE = 0.01  # m; combinations of parameters that data hold worse than a tape measure stay where they started


def tape_limit(noise: float, tape: float = TAPE) -> float:
    """Singular value below which a direction stays at its start: a prior as wide as a tape measure still counts."""
    return noise / tape * (1 - 1e-6)


@dataclass(frozen=True)
class Group(Record):
    """Links with common parameters x.

    x: start values (n,); names: of the parameters, (n,); free: mask of the identified ones; scale: change of each for a
    metre at a joint; places: indices in x of the parameters of each link; prior: value and standard deviation by index;
    noise: standard deviation of a closure error, None to estimate it from the residuals; tape: standard deviation of the
    start values, m.
    """

    chains: tuple[Chain | ArmLink, ...]
    places: tuple[np.ndarray, ...]
    names: tuple[str, ...]
    x: np.ndarray
    free: np.ndarray
    scale: np.ndarray
    prior: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    noise: float | None = None
    tape: float = TAPE

    def parameters(self, k: int, x: np.ndarray) -> np.ndarray:
        """The parameters of chain k."""
        return x[self.places[k]]

    def errors(self, x: np.ndarray) -> np.ndarray:
        """Closure errors of all poses, (N, links), in m2, or in m where there are turntables."""
        return np.column_stack([c.error(x[p]) for c, p in zip(self.chains, self.places, strict=True)])

    def link_jacobian(self, x: np.ndarray, k: int) -> np.ndarray:
        """Derivatives of the errors of chain k by the free parameters, (N, free)."""
        whole = np.zeros((len(self.chains[k].q), len(x)))
        whole[:, self.places[k]] = self.chains[k].jacobian(x[self.places[k]])
        return whole[:, self.free]

    @property
    def count(self) -> int:
        """How many closure errors there are."""
        return sum(len(c.q) for c in self.chains)

    def condensed(self, weights: np.ndarray | None = None) -> "Group":
        """The group with links in few rows that leave the same sum of squares; weights (N,) of the poses, None for 1."""
        chains: Any = tuple(condense(c, weights) for c in self.chains)
        return replace(self, chains=chains)

    def residuals(self, x: np.ndarray) -> np.ndarray:
        """Closure errors of all links one after another, (m,)."""
        return np.concatenate([c.error(x[p]) for c, p in zip(self.chains, self.places, strict=True)])

    def jacobian(self, x: np.ndarray) -> np.ndarray:
        """Derivatives of the residuals by all parameters, (m, n)."""
        blocks = []
        for chain, places in zip(self.chains, self.places, strict=True):
            small = chain.jacobian(x[places])
            blocks.append(np.zeros((len(small), len(x))))
            blocks[-1][:, places] = small
        return np.vstack(blocks)

    def minimum(self, x: np.ndarray, noise: float, priors: Sequence[Prior] = (), **along: Any) -> Minimum:
        """Least squares from x; noise: of a closure error, which weighs the prior; along: as of `least_squares`."""
        rows = [Prior.of(self.prior, noise), *priors]
        scale = np.where(self.free, self.scale, 0.0)
        return least_squares(self.residuals, self.jacobian, x, scale=scale, priors=rows, **along)

    def started(self, x: np.ndarray) -> "Group":
        """This group with other start values."""
        return replace(self, x=x.copy())

    def over(self, q: np.ndarray, r: np.ndarray, R: np.ndarray | None) -> "Group":
        """The same links over other poses, q (N, n), r (N, 3), R (N, 3, 3)."""
        arms: dict[int, ArmOverPoses] = {}
        links: list[Chain | ArmLink] = []
        for link in self.chains:
            if isinstance(link, ArmLink):
                key = id(link.poses)
                arms.setdefault(key, ArmOverPoses(link.poses.arm, q, r, R))
                links.append(ArmLink(arms[key], link.j))
            else:
                links.append(link.over(q, r, R))
        return replace(self, chains=tuple(links))

    def distances(self, x: np.ndarray) -> np.ndarray:
        """Closure errors as differences of lengths, (N, links) in m."""
        return np.column_stack([c.distance(x[p]) for c, p in zip(self.chains, self.places, strict=True)])

    @property
    def arms(self) -> tuple[ArmOverPoses, ...]:
        """The arms on turntables that these links hang on."""
        found = {id(link.poses): link.poses for link in self.chains if isinstance(link, ArmLink)}
        return tuple(found.values())

    def squares(self, x: np.ndarray) -> np.ndarray:
        """Squares of |y|^2 - L^2 of all poses, (N, links) in m4."""
        arms = {id(arm): 2 * arm.arm.lengths for arm in self.arms}
        factors = [arms[id(k.poses)][k.j] if isinstance(k, ArmLink) else 1.0 for k in self.chains]
        return (self.errors(x) * factors) ** 2
