"""Families of a response whose resonances lie elsewhere, and are damped otherwise."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol, overload

import numpy as np

from gantrytau import ModelError, StateSpace
from gantrytau.answers.linear_systems.linear_system import LinearSystem
from gantrytau_optimica.learning.runs.estimated_response import EstimatedResponse

RESONANT = 0.3  # damping ratio, below which a pair of poles is a resonance
APART = 1e-6  # cosine between left and right vectors of a mode, below which it is not apart from others

Uncertain = LinearSystem | EstimatedResponse


class OverFrequencies(Protocol):
    """Anything from corrections to what is learnt from that is known over frequencies."""

    @property
    def period(self) -> float | None:
        """The sampling period in s."""
        ...

    def response(self, frequencies: np.ndarray, /) -> np.ndarray:
        """(m, m, K) complex at frequencies (K,) in Hz."""
        ...


@overload
def uncertain(
    response: LinearSystem, frequencies: Sequence[float] = ..., damping: Sequence[float] = ...
) -> tuple[StateSpace, ...]: ...
@overload
def uncertain(
    response: EstimatedResponse, frequencies: Sequence[float] = ..., damping: Sequence[float] = ...
) -> tuple[EstimatedResponse, ...]: ...
def uncertain(
    response: Uncertain,
    frequencies: Sequence[float] = (0.92, 1.0, 1.08),
    damping: Sequence[float] = (0.7, 1.4),
) -> tuple[Uncertain, ...]:
    """A sampled response with all its resonances at these multiples of their frequencies and damping ratios, all pairs.

    What each mode gives at rest stays, and so does the static gain. Raises ModelError for a response that is not sampled,
    for multiples that are not above zero or leave a mode undamped, and for modes that are not apart.
    """
    for name, values in (("frequencies", frequencies), ("damping", damping)):
        if not len(values) or not all(np.isfinite(x) and x > 0 for x in values):
            raise ModelError(
                f"uncertain: found {name}={values!r}, expected numbers above zero", argument=name
            )
    return tuple(_moved(response, f, d) for f in frequencies for d in damping)


def _moved(response: Uncertain, frequency: float, damping: float) -> Uncertain:
    if isinstance(response, EstimatedResponse):
        return replace(response, system=_moved(response.system, frequency, damping))
    if response.period is None:
        raise ModelError(
            "uncertain: found a continuous system, expected one that is sampled; take system.discrete(period)",
            argument="response",
        )
    from scipy.linalg import eig

    # only resonances need vectors of their own: delays, whose poles are all zero, have none
    decomposed: Any = eig(response.A, left=True)
    poles, left, right = decomposed
    chosen = resonant(poles, response.period)
    poles, V, W = poles[chosen], right[:, chosen], left[:, chosen].conj().T
    apart = np.sum(W.T * V, axis=0)
    if np.any(np.abs(apart) < APART):
        raise ModelError(
            "uncertain: found resonances that are not apart, expected ones with poles of their own; take a lower order",
            argument="response",
        )
    W = W / apart[:, None]
    moved = poles.copy()
    for k, pole in enumerate(poles):
        s = np.log(pole) / response.period
        size, ratio = abs(s) * frequency, -s.real / abs(s) * damping
        if ratio >= 1 or size * np.sqrt(1 - min(ratio, 1.0) ** 2) * response.period >= np.pi:
            raise ModelError(
                f"uncertain: found a resonance of {abs(s) / 2 / np.pi:.3g} Hz that becomes {size / 2 / np.pi:.3g} Hz with "
                f"the damping ratio {ratio:.3g}, expected one below half the sampling frequency that still swings",
                argument="response",
            )
        turned = size * (-ratio + 1j * np.sqrt(1 - ratio**2))
        moved[k] = np.exp(response.period * (turned if s.imag > 0 else turned.conjugate()))
    scale = (1 - moved) / (1 - poles)  # so that each mode gives the same at rest
    A = response.A + ((V * (moved - poles)) @ W).real
    B = response.B + ((V * (scale - 1)) @ (W @ response.B)).real
    return StateSpace(A, B, response.C, response.D, period=response.period)


def resonant(poles: np.ndarray, period: float) -> np.ndarray:
    """Which poles of a sampled system are those of resonances, by number."""
    s = np.log(np.where(poles == 0, np.finfo(float).tiny, poles.astype(complex))) / period
    swings = np.abs(np.abs(s.imag) * period - np.pi) > 1e-9  # not between samples
    return np.flatnonzero((np.abs(s.imag) > 0) & swings & (-s.real < RESONANT * np.abs(s)) & (s.real < 0))
