"""The record of a closed loop: what the plant did, what the controller planned, and where the loop goes on."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from gantrytau import Result
from gantrytau.border.checks import whole
from gantrytau.describing.record import Record
from gantrytau.results.display_units import DECLARED, Display, shown_units
from gantrytau.results.figures import check_suffix, finished
from gantrytau_optimica.predictive.plan import PlannedMotion, StepTimes, motion_result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN = 12  # plans in a figure


@dataclass(frozen=True, eq=False)
class LoopEnd:
    """Where a loop with a model ended. controller: its `key`; memory: of it; made: all plans, without stages; now, waiting:
    inputs held, and those that follow; motion: of the plant, scaled; random: state of the noise; estimator: its kind, what
    it estimates of what, and its memory, None without one.
    """

    controller: tuple[Any, ...]
    memory: Any
    made: tuple[PlannedMotion, ...]
    now: Mapping[str, float]
    waiting: Mapping[str, float]
    motion: PlannedMotion
    random: Mapping[str, Any]
    estimator: tuple[str, Mapping[str, Any]] | None = None


@dataclass(frozen=True, eq=False)
class ClosedLoop(Record):
    """A closed loop, looked up by the model's names as its `result`: `loop["crane.s"]`, (times,).

    result: all variables of the plant at the samples, inputs held; statuses: of the controller at each sample; timing: of
    its steps; cost: the integral of the problem's integrand along the motion; estimates: what an estimator gave at each
    sample but the last, by name; parameters: of the plant, or, if it does not tell them, of
    the controller's model. plans: at each sample but the last the plan made there, name ->
    (samples, elements + 1), of states and inputs; planned: all variables at the ends of these plans, at the samples.
    record: of a plant that runs by itself, what it returned.
    """

    result: Result
    statuses: tuple[str, ...]
    timing: StepTimes
    cost: float
    plans: Mapping[str, np.ndarray]
    planned: Result
    estimates: Mapping[str, np.ndarray] = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    record: Any = None
    end: LoopEnd | None = None

    def __getitem__(self, name: str) -> np.ndarray:
        return self.result[name]

    @property
    def time(self) -> np.ndarray:
        """The samples in s."""
        return self.result.time

    def plot(
        self, *names: str, plans: int = SHOWN, file: str | Path | None = None, display: Display = None
    ) -> "Figure":
        """Variables over time, as Result.plot; plans: how many of those of states and inputs stand beside them, in grey."""
        shown = whole("plot", "plans", plans, least=0)
        if file is not None:
            check_suffix(file)
        figure = self.result.plot(*names, display=display)
        rows = np.unique(np.linspace(0, len(self.statuses) - 1, shown).astype(int))
        for axis in figure.axes:
            for line in axis.get_lines():
                if (name := str(line.get_label())) in self.plans:
                    units = shown_units(self.result, ("time", name), display, DECLARED, "plot")
                    times, values = (units[one].of(self.plans[one][rows].T) for one in ("time", name))
                    style: Any = dict(color="0.6", linewidth=0.7, zorder=1, drawstyle=line.get_drawstyle())
                    axis.plot(times, values, **style)
        return finished(figure, file)

    def __str__(self) -> str:
        words = {status: self.statuses.count(status) for status in dict.fromkeys(self.statuses)}
        said = ", ".join(f"{count} {status}" for status, count in words.items())
        return f"{self.result.title}: {self.result.time[-1]:g} s, cost {self.cost:.6g}; {said}\n{self.timing}"


def planned_by(mpc: Any, made: Sequence[PlannedMotion], times: np.ndarray) -> dict[str, Any]:
    """The fields `plans` and `planned` of the plans that a controller made, at times (samples + 1,) in s."""
    stages, begun = mpc.stages, np.array([plan.t for plan in made])
    plans = {"time": begun[:, None] + mpc.period * np.arange(mpc.elements + 1)}
    x = np.array([plan.x for plan in made]) * stages.sizes_x
    u = np.array([np.vstack([plan.u, plan.u[-1:]]) for plan in made]) * stages.sizes_u
    for names, values in ((mpc.states, x), (mpc.inputs, u)):
        plans |= {name: values[:, :, k] for k, name in enumerate(names)}
    last = [*made, made[-1]]
    x, w, u = (np.array([getattr(plan, one)[-1] for plan in last]) for one in ("x", "w", "u"))
    each = (
        stages.nx + stages.nz
    )  # algebraics of a row are those at the end of the row of w before it, of the first its first
    w = np.vstack([np.append(w[0, each:], w[1, each:]), w[2:]])
    ahead = made[0].t + mpc.elements * mpc.period - float(times[0])
    motion, title = PlannedMotion(x, w, u[:-1], float(times[0])), f"{mpc.name}, ends of plans"
    return dict(plans=plans, planned=motion_result(mpc.built, stages, motion, mpc.period, title, ahead))
