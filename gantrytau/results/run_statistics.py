"""What a simulation took: steps, evaluations, events by condition, seconds, and which states its step is short for."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from time import process_time

import numpy as np

from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau.results.series import Series

MAKING, INTEGRATION = "making functions", "integration"
BESIDE, VARIABLES = "events, constraints and start", "all variables"  # what seconds are spent on
MOST = 5  # states and events that the table names
LEAST = 1e-7  # of a state's size: what an interval leaves of it by the tolerance of a run


@dataclass
class RunStatistics:
    """What a simulation took, all repeated parts of its run included; `print` shows it as a table.

    steps, rejected: of the integrators, accepted and repeated with a shorter step.
    evaluations, jacobians: calls of the right-hand side, and Jacobians that were factored.
    restarts: how often an integrator started anew, in steps of first order: at events, samples and looks for events.
    events: condition or `when` in the model's names -> how often it turned or acted.
    samples: period of `sampled` variables, s -> at how many instants they were sampled.
    sizes: state -> below this size its errors are absolute.
    seconds: processor time by what it was spent on, s.
    limiting: state -> share of the output intervals in which it bends most by its size, largest first: by these states the
        integrator chooses its step. Empty where the states are not kept (`outputs=`).
    """

    steps: int = 0
    rejected: int = 0
    evaluations: int = 0
    jacobians: int = 0
    restarts: int = 0
    events: dict[str, int] = field(default_factory=dict)
    samples: dict[float, int] = field(default_factory=dict)
    sizes: dict[str, float] = field(default_factory=dict)
    seconds: dict[str, float] = field(default_factory=dict)
    limiting: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def spent_on(self, what: str, within: str = "") -> Iterator[None]:
        """Count the processor time of what is computed meanwhile; within: the sum that it is taken out of."""
        begin = process_time()
        try:
            yield
        finally:
            spent = process_time() - begin
            self.seconds[what] = self.seconds.get(what, 0.0) + spent
            if within:
                self.seconds[within] = self.seconds.get(within, 0.0) - spent

    def count(self, event: str, times: int) -> None:
        """Add events of one condition."""
        if times:
            self.events[event] = self.events.get(event, 0) + times

    def of(self, result: Series) -> "RunStatistics":
        """These statistics with the states that limit the step of a result."""
        return replace(self, limiting=_limiting(result, self.sizes))

    def __str__(self) -> str:
        rows = [
            ("steps", f"{self.steps}, and {self.rejected} rejected"),
            ("evaluations", f"{self.evaluations}, and {self.jacobians} Jacobians"),
            ("restarts", f"{self.restarts}"),
            ("events", f"{sum(self.events.values())}"),
            *((f"  {name}", f"{n}") for name, n in self._most(self.events)),
            *((f"samples every {period:.6g} s", f"{n}") for period, n in sorted(self.samples.items())),
            *((f"step limited by {name}", f"{n:.0%}") for name, n in self._most(self.limiting)),
            *((name, f"{s:.3g} s") for name, s in self.seconds.items()),
        ]
        width = max(len(name) for name, _ in rows) + 2
        return "\n".join(f"{name:{width}}{value}" for name, value in rows)

    @staticmethod
    def _most(counts: Mapping[str, float]) -> list[tuple[str, float]]:
        return sorted(counts.items(), key=lambda one: -one[1])[:MOST]


def _limiting(result: Series, sizes: Mapping[str, float]) -> dict[str, float]:
    """State -> share of the intervals in which the trapezoidal rule misses it most, by its size."""
    h = np.diff(result.time)
    errors: dict[str, np.ndarray] = {}
    for name, size in sizes.items():
        base, order = split_derivative(name)
        rate = derivative_name(base, order + 1)
        if name in result and rate in result:
            x, v = result[name], result[rate]
            missed = np.abs(np.diff(x) - h / 2 * (v[1:] + v[:-1]))
            errors[name] = missed / (size + np.maximum(np.abs(x[1:]), np.abs(x[:-1])))
    if not errors:
        return {}
    table = np.nan_to_num(np.stack(list(errors.values())))
    bent = (h > 0) & (table.max(axis=0) > LEAST)
    counts = np.bincount(table.argmax(axis=0)[bent], minlength=len(errors))
    shares = dict(zip(errors, (counts / max(1, bent.sum())).tolist(), strict=True))
    return dict(sorted(((n, s) for n, s in shares.items() if s), key=lambda one: -one[1]))
