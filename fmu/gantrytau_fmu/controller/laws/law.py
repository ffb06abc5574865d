"""What the user's controller may be: a Python function, a model or an FMU. From all that is known to references."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np

from gantrytau.border.checks import numbers_of
from gantrytau.border.dimensions import dimension
from gantrytau.border.refusal import USERS_ERRORS, ModelError, SolveError, did_you_mean, in_words
from gantrytau_fmu.controller.board import Board
from gantrytau_fmu.controller.channels import Channel, Declaration, Values
from gantrytau_fmu.controller.stepped_part import SteppedPart

LawFunction = Callable[[float, Mapping[str, Any]], Mapping[str, Any]]


class Law(Protocol):
    """A user's controller, called in every sample, whatever the state is, so that it may follow before it leads."""

    @property
    def tunables(self) -> Declaration:
        """Parameters that it has itself."""
        ...

    @property
    def tuned(self) -> Values:
        """Their values at first."""
        ...

    def fit(self, board: Board, references: Declaration) -> None:
        """What there is, and what it may give; ModelError where it does not fit."""
        ...

    def begin(self, stop: float) -> None:
        """The run begins, to end at `stop`, s."""
        ...

    def set(self, name: str, values: Values) -> None:
        """One of its parameters changes, between samples."""
        ...

    def references(self, k: int, time: float, period: float, nominal: Values) -> Values:
        """References (m,) of sample k; nominal: those that it leaves as they are."""
        ...

    def close(self) -> None:
        """The run has ended."""
        ...


class FunctionLaw:
    """`function(t, values) -> {reference: value}`; references that it does not name stay nominal."""

    tunables, tuned = Declaration(), np.zeros(0)

    def __init__(self, function: LawFunction):
        self._function = function
        self._name = getattr(function, "__name__", type(function).__name__)

    def fit(self, board: Board, references: Declaration) -> None:
        """See `Law.fit`."""
        self._board, self._references = board, references

    def begin(self, stop: float) -> None:
        """Nothing to prepare."""

    def set(self, name: str, values: Values) -> None:
        """It has no parameters of its own."""

    def references(self, k: int, time: float, period: float, nominal: Values) -> Values:
        """See `Law.references`; SolveError where the function raises, or names what is no reference."""
        try:
            found = self._function(time, self._board.by_name())
        except USERS_ERRORS as error:  # whatever a function of the user raises
            raise self._failure(f"raised {type(error).__name__}: {in_words(error)}; mend it", time) from error
        if not isinstance(found, Mapping):
            raise self._failure(f"answered {found!r}, expected {{name: value}} of references", time)
        wanted = nominal.copy()
        for name, value in found.items():
            place = self._references.slices.get(name)
            if place is None:
                words = did_you_mean(str(name), self._references.names)
                raise self._failure(f"answered '{name}', which is no reference{words}", time)
            try:
                numbers = np.asarray(value)
                if numbers.dtype.kind not in "biuf":  # None and texts are no numbers
                    raise TypeError
                wanted[place] = numbers.reshape(place.stop - place.start)
            except (TypeError, ValueError):
                count = place.stop - place.start
                raise self._failure(
                    f"answered {name} = {value!r}, expected {numbers_of((count,))}", time
                ) from None
        return wanted

    def close(self) -> None:
        """Nothing is held."""

    def _failure(self, words: str, time: float) -> SolveError:
        return SolveError(f"controller: the function {self._name} {words} (at t = {time:.6g} s)", time=time)


class PartLaw:
    """A model, an FMU or a `PythonComponent`: its inputs by the names of what is known, its outputs by those of references.

    wires: input -> name of what is known, and output -> reference, where these differ; elements of vectors one by one, too.
    """

    def __init__(self, part: SteppedPart, wires: Mapping[str, str]):
        self.part, self._wires = part, dict(wires)
        self.tunables, self.tuned = part.tunables, part.tuned

    def fit(self, board: Board, references: Declaration) -> None:
        """See `Law.fit`."""
        channels = (*self.part.inputs, *self.part.outputs)
        own = [name for c in channels for name in dict.fromkeys((c.name, *c.elements))]
        for name in self._wires:
            if name not in own:
                raise ModelError(f"wires: the controller has no '{name}'{did_you_mean(name, own)}")
        self._board = board
        known, numbers = board.declaration, self.part.outputs.slices
        self._taken = _places([self._joined(channel, known, "what is known") for channel in self.part.inputs])
        given = [c for c in self.part.outputs if c.name in references or self._wired(c)]
        if not given:
            raise ModelError(
                f"controller: found the outputs {', '.join(self.part.outputs.names) or 'none'}, expected one that is a "
                f"reference, {', '.join(references.names)}; wires={{output: reference}} joins other names"
            )
        self._to = _places([self._joined(channel, references, "the references") for channel in given])
        self._from = _places([range(numbers[c.name].start, numbers[c.name].stop) for c in given])

    def begin(self, stop: float) -> None:
        """See `Law.begin`."""
        self.part.begin(self._board.values[self._taken], stop)

    def set(self, name: str, values: Values) -> None:
        """See `Law.set`."""
        self.part.set(name, values)

    def references(self, k: int, time: float, period: float, nominal: Values) -> Values:
        """See `Law.references`."""
        found = self.part.step(time, period, self._board.values[self._taken])
        wanted = nominal.copy()
        wanted[self._to] = found[self._from]
        return wanted

    def close(self) -> None:
        """See `Law.close`."""
        self.part.close()

    def _wired(self, channel: Channel) -> bool:
        return any(name in self._wires for name in (channel.name, *channel.elements))

    def _joined(self, channel: Channel, there: Declaration, where: str) -> Sequence[int]:
        """The places of what a channel is joined with, whole or number by number."""
        if channel.name in self._wires or not self._wired(channel):
            return self._fitting(channel, there, where)
        singles = [Channel(element, channel.unit) for element in channel.elements]
        return [place for single in singles for place in self._fitting(single, there, where)]

    def _fitting(self, channel: Channel, there: Declaration, where: str) -> Sequence[int]:
        """The places of what has its name; ModelError where there is none, or of another size or dimension."""
        name = self._wires.get(channel.name, channel.name)
        if name in there:
            other, place = there[name], there.slices[name]
            places = range(place.start, place.stop)
        elif name in there.elements:
            first = there.elements.index(name)
            other = next(c for c in there if name in c.elements)
            places = range(first, first + 1)
        else:
            words = did_you_mean(name, there.names)
            raise ModelError(
                f"controller.{channel.name}: found no '{name}' among {where}{words} wires={{'{channel.name}': name}} joins "
                "it with another"
            )
        if len(places) != channel.size or dimension(other.unit) != dimension(channel.unit):
            raise ModelError(
                f"controller.{channel.name}: found {channel.size} in {channel.unit}, expected {len(places)} in "
                f"{other.unit}, as {name} has"
            )
        return places


def _places(parts: Sequence[Sequence[int]]) -> np.ndarray:
    return np.array([k for part in parts for k in part], dtype=int)
