"""The masters: how components step from one communication point to the next, and how they begin.

Communication points are begin + k step. u_i are the inputs of component i that others drive, y_i its outputs.
Gauss-Seidel: one after the other; u_i comes from those before at k+1 and from those behind at k.
Jacobi: all from k. Iteration: u_i is the mean of y(k) and y(k+1), found by repeating the step from saved states, which
is of second order; sampled components step once, before the others, as a sample is taken when a step begins.
A component with a step of m points takes it in Jacobi when its interval begins, its outputs being seen when it ends.
In Gauss-Seidel one that stands before all faster ones steps when its interval begins (a sampled controller holds its
answer until it ends), the others when the faster ones have come to its end.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, get_args

import numpy as np

from gantrytau.border.checks import check_words, number, whole
from gantrytau.border.refusal import Given, ModelError, SolveError, did_you_mean
from gantrytau.describing.record import Record
from gantrytau_fmu.systems.component import dotted
from gantrytau_fmu.systems.connected_system import ConnectedSystem
from gantrytau_fmu.systems.drives import Drive, between, knots_of
from gantrytau_fmu.systems.step_order import is_sampled, takes_samples

Order = Literal["gauss-seidel", "jacobi", "iterate"]
ORDERS: tuple[str, ...] = get_args(Order)
SMALL = 1e-6  # magnitude below which agreement is absolute: noise around zero never agrees relatively


@dataclass(frozen=True)
class Master(Record):
    """The master algorithm of a co-simulation: in which order components step, how often, and where they run.

    order: "gauss-seidel": one after the other, by step_order.py or in a `sequence`; "jacobi": all with what was known at
        the last point; "iterate": steps are repeated from saved states until every input is the mean of the output that
        drives it at both ends of the step, within `agreement` (relative), in at most `iterations`.
    steps: component -> its own step, s, a multiple or a fraction of the communication step; what others give it is held
        in between.
    tolerance: relative, handed to the components; models are integrated with it (1e-6).
    error_estimate: simulate again with half the steps and add 'error(a.y)' = 2 |y(step) - y(step / 2)|, which is the
        error of the result to first order in the step.
    isolate: components (True: all) in processes of their own, where a crash or a call longer than `timeout`, s, is an error.
    progress: called with the time reached; by default a bar on the terminal when it takes long.
    """

    order: Order = "gauss-seidel"
    sequence: Sequence[str] | None = None
    steps: Mapping[str, float] | None = None
    agreement: float = 1e-8
    iterations: int = 50
    tolerance: float | None = None
    error_estimate: bool = False
    isolate: Sequence[str] | bool = ()
    timeout: float = 60.0
    progress: Callable[[float], None] | None = None

    def __post_init__(self):
        check_words(Master, vars(self))
        number("Master", "agreement", self.agreement, above=0.0, below=1.0)
        whole("Master", "iterations", self.iterations, least=1)
        if self.tolerance is not None:
            number("Master", "tolerance", self.tolerance, above=0.0, below=1.0)
        timeout = number("Master", "timeout", self.timeout, above=0.0, unit="s")
        object.__setattr__(self, "timeout", timeout)

    def isolated(self, components: Collection[str]) -> tuple[str, ...]:
        """The components that run in processes of their own."""
        if isinstance(self.isolate, bool):
            return tuple(components) if self.isolate else ()
        return tuple(self.isolate)


class RunningComponent(Protocol):
    """A running component, in this process or in one of its own; see `Slave`."""

    def begin(
        self, start: Mapping[str, float | str], begin: float, stop: float, tolerance: float | None
    ) -> None: ...
    def started(self) -> None: ...
    def get(self, names: tuple[str, ...]) -> list[float]: ...
    def set(self, names: tuple[str, ...], values: Sequence[float]) -> None: ...
    def step(
        self,
        time: float,
        size: float,
        known: tuple[str, ...],
        values: Sequence[float],
        wanted: tuple[str, ...],
    ) -> list[float]: ...
    def save(self) -> None: ...
    def restore(self) -> None: ...
    def close(self) -> None: ...


@dataclass(frozen=True)
class Grid:
    """Communication points begin + k step for k = 0 .. count, the last one at stop."""

    begin: float
    stop: float
    step: float
    count: int
    even: bool  # whether the last interval is as long as the others

    def time(self, k: int) -> float:
        return self.stop if k == self.count else self.begin + k * self.step

    def size(self, first: int, last: int) -> float:
        if last == self.count and not self.even:
            return self.stop - self.time(first)
        return (last - first) * self.step


def check_times(place: str, begin: float, stop: float, step: float) -> None:
    """ModelError unless begin < stop and 0 < step <= stop - begin."""
    if not stop > begin:
        expected = f"expected a time after the beginning at {begin:g} s; choose a later one"
        raise ModelError(expected, place=place, found=Given("stop", stop))
    if not 0 < step <= (stop - begin) * (1 + 1e-9):
        expected = (
            f"expected more than 0 and at most the {stop - begin:g} s that are simulated; choose such a step"
        )
        raise ModelError(expected, place=place, found=Given("step", step))


def make_grid(begin: float, stop: float, step: float) -> Grid:
    """The points from begin to stop; the last interval is shorter if the step does not divide the span."""
    ratio = (stop - begin) / step
    count = round(ratio)
    even = count > 0 and abs(ratio - count) < 1e-9 * count  # rounding of decimal steps stays far below
    return Grid(begin, stop, step, count if even else int(np.ceil(ratio)), even)


@dataclass(frozen=True)
class Pace:
    """How often a component steps: once in `multiple` intervals, `parts` times within one."""

    multiple: int = 1
    parts: int = 1


@dataclass(frozen=True)
class _Feed:
    """Where the value of an input comes from: an output of another component, or a function of time."""

    name: str
    owner: str = ""
    place: int = 0
    factor: float = 1.0
    offset: float = 0.0
    drive: Drive | None = None


class RunningSystem:
    """The running components of a system, with the values that they exchange.

    wanted: names of each component to be read at every point; those that drive others are added.
    """

    def __init__(
        self,
        system: ConnectedSystem,
        parts: Mapping[str, RunningComponent],
        sequence: Sequence[str],
        paces: Mapping[str, Pace],
        grid: Grid,
        wanted: Mapping[str, Sequence[str]],
    ):
        self.system, self.parts, self.sequence, self.paces, self.grid = (
            system,
            parts,
            tuple(sequence),
            paces,
            grid,
        )
        sources = {
            name: [link.source[1] for link in system.links if link.source[0] == name] for name in parts
        }
        self.wanted = {name: tuple(dict.fromkeys([*wanted[name], *sources[name]])) for name in parts}
        self.feeds = {name: self._feeds(name) for name in parts}
        self.known = {name: tuple(feed.name for feed in self.feeds[name]) for name in parts}
        self.knots = {name: self._knots(name) for name in parts}
        self.sampled = [name for name in self.sequence if is_sampled(system, name)]
        self.values: dict[str, list[float]] = {}
        self.pending: dict[int, list[tuple[str, list[float]]]] = {}
        self.largest: dict[str, np.ndarray] = {}

    def inputs(self, name: str, time: float) -> list[float]:
        """What drives the inputs `known` of a component now."""
        return self._driven(name) + self._external(name, time)

    def read(self) -> None:
        """Read all components."""
        for name, part in self.parts.items():
            self.values[name] = part.get(self.wanted[name])
            self.check(name, self.grid.begin)

    def advance(self, k: int, master: Master) -> None:
        """From point k to k + 1."""
        if master.order == "jacobi":
            self._jacobi(k)
        elif master.order == "gauss-seidel":
            self._gauss_seidel(k)
        else:
            self._iterate(k, master.agreement, master.iterations)

    def check(self, name: str, time: float) -> None:
        """SolveError if a component gave values that are not finite."""
        if all(map(np.isfinite, self.values[name])):
            return
        pairs = zip(self.wanted[name], self.values[name], strict=True)
        bad = [f"{dotted(name, scalar)} = {value}" for scalar, value in pairs if not np.isfinite(value)]
        raise SolveError(
            f"found {', '.join(bad[:6])} at t = {time:.6g} s, expected finite values; take a shorter step, or look at "
            "what drives this component",
            place=self.system.components[name].title,
            time=time,
        )

    def _feeds(self, name: str) -> list[_Feed]:
        links = [link for link in self.system.links if link.target[0] == name]
        feeds = [
            _Feed(
                link.target[1],
                link.source[0],
                self.wanted[link.source[0]].index(link.source[1]),
                link.factor,
                link.offset,
            )
            for link in links
        ]
        drives = self.system.drives.items()
        return feeds + [_Feed(scalar, drive=drive) for (owner, scalar), drive in drives if owner == name]

    def _knots(self, name: str) -> np.ndarray:
        """Times at which a component begins a step of its own, as what drives it jumps or bends there, if it can."""
        if not self.system.components[name].variable_step:
            return np.zeros(0)
        return knots_of({place: drive for place, drive in self.system.drives.items() if place[0] == name})

    def _step(self, name: str, first: int, last: int) -> list[float]:
        """Step a component over the points from first to last; what others give stays, functions of time go on."""
        found = []
        for time, size in self._parts(name, first, last):
            values = self._driven(name) + self._over(name, time, size)
            found = self.parts[name].step(time, size, self.known[name], values, self.wanted[name])
        return found

    def _parts(self, name: str, first: int, last: int) -> list[tuple[float, float]]:
        """Begin and length, s, of all steps of a component over the points from first to last."""
        begin, parts = self.grid.time(first), self.paces[name].parts
        size = self.grid.size(first, last) / parts
        return [
            piece for part in range(parts) for piece in between(self.knots[name], begin + part * size, size)
        ]

    def _over(self, name: str, time: float, size: float) -> list[float]:
        """The inputs of a component that are driven from outside, over one of its steps.

        A function of time is held over a step at its value in the middle, the mean to second order; samples at their
        mean, so that no pulse is lost. A sampled component gets the value at the beginning, where it samples.
        """
        drives = [feed.drive for feed in self.feeds[name] if feed.drive]
        if takes_samples(self.system.components[name]):
            return [drive(time) for drive in drives]
        return [drive.mean(time, size) for drive in drives]

    def _interval(self, name: str, k: int) -> tuple[int, int] | None:
        """First and last point of the step that a component takes at k, None if it takes none."""
        multiple = self.paces[name].multiple
        first = k - k % multiple
        last = min(first + multiple, self.grid.count)
        return (first, last) if k + 1 == last or (self._ahead(name) and k == first) else None

    def _ahead(self, name: str) -> bool:
        """Whether all faster components come later in the sequence."""
        place, pace = self.sequence.index(name), self.paces[name].multiple
        return all(self.paces[other].multiple >= pace for other in self.sequence[:place])

    def _gauss_seidel(self, k: int) -> None:
        for name in self.sequence:
            interval = self._interval(name, k)
            if interval is None or (self._ahead(name) and k != interval[0]):
                continue
            self.values[name] = self._step(name, *interval)
            self.check(name, self.grid.time(interval[1]))

    def _jacobi(self, k: int) -> None:
        for name in self.sequence:
            if k % self.paces[name].multiple == 0:
                last = min(k + self.paces[name].multiple, self.grid.count)
                self.pending.setdefault(last, []).append((name, self._step(name, k, last)))
        for name, values in self.pending.pop(k + 1, ()):
            self.values[name] = values
            self.check(name, self.grid.time(k + 1))

    def _iterate(self, k: int, agreement: float, iterations: int) -> None:
        """Repeat the step until the outputs at its end are those that the inputs used were made of."""
        worst = ""
        for name in self.sampled:  # a sample is taken as the step begins, from what there is then
            self.values[name] = self._step(name, k, k + 1)
            self.check(name, self.grid.time(k + 1))
        repeated = [name for name in self.sequence if name not in self.sampled]
        before = {name: self._driven(name) for name in repeated}
        for name in repeated:
            self.parts[name].save()
        for sweep in range(iterations):
            used = {}
            for name in repeated:
                if sweep:
                    self.parts[name].restore()
                used[name] = self._driven(name)
                self._implicit_step(name, k, before[name])
            worst = self._disagreement(used, agreement)
            if not worst:
                return
        raise SolveError(
            f"co-simulation: after {iterations} iterations at t = {self.grid.time(k):.6g} s the inputs do not agree with "
            f"the outputs: {worst}; take a shorter step, or allow more iterations",
            time=self.grid.time(k),
        )

    def _implicit_step(self, name: str, k: int, before: Sequence[float]) -> None:
        """A step with the mean of the inputs at both its ends, and the outputs for those at its end."""
        part, after = self.parts[name], self._driven(name)
        mean = [(a + b) / 2 for a, b in zip(before, after, strict=True)]
        for time, size in self._parts(name, k, k + 1):
            part.step(time, size, self.known[name], mean + self._over(name, time, size), self.wanted[name])
        part.set(self.known[name], after + self._external(name, self.grid.time(k + 1)))
        self.values[name] = part.get(self.wanted[name])
        self.check(name, self.grid.time(k + 1))

    def _driven(self, name: str) -> list[float]:
        """The inputs of a component that outputs of others drive; they come first in `known`."""
        feeds = [feed for feed in self.feeds[name] if not feed.drive]
        return [self.values[feed.owner][feed.place] * feed.factor + feed.offset for feed in feeds]

    def _external(self, name: str, time: float) -> list[float]:
        """The inputs of a component that functions of time drive."""
        return [feed.drive(time) for feed in self.feeds[name] if feed.drive]

    def _disagreement(self, used: Mapping[str, list[float]], agreement: float) -> str:
        """The input that agrees least, with both values, or nothing if all agree."""
        found: list[tuple[float, str]] = []
        for name, before in used.items():
            if not before:
                continue
            old, new = np.array(before), np.array(self._driven(name))
            scale = np.maximum(self.largest.get(name, SMALL), np.maximum(abs(old), abs(new)))
            self.largest[name] = scale
            place = int(np.argmax(abs(new - old) / scale))
            words = f"{dotted(name, self.known[name][place])} was {old[place]:.6g}, is {new[place]:.6g}"
            found.append((float(abs(new - old)[place] / scale[place]), words))
        worst = max(found, default=(0.0, ""))
        return worst[1] if worst[0] > agreement else ""


def paces_of(system: ConnectedSystem, step: float, steps: Mapping[str, Any] | None) -> dict[str, Pace]:
    """How often each component steps; ModelError for steps that are no multiple and no fraction of `step`."""
    found = {name: Pace() for name in system.components}
    for name, own in (steps or {}).items():
        if name not in found:
            raise no_component("steps", name, found)
        ratio = number(f"Master: steps {name}", "steps", own, above=0.0, unit="s") / step
        multiple, parts = round(ratio), round(1 / ratio)
        if abs(ratio - multiple) < 1e-9 * ratio:
            found[name] = Pace(multiple=multiple)
        elif abs(1 / ratio - parts) < 1e-9 / ratio:
            found[name] = Pace(parts=parts)
        else:
            raise ModelError(
                f"steps: {name} has {own!r} s, expected a whole multiple or fraction of the step of {step:g} s",
                place="Master",
                argument="steps",
            )
    return found


def no_component(argument: str, name: Any, components: Collection[str]) -> ModelError:
    """That an argument of the master names a component that is not there."""
    words = f"{argument}: there is no component '{name}'{did_you_mean(str(name), components)}"
    return ModelError(words, place="Master", argument=argument)
