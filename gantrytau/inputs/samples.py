"""Values of signals at times, measured or chosen, checked when they are told."""

from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np

from gantrytau.border.checks import array, number, one_of
from gantrytau.border.refusal import ModelError
from gantrytau.border.units import known_scale, scale
from gantrytau.flattening.shapes import fits

LARGEST_GAP = 10.0  # median distances of samples: what is longer is a gap, across which nothing is known
SMALL = 1e-9  # of a run, by which samples may fail to cover it: ends of times are sums
Kind = Literal["linear", "constant"]
KINDS = get_args(Kind)
SAME = 8  # roundings of a time, within which two times are one: 3 * 0.1 is not 0.3


@dataclass(frozen=True, eq=False, repr=False)
class Samples:
    """Values of k signals at n times, as an input over time or as measurements.

    times: (n,) in s, rising. values: (n,), (n, k), or (n, rows, columns) of a matrix, in the unit of the quantity; they are
    kept as columns, (n, k). kind: "linear" between samples, or "constant": each value holds from its time until the next,
    the last from then on. deviation: standard deviation of a measured value, a number or an array of the shape of one or
    of all samples; 1 if unknown, see `weighted`. unit: of values and deviation, such as "mm", the quantity being of the
    same kind; both are kept in SI. largest_gap: distance of two samples, s, beyond which an estimation takes the signal
    between them for unknown (default: ten times the median distance).
    Raises ModelError for an unknown unit, NaN, repeated or unsorted times, and shapes that do not fit.
    """

    times: Any
    values: Any
    _: KW_ONLY
    kind: Kind = "linear"
    deviation: Any = None
    largest_gap: float | None = None
    unit: str | None = None
    shape: tuple[int, ...] = field(init=False)

    def __post_init__(self):
        one_of("Samples", "kind", self.kind, KINDS)
        if self.largest_gap is not None:
            gap = number("Samples", "largest_gap", self.largest_gap, above=0.0, most=np.inf)
            object.__setattr__(self, "largest_gap", gap)
        times = array("Samples", "times", self.times, finite=False)
        switch = getattr(getattr(self.values, "dtype", None), "kind", "") == "b"  # logged as False and True
        values = self.values.astype(float) if switch else self.values
        values = array("Samples", "values", values, finite=False)
        if values.ndim == 1:
            values = values[:, None]
        if self.unit is not None:
            values = self._in_si(values)
        if times.ndim != 1 or values.ndim not in (2, 3) or values.shape[0] != times.size or not times.size:
            raise ModelError(
                f"Samples: found times of shape {np.shape(self.times)} and values of shape {np.shape(self.values)}, "
                "expected (n,) and (n,), (n, k) or (n, rows, columns)"
            )
        object.__setattr__(self, "shape", values.shape[1:])
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "values", self._as_columns(values))
        for one in (self.times, self.values):
            one.flags.writeable = False
        self._check()
        _ = self.deviations  # so that a wrong one is told at once

    @property
    def weighted(self) -> bool:
        """Whether standard deviations were given."""
        return self.deviation is not None

    @cached_property
    def deviations(self) -> np.ndarray:
        """Standard deviations of all values, (n, k)."""
        return self._deviations(1.0 if self.deviation is None else self.deviation)

    def __repr__(self) -> str:
        return f"<Samples: {self.times.size} of {self.values.shape[1]}, {self.times[0]:g} to {self.times[-1]:g} s>"

    def _in_si(self, values: np.ndarray) -> np.ndarray:
        """Values in SI; unit and deviation become those of them."""
        try:
            written = scale(self.unit or "")
            values = written.si(values)
        except ModelError as error:
            raise ModelError(f"Samples: {error}", argument="unit") from None
        object.__setattr__(self, "unit", written.coherent)
        if self.deviation is not None:
            deviation = array("Samples", "deviation", self.deviation) * written.slope
            object.__setattr__(self, "deviation", deviation)
        return values

    def check_unit(self, place: str, unit: str | None) -> None:
        """Refuse samples with a unit in which a quantity of another unit cannot be measured; ModelError."""
        if self.unit is not None and unit is not None:
            known_scale(place, self.unit, unit)

    def _as_columns(self, values: np.ndarray) -> np.ndarray:
        """One column for each element, those of a matrix column after column, (n, k)."""
        return values.reshape(self.times.size, -1, order="F")

    def _check(self) -> None:
        bad = np.flatnonzero(~(np.isfinite(self.times) & np.all(np.isfinite(self.values), axis=1)))
        if bad.size:
            more = f" (and {bad.size - 1} more)" if bad.size > 1 else ""
            raise ModelError(
                f"Samples: row {bad[0]} is not finite{more}, expected numbers; leave such rows out, times and values"
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
        found = array("Samples", "deviation", deviation, above=0.0)
        try:
            return self._as_columns(np.broadcast_to(found, (self.times.size, *self.shape)).copy())
        except ValueError:
            raise ModelError(
                f"Samples: found deviation of shape {found.shape}, expected a number, (k,) or the shape of the values "
                f"{self.values.shape}"
            ) from None

    def check_shape(self, place: str, shape: tuple[int, ...]) -> None:
        """Refuse samples of another shape than the quantity compared with them; ModelError."""
        if not fits(self.shape, shape):
            words = f"found {self.values.shape[1]} columns, expected {int(np.prod(shape))}"
            if len(shape) == 2:
                words = f"found samples of shape {self.shape}, expected {shape}; give values of shape (n, rows, columns)"
            raise ModelError(f"{place}: {words}")

    def check_cover(self, what: str, start: float, final: float) -> None:
        """Refuse samples that do not cover the time from start to final, s; ModelError."""
        small, (first, last) = SMALL * abs(final - start), self.times[[0, -1]]
        if first <= start + small and (last >= final - small or self.kind == "constant"):
            return
        remedy = "add samples or take a shorter time"
        if first <= start + small and self.times.size == 1:
            remedy = "add samples, or say kind='constant'"
        raise ModelError(
            f"{what}: samples cover {first:g} to {last:g} s, expected {start:g} to {final:g} s; {remedy}"
        )

    def require(self, what: str, start: float, final: float, between: bool) -> None:
        """Refuse samples outside of the horizon, with `between` also a horizon not covered, or gaps; ModelError."""
        small = SMALL * abs(final - start)
        if not between:
            outside = np.flatnonzero((self.times < start - small) | (self.times > final + small))
            if outside.size:
                raise ModelError(
                    f"{what}: {outside.size} samples lie outside of the horizon from {start:g} to {final:g} s, the first at "
                    f"{self.times[outside[0]]:g} s; leave them out or change the horizon"
                )
            return
        self.check_cover(what, start, final)
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
        """Values of one column at times between the samples, (m,)."""
        if self.kind == "linear":
            return np.interp(times, self.times, self.values[:, column])
        within = SAME * np.spacing(np.abs(times))
        row = np.clip(np.searchsorted(self.times, times + within, side="right") - 1, 0, self.times.size - 1)
        return self.values[row, column]

    def jumps(self, column: int) -> np.ndarray:
        """Times in s at which a column jumps."""
        return (
            self.times[1:][np.diff(self.values[:, column]) != 0] if self.kind == "constant" else np.zeros(0)
        )

    def kinks(self) -> np.ndarray:
        """Times in s at which the signals are not smooth."""
        return self.times[1:-1] if self.kind == "linear" else self.times[1:]
