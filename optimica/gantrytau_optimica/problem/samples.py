"""Measured signals: values at times, checked when they are told."""

from typing import Any, Literal

import numpy as np

from gantrytau import ModelError
from gantrytau.flattening.shapes import fits

LARGEST_GAP = 10.0  # median distances of samples: what is longer is a gap, across which nothing is known


class Samples:
    """Measured values of k signals at n times.

    times: (n,) in s, rising; values: (n,), (n, k), or (n, rows, columns) of a matrix, in the unit of what they are
    compared with; deviation: standard deviation of one value, a number or of the shape of one or of all samples; 1 where
    it is not known, which `weighted` tells; kind: "linear" or "constant" (each value holds until the next) between
    samples; largest_gap: s, distance of two samples beyond which the course between them is unknown (default: ten
    times the median distance). Raises ModelError for NaN, for repeated or unsorted times, and for shapes that do not fit.
    """

    def __init__(
        self,
        times: Any,
        values: Any,
        *,
        deviation: Any = None,
        kind: Literal["linear", "constant"] = "linear",
        largest_gap: float | None = None,
    ):
        self.times = _numbers("times", times)
        self.values = _numbers("values", values)
        if self.values.ndim == 1:
            self.values = self.values[:, None]
        if (
            self.times.ndim != 1
            or self.values.ndim not in (2, 3)
            or self.values.shape[0] != self.times.size
            or not self.times.size
        ):
            raise ModelError(
                f"Samples: found times of shape {np.shape(times)} and values of shape {np.shape(values)}, expected (n,) and "
                "(n,), (n, k) or (n, rows, columns)"
            )
        self.shape = self.values.shape[1:]
        self.values = self._as_columns(self.values)
        if kind not in ("linear", "constant"):
            raise ModelError(f"Samples: found kind={kind!r}, expected 'linear' or 'constant'")
        self.kind = kind
        self._check()
        self.weighted = deviation is not None
        self.deviations = self._deviations(1.0 if deviation is None else deviation)
        self.largest_gap = largest_gap

    def __repr__(self) -> str:
        return f"<Samples: {self.times.size} of {self.values.shape[1]}, {self.times[0]:g} to {self.times[-1]:g} s>"

    def _as_columns(self, values: np.ndarray) -> np.ndarray:
        """One column for each element, those of a matrix column after column, (n, k)."""
        return values.reshape(self.times.size, -1, order="F")

    def _check(self) -> None:
        bad = np.flatnonzero(~(np.isfinite(self.times) & np.all(np.isfinite(self.values), axis=1)))
        if bad.size:
            raise ModelError(
                f"Samples: row {bad[0]} is not finite (and {bad.size - 1} more), expected numbers; leave such rows out, "
                "times and values"
            )
        step = np.diff(self.times)
        if np.any(step == 0):
            row = int(np.flatnonzero(step == 0)[0])
            raise ModelError(
                f"Samples: rows {row} and {row + 1} have the same time {self.times[row]:g} s, expected rising times; "
                "average or drop one"
            )
        if np.any(step < 0):
            row = int(np.flatnonzero(step < 0)[0])
            raise ModelError(
                f"Samples: the time falls from {self.times[row]:g} s in row {row} to {self.times[row + 1]:g} s, expected "
                "rising times; sort the rows by time"
            )

    def _deviations(self, deviation: Any) -> np.ndarray:
        found = _numbers("deviation", deviation)
        try:
            whole = self._as_columns(np.broadcast_to(found, (self.times.size, *self.shape)).copy())
        except ValueError:
            raise ModelError(
                f"Samples: found deviation of shape {found.shape}, expected a number, (k,) or the shape of the values "
                f"{self.values.shape}"
            ) from None
        if not np.all(np.isfinite(whole)) or np.any(whole <= 0):
            raise ModelError("Samples: found a deviation that is not above 0, expected standard deviations")
        return whole

    def check_shape(self, place: str, shape: tuple[int, ...]) -> None:
        """ModelError unless each sample has the shape of what it is compared with."""
        if not fits(self.shape, shape):
            words = f"found {self.values.shape[1]} columns, expected {int(np.prod(shape))}"
            if len(shape) == 2:
                words += f": samples of shape {self.shape} for a matrix {shape}; give values of shape (n, rows, columns)"
            raise ModelError(f"{place}: {words}")

    def require(self, what: str, start: float, final: float, between: bool) -> None:
        """ModelError if samples lie outside of the horizon; with `between`, if they do not cover it or have a gap."""
        small = 1e-9 * max(1.0, abs(final - start))
        if not between:
            outside = np.flatnonzero((self.times < start - small) | (self.times > final + small))
            if outside.size:
                raise ModelError(
                    f"{what}: {outside.size} samples lie outside of the horizon from {start:g} to {final:g} s, the first at "
                    f"{self.times[outside[0]]:g} s; leave them out or change the horizon"
                )
            return
        if self.times[0] > start + small or (self.times[-1] < final - small and self.kind == "linear"):
            raise ModelError(
                f"{what}: samples from {self.times[0]:g} to {self.times[-1]:g} s do not cover the horizon from {start:g} to "
                f"{final:g} s; shorten the horizon or add samples"
            )
        step = np.diff(self.times)
        if step.size < 2:
            return
        largest = LARGEST_GAP * float(np.median(step)) if self.largest_gap is None else self.largest_gap
        row = int(np.argmax(step))
        if step[row] > largest:
            raise ModelError(
                f"{what}: a gap from {self.times[row]:g} to {self.times[row + 1]:g} s, longer than {largest:g} s, expected "
                "samples there; split the horizon, or allow it with Samples(..., largest_gap=...)"
            )

    def at(self, times: np.ndarray, column: int) -> np.ndarray:
        """The course of one column between the samples, (m,)."""
        if self.kind == "linear":
            return np.interp(times, self.times, self.values[:, column])
        row = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, self.times.size - 1)
        return self.values[row, column]

    def jumps(self, column: int) -> np.ndarray:
        """Times in s at which the course of a column jumps."""
        return (
            self.times[1:][np.diff(self.values[:, column]) != 0] if self.kind == "constant" else np.zeros(0)
        )

    def kinks(self) -> np.ndarray:
        """Times in s at which the course is not smooth."""
        return self.times[1:-1] if self.kind == "linear" else self.times[1:]


def _numbers(what: str, values: Any) -> np.ndarray:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise ModelError(f"Samples: found {what} {values!r}, expected numbers") from None
