"""One FMU of any tool, simulated by itself: Co-Simulation, or Model Exchange with FMPy's CVode."""

import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.errors import ModelError, SolveError
from gantrytau.result import Result
from gantrytau_fmu.reading.safety import unpack
from gantrytau_fmu.systems.components import Component, read_component
from gantrytau_fmu.systems.cosimulation import cosimulate
from gantrytau_fmu.systems.masters import Grid, make_grid
from gantrytau_fmu.systems.system import System, build_system

NAME = "fmu"
STEPS = 500  # where neither the caller nor the file says a step


def run_fmu(
    path: str | os.PathLike[str],
    *,
    stop: float | None = None,
    step: float | None = None,
    start: Mapping[str, Any] | None = None,
    inputs: Mapping[str, Any] | None = None,
    tolerance: float | None = None,
    model_exchange: bool = False,
    isolate: bool = False,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Simulate one FMU and return its inputs and outputs by their own names.

    stop, step: s, by default those of the file's experiment, else a five-hundredth; start, inputs: as for
    `cosimulate`, names without prefix; model_exchange: integrate it with CVode, `step` being the distance of the
    output times; isolate: run it in a process of its own. Raises what `cosimulate` raises.
    """
    if model_exchange and isolate:
        raise ModelError(f"{path}: Model Exchange runs in this process, found isolate; leave one of them out")
    kind = "model-exchange" if model_exchange else "co-simulation"
    with tempfile.TemporaryDirectory(prefix="fmu-", ignore_cleanup_errors=True) as folder:
        place = unpack(path, Path(folder) / NAME)
        component = read_component(NAME, Path(path).name, place, kind)
        stop = component.stop if stop is None else stop
        if stop is None:
            raise ModelError(
                f"{path}: found no stop time, in the file neither; expected one in s, as stop=1.0"
            )
        step = component.step or stop / STEPS if step is None else step
        step = min(step, stop)
        starts = {f"{NAME}.{name}": value for name, value in (start or {}).items()}
        signals = {f"{NAME}.{name}": value for name, value in (inputs or {}).items()}
        if model_exchange:
            system = build_system({NAME: component}, (), starts, signals, (0.0, stop))
            return _integrated(component, system, make_grid(0.0, stop, step), tolerance)
    policy: dict[str, Any] = dict(stop=stop, step=step, start=starts, inputs=signals, tolerance=tolerance)
    try:
        found = cosimulate({NAME: path}, **policy, isolate=[NAME] if isolate else (), progress=progress)
    except SolveError as error:
        error.result = error.result and _bare(error.result, Path(path).stem)
        raise
    return _bare(found, Path(path).stem)


def _bare(result: Result, title: str) -> Result:
    """The result with names that do not begin with that of the component."""
    names = {name.removeprefix(f"{NAME}."): name for name in result.names}
    return Result(
        result.time,
        {short: result[name] for short, name in names.items()},
        units={short: result.unit(name) for short, name in names.items()},
        descriptions={short: result.description(name) for short, name in names.items()},
        title=title,
    )


def _integrated(component: Component, system: System, grid: Grid, tolerance: float | None) -> Result:
    import fmpy

    outputs = component.of("output", "input")
    if any(component.scalars[name].size > 1 for name in outputs):
        raise ModelError(f"{component.file}: arrays of FMI 3 are not supported with Model Exchange")
    times = np.array([grid.time(k) for k in range(grid.count + 1)])
    drives = {name: drive for (_, name), drive in system.drives.items()}
    for name in component.of("input"):  # FMPy warns of inputs that are left to their start values
        scalar = component.scalars[name]
        if scalar.kind == "real" and name not in drives:
            value = float(system.start[NAME].get(name, scalar.start or 0.0))
            drives[name] = lambda t, value=value: value
    table = np.zeros(times.size, dtype=[("time", float), *((name, float) for name in drives)])
    table["time"] = times
    for name, drive in drives.items():
        table[name] = [drive(t) for t in times]
    simulate: Callable[..., Any] = fmpy.simulate_fmu
    try:
        found = simulate(
            component.folder,
            start_time=grid.begin,
            stop_time=grid.stop,
            solver="CVode",
            relative_tolerance=tolerance,
            output_interval=grid.step,
            start_values=dict(system.start[NAME]),
            input=table if drives else None,
            output=list(outputs),
            fmi_type="ModelExchange",
        )
    except Exception as error:  # FMPy raises bare exceptions
        raise SolveError(
            f"{component.file}: the integration failed: {error}; try a smaller tolerance or Co-Simulation"
        ) from error
    return Result(
        found["time"],
        {name: found[name].astype(float) for name in outputs},
        units={name: component.scalars[name].unit for name in outputs},
        descriptions={name: component.scalars[name].description for name in outputs},
        title=Path(component.file).stem,
    )
