"""Signals over time, looked up by name: the record below results, files and figures."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gantrytau.border.checks import instance
from gantrytau.border.refusal import ModelError, did_you_mean
from gantrytau.language.self_description.appearance import Shape

Values = NDArray[np.float64]

# 'tool.r[2]', 'R[0,1]', 'der(tool.r[2])': text before the index, the index, closing brackets behind it
_ELEMENT = re.compile(r"(.*[^\[])\[(\d+(?:, ?\d+)*)\](\)*)")
ONE_NAME = "one name, a string; several one by one, as in plot('a', 'b')"


class Series:
    """The variables of a model at the output times of a simulation or an optimum; it cannot be changed.

    time: output times, (times,) in s, not decreasing.
    values: scalar name -> its values, (times,) or one number for a constant. Any mapping will do, also one
        that computes an entry when it is asked for; each is asked for once, and only if it is wanted.
    units, descriptions: scalar or vector name -> text; a name left out has none.
    title: what was computed, for figures and files.
    aliases: further name -> the name in `values` that it equals; a minus sign before it says the negative.
    held: names of scalars that hold their values from one time to the next, as what is sampled does.
    instants: some of these at more times, at all at which they change, for `at`.
    ended: why it ends where it does, "stop" where that was asked for.
    modes: names of the values 0, 1, ... of a scalar, by its name.
    shapes: what the components of the model look like, by names.
    displays: scalar or vector name -> the unit in which figures and tables show it, where that is not its own.
    limits: declared min and max of scalars by name, infinite where there is none.

    Elements `tool.r[0]` to `tool.r[2]` make up the vector `tool.r`, (times, 3), and `R[0,0]` to `R[2,2]` the
    matrix `R`, (times, 3, 3). `time` is a name, too.
    """

    def __init__(
        self,
        time: ArrayLike,
        values: Mapping[str, Any],
        *,
        units: Mapping[str, str] | None = None,
        descriptions: Mapping[str, str] | None = None,
        title: str = "",
        aliases: Mapping[str, str] | None = None,
        held: Iterable[str] = (),
        instants: "Series | None" = None,
        ended: str = "stop",
        modes: Mapping[str, Sequence[str]] | None = None,
        shapes: Iterable[Shape] = (),
        displays: Mapping[str, str] | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
    ):
        self._time = np.array(time, dtype=float)
        if self._time.ndim != 1 or self._time.size == 0 or not np.all(np.diff(self._time) >= 0):
            raise ModelError(
                f"{title or 'Result'}: time has shape {self._time.shape} or decreases; "
                "expected a vector of output times in s that never decreases"
            )
        self._time.flags.writeable = False
        self._values = values
        self._units = dict(units or {})
        self._descriptions = dict(descriptions or {})
        self._displays = {name: text for name, text in (displays or {}).items() if text}
        self._limits = dict(limits or {})
        self._title = title
        self._aliases = dict(aliases or {})
        self._held = frozenset(held)
        self._instants = instants
        self._ended = ended
        self._modes = {name: tuple(words) for name, words in (modes or {}).items()}
        self._shapes = tuple(shapes)
        self._names = (*(name for name in values if name != "time"), *self._aliases)
        self._scalars = frozenset(self._names)
        self._arrays = _arrays(self._names, tuple(self._descriptions))
        targets = self._scalars - self._aliases.keys() | {"time"}
        for name, target in self._aliases.items():
            if target.removeprefix("-") in targets:
                continue
            raise ModelError(
                f"{title or 'Result'}: alias '{name}' names '{target}'; "
                "expected a name in values, or a minus sign and such a name"
            )
        self._known: dict[str, Values] = {"time": self._time}

    @property
    def time(self) -> Values:
        """Output times, (times,) in s."""
        return self._time

    @property
    def title(self) -> str:
        """What was computed."""
        return self._title

    @property
    def ended(self) -> str:
        """Why it ends where it does: "stop" where that was asked for, else what `terminate` said, or what went wrong."""
        return self._ended

    @property
    def held(self) -> frozenset[str]:
        """Names of scalars that hold their values from one time to the next, and are drawn as steps."""
        return self._held

    @property
    def limits(self) -> Mapping[str, tuple[float, float]]:
        """Declared min and max of scalars by name."""
        return self._limits

    @property
    def modes(self) -> Mapping[str, tuple[str, ...]]:
        """Names of the values 0, 1, ... of scalars that are modes, by the names of these."""
        return self._modes

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """What the components of the model look like, by the names of their places."""
        return self._shapes

    def mode(self, name: str) -> np.ndarray:
        """The names of a mode at all times, (times,); ModelError for a variable that is none."""
        if name not in self._modes:
            self[name]  # an unknown name raises
            there = ", ".join(self._modes) or "of which there is none"
            raise ModelError(
                f"{self._title or 'Result'}: found {name}, which is no mode, expected a mode, {there}; its values are "
                f"result['{name}']"
            )
        return np.array(self._modes[name])[self[name].astype(int)]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all scalars; vectors and matrices answer to their own names as well."""
        return self._names

    @property
    def arrays(self) -> Mapping[str, np.ndarray]:
        """Vector or matrix name -> the names of its elements in its shape."""
        return self._arrays

    @property
    def aliases(self) -> Mapping[str, str]:
        """Name -> the name it equals, with a minus sign before it if it is the negative."""
        return self._aliases

    @property
    def units(self) -> dict[str, str]:
        """Name -> unit of all scalars, vectors and matrices; "" where none was declared."""
        return {name: self.unit(name) for name in (*self._names, *self._arrays)}

    def unit(self, name: str) -> str:
        """The unit of one variable; that of its vector if the element has none of its own, "" if none."""
        return "s" if name == "time" else self._attribute(self._units, name)

    def description(self, name: str) -> str:
        """The description of one variable, found like its unit."""
        return "time" if name == "time" else self._attribute(self._descriptions, name)

    def display(self, name: str) -> str:
        """The unit in which one variable is shown, as its declaration says, "" if it says none; found like its unit."""
        return self._attribute(self._displays, name) if self._displays and name != "time" else ""

    def __contains__(self, name: object) -> bool:
        return name == "time" or name in self._scalars or name in self._arrays

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __getitem__(self, name: str) -> Values:
        instance(self.title or "Result", "name", name, str, ONE_NAME)
        if name not in self._known:
            values = self._compute(name)
            values.flags.writeable = False
            self._known[name] = values
        return self._known[name]

    def _ipython_key_completions_(self) -> list[str]:
        return ["time", *self._names, *self._arrays]

    def final(self, name: str) -> Any:
        """The last value: a float, or an array for a vector or matrix."""
        last = self[name][-1]
        return last if last.ndim else float(last)

    def at(self, t: ArrayLike, name: str) -> Any:
        """A variable at a time, or at times (n,), in s: a float, (n,), or with the shape of a vector or matrix behind.

        Where it jumps it is the value behind the jump. Between two output times it is held, if it holds its values, else
        interpolated: by a cubic where its derivative is known by name, `der(x)`, by a straight line otherwise. ModelError
        for a time outside of the result.
        """
        times = np.asarray(t, dtype=float)
        if not np.all((times >= self._time[0]) & (times <= self._time[-1])):
            raise ModelError(
                f"{self._title or 'Result'}: at: found t = {t}, expected times from {self._time[0]:.6g} s to "
                f"{self._time[-1]:.6g} s"
            )
        if name in self._arrays:
            columns = [np.asarray(self.at(times, str(element))) for element in self._arrays[name].flat]
            return np.stack(columns, axis=-1).reshape(*times.shape, *self._arrays[name].shape)
        if self._instants is not None and name in self._instants:
            return self._instants.at(t, name)
        values = self[name]
        left = np.searchsorted(self._time, times, side="right") - 1
        right = np.minimum(left + 1, self._time.size - 1)
        h = self._time[right] - self._time[left]
        s = (times - self._time[left]) / np.where(h > 0, h, 1.0)
        found = values[left]
        if name not in self._held:
            found = found + s * (values[right] - values[left])
            rate = f"der({name})"
            if rate in self._scalars:  # the cubic with these values and rates at both ends
                mean = values[right] - values[left]
                found = found + s * (1 - s) * (
                    (1 - s) * (h * self[rate][left] - mean) - s * (h * self[rate][right] - mean)
                )
        return found if times.ndim else float(found)

    def select(self, names: Sequence[str]) -> Self:
        """Only the named variables, vectors with all their elements; ModelError for an unknown name."""
        values: dict[str, Values] = {}
        for name in names:
            elements = self._arrays[name].flat if name in self._arrays else [name]
            values.update((str(e), self[str(e)]) for e in elements)  # an unknown name raises
        units = {name: self.unit(name) for name in values}
        words = {name: self.description(name) for name in values}
        own: dict[str, Any] = dict(title=self._title, held=self._held & values.keys(), ended=self._ended)
        some = [] if self._instants is None else [name for name in values if name in self._instants]
        own["instants"] = self._instants.select(some) if self._instants is not None and some else None
        own["modes"] = {name: words for name, words in self._modes.items() if name in values}
        own |= dict(shapes=self._shapes, displays={name: self.display(name) for name in values})
        own["limits"] = {name: ends for name, ends in self._limits.items() if name in values}
        return type(self)(self._time, values, units=units, descriptions=words, **own)

    def __repr__(self) -> str:
        title = f"{self._title}: " if self._title else ""
        span = f"{self._time.size} times from {self._time[0]:g} s to {self._time[-1]:g} s"
        shown = ", ".join(self._names[:6]) + (", ..." if len(self._names) > 6 else "")
        return f"<{type(self).__name__} {title}{len(self._names)} variables at {span}: {shown}>"

    def _compute(self, name: str) -> Values:
        if name not in self:
            path = self._title or "Result"
            choice = ("time", *self._names, *self._arrays)
            raise ModelError(f"{path} has no variable '{name}'{did_you_mean(str(name), choice)}")
        if name in self._arrays:
            elements = self._arrays[name]
            columns = [self[element] for element in elements.flat]
            return np.stack(columns, axis=1).reshape(self._time.size, *elements.shape)
        if name in self._aliases:
            target = self._aliases[name]
            return -self[target[1:]] if target.startswith("-") else self[target].view()
        values = np.array(self._values[name], dtype=float)
        if values.size == 1:
            return np.full(self._time.size, values.item())
        if values.shape != self._time.shape:
            raise ModelError(
                f"{self._title or 'Result'}: {name} has values of shape {values.shape}; expected one value "
                f"for each of {self._time.size} times, and vectors by their elements, '{name}[0]'"
            )
        return values

    def _attribute(self, texts: Mapping[str, str], name: str) -> str:
        """The unit or description of a variable: its own, else that of its array, of its first element or of its alias."""
        if name in texts:
            return texts[name]
        if name in self._arrays:
            return texts.get(str(self._arrays[name].flat[0]), "")
        element = split_element(name)
        if element and element[0] in texts:
            return texts[element[0]]
        if name in self._aliases:
            return self._attribute(texts, self._aliases[name].removeprefix("-"))
        if name not in self:
            self._compute(name)  # raises
        return ""


