"""Families of a response whose resonances lie elsewhere, and are damped otherwise.

What answers late does so as a sum of modes that cancel each other before: moved modes would no longer. So dead times
are taken out first, and put back behind: T = diag(z^-e) T_0 diag(z^-d), with d of inputs and e of outputs.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol, overload

import numpy as np

from gantrytau import ModelError, StateSpace
from gantrytau.answers.linear_systems.linear_system import LinearSystem
from gantrytau.border.checks import array, instance
from gantrytau.border.refusal import Given
from gantrytau_optimica.learning.laws.lifted import pulses
from gantrytau_optimica.learning.runs.estimated_response import EstimatedResponse

RESONANT = 0.3  # damping ratio, below which a pair of poles is a resonance
APART = 1e-6  # cosine between left and right vectors of a mode, below which it is not apart from others
NOTHING = 1e-12  # of the largest value of all pulse responses, below which one has not begun

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
        multiples = array("uncertain", name, values, (None,))
        if not multiples.size or multiples.min() <= 0:
            raise ModelError("expected numbers above zero", place="uncertain", found=Given(name, values))
    expected = "a sampled linear system, or one by estimated_response"
    instance("uncertain", "response", response, Uncertain, expected)
    return tuple(_moved(response, f, d) for f in frequencies for d in damping)


def _moved(response: Uncertain, frequency: float, damping: float) -> Uncertain:
    if isinstance(response, EstimatedResponse):
        return replace(response, system=_moved(response.system, frequency, damping))
    if response.period is None:
        raise ModelError(
            "uncertain: found a continuous system, expected one that is sampled; take system.discrete(period)",
            argument="response",
        )
    late = dead_times(response)
    prompt = _advanced(response, *late)
    # only resonances need vectors of their own: delays, whose poles are all zero, have none
    poles, V, W = _resonances(response)
    moved = np.array(
        [_moved_pole(pole, response.period, frequency, damping) for pole in poles], dtype=complex
    )
    scale = (1 - moved) / (1 - poles)  # so that each mode gives the same at rest
    A = prompt.A + np.real((V * (moved - poles)) @ W)
    B = prompt.B + np.real((V * (scale - 1)) @ (W @ prompt.B))
    return _delayed(StateSpace(A, B, prompt.C, prompt.D, period=response.period), *late)


def _resonances(system: LinearSystem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Poles (k,), right vectors V (n, k) and left ones W (k, n), W V = I. Raises ModelError for poles that coincide."""
    from scipy.linalg import eig

    decomposed: Any = eig(system.A, left=True)
    poles, left, right = decomposed
    chosen = resonant(poles, float(system.period or 0.0))
    V, W = right[:, chosen], left[:, chosen].conj().T
    apart = np.sum(W.T * V, axis=0)
    if np.any(np.abs(apart) < APART):
        raise ModelError(
            "uncertain: found resonances that are not apart, expected ones with poles of their own; take a lower order",
            argument="response",
        )
    return poles[chosen], V, W / apart[:, None]


def _moved_pole(pole: complex, period: float, frequency: float, damping: float) -> complex:
    s = np.log(pole) / period
    size, ratio = abs(s) * frequency, -s.real / abs(s) * damping
    if ratio >= 1 or size * np.sqrt(1 - min(ratio, 1.0) ** 2) * period >= np.pi:
        raise ModelError(
            f"uncertain: found a resonance of {abs(s) / 2 / np.pi:.3g} Hz that becomes {size / 2 / np.pi:.3g} Hz with "
            f"the damping ratio {ratio:.3g}, expected one below half the sampling frequency that still swings",
            argument="response",
        )
    turned = size * (-ratio + 1j * np.sqrt(1 - ratio**2))
    return np.exp(period * (turned if s.imag > 0 else turned.conjugate()))


def dead_times(system: LinearSystem) -> tuple[np.ndarray, np.ndarray]:
    """Samples d (m,) before any output answers to an input, and e (p,) before outputs answer to any besides."""
    last = len(system.A) + 1  # what is zero until then is zero for ever: Cayley and Hamilton
    h = np.abs(pulses(system, last))
    begun = h > NOTHING * h.max(axis=(0, 2), keepdims=True)
    first = np.where(begun.any(axis=0), np.argmax(begun, axis=0), last)
    of_inputs = first.min(axis=0)
    of_outputs = (first - of_inputs).min(axis=1)
    # what never answers is not late
    return np.where(of_inputs < last, of_inputs, 0), np.where(begun.any(axis=(0, 2)), of_outputs, 0)


def _advanced(system: LinearSystem, of_inputs: np.ndarray, of_outputs: np.ndarray) -> StateSpace:
    """The same without these dead times: its pulse responses begin with sample d + e of those of the system."""
    h = pulses(system, int(of_inputs.max(initial=0) + of_outputs.max(initial=0)) + 1)
    power = np.linalg.matrix_power
    B = np.column_stack([power(system.A, d) @ b for d, b in zip(of_inputs, system.B.T, strict=True)])
    C = np.vstack([c @ power(system.A, e) for e, c in zip(of_outputs, system.C, strict=True)])
    D = [[h[e + d, i, j] for j, d in enumerate(of_inputs)] for i, e in enumerate(of_outputs)]
    return StateSpace(system.A, B, C, np.array(D), period=system.period)


def _delayed(system: StateSpace, of_inputs: np.ndarray, of_outputs: np.ndarray) -> StateSpace:
    """The same with its inputs and outputs so many samples late."""
    (A_u, B_u, C_u, D_u), (A_y, B_y, C_y, D_y) = _shifts(of_inputs), _shifts(of_outputs)
    none = np.zeros
    A = np.block(
        [
            [A_u, none((len(A_u), len(system.A))), none((len(A_u), len(A_y)))],
            [system.B @ C_u, system.A, none((len(system.A), len(A_y)))],
            [B_y @ system.D @ C_u, B_y @ system.C, A_y],
        ]
    )
    B = np.vstack([B_u, system.B @ D_u, B_y @ system.D @ D_u])
    C = np.hstack([D_y @ system.D @ C_u, D_y @ system.C, C_y])
    return StateSpace(A, B, C, D_y @ system.D @ D_u, period=system.period)


def _shifts(samples: np.ndarray) -> tuple[Any, Any, Any, Any]:
    """A, B, C, D of signals that each come so many samples later."""
    from scipy.linalg import block_diag

    each = [
        (np.eye(k, k=-1), np.eye(k, 1), np.eye(1, k, k=k - 1), np.array([[float(k == 0)]])) for k in samples
    ]
    A, B, C, D = (block_diag(*matrices) for matrices in zip(*each, strict=True))
    return A, B, C, D


def resonant(poles: np.ndarray, period: float) -> np.ndarray:
    """Which poles of a sampled system are those of resonances, by number."""
    s = np.log(np.where(poles == 0, np.finfo(float).tiny, poles.astype(complex))) / period
    swings = np.abs(np.abs(s.imag) * period - np.pi) > 1e-9  # not between samples
    return np.flatnonzero((np.abs(s.imag) > 0) & swings & (-s.real < RESONANT * np.abs(s)) & (s.real < 0))
