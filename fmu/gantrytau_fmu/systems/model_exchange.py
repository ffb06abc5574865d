"""Model Exchange of one FMU, integrated by FMPy's CVode."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError, SolveError
from gantrytau.interruption import on_interrupt
from gantrytau.progress import Progress
from gantrytau.results.result import Result
from gantrytau_fmu.systems.component import Component
from gantrytau_fmu.systems.connected_system import ConnectedSystem
from gantrytau_fmu.systems.drives import knots_of
from gantrytau_fmu.systems.master import Grid
from gantrytau_fmu.systems.slave import LAST, ended_in_words, hook_log

SAME = 1e-9  # of a time, within which two are one to FMPy (math.isclose)


def integrate(component: Component, system: ConnectedSystem, grid: Grid, tolerance: float | None) -> Result:
    """Integrate the only component of a system over the grid; its inputs and outputs by their own names.

    Raises ModelError for arrays of FMI 3, SolveError with `.time` and the partial `.result` where the integration
    fails or is interrupted by Ctrl-C.
    """
    import fmpy

    outputs = component.of("output", "input")
    if any(component.scalars[name].size > 1 for name in outputs):
        raise ModelError(
            f"{component.title}: arrays of FMI 3 are not supported with Model Exchange; run its Co-Simulation"
        )
    table = _inputs(component, system, grid)
    pressed: list[bool] = []
    log: list[str] = []
    reached: list[Any] = []  # FMPy's recorder, once there is one
    simulate: Callable[..., Any] = fmpy.simulate_fmu
    with Progress("cosimulate", grid.begin, grid.stop) as bar, on_interrupt(lambda: pressed.append(True)):

        def go_on(time: float, recorder: Any) -> bool:
            reached[:] = [recorder]
            bar.at(time)
            if pressed:
                recorder.sample(time, force=True)  # what was reached; FMPy would do so with the next step
            return not pressed

        try:
            found = simulate(
                component.folder,
                start_time=grid.begin,
                stop_time=grid.stop,
                solver="CVode",
                relative_tolerance=tolerance,
                output_interval=grid.step,
                start_values=dict(system.start[component.name]),
                input=table if len(table.dtype.names or ()) > 1 else None,
                output=list(outputs),
                fmi_type="ModelExchange",
                step_finished=go_on,
                logger=lambda *told: log.append((told[-1] or b"").decode("utf-8", "replace")),
            )
        except Exception as error:  # FMPy raises bare exceptions
            raise _failure(component, outputs, reached, error, log) from error
        finally:
            hook_log()
    if not pressed:
        early = found["time"][-1] < grid.stop - 1e-6 * grid.step  # FMPy stops where the FMU asks for it
        return _result(component, outputs, found, ended_in_words(log, component.title) if early else "stop")
    result = _result(component, outputs, found)
    stopped = SolveError(
        f"{component.title}: the integration was interrupted at t = {result.time[-1]:.4g} s; "
        ".result holds what was computed",
        time=float(result.time[-1]),
        result=result,
    )
    stopped.__context__ = KeyboardInterrupt()  # the signal was only noted: FMPy would take it for a failure
    raise stopped


def _failure(
    component: Component, outputs: tuple[str, ...], reached: list[Any], error: Exception, log: list[str]
) -> SolveError:
    partial = _result(component, outputs, reached[0].result()) if reached else None
    time = float(partial.time[-1]) if partial is not None else None
    said = f"; its log says: {' | '.join(line.strip() for line in log[-LAST:])}" if log else ""
    when = f" after t = {time:.6g} s" if time is not None else ""
    return SolveError(
        f"{component.title}: the integration failed{when}: {error}{said}; try a smaller tolerance or Co-Simulation",
        time=time,
        result=partial,
    )


def _inputs(component: Component, system: ConnectedSystem, grid: Grid) -> np.ndarray:
    """The inputs at points and knots, as FMPy takes them: those that nothing drives, too, or it warns of them."""
    points = np.array([grid.time(k) for k in range(grid.count + 1)])
    knots = knots_of(system.drives)
    knots = knots[(knots > grid.begin) & (knots < grid.stop)]
    _check_knots(component, knots)
    # FMPy begins anew at a time that stands twice
    times = np.sort(np.concatenate([np.setdiff1d(points, knots), knots, knots]))
    first = np.append(np.diff(times) == 0, False)
    columns = {
        name: [drive.before(t) if left else drive(t) for t, left in zip(times.tolist(), first, strict=True)]
        for (_, name), drive in system.drives.items()
    }
    for name in component.of("input"):
        scalar = component.scalars[name]
        if scalar.kind == "real" and name not in columns:
            value = float(system.start[component.name].get(name, scalar.start or 0.0))
            columns[name] = [value] * times.size
    table = np.zeros(times.size, dtype=[("time", float), *((name, float) for name in columns)])
    table["time"] = times
    for name, values in columns.items():
        table[name] = values
    return table


def _check_knots(component: Component, knots: np.ndarray) -> None:
    """ModelError for instants of samples that FMPy takes for one."""
    near = np.flatnonzero(np.diff(knots) <= SAME * np.abs(knots[1:]))
    if near.size:
        t = float(knots[near[0]])
        raise ModelError(
            f"{component.title}: samples at t = {t:.9g} s and {np.diff(knots)[near[0]]:.3g} s later are one instant to "
            f"FMPy, which integrates Model Exchange; run Co-Simulation, or leave more than {SAME:g} of the time between",
            argument="inputs",
        )


def _result(component: Component, outputs: tuple[str, ...], found: Any, ended: str = "stop") -> Result:
    return Result(
        found["time"],
        {name: found[name].astype(float) for name in outputs},
        units={name: component.scalars[name].unit for name in outputs},
        descriptions={name: component.scalars[name].description for name in outputs},
        title=Path(component.file).stem,
        ended=ended,
    )
