"""One FMU of any tool, simulated by itself: Co-Simulation, or Model Exchange with FMPy's CVode."""

import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from gantrytau.border.checks import number
from gantrytau.border.refusal import Given, ModelError
from gantrytau.inputs.input_signal import with_seeds
from gantrytau.results.result import Result
from gantrytau_fmu.reading.safety import unpack
from gantrytau_fmu.systems.component import Component, read_component
from gantrytau_fmu.systems.connected_system import build_system, unconnected, warn_of
from gantrytau_fmu.systems.cosimulate import run_system
from gantrytau_fmu.systems.master import Grid, Master, check_times, make_grid
from gantrytau_fmu.systems.model_exchange import integrate

STEPS = 500  # where neither the caller nor the file says a step


def run_fmu(
    path: str | os.PathLike[str],
    *,
    stop: float | None = None,
    step: float | None = None,
    start: Mapping[str, Any] | None = None,
    inputs: Mapping[str, Any] | None = None,
    seed: int | None = None,
    tolerance: float | None = None,
    model_exchange: bool = False,
    isolate: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Simulate one FMU and return its inputs and outputs by their own names.

    stop, step: s, by default those of the file's experiment, else a five-hundredth; start, inputs, seed: as
    for `cosimulate`, names without prefix; model_exchange: integrate it with CVode, `step` being the distance of the
    output times; isolate: run it in a process of its own. Raises what `cosimulate` raises, and warns likewise of
    inputs that nothing drives.
    """
    times = {
        name: None if value is None else number("run_fmu", name, value, unit="s")
        for name, value in (("stop", stop), ("step", step))
    }
    master = Master(tolerance=tolerance, isolate=isolate, progress=progress)
    driven = with_seeds(inputs or {}, seed)
    if model_exchange and isolate:
        raise ModelError(
            "Model Exchange runs in this process, found ",
            Given("isolate", True),
            "; leave one of them out",
            place="run_fmu",
        )
    with tempfile.TemporaryDirectory(prefix="fmu-", ignore_cleanup_errors=True) as folder:
        unpacked = unpack(path, Path(folder) / "fmu")
        component = read_component(
            "", os.fspath(path), unpacked, "model-exchange" if model_exchange else "co-simulation"
        )
        grid = _grid(component, times["stop"], times["step"])
        system = build_system({"": component}, (), start or {}, driven, (0.0, grid.stop))
        warn_of(unconnected(system), stacklevel=2)
        if model_exchange:
            return integrate(component, system, grid, tolerance)
        return run_system(system, master, grid, {"": path})


def _grid(component: Component, stop: float | None, step: float | None) -> Grid:
    """The points of the output; what is not given is as the file says. ModelError for times that do not fit."""
    stop = component.stop if stop is None else stop
    if stop is None:
        raise ModelError(
            "found no stop time, in the file neither; expected one in s, as ",
            Given("stop", 1.0),
            place=component.title,
            argument="stop",
        )
    if step is None:
        step = min(component.step or stop / STEPS, stop)
    check_times("run_fmu", 0.0, stop, step)
    return make_grid(0.0, stop, step)
