"""Linear systems over a whole run at once: y = T u with all samples in one vector, axis by axis.

T is made of lower triangular Toeplitz blocks of pulse responses: Dressler (2012), (7.8), (7.9).
"""

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np

from gantrytau import ModelError
from gantrytau.answers.linear_systems.linear_system import LinearSystem


@runtime_checkable
class Liftable(Protocol):
    """A linear response over a whole run that no causal system has, as that of estimators that look ahead."""

    @property
    def period(self) -> float:
        """The sampling period in s."""
        ...

    @property
    def axes(self) -> int:
        """How many corrections there are."""
        ...

    def lifted(self, samples: int) -> np.ndarray:
        """T (m N, m N), axis by axis."""
        ...


Response = LinearSystem | Sequence[LinearSystem] | Liftable  # of all axes, or of each alone
CLOSE = 1e-5  # of its square, to which the largest singular value is found
FEW = 300  # rows, up to which all singular values are found


def systems_of(response: LinearSystem | Sequence[LinearSystem]) -> tuple[LinearSystem, ...]:
    """One system of all axes, or one for each, sampled with one period. Raises ModelError for others."""
    found: tuple[Any, ...] = tuple(response) if isinstance(response, Sequence) else (response,)
    if not found or not all(isinstance(each, LinearSystem) for each in found):
        raise ModelError(
            f"Learning: found the response {response!r}, expected a sampled linear system of all axes, or one for each",
            argument="response",
        )
    periods = {each.period for each in found}
    if len(periods) > 1 or None in periods:
        words = ", ".join("none (continuous)" if p is None else f"{p:g} s" for p in sorted(periods, key=str))
        raise ModelError(
            f"Learning: found responses with periods of {words}, expected one of all; take system.discrete(period)",
            argument="response",
        )
    for each in found:
        p, m = each.D.shape
        if p != m or (len(found) > 1 and p != 1):
            raise ModelError(
                f"Learning: found a response from {m} corrections to {p} positions, expected as many of both"
                + (", one of each axis" if len(found) > 1 else ""),
                argument="response",
            )
    return found


def period_of(response: Response) -> float:
    """The sampling period in s."""
    if isinstance(response, Liftable):
        return response.period
    return float(systems_of(response)[0].period or 0.0)


def axes_of(response: Response) -> int:
    """How many corrections there are."""
    if isinstance(response, Liftable):
        return response.axes
    return sum(each.D.shape[1] for each in systems_of(response))


def pulses(system: LinearSystem, samples: int) -> np.ndarray:
    """Pulse responses (N, p, m) of a sampled system: sample k of each output after one of each input at sample 0."""
    p, m = system.D.shape
    found = np.empty((samples, p, m))
    for j in range(m):
        pulse = np.zeros((samples, m))
        pulse[0, j] = 1.0
        found[:, :, j] = system.simulate(pulse)
    return found


def toeplitz_blocks(h: np.ndarray) -> np.ndarray:
    """Pulse responses (N, p, m) as one matrix (p N, m N), axis by axis."""
    from scipy.linalg import toeplitz

    return np.block([[np.tril(toeplitz(h[:, i, j])) for j in range(h.shape[2])] for i in range(h.shape[1])])


def lifted(response: Response, samples: int) -> np.ndarray:
    """T (m N, m N)."""
    if isinstance(response, Liftable):
        return response.lifted(samples)
    found = np.zeros((axes_of(response) * samples,) * 2)
    first = 0
    for each in systems_of(response):
        block = toeplitz_blocks(pulses(each, samples))
        rows = slice(first, first + len(block))
        found[rows, rows] = block
        first += len(block)
    return found


def norm(matrix: np.ndarray) -> float:
    """The largest singular value."""
    from scipy.sparse.linalg import ArpackError, svds

    if min(matrix.shape) <= FEW:
        return float(np.linalg.norm(matrix, 2)) if matrix.size else 0.0
    try:
        start = np.random.default_rng(0).standard_normal(min(matrix.shape))
        find: Any = svds
        return float(find(matrix, k=1, v0=start, tol=CLOSE, return_singular_vectors=False)[0])
    except ArpackError:
        return float(np.linalg.norm(matrix, 2))


def spectral_radius(matrix: np.ndarray) -> float:
    """The largest eigenvalue by size; of all, as iterations do not tell those that lie close together."""
    return float(np.abs(np.linalg.eigvals(matrix)).max(initial=0.0))
