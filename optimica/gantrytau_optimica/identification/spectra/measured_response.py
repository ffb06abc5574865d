"""The frequency response between measured inputs and outputs, without a model.

    G = S_yu S_uu^-1,  S the spectra averaged over blocks with Hann windows that overlap by half

Noise of the outputs averages out, noise of the inputs does not. Bendat and Piersol, Random Data (2010), chapter 7.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gantrytau import ModelError
from gantrytau.border.checks import number, whole
from gantrytau.describing.record import Record
from gantrytau_optimica.identification.spectra.sampled_motion import sampled_motion

SHORTEST = 16  # samples of a block
OVERLAP = 0.95  # independent blocks for each that overlaps by half under a Hann window
QUIET = 1e-14  # of the largest power of the inputs, below which there is none


@dataclass(frozen=True, eq=False, repr=False)
class MeasuredResponse(Record):
    """Response (k, m, F) complex of k outputs to m inputs at frequencies hertz (F,), without 0.

    coherence: share of the power of each output that the inputs explain, (k, F) from 0 to 1; deviation: standard deviation
    of the response, (k, m, F), NaN where inputs have no power. `plot_bode(beside={"measured": ...})` draws it.
    """

    hertz: np.ndarray
    response: np.ndarray
    coherence: np.ndarray
    deviation: np.ndarray

    def __repr__(self) -> str:
        outputs, inputs, _ = self.response.shape
        mean = ", ".join(f"{share:.2f}" for share in np.nanmean(self.coherence, axis=1))
        return (
            f"<MeasuredResponse of {outputs} outputs to {inputs} inputs, {self.hertz[0]:.3g} to {self.hertz[-1]:.3g} Hz, "
            f"coherence {mean}>"
        )


def measured_response(u: ArrayLike, y: ArrayLike, *, period: float, blocks: int = 16) -> MeasuredResponse:
    """The frequency response from inputs u (N, m) to outputs y (N, k), sampled every `period` s.

    blocks: parts of the samples that are averaged, at least two for each input: more of them, less noise, fewer frequencies.
    Resonances narrower than blocks / (N period) Hz are blunted. Raises ModelError for samples that are too few, or none.
    """
    place = "measured_response"
    whole(place, "blocks", blocks, least=2)
    period = number(place, "period", period, unit="s", above=0)
    u, y = sampled_motion(place, u, y, least=SHORTEST * blocks)
    inputs = u.shape[1]
    if blocks < 2 * inputs:
        raise ModelError(
            f"{place}: found blocks={blocks} for {inputs} inputs, expected {2 * inputs} at least, or chance explains all",
            argument="blocks",
        )
    length = len(u) // blocks
    U, Y = _transforms(u, length), _transforms(y, length)
    S_uu, S_yu = _mean(U, U), _mean(Y, U)
    S_yy = np.mean(np.abs(Y) ** 2, axis=0)
    quiet = np.linalg.eigvalsh(S_uu)[:, 0] <= QUIET * np.max(np.trace(S_uu, axis1=1, axis2=2).real)
    S_uu[quiet] = np.eye(inputs)
    inverse = np.linalg.inv(S_uu)
    G = S_yu @ inverse
    G[quiet] = np.nan
    known = np.real(np.einsum("fij,fij->fi", G, S_yu.conj()))
    left = np.maximum(S_yy - known, 0.0)
    count = OVERLAP * len(U)
    own = np.real(np.diagonal(inverse, axis1=1, axis2=2))
    variance = left[:, :, None] * own[:, None, :] / max(count - inputs, 1.0)
    coherence = np.clip(known / np.where(S_yy > 0, S_yy, 1.0), 0.0, 1.0)
    return MeasuredResponse(
        np.fft.rfftfreq(length, period)[1:],
        np.moveaxis(G, 0, 2),
        coherence.T,
        np.moveaxis(np.sqrt(variance), 0, 2),
    )


def _transforms(x: np.ndarray, length: int) -> np.ndarray:
    """Fourier transforms (blocks, F, columns) of blocks without their means, that of 0 Hz left out."""
    starts = range(0, len(x) - length + 1, length // 2)
    window = np.hanning(length + 1)[:-1, None]
    parts = np.stack([x[k : k + length] for k in starts])
    return np.fft.rfft(window * (parts - parts.mean(axis=1, keepdims=True)), axis=1)[:, 1:]


def _mean(X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Cross spectra (F, i, j)."""
    return np.einsum("bfi,bfj->fij", X, Y.conj()) / len(X)
