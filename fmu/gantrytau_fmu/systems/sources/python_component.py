"""A Python function as a component of a system: a controller of three lines, or a plant that has no model.

law = PythonComponent(lambda t, u: {"f": -k * u["q"]}, inputs=[Channel("q", "m")], outputs=[Channel("f", "N")])
cosimulate({"robot": MyRobot(), "law": law}, [("robot.q", "law.q"), ("law.f", "robot.f")], stop=1.0, step=0.004)
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from gantrytau.border.checks import numbers_of
from gantrytau.border.refusal import USERS_ERRORS, ModelError, SolveError, did_you_mean, in_words
from gantrytau_fmu.systems.component import Component, Scalar

Function = Callable[[float, Mapping[str, Any]], Mapping[str, Any]]


class Port(Protocol):
    """What goes into a function or comes out, as `Channel`: a scalar or a vector of `size` numbers."""

    @property
    def name(self) -> str: ...
    @property
    def unit(self) -> str: ...
    @property
    def size(self) -> int: ...
    @property
    def minimum(self) -> float | None: ...
    @property
    def maximum(self) -> float | None: ...
    @property
    def elements(self) -> tuple[str, ...]: ...


class PythonComponent:
    """A function `function(t, values) -> {output: value}` as a component.

    values: inputs and parameters by name, floats and vectors (size,); t: s. starts: outputs before the first call, 0 where
    none is given. sampled: a controller, called when a step begins, whose answer is held over it; else a plant, called with
    the end of the step, which answers with what there is then. parameters: tunable, each with its value.
    Raises ModelError for names that stand twice, starts that are no outputs, and values of other sizes.
    """

    def __init__(
        self,
        function: Function,
        *,
        inputs: Sequence[Port],
        outputs: Sequence[Port],
        parameters: Mapping[Any, ArrayLike] | None = None,
        starts: Mapping[str, ArrayLike] | None = None,
        sampled: bool = True,
    ):
        if not callable(function):
            raise ModelError(f"PythonComponent: found {function!r}, expected a function of t and values")
        self.function, self.sampled = function, sampled
        self.inputs, self.outputs = tuple(inputs), tuple(outputs)
        self.parameters = {
            port: np.asarray(value, dtype=float).ravel() for port, value in (parameters or {}).items()
        }
        ports = (*self.inputs, *self.outputs, *self.parameters)
        names = [port.name for port in ports]
        for name in names:
            if names.count(name) > 1:
                raise ModelError(
                    f"PythonComponent: found '{name}' twice, expected each name once; rename one"
                )
        outgoing = {port.name: port for port in self.outputs}
        for name in starts or {}:
            if name not in outgoing:
                raise ModelError(
                    f"PythonComponent: found a start of '{name}', which is no output{did_you_mean(name, outgoing)}"
                )
        self.starts = {name: np.asarray(value, dtype=float).ravel() for name, value in (starts or {}).items()}
        values = {port.name: value for port, value in self.parameters.items()} | self.starts
        for port in ports:
            if port.name in values and values[port.name].size != port.size:
                raise ModelError(
                    f"PythonComponent: found {values[port.name].size} numbers for {port.name}, expected {port.size}"
                )

    def component(self, name: str) -> Component:
        """Its description under a name in a system."""
        scalars: dict[str, Scalar] = {}
        groups = (
            ("input", "continuous", {port: np.zeros(port.size) for port in self.inputs}),
            (
                "output",
                "discrete" if self.sampled else "continuous",
                {port: self.starts.get(port.name, np.zeros(port.size)) for port in self.outputs},
            ),
            ("parameter", "tunable", self.parameters),
        )
        for causality, variability, ports in groups:
            for port, values in ports.items():
                for element, value in zip(port.elements, values, strict=True):
                    scalars[element] = Scalar(
                        element,
                        "real",
                        "Float64",
                        len(scalars),
                        causality,
                        variability,
                        "exact",
                        unit=port.unit,
                        start=repr(float(value)),
                        min=port.minimum,
                        max=port.maximum,
                    )
        words = getattr(self.function, "__name__", type(self.function).__name__)
        return Component(name, words, "", 3, "", "", "", scalars, {port: frozenset() for port in scalars})

    def running(self, component: Component) -> "RunningFunction":
        """An instance; it has what the function remembers in common with all others."""
        return RunningFunction(self, component)


class RunningFunction:
    """A function that takes its steps in a system; see `RunningComponent` for the calls."""

    def __init__(self, source: PythonComponent, component: Component):
        self.source, self.component, self.time = source, component, 0.0
        self.values = {name: float(scalar.start or 0.0) for name, scalar in component.scalars.items()}

    def begin(
        self, start: Mapping[str, float | str], begin: float, stop: float, tolerance: float | None
    ) -> None:
        """Take start values."""
        self.time = begin
        self.values.update({name: float(value) for name, value in start.items()})

    def started(self) -> None:
        """Nothing waits for it."""

    def get(self, names: tuple[str, ...]) -> list[float]:
        """Values by name."""
        return [self.values[name] for name in names]

    def set(self, names: tuple[str, ...], values: Sequence[float]) -> None:
        """Set values by name."""
        self.values.update(zip(names, values, strict=True))

    def step(
        self,
        time: float,
        size: float,
        known: tuple[str, ...],
        values: Sequence[float],
        wanted: tuple[str, ...],
    ) -> list[float]:
        """Call the function; SolveError where it raises or answers with other names and sizes."""
        self.set(known, values)
        self.time = time if self.source.sampled else time + size
        taken = (*self.source.inputs, *self.source.parameters)
        try:
            found = self.source.function(self.time, {port.name: self._value(port) for port in taken})
        except USERS_ERRORS as error:  # whatever a function of the user raises
            raise self._failure(f"raised {type(error).__name__}: {in_words(error)}; mend it") from error
        self._take(found)
        return self.get(wanted)

    def save(self) -> None:
        """What a function remembers cannot be saved."""
        raise self._failure("cannot save what it remembers; take another order than 'iterate'")

    restore = save

    def close(self) -> None:
        """Nothing is held."""

    def _value(self, port: Port) -> Any:
        numbers = [self.values[name] for name in port.elements]
        return numbers[0] if port.size == 1 else np.array(numbers)

    def _take(self, found: Any) -> None:
        outputs = {port.name: port for port in self.source.outputs}
        if not isinstance(found, Mapping) or set(found) != set(outputs):
            names = list(found) if isinstance(found, Mapping) else repr(found)
            raise self._failure(f"answered {names}, expected {{name: value}} of {', '.join(outputs)}")
        for name, value in found.items():
            try:
                numbers = np.asarray(value, dtype=float).ravel()
            except (TypeError, ValueError):
                numbers = np.empty(0)
            if numbers.size != outputs[name].size:
                raise self._failure(
                    f"answered {name} = {value!r}, expected {numbers_of((outputs[name].size,))}"
                )
            self.values.update(zip(outputs[name].elements, numbers.tolist(), strict=True))

    def _failure(self, words: str) -> SolveError:
        return SolveError(
            f"{self.component.name}: the function {self.component.file} {words} (at t = {self.time:.6g} s)",
            time=self.time,
        )
