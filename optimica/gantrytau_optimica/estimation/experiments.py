"""Experiments: what was measured, under which inputs, from which start; checked when they are told."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import Any

import numpy as np

from gantrytau import ModelError, Samples
from gantrytau.border.checks import instance, number
from gantrytau.describing.record import Record
from gantrytau_optimica.problem.optimization import Free, Optimization

EXPECTED = 0.01  # of the spread of the data: their noise, until the fit tells it
SPREAD = 1e-9  # of the largest value: what does not spread more is constant


@dataclass(frozen=True, eq=False)
class Experiment(Record):
    """One experiment; names are those of the model.

    measured: name -> Samples or (times, values); a static model takes values (n,) without times as well, one row each.
    inputs: name -> number, function of time, Samples, a signal as `prbs`, or values for a static model.
    start: initial values, name -> number or array; `Free(guess, min=..., max=...)` where it is estimated too.
    parameters: those that are known to be other than declared here, or `Free(...)` where this experiment has its own.
    guess: name -> number, array or function of time, beside the measured courses.
    begin, stop: of the experiment in s; stop: default the last sample. name: default experiment_1 and so on.
    Raises ModelError for what is none of these.
    """

    measured: Mapping[str, Any]
    inputs: Mapping[str, Any] = field(default_factory=dict)
    start: Mapping[str, Any] = field(default_factory=dict)
    _: KW_ONLY
    parameters: Mapping[str, Any] = field(default_factory=dict)
    guess: Mapping[str, Any] = field(default_factory=dict)
    begin: float = 0.0
    stop: float | None = None
    name: str = ""
    static: bool = field(default=False, init=False)

    def __post_init__(self):
        for which in ("begin", "stop"):
            if getattr(self, which) is not None:
                value = number("Experiment", which, getattr(self, which), unit="s")
                object.__setattr__(self, which, value)
        for which in ("measured", "inputs", "start", "parameters", "guess"):
            instance("Experiment", which, getattr(self, which), Mapping, "{name: ...}")
        if not self.measured:
            raise ModelError("Experiment: found nothing measured, expected {name: Samples(times, values)}")
        rows = [_rows(v) for v in self.measured.values()]
        object.__setattr__(self, "static", any(r is not None for r in rows))
        object.__setattr__(self, "measured", {n: _samples(n, v) for n, v in self.measured.items()})
        object.__setattr__(self, "inputs", {n: self._input(n, v) for n, v in self.inputs.items()})
        last = max(s.times[-1] for s in self.measured.values())
        object.__setattr__(self, "stop", float(last) if self.stop is None else self.stop)
        if not self.static and not self.begin < self.horizon[1]:
            raise ModelError(
                f"Experiment: found begin={self.begin:g} s and stop={self.stop:g} s, expected the first to be the smaller"
            )

    @property
    def horizon(self) -> tuple[float, float]:
        """Begin and stop in s."""
        return float(self.begin), float(self.stop or 0.0)

    @property
    def size(self) -> int:
        """Number of measured values."""
        return sum(s.values.size for s in self.measured.values())

    def _input(self, name: str, value: Any) -> Any:
        if isinstance(value, tuple) and len(value) == 2 and np.ndim(value[0]) == 1:
            return Samples(*value)
        values = _rows(value) if self.static else None
        if values is None:
            return value
        rows = [len(s.times) for s in self.measured.values()]
        if len(values) != rows[0]:
            raise ModelError(
                f"Experiment: input {name} has {len(values)} rows, the measured ones {rows[0]}; expected as many"
            )
        return Samples(np.arange(1.0, len(values) + 1), values)


def _rows(value: Any) -> np.ndarray | None:
    """Values without times, one row for each measurement."""
    if isinstance(value, (list, np.ndarray)) and np.ndim(value) >= 1:
        return np.asarray(value)
    return None


def _samples(name: str, value: Any) -> Samples:
    if isinstance(value, Samples):
        return value
    if isinstance(value, tuple) and len(value) == 2:
        return Samples(*value)
    values = _rows(value)
    if values is None:
        raise ModelError(f"Experiment: measured {name}: found {value!r}, expected Samples(times, values)")
    return Samples(np.arange(1.0, len(values) + 1), values)


def named(experiments: Any) -> tuple[Experiment, ...]:
    """One or several experiments with names of their own. Raises ModelError."""
    found = (experiments,) if isinstance(experiments, Experiment) else experiments
    if not isinstance(found, (list, tuple)) or not found or not all(isinstance(e, Experiment) for e in found):
        raise ModelError(
            f"estimate: found experiments {experiments!r}, expected one Experiment or a list of them"
        )
    whole = tuple(replaced(e, name=e.name or f"experiment_{k}") for k, e in enumerate(found, 1))
    names = [e.name for e in whole]
    for name in names:
        if not isinstance(name, str) or not name.isidentifier() or hasattr(Optimization, name):
            raise ModelError(f"Experiment: found name={name!r}, expected a word of letters, digits and _")
        if names.count(name) > 1:
            raise ModelError(f"estimate: two experiments are called {name}, expected different names")
    weighted = {s.weighted: f"{e.name}, {n}" for e in whole for n, s in e.measured.items()}
    if len(weighted) > 1:
        raise ModelError(
            f"estimate: {weighted[True]} has a deviation and {weighted[False]} has none, expected all or none; give "
            "Samples(..., deviation=...) everywhere, or their sizes relative to each other cannot be told"
        )
    return whole


def expected_noise(experiments: Sequence[Experiment]) -> dict[str, float]:
    """A deviation of the values of every measured name, where none were given: a part of how far they spread."""
    found = {}
    for name in dict.fromkeys(n for e in experiments for n in e.measured):
        mine = [e.measured[name].values for e in experiments if name in e.measured]
        spread = np.sqrt(np.mean(np.concatenate([(v - v.mean(axis=0)).ravel() for v in mine]) ** 2))
        largest = max(float(np.max(np.abs(v))) for v in mine)
        found[name] = EXPECTED * float(spread if spread > SPREAD * largest else largest or 1.0)
    return found


def courses(experiments: Sequence[Experiment]) -> dict[str, np.ndarray]:
    """Times and values (N, 1 + k) of what moves, by what was measured."""
    return {
        f"{name} of {e.name}": np.column_stack([s.times, s.values])
        for e in experiments
        for name, s in e.measured.items()
        if np.any(np.ptp(s.values, axis=0) > 0)
    }


def replaced(experiment: Experiment, **changes: Any) -> Experiment:
    """The experiment with other fields; it stays static."""
    found = replace(experiment, **changes)
    object.__setattr__(found, "static", experiment.static)
    return found


def is_free(value: Any) -> bool:
    """Whether a value is to be estimated."""
    return isinstance(value, Free)
