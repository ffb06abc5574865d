"""Iterative learning control as a law: how a correction follows from the one before and its error, and what that leads to.

    u_{k+1} = W Qbar (u_k + L eps_k)                                            Dressler (2012), (7.2), (7.6)
    eps_k   = r - zhat_k,   zhat_k = F r + T u_k
    u_{k+1} = M u_k + ...,  M = W Qbar (I - L T)                                (7.15), (7.16)

Stable where the spectral radius of M is below one, monotone where its largest singular value is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from gantrytau import ModelError
from gantrytau.describing.record import Record
from gantrytau_optimica.learning.filters.tukey import Tukey
from gantrytau_optimica.learning.filters.zero_phase import ZeroPhase
from gantrytau_optimica.learning.laws.correction_laws import CorrectionLaw, Gradient, NormOptimal, Shifted
from gantrytau_optimica.learning.laws.lifted import (
    Response,
    axes_of,
    lifted,
    norm,
    period_of,
    spectral_radius,
)

RUNS = 10  # after which growth is judged
GROWN = 10.0  # times, from which learning is said to diverge: a path that is learnt is far from the worst


@dataclass(frozen=True, eq=False)
class Stability(Record):
    """What a learning law does to corrections from run to run.

    sigma: largest singular value of M with all axes coupled; diagonal: that of each axis alone, (m,); parts: M, or one
    matrix for each axis where axes do not move each other; inside: the samples (n,) of the window, which are those of M.
    """

    sigma: float
    diagonal: np.ndarray
    parts: Sequence[np.ndarray] = field(repr=False)
    inside: np.ndarray = field(repr=False)

    @cached_property
    def rho(self) -> float:
        """Spectral radius of M; seconds for a thousand samples."""
        return max(map(spectral_radius, self.parts))

    def next(self, u: np.ndarray) -> np.ndarray:
        """M u, what is left after a run of a difference u (N, m) in corrections, (N, m)."""
        columns = u[self.inside].T.reshape(len(self.parts), -1)
        rows = np.concatenate([part @ column for part, column in zip(self.parts, columns, strict=True)])
        found = np.zeros_like(u)
        found[self.inside] = rows.reshape(u.shape[1], -1).T
        return found

    @property
    def stable(self) -> bool:
        """Corrections come to an end, perhaps after growing for many runs."""
        return self.monotone or self.rho < 1

    @property
    def monotone(self) -> bool:
        """Corrections come nearer to their end with each run."""
        return self.sigma < 1

    @cached_property
    def growth(self) -> float:
        """Times as far from their end as at first corrections can be after ten runs, the norm of M^10."""
        return max(norm(np.linalg.matrix_power(part, RUNS)) for part in self.parts)

    @property
    def diverges(self) -> bool:
        """Errors grow from run to run: for ever, or over more runs than anyone waits for."""
        return not self.monotone and (self.growth > GROWN or not self.stable)

    def __str__(self) -> str:
        alone = ", ".join(f"{s:.3f}" for s in self.diagonal)
        remedy = "lower the cut-off of q, notch it at the resonances, or take another gain and shift"
        if self.monotone:
            words = f"monotone: each run leaves at most {self.sigma:.0%} of the way to where learning ends"
        elif self.diverges:
            words = f"diverges: after {RUNS} runs up to {self.growth:.3g} times as far from where learning ends; {remedy}"
        else:
            words = f"converges, but not in each run: after {RUNS} at most {self.growth:.3g} of the way is left; {remedy}"
        return f"sigma {self.sigma:.4f} (axes alone {alone}): {words}"


@dataclass(frozen=True)
class Learning(Record):
    """A learning law for runs of N samples with m axes.

    gain, shift: L takes the error `shift` samples later, times gain, (7.10); law: another L, such as Gradient or
    NormOptimal; q: zero-phase filter of corrections, one for all axes or one for each; window: the part that is learnt.
    """

    gain: float = 0.9
    shift: int = 5
    q: ZeroPhase = field(default_factory=lambda: ZeroPhase.butterworth(2, 10.0))
    window: Tukey = field(default_factory=Tukey)
    law: CorrectionLaw | None = None

    def __post_init__(self):
        Shifted(self.gain, self.shift)
        for name, value, words, example in (
            ("q", self.q, ("apply",), "ZeroPhase.butterworth(2, 10.0)"),
            ("window", self.window, ("weights", "full"), "Tukey(1.2, 4.5)"),
            ("law", self.law, ("corrections",), "Gradient()"),
        ):
            if not (name == "law" and value is None) and not all(hasattr(value, word) for word in words):
                raise ModelError(
                    f"Learning: found {name}={value!r}, expected one such as {example}", argument=name
                )

    @property
    def corrections_of(self) -> CorrectionLaw:
        """L."""
        return Shifted(self.gain, self.shift) if self.law is None else self.law

    def with_response(self, response: Response) -> "Learning":
        """With this response in a law that goes by one and has none."""
        if isinstance(self.law, Gradient | NormOptimal) and self.law.response is None:
            return replace(self, law=replace(self.law, response=response))
        return self

    def next(self, u: np.ndarray, error: np.ndarray, period: float) -> np.ndarray:
        """Corrections (N, m) of the next run, for those of this one and its errors, samples every period s.

        Raises ModelError for corrections and errors of different shapes, or that are not finite.
        """
        u, error = np.asarray(u, dtype=float), np.asarray(error, dtype=float)
        if u.shape != error.shape or u.ndim != 2:
            raise ModelError(
                f"Learning.next: found corrections of shape {u.shape} and errors of shape {error.shape}, expected "
                "(N, m) both"
            )
        bad = np.flatnonzero(~np.isfinite(error).all(axis=1))
        if bad.size:
            raise ModelError(
                f"Learning.next: found errors that are not finite, first at {bad[0] * period:g} s, expected numbers; "
                "nothing was learnt from this run"
            )
        weights = self.window.weights(len(u), period)
        return weights[:, None] * self.q.apply(u + self.corrections_of.corrections(error), period)

    def matrix(self, response: Response, samples: int) -> np.ndarray:
        """M over the samples of the window, axis by axis, (m n, m n); response: from corrections to what is learnt from."""
        period, m = period_of(response), axes_of(response)
        weights = self.window.weights(samples, period)
        inside = np.flatnonzero(weights)
        columns = (np.arange(m)[:, None] * samples + inside).ravel()
        given = np.eye(m * samples)[:, columns].reshape(m, samples, -1).transpose(1, 0, 2)
        answered = lifted(response, samples)[:, columns].reshape(m, samples, -1).transpose(1, 0, 2)
        left = self.q.apply(given - self.corrections_of.corrections(answered), period)[inside]
        return (weights[inside, None, None] * left).transpose(1, 0, 2).reshape(len(columns), -1)

    def stability(self, response: Response, samples: int) -> Stability:
        """Whether learning converges, for sampled systems from corrections to what is learnt from.

        response: a system of all axes, or one for each, F_u + F_y T_uy of the estimator; samples: of a run. Raises
        ModelError for systems that are not sampled with one period, and for a window that does not fit the run.
        """
        M, m = self.matrix(response, samples), axes_of(response)
        inside = np.flatnonzero(self.window.weights(samples, period_of(response)))
        n = len(M) // m
        parts = M.reshape(m, n, m, n)
        own = [parts[i, :, i] for i in range(m)]
        alone = [norm(part) for part in own]
        if sum(map(np.count_nonzero, own)) == np.count_nonzero(M):  # axes do not move each other
            return Stability(max(alone), np.array(alone), own, inside)
        return Stability(norm(M), np.array(alone), [M], inside)
