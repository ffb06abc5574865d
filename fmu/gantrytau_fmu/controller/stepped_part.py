"""A model, FMU or Python function that takes one period after the other: a plant, or a user's controller."""

import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError, SolveError, told
from gantrytau.results.series import split_element
from gantrytau_fmu.controller.channels import Channel, Declaration, Values
from gantrytau_fmu.systems.component import Component
from gantrytau_fmu.systems.connected_system import build_system
from gantrytau_fmu.systems.sources.component_sources import Source, describe_source, run_source


class SteppedPart:
    """A source with its inputs, outputs and tunable parameters as declarations; running between `begin` and `close`.

    starts: name -> value of parameters, inputs and states. minimum, maximum: of the inputs, (n,), as the source says.
    Raises ModelError for a source that is none, starts that do not fit, and outputs in units that are not SI.
    """

    def __init__(self, name: str, source: Source, starts: Mapping[str, Any] | None = None):
        self._folder = tempfile.TemporaryDirectory(prefix="controller-", ignore_cleanup_errors=True)
        self._source = source
        try:
            self.component: Component = describe_source(name, source, Path(self._folder.name) / "fmu")
            dotted = {f"{name}.{key}": value for key, value in (starts or {}).items()}
            self._starts = dict(build_system({name: self.component}, (), dotted, {}, (0.0, 1.0)).start[name])
            self.inputs, self._known = self._declared("input")
            self.outputs, self._wanted = self._declared("output")
            self.tunables, self._settable = self._declared("parameter")
        except BaseException:
            self._folder.cleanup()
            raise
        scalars = self.component.scalars
        self.minimum, self.maximum = (
            np.array(
                [none if (own := getattr(scalars[n], side)) is None else own for n in self._known],
                dtype=float,
            )
            for side, none in (("min", -np.inf), ("max", np.inf))
        )
        self._running: Any = None

    @property
    def first_inputs(self) -> Values:
        """The start values of its inputs, (n,)."""
        return self._first(self._known)

    @property
    def tuned(self) -> Values:
        """The start values of its tunable parameters."""
        return self._first(self._settable)

    def begin(self, inputs: Values, stop: float) -> Values:
        """Initialise with inputs (n,), and the outputs then."""
        self._running = run_source(self.component, self._source)
        self._running.begin(self._starts, 0.0, stop, None)
        self._running.set(self._known, inputs.tolist())
        self._running.started()
        return self._finite(self._running.get(self._wanted), 0.0)

    def step(self, time: float, period: float, inputs: Values) -> Values:
        """Hold inputs over a period from `time`, s, and the outputs behind it."""
        return np.array(self._running.step(time, period, self._known, inputs.tolist(), self._wanted))

    def finite_step(self, time: float, period: float, inputs: Values) -> Values:
        """`step`; SolveError for outputs that are not finite."""
        return self._finite(self.step(time, period, inputs), time + period)

    def set(self, name: str, values: Values) -> None:
        """Set a tunable parameter, now."""
        place = self.tunables.slices[name]
        self._running.set(self._settable[place], values.tolist())

    def close(self) -> None:
        """Free the instance; it may begin again."""
        running, self._running = self._running, None
        if running is not None:
            running.close()

    def _first(self, names: Sequence[str]) -> Values:
        scalars = self.component.scalars
        return np.array([float(self._starts.get(n, scalars[n].start or 0.0)) for n in names], dtype=float)

    def _finite(self, found: Sequence[float] | Values, time: float) -> Values:
        values = np.asarray(found, dtype=float)
        if not np.isfinite(values).all():
            k = int(np.argmin(np.isfinite(values)))
            raise SolveError(
                f"{self.component.name}: found {self.outputs.elements[k]} = {values[k]} at t = {time:.6g} s, "
                "expected finite values; look at the references that it is given",
                time=time,
            )
        return values

    def _declared(self, causality: str) -> tuple[Declaration, tuple[str, ...]]:
        """Channels of all variables of a causality, vectors whole, and the scalars in their order."""
        names = self.component.of(causality)
        if causality == "parameter":
            tunable = [n for n in names if self.component.scalars[n].variability == "tunable"]
            names = tuple(n for n in tunable if self.component.scalars[n].kind == "real")
        groups: dict[str, list[tuple[tuple[int, ...], str]]] = {}
        for name in names:
            base, index = split_element(name) or (name, ())
            groups.setdefault(base, []).append((index, name))
        channels, scalars = [], []
        for base, members in groups.items():
            ordered = [name for _, name in sorted(members)]
            unit, count = self.component.scalars[ordered[0]].unit or "1", len(ordered)
            make = partial(Channel, base, unit, count)
            channels.append(told(f"{self.component.name}.{base}", make))
            scalars += ordered
        if causality == "input" and self.component.name == "plant" and not channels:
            raise ModelError(
                "plant: found no inputs, expected those that take references; declare them as Input"
            )
        return Declaration(channels), tuple(scalars)