def split_element(name: str) -> tuple[str, tuple[int, ...]] | None:
    """The array and the index that an element's name consists of, or None for another name."""
    match = _ELEMENT.fullmatch(name)
    if match is None:
        return None
    before, index, behind = match.groups()
    return before + behind, tuple(int(number) for number in index.split(","))


@lru_cache(maxsize=16)  # results of one model have the same names
def _arrays(names: tuple[str, ...], described: tuple[str, ...]) -> Mapping[str, np.ndarray]:
    """Array name -> element names in the shape of the array, for arrays all of whose elements exist.

    Indices begin at 0; at 1 where the array is described and has no element 0, as Modelica writes it.
    """
    found: dict[str, dict[tuple[int, ...], str]] = {}
    for name in names:
        element = split_element(name)
        if element:
            found.setdefault(element[0], {})[element[1]] = name
    arrays, scalars, words = {}, frozenset(names), frozenset(described)
    for base, elements in found.items():
        if base in scalars or len({len(index) for index in elements}) > 1:
            continue
        places = np.array(list(elements))
        zero = f"{base}[{','.join('0' * places.shape[1])}]"
        first = 1 if np.all(places.min(axis=0) == 1) and base in words and zero not in words else 0
        shape = tuple(int(size) for size in np.max(places, axis=0) + 1 - first)
        if len(elements) == np.prod(shape):
            indices = (tuple(k + first for k in index) for index in np.ndindex(*shape))
            arrays[base] = np.array([elements[index] for index in indices], dtype=object)
            arrays[base] = arrays[base].reshape(shape)
    return arrays
