"""Random signals, the same numbers for a seed: white noise, and binary sequences of a shift register."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from gantrytau.border.checks import array, number, whole
from gantrytau.border.refusal import ModelError
from gantrytau.inputs.input_signal import HeldSignal, check_seed, counted, rows_from, seed_of
from gantrytau.inputs.samples import Samples

# a_n = sum of a_(n - lag), modulo 2: lags of primitive polynomials, so that all 2^bits - 1 states but zero follow one
# another. Alfke (1996), Xilinx XAPP 052, table 3.
LAGS = {
    2: (2, 1), 3: (3, 2), 4: (4, 3), 5: (5, 3), 6: (6, 5), 7: (7, 6), 8: (8, 6, 5, 4), 9: (9, 5), 10: (10, 7),
    11: (11, 9), 12: (12, 6, 4, 1), 13: (13, 4, 3, 1), 14: (14, 5, 3, 1), 15: (15, 14), 16: (16, 15, 13, 4),
    17: (17, 14), 18: (18, 11), 19: (19, 6, 2, 1), 20: (20, 17), 21: (21, 19), 22: (22, 21), 23: (23, 18),
    24: (24, 23, 22, 17), 25: (25, 22), 26: (26, 6, 2, 1), 27: (27, 5, 2, 1), 28: (28, 25), 29: (29, 27),
    30: (30, 6, 4, 1), 31: (31, 28),
}  # fmt: skip


@dataclass(frozen=True, repr=False)
class WhiteNoise(HeldSignal):
    """See `white_noise`."""

    std: Any
    period: float
    seed: int | None = None

    def __post_init__(self):
        check_seed("white_noise", self.seed)
        period = number("white_noise", "period", self.period, unit="s", above=0.0)
        std = array("white_noise", "std", self.std, (), (None,), (None, None), least=0.0)
        object.__setattr__(self, "period", period)
        object.__setattr__(self, "std", _as_tuples(std))

    def __repr__(self) -> str:
        return f"white_noise(std={self.std}, period={self.period:g}, seed={self.seed})"

    def samples(self, start: float, stop: float) -> Samples:
        rows = rows_from(self.period, start, stop, str(self))
        if self.seed is None:
            raise ModelError(f"{self} has no seed; give it one, as seed=1", argument="seed")
        std = np.asarray(self.std)
        counted(str(self), rows[-1] * std.size)
        draws = np.random.Generator(np.random.PCG64(self.seed)).standard_normal((rows[-1] + 1, *std.shape))
        return Samples(rows * self.period, std * draws[rows[0] :], kind="constant", largest_gap=np.inf)

    def seeded(self, seed: int | None, name: str) -> Self:
        return self if self.seed is not None else replace(self, seed=seed_of("white_noise", seed, name))

    def shaped(self, shape: tuple[int, ...]) -> Self:
        return replace(self, std=np.full(shape, self.std)) if shape and np.ndim(self.std) == 0 else self


def white_noise(
    std: float | Sequence[Any] | np.ndarray, period: float, seed: int | None = None
) -> WhiteNoise:
    """Gaussian noise: independent numbers of mean zero and standard deviation `std`, each held for `period`, s.

    std: in the unit of the input; a number, for each element of an input of several, or an array of its shape. Elements
    have streams of their own. seed: of NumPy's PCG64; None derives one from the seed of the run and the name of the
    input. The first n numbers do not depend on the length of the run.
    One-sided power spectral density at the frequency f: 2 std^2 period
    sinc^2(f period), with sinc(x) = sin(pi x) / (pi x): 2 std^2 period well below 1 / period. For a density S of
    continuous white noise take std = sqrt(S / (2 period)), and a period short beside the time constants of the model.
    Raises ModelError for a std below zero, a period not above zero, and a seed other than a whole number.
    """
    return WhiteNoise(std, period, seed)


@dataclass(frozen=True, repr=False)
class BinarySequence(HeldSignal):
    """See `prbs`."""

    bits: int
    hold: float
    amplitude: float = 1.0
    seed: int | None = None

    def __post_init__(self):
        check_seed("prbs", self.seed)
        for name, unit in (("hold", "s"), ("amplitude", None)):
            object.__setattr__(self, name, number("prbs", name, getattr(self, name), unit=unit, above=0.0))
        whole("prbs", "bits", self.bits, least=min(LAGS), most=max(LAGS))

    def __repr__(self) -> str:
        return f"prbs(bits={self.bits}, hold={self.hold:g}, amplitude={self.amplitude:g}, seed={self.seed})"

    @property
    def length(self) -> int:
        """Number of values after which they repeat, 2^bits - 1."""
        return 2**self.bits - 1

    def samples(self, start: float, stop: float) -> Samples:
        rows = rows_from(self.hold, start, stop, str(self))
        if self.seed is None:
            raise ModelError(f"{self} has no seed; give it one, as seed=1", argument="seed")
        bits = self._sequence(min(int(rows[-1]) + 1, self.length))[rows % self.length]
        values = self.amplitude * (2.0 * bits - 1.0)
        return Samples(rows * self.hold, values, kind="constant", largest_gap=np.inf)

    def seeded(self, seed: int | None, name: str) -> Self:
        return self if self.seed is not None else replace(self, seed=seed_of("prbs", seed, name))

    def _sequence(self, count: int) -> np.ndarray:
        """The first values of the register, 0 or 1.

        A square of a polynomial over two numbers has the same terms at twice the lags: the sequence obeys these, too, so
        that twice as many values follow from those there are at once.
        """
        generator = np.random.Generator(np.random.PCG64(self.seed))
        state = int(generator.integers(1, 2**self.bits))  # a register of zeros stays there
        found = np.array([state >> k & 1 for k in range(self.bits)], dtype=np.uint8)
        lags = np.array(LAGS[self.bits])
        while found.size < count:
            while 2 * lags.max() <= found.size:
                lags = 2 * lags
            starts = found.size - lags
            more = [found[k : k + lags.min()] for k in starts]
            found = np.concatenate([found, np.bitwise_xor.reduce(more)])
        return found[:count]


def prbs(bits: int, hold: float, amplitude: float = 1.0, seed: int | None = None) -> BinarySequence:
    """A pseudo-random binary sequence of maximal length: +amplitude or -amplitude, each value held for `hold`, s.

    bits: of the shift register, 2 to 31; the sequence repeats after 2^bits - 1 values. In a period the mean is
    amplitude / (2^bits - 1), and the autocorrelation amplitude^2 at no shift, -amplitude^2 / (2^bits - 1) at every other,
    the whitest spectrum of two values. seed: chooses the begin within the period, by NumPy's PCG64; None derives one from
    the seed of the run and the name of the input. amplitude: in the unit of the input.
    Raises ModelError for other bits, a hold or an amplitude not above zero, and a seed other than a whole number.
    """
    return BinarySequence(bits, hold, amplitude, seed)


def _as_tuples(values: np.ndarray) -> Any:
    """Numbers as they compare and hash: a float, or tuples of floats."""
    return float(values) if not values.ndim else tuple(_as_tuples(part) for part in values)
