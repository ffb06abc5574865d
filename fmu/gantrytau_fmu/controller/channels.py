"""What is exchanged from sample to sample: names, units, sizes and limits, declared before any value."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gantrytau.border.checks import instance, number, whole
from gantrytau.border.dimensions import dimension
from gantrytau.border.refusal import Given, ModelError, did_you_mean
from gantrytau.describing.record import Record

Values = NDArray[np.float64]
LARGEST = 4096  # numbers in one declaration: a bound for whoever makes room for them


@dataclass(frozen=True)
class Channel:
    """A scalar or vector that is exchanged.

    unit: as in models, "1" for none; size: numbers in it; minimum, maximum: of each number, in this unit, None for none.
    Raises ModelError for an empty name, a text that is no unit, a size below 1 and limits that are none.
    """

    name: str
    unit: str
    size: int = 1
    minimum: float | None = None
    maximum: float | None = None

    def __post_init__(self):
        place = f"channel {self.name!r}"
        whole(place, "size", self.size, least=1)
        for side, value in (("minimum", self.minimum), ("maximum", self.maximum)):
            if value is not None:
                object.__setattr__(self, side, number(place, side, value, least=-np.inf, most=np.inf))
        if self.minimum is not None and self.maximum is not None and self.minimum > self.maximum:
            expected = f"expected it below the maximum, {self.maximum:g}"
            raise ModelError(expected, place=place, found=Given("minimum", self.minimum))
        if not isinstance(self.name, str) or not self.name.strip() or not self.name.isprintable():
            raise ModelError(
                "expected a text that can be printed", place="channel", found=Given("name", self.name)
            )
        instance(place, "unit", self.unit, str, "a text, as 'm/s', or '1'")
        dimension(self.unit)  # raises for a text that is no unit

    @property
    def elements(self) -> tuple[str, ...]:
        """The names of its numbers: `q[0]`, `q[1]` of a vector, its own of a scalar."""
        return (self.name,) if self.size == 1 else tuple(f"{self.name}[{k}]" for k in range(self.size))


@dataclass(frozen=True)
class Declaration(Record):
    """Channels in their order: what a vector of values (n,) means. Empty where nothing is exchanged.

    Raises ModelError for a name that stands twice, and for more than 4096 numbers.
    """

    channels: tuple[Channel, ...] = ()

    def __init__(self, channels: Sequence[Channel] = ()):
        for channel in channels:
            instance("declaration", "channels", channel, Channel, "Channel(name, unit)")
        names = [channel.name for channel in channels]
        for name in names:
            if names.count(name) > 1:
                raise ModelError(f"declaration: found '{name}' twice, expected each name once; rename one")
        size = sum(channel.size for channel in channels)
        if size > LARGEST:
            raise ModelError(f"declaration: found {size} numbers, expected {LARGEST} at most; send fewer")
        object.__setattr__(self, "channels", tuple(channels))

    @cached_property
    def size(self) -> int:
        """Numbers in all."""
        return sum(channel.size for channel in self.channels)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the channels."""
        return tuple(channel.name for channel in self.channels)

    @cached_property
    def elements(self) -> tuple[str, ...]:
        """Names of all numbers, in the order of the vector."""
        return tuple(name for channel in self.channels for name in channel.elements)

    @cached_property
    def slices(self) -> Mapping[str, slice]:
        """Where in the vector each channel stands, by name."""
        ends = np.cumsum([channel.size for channel in self.channels]).tolist()
        return {c.name: slice(end - c.size, end) for c, end in zip(self.channels, ends, strict=True)}

    @cached_property
    def minimum(self) -> Values:
        """Least values, (n,), -inf where there is no limit."""
        return self._limits("minimum", -np.inf)

    @cached_property
    def maximum(self) -> Values:
        """Greatest values, (n,), inf where there is no limit."""
        return self._limits("maximum", np.inf)

    def __getitem__(self, name: str) -> Channel:
        """A channel by name; ModelError if there is none."""
        for channel in self.channels:
            if channel.name == name:
                return channel
        raise ModelError(f"there is no channel '{name}'{did_you_mean(str(name), self.names)}")

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[Channel]:
        return iter(self.channels)

    def vector(self, values: Mapping[str, ArrayLike]) -> Values:
        """The numbers as one vector (n,) of float64, from a value for each channel by name.

        Raises ModelError for channels that are missing or unknown, and for other sizes; values may be out of range, see
        `refusal`.
        """
        for name in values:
            self[name]  # an unknown name raises
        found = np.empty(self.size)
        for channel in self.channels:
            if channel.name not in values:
                raise ModelError(f"{channel.name}: found no value, expected {_count(channel)}")
            value = _numbers(values[channel.name])
            if value is None or value.shape not in (
                (channel.size,),
                () if channel.size == 1 else (channel.size,),
            ):
                raise ModelError(
                    f"{channel.name}: found {values[channel.name]!r}, expected {_count(channel)} in {channel.unit}"
                )
            found[self.slices[channel.name]] = value
        return found

    def by_name(self, vector: Values) -> dict[str, Values]:
        """The values of each channel, (size,), as views of a vector (n,)."""
        return {name: vector[place] for name, place in self.slices.items()}

    def refusal(self, vector: Any) -> str:
        """Why a vector cannot be taken, in words, or "" if it can: its kind, size, numbers that are not finite, limits."""
        if not isinstance(vector, np.ndarray) or vector.dtype.kind not in "fiu":
            return f"found {type(vector).__name__}, expected an array of numbers"
        if vector.shape != (self.size,):
            return f"found values of shape {np.shape(vector)}, expected ({self.size},)"
        bad = ~((vector >= self.minimum) & (vector <= self.maximum) & np.isfinite(vector))
        if not bad.any():
            return ""
        k = int(np.argmax(bad))
        channel = next(c for c in self.channels if self.slices[c.name].stop > k)
        least, most = float(self.minimum[k]), float(self.maximum[k])
        return f"found {self.elements[k]} = {vector[k]:g} {channel.unit}, expected a number in [{least:g}, {most:g}]"

    def _limits(self, side: str, none: float) -> Values:
        pairs = [(getattr(channel, side), channel.size) for channel in self.channels]
        return np.repeat(
            [none if value is None else value for value, _ in pairs], [n for _, n in pairs]
        ).astype(np.float64)


def _numbers(value: ArrayLike) -> Values | None:
    try:
        return np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return None


def _count(channel: Channel) -> str:
    return "one number" if channel.size == 1 else f"{channel.size} numbers"
