"""The cases of a study: names and their values, seeds, and every combination that is asked for."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np

from gantrytau.border.checks import instance, one_of, whole
from gantrytau.border.refusal import Given, ModelError
from gantrytau.describing.record import Record

SEED = "seed"  # the name of the axis of seeds
CASE = "case"  # the name of the axis of values that go together
WAYS = ("grid", "zip")
SAME = 1e-9  # relative: numbers that are closer are one value


@dataclass(frozen=True, eq=False)
class Case(Record):
    """One run of a study.

    number: from 0, seeds last and fastest; place: along each axis; chosen: name -> value; seed: None without seeds.
    """

    number: int
    place: tuple[int, ...]
    chosen: Mapping[str, Any]
    seed: int | None = None

    @property
    def names(self) -> dict[str, Any]:
        """All that tells it from other cases, the seed too."""
        return {**self.chosen, **({} if self.seed is None else {SEED: self.seed})}

    def __str__(self) -> str:
        return ", ".join(f"{name}={spoken(value)}" for name, value in self.names.items()) or "the one case"


@dataclass(frozen=True, eq=False)
class FailedCase(Record):
    """A case that has no result: its error in words, and the class of the error."""

    case: Case
    message: str
    kind: str

    def __str__(self) -> str:
        return f"{self.case}: {self.kind}: {self.message}"


@dataclass(frozen=True, eq=False)
class Axes(Record):
    """What varies: name -> its values; combined as a grid, or value by value ("zip"); seeds, None without.

    labels: name -> its name as an axis, where that is another one: the start of x is "x.start".
    """

    over: Mapping[str, Sequence[Any]]
    seeds: tuple[int, ...] | None
    combine: str
    labels: Mapping[str, str] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """One name for each axis."""
        varied = tuple(map(self.label, self.over)) if self.combine == "grid" else (CASE,) if self.over else ()
        return (*varied, *((SEED,) if self.seeds is not None else ()))

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of cases along each axis."""
        sizes = [len(values) for values in self.over.values()]
        varied = sizes if self.combine == "grid" else sizes[:1]
        return (*varied, *((len(self.seeds),) if self.seeds is not None else ()))

    def label(self, name: str) -> str:
        """What varies by a name."""
        return self.labels.get(name, name)

    @property
    def cases(self) -> tuple[Case, ...]:
        """All cases in their order."""
        return tuple(self._cases())

    def _cases(self) -> Iterator[Case]:
        for number, place in enumerate(product(*(range(size) for size in self.shape))):
            varied = place[:-1] if self.seeds is not None else place
            where = varied if self.combine == "grid" else varied * len(self.over)
            chosen = {name: self.over[name][k] for name, k in zip(self.over, where, strict=True)}
            yield Case(number, place, chosen, None if self.seeds is None else self.seeds[place[-1]])


def read_axes(over: Any, seeds: Any, combine: Any) -> Axes:
    """The axes of a study; ModelError for what is no list of values, empty, or of several lengths with "zip"."""
    one_of("study", "combine", combine, WAYS)
    instance("study", "over", over, (Mapping, type(None)), "{name: values}")
    lists = {str(name): _values(str(name), values) for name, values in (over or {}).items()}
    numbers = None if seeds is None else _seeds(seeds)
    if not lists and numbers is None:
        raise ModelError(
            "study: found nothing that varies, expected over={name: values} or seeds=; for one run take simulate",
            argument="over",
        )
    sizes = {name: len(values) for name, values in lists.items()}
    if combine == "zip" and len(set(sizes.values())) > 1:
        told = ", ".join(f"{name} has {size}" for name, size in sizes.items())
        raise ModelError(
            f"study: over: {told}; expected as many values of each, as combine='zip' takes them one by one; "
            "repeat values, or take combine='grid'",
            argument="over",
        )
    if SEED in lists:
        raise ModelError("study: over: found 'seed', expected it as seeds=[...]", argument="over")
    return Axes(lists, numbers, combine)


def _values(name: str, values: Any) -> tuple[Any, ...]:
    listed = isinstance(values, (Sequence, range)) and not isinstance(values, (str, bytes))
    if not listed and not (isinstance(values, np.ndarray) and values.ndim):
        raise ModelError(
            f"study: over: {name}: found {spoken(values)}, expected a list of values; for one value write [value]",
            argument="over",
        )
    if not len(values):
        raise ModelError(
            f"study: over: {name}: found no values, expected at least one; leave the name out to keep its value",
            argument="over",
        )
    return tuple(v.item() if isinstance(v, np.generic) else v for v in values)


def _seeds(seeds: Any) -> tuple[int, ...]:
    if isinstance(seeds, (str, bytes)) or not np.iterable(seeds):
        return tuple(range(whole("study", "seeds", seeds, least=1)))
    found = tuple(whole("study", "seeds", seed, least=0) for seed in seeds)
    if not found or len(set(found)) < len(found):
        raise ModelError(
            "expected how many, as 20, or a list of different numbers",
            place="study",
            found=Given("seeds", seeds),
        )
    return found


def equal(a: Any, b: Any) -> bool:
    """Whether two values of a case are one: numbers and arrays to rounding."""
    if a is b:
        return True
    try:
        first, second = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    except (TypeError, ValueError):
        return bool(np.all(a == b))
    return first.shape == second.shape and bool(np.allclose(first, second, rtol=SAME, atol=0.0))


def spoken(value: Any) -> str:
    """A value in a message, short."""
    if isinstance(value, float):
        return f"{value:.6g}"
    text = repr(value.tolist() if isinstance(value, np.ndarray) else value)
    return text if len(text) < 60 else f"{text[:56]}..."
