"""Signals to test a system with: steps, sweeps of frequency, sums of sines."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, Self, get_args

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import array, number, one_of
from gantrytau.border.refusal import Given, ModelError
from gantrytau.inputs.input_signal import HeldSignal, SmoothSignal, check_seed, check_span, seed_of
from gantrytau.inputs.samples import Samples
from gantrytau.language.functions import cos, exp, fmax, fmin, sin

Kind = Literal["linear", "logarithmic"]
PHASES = ("schroeder", "random")


@dataclass(frozen=True, eq=False, repr=False)
class Steps(HeldSignal):
    """See `steps`."""

    told: Samples

    def __repr__(self) -> str:
        times, values = self.told.times, self.told.values
        few = ", ".join(f"{v.tolist()} from {t:g} s" for t, v in zip(times[:3], values[:3], strict=True))
        return f"steps({few}{', ...' if times.size > 3 else ''})"

    def samples(self, start: float, stop: float) -> Samples:
        check_span(str(self), start, stop)
        times, values = self.told.times, self.told.values
        if times[0] > start:
            times, values = np.append(start, times), np.vstack([np.zeros((1, values.shape[1])), values])
        kept = slice(max(int(np.searchsorted(times, start, side="right")) - 1, 0), None)
        shape = self.told.shape
        rows = values[kept].reshape(-1, *reversed(shape)).swapaxes(1, -1)
        return Samples(times[kept], rows, kind="constant", largest_gap=np.inf)


def steps(times: ArrayLike, values: ArrayLike) -> Steps:
    """Steps at times (n,) in s to values (n,), (n, k) or (n, rows, columns), each held until the next; zero before.

    Raises ModelError for NaN, times that do not rise, and shapes that do not fit, as `Samples` does.
    """
    return Steps(Samples(times, values, kind="constant"))


@dataclass(frozen=True, repr=False)
class Chirp(SmoothSignal):
    """See `chirp`."""

    low: float
    high: float
    duration: float
    amplitude: float = 1.0
    kind: Kind = "linear"

    def __post_init__(self):
        for name, unit in (("low", "Hz"), ("high", "Hz"), ("duration", "s"), ("amplitude", None)):
            object.__setattr__(self, name, number("chirp", name, getattr(self, name), unit=unit, above=0.0))
        one_of("chirp", "kind", self.kind, get_args(Kind))

    def __repr__(self) -> str:
        return (
            f"chirp(low={self.low:g}, high={self.high:g}, duration={self.duration:g}, amplitude={self.amplitude:g}, "
            f"kind={self.kind!r})"
        )

    @property
    def shortest_period(self) -> float:
        return 1.0 / max(self.low, self.high)

    def __call__(self, t: Any) -> Any:
        within = fmin(fmax(t, 0.0), self.duration)
        ratio = np.log(self.high / self.low) / self.duration
        if self.kind == "linear":
            turns = self.low * within + (self.high - self.low) / (2 * self.duration) * within**2
        elif ratio == 0:
            turns = self.low * within
        else:
            turns = self.low / ratio * (exp(ratio * within) - 1)
        turns = turns + self.low * fmin(t, 0.0) + self.high * fmax(t - self.duration, 0.0)
        return self.amplitude * sin(2 * np.pi * turns)


def chirp(low: float, high: float, duration: float, amplitude: float = 1.0, kind: Kind = "linear") -> Chirp:
    """A sine whose frequency goes from `low` at t = 0 to `high` at `duration`, Hz and s; it begins at zero, rising.

    kind: "linear" or "logarithmic", how the frequency changes in time. After `duration` the sine goes on with the frequency
    `high`, its value and first derivative being continuous. high may be below low. amplitude: in the unit of the input.
    The signal is a differentiable function of time. Raises ModelError for numbers not above zero.
    """
    return Chirp(low, high, duration, amplitude, kind)


@dataclass(frozen=True, repr=False)
class Multisine(SmoothSignal):
    """See `multisine`."""

    frequencies: tuple[float, ...]
    amplitude: tuple[float, ...]
    phases: str | tuple[float, ...] = "schroeder"
    seed: int | None = None

    def __repr__(self) -> str:
        low, high = min(self.frequencies), max(self.frequencies)
        phases = self.phases if isinstance(self.phases, str) else "given"
        count = len(self.frequencies)
        return (
            f"multisine({count} frequencies from {low:g} to {high:g} Hz, {phases} phases, seed={self.seed})"
        )

    @property
    def shortest_period(self) -> float:
        return 1.0 / max(self.frequencies)

    @property
    def angles(self) -> np.ndarray:
        """Phases of the sines at t = 0, (n,) in rad."""
        if not isinstance(self.phases, str):
            return np.array(self.phases)
        if self.phases == "random":
            if self.seed is None:
                raise ModelError(f"{self} has no seed; give it one, as seed=1", argument="seed")
            generator = np.random.Generator(np.random.PCG64(self.seed))
            return 2 * np.pi * generator.random(len(self.frequencies))
        powers = np.square(self.amplitude) / np.sum(np.square(self.amplitude))
        return -2 * np.pi * np.cumsum(np.cumsum(powers) - powers)

    def __call__(self, t: Any) -> Any:
        waves = zip(self.amplitude, self.frequencies, self.angles.tolist(), strict=True)
        return sum(a * cos(2 * np.pi * f * t + angle) for a, f, angle in waves)

    def seeded(self, seed: int | None, name: str) -> Self:
        if self.phases != "random" or self.seed is not None:
            return self
        return replace(self, seed=seed_of("multisine", seed, name))


def multisine(
    frequencies: ArrayLike,
    amplitude: ArrayLike = 1.0,
    *,
    phases: str | Sequence[float] = "schroeder",
    seed: int | None = None,
) -> Multisine:
    """A sum of sines: amplitude_k cos(2 pi frequency_k t + phase_k).

    frequencies: (n,) in Hz, all different; amplitude: of each, a number or (n,), in the unit of the input. phases:
    "schroeder", phase_k = -2 pi sum over l < k of (k - l) p_l with the shares p of the power, which keeps the peak low
    (Schroeder 1970, IEEE Trans. Inf. Theory 16, eq. 11); "random", by the seed (None: that of the run); or (n,) in rad.
    The signal is a differentiable function of time; over a common period of the frequencies its spectrum does not leak.
    Raises ModelError for numbers not above zero, repeated frequencies, and shapes that do not fit.
    """
    check_seed("multisine", seed)
    given = {"frequencies": frequencies, "amplitude": amplitude}
    hertz, sizes = (
        np.atleast_1d(array("multisine", name, found, (), (None,), above=0.0))
        for name, found in given.items()
    )
    if sizes.size == 1:
        sizes = np.repeat(sizes, hertz.size)
    if sizes.shape != hertz.shape:
        raise ModelError(
            f"multisine: found {sizes.size} amplitudes, expected one, or {hertz.size} as of the frequencies"
        )
    if not hertz.size or len(set(hertz.tolist())) < hertz.size:
        raise ModelError(
            "expected different frequencies, at least one; add the amplitudes of equal ones",
            place="multisine",
            found=Given("frequencies", frequencies),
        )
    if isinstance(phases, str):
        angles: Any = one_of("multisine", "phases", phases, PHASES)
    else:
        angles = tuple(array("multisine", "phases", phases, hertz.shape, unit="rad").tolist())
    return Multisine(tuple(hertz.tolist()), tuple(sizes.tolist()), angles, seed)
