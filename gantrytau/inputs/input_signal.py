"""What signals have in common, and how what is given for an input becomes samples or a function of time."""

import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import array, instance, whole
from gantrytau.border.refusal import ModelError, told
from gantrytau.inputs.samples import SAME, Samples

MOST = 10_000_000  # values that one signal holds in a run
POINTS = 256  # of a period: straight lines between them are within 1e-4 of the amplitude
Span = tuple[float, float]  # of time, s


@dataclass(frozen=True)
class InputSignal:
    """A signal over time, as input of `simulate`, `cosimulate`, `optimize` and `estimate`.

    Signals begin at t = 0. They are records of numbers: signals with equal fields have equal values, to the last digit.
    """

    def samples(self, start: float, stop: float) -> Samples:
        """Samples of the signal from start to stop, s; exact for held signals, else within 1e-4 of the amplitude.

        Raises ModelError for a span before t = 0, and for a random signal without seed.
        """
        raise NotImplementedError

    def values(self, t: ArrayLike) -> np.ndarray:
        """The values at times t (n,) in s: (n,), or (n, k) of k elements."""
        raise NotImplementedError

    def seeded(self, seed: int | None, name: str) -> Self:
        """The signal with a seed, made from the seed of a run and the name of an input, if it needs one."""
        return self

    def shaped(self, shape: tuple[int, ...]) -> Self:
        """The signal for an input of that shape."""
        return self


@dataclass(frozen=True)
class HeldSignal(InputSignal):
    """A signal of values that are held, each until the next: its samples are exact."""

    def values(self, t: ArrayLike) -> np.ndarray:
        times = _times(t)
        found = self.samples(0.0, max(float(times.max(initial=0.0)), float(np.finfo(float).tiny)))
        columns = np.stack([found.at(times, k) for k in range(found.values.shape[1])], axis=-1)
        if found.shape == (1,):
            return columns[..., 0]
        return columns.reshape(*times.shape, *reversed(found.shape)).swapaxes(times.ndim, -1)


@dataclass(frozen=True)
class SmoothSignal(InputSignal):
    """A signal that is a function of time, of numbers and of symbols alike."""

    @property
    def shortest_period(self) -> float:
        """Of its fastest part, s."""
        raise NotImplementedError

    def __call__(self, t: Any) -> Any:
        raise NotImplementedError

    def samples(self, start: float, stop: float) -> Samples:
        check_span(str(self), start, stop)
        count = counted(str(self), (stop - start) / self.shortest_period * POINTS)
        times = np.linspace(start, stop, max(count, 1) + 1)
        return Samples(times, self.values(times))

    def values(self, t: ArrayLike) -> np.ndarray:
        x = ca.SX.sym("t")
        course = ca.Function("course", [x], [self(x)])
        return np.array(course(_times(t).reshape(1, -1))).reshape(np.shape(t))


def _times(t: ArrayLike) -> np.ndarray:
    return array("values", "t", t, unit="s", least=0.0)


def counted(what: str, count: float) -> int:
    """A number of values; ModelError if there are too many of them."""
    if count > MOST:
        raise ModelError(
            f"{what}: the run needs {count:.3g} of its values, expected at most {MOST:g}; take a shorter time "
            "or longer holds"
        )
    return int(np.ceil(count))


def check_span(what: str, start: float, stop: float) -> None:
    """ModelError unless a signal is known from start to stop, s."""
    if not (np.isfinite(start) and np.isfinite(stop) and start < stop):
        raise ModelError(
            f"{what}: found the span from {start} to {stop} s, expected start < stop, both finite"
        )
    if start < 0:
        raise ModelError(
            f"{what} begins at t = 0, found a span from {start:g} s on; begin there, or give Samples(times, values) of "
            "other times"
        )


def check_seed(what: str, seed: Any) -> None:
    """ModelError unless a seed is None or a whole number that is not negative."""
    if seed is not None:
        whole(what, "seed", seed, least=0)


def seed_of(what: str, seed: int | None, name: str) -> int:
    """A seed for the signal at one input of a run with a seed: inputs of different names have independent streams.

    Raises ModelError where the run has none.
    """
    if seed is None:
        raise ModelError(
            f"input {name}: {what} has no seed; give it one, as seed=1, or give the run one", argument="seed"
        )
    words = np.random.SeedSequence([seed, zlib.crc32(name.encode())]).generate_state(2)
    return int(words[0]) << 32 | int(words[1])


def rows_from(period: float, start: float, stop: float, what: str) -> np.ndarray:
    """Numbers k of the values held at some time from start to stop, that of k from k * period on."""
    check_span(what, start, stop)
    within = SAME * np.spacing(stop)
    last = counted(what, (stop + within) / period)
    first = int((start + within) / period)
    rows = np.arange(first, last + 1)
    return rows[rows * period <= stop + within]


def with_course(name: str, value: Any, shape: tuple[int, ...], span: Callable[[], Span]) -> Any:
    """What is given for an input as Samples or a function of time, if it is a signal or (times, values); else as it is.

    span: of the run, asked for where the course needs it.
    """
    if isinstance(value, tuple) and len(value) == 2 and np.ndim(value[0]) == 1:
        value = told(f"input {name}", lambda: Samples(*value))
    if not isinstance(value, InputSignal):
        return value
    signal = value.shaped(shape)
    return (
        signal if isinstance(signal, SmoothSignal) else told(f"input {name}", lambda: signal.samples(*span()))
    )


def with_seeds(inputs: Any, seed: int | None) -> dict[str, Any]:
    """Inputs of a run by name, signals without a seed with one of their own.

    Raises ModelError for what is no mapping, and for a seed that is none, or missing.
    """
    instance("simulate", "inputs", inputs, Mapping, "{name: number, function of time, samples or signal}")
    check_seed("simulate", seed)
    return {n: v.seeded(seed, n) if isinstance(v, InputSignal) else v for n, v in inputs.items()}
