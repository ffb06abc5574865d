"""Co-simulation: a system of FMUs, stepped together, as one result by dotted names."""

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.border.refusal import ModelError, SolveError, did_you_mean
from gantrytau.inputs.input_signal import with_seeds
from gantrytau.progress import Progress
from gantrytau.results.result import Result
from gantrytau_fmu.systems.component import Component, numeric
from gantrytau_fmu.systems.connected_system import (
    ConnectedSystem,
    SystemConnection,
    build_system,
    locate,
    unconnected,
    warn_of,
)
from gantrytau_fmu.systems.initialize import initialize
from gantrytau_fmu.systems.master import ORDERS, Grid, Master, Order, RunningComponent, make_grid, paces_of
from gantrytau_fmu.systems.recorder import Recorder
from gantrytau_fmu.systems.slave import RunEnded
from gantrytau_fmu.systems.sources.component_sources import Source, describe_source, run_source
from gantrytau_fmu.systems.sources.python_component import PythonComponent
from gantrytau_fmu.systems.ssp.read_ssp import SystemStructure, matching, read_ssp
from gantrytau_fmu.systems.step_order import sequence_of

FileName = str | os.PathLike[str]
Wires = Sequence[SystemConnection | tuple[str, str]]


def cosimulate(
    components: Mapping[str, Source] | FileName,
    connections: Wires = (),
    *,
    stop: float | None = None,
    step: float | None = None,
    start: Mapping[str, Any] | None = None,
    order: Order = "gauss-seidel",
    begin: float | None = None,
    inputs: Mapping[str, Any] | None = None,
    seed: int | None = None,
    tolerance: float | None = None,
    outputs: Sequence[str] | None = None,
    steps: Mapping[str, float] | None = None,
    sequence: Sequence[str] | None = None,
    error_estimate: bool = False,
    isolate: Sequence[str] | bool = (),
    timeout: float = 60.0,
    agreement: float = 1e-8,
    iterations: int = 50,
    progress: Callable[[float], None] | None = None,
) -> Result:
    """Simulate components together and return their variables at the communication points begin + k step.

    components: name -> .fmu file (FMI 2 or 3, Co-Simulation), model instance, which is compiled first, or `PythonComponent`;
        or one .ssp file, which also brings connections, start values and, if they are not given, stop and step. Variables
        are named 'component.variable'.
    connections: pairs (output, input), scalars or whole vectors; units are converted, dimensions have to match.
    stop, step, begin: s; if the step does not divide the span, the last one is shorter.
    start: name -> value of parameters, inputs and states before initialisation.
    order: "gauss-seidel": one after the other, by step_order.py or in a `sequence`; "jacobi": all with what was known at
        the last point; "iterate": steps are repeated from saved states until every input is the mean of the output that
        drives it at both ends of the step, within `agreement` (relative), in at most `iterations`.
    inputs: name of an unconnected input -> number, function of time, `Samples` ((times, values) for short), or a signal as
        `prbs`; seed: of signals that have none. Where samples jump or bend, a component takes a step in parts, or gets
        their mean if it takes equal steps only. A warning (`UnconnectedInputs`) lists what nothing drives.
    tolerance: handed to the components; outputs: names to keep (all outputs and inputs that are numbers).
    steps: component -> its own step, a multiple or a fraction of `step`; what others give it is held in between.
    error_estimate: simulate again with half the steps and add 'error(a.y)' = 2 |y(step) - y(step / 2)|, which is the
        error of the result to first order in the step.
    isolate: components (True: all) in processes of their own, where a crash or a call longer than `timeout`, s, is an error.
    progress: called with the time reached; by default a bar on the terminal when it takes long.

    A component that asks to end the run ends the result (`.ended` says why), there if it is alone, else at the point before.
    An input shows the output that drives it at that point; a sample is seen a step after it was taken.
    Raises ModelError for a system that does not fit, InitializationError if the components cannot begin, SolveError with
    `.time` and the partial `.result` when a component fails, gives values that are not finite, or on Ctrl-C.
    """
    with tempfile.TemporaryDirectory(prefix="cosimulation-", ignore_cleanup_errors=True) as folder:
        told = _structure(components, connections, Path(folder))
        grid = _grid(told, begin, stop, step)
        _check(order, tolerance, agreement, iterations)
        _check_functions(told.components, isolate, error_estimate)
        alone = isolate if isinstance(isolate, Sequence) else tuple(told.components) if isolate else ()
        parts = _read(told.components, Path(folder), alone, tolerance)
        system = _system(parts, told, start or {}, with_seeds(inputs or {}, seed), grid)
        plan = _Plan(order, sequence, steps or {}, outputs, tolerance, alone, timeout, agreement, iterations)
        plan = replace(plan, sources=told.components)
        result = _run(system, plan, grid, progress)
        return _with_errors(result, _halved(system, plan, grid, progress)) if error_estimate else result


@dataclass(frozen=True)
class _Plan:
    """How a system is to be simulated."""

    order: Order
    sequence: Sequence[str] | None
    steps: Mapping[str, float]
    outputs: Sequence[str] | None
    tolerance: float | None
    isolate: Sequence[str]
    timeout: float
    agreement: float
    iterations: int
    sources: Mapping[str, Any] = field(default_factory=dict)


def _run(
    system: ConnectedSystem, plan: _Plan, grid: Grid, progress: Callable[[float], None] | None
) -> Result:
    """Simulate over the grid; a failure carries what was computed until then."""
    paces = paces_of(system, grid.step, plan.steps)
    _check_abilities(system, plan, grid, {name for name, pace in paces.items() if pace.multiple > 1})
    recorder = Recorder(system, _wanted(system, plan.outputs), grid)
    with _running(system, plan) as parts:
        master = Master(system, parts, sequence_of(system, plan.sequence), paces, grid, recorder.wanted)
        try:
            for name, part in parts.items():
                part.begin(system.start[name], grid.begin, grid.stop, plan.tolerance)
            initialize(master)
            for part in parts.values():
                part.started()
            master.read()
            recorder.begin(master)
            _advance(plan, grid, master, recorder, progress)
        except RunEnded as ended:
            recorder.end(master, ended)
        except SolveError as error:
            error.result = recorder.result()
            raise
        except KeyboardInterrupt:
            if not recorder.count:
                raise
            time = grid.time(recorder.count - 1)
            raise SolveError(
                f"co-simulation interrupted at t = {time:.4g} s; .result holds what was computed",
                time=time,
                result=recorder.result(),
            ) from None
    return recorder.complete()


def _halved(
    system: ConnectedSystem, plan: _Plan, grid: Grid, progress: Callable[[float], None] | None
) -> Result:
    """The same with half of every step."""
    finer = replace(plan, steps={name: own / 2 for name, own in plan.steps.items()})
    return _run(system, finer, make_grid(grid.begin, grid.stop, grid.step / 2), progress)


def _advance(
    plan: _Plan, grid: Grid, master: Master, recorder: Recorder, progress: Callable[[float], None] | None
) -> None:
    bar = Progress(grid.begin, grid.stop) if progress is None else nullcontext()
    with bar as shown:
        tell = progress or (shown.at if shown else None)
        for k in range(grid.count):
            master.advance(k, plan.order, plan.agreement, plan.iterations)
            recorder.add(master)
            if tell:
                tell(grid.time(k + 1))


@contextmanager
def _running(system: ConnectedSystem, plan: _Plan) -> Iterator[dict[str, RunningComponent]]:
    """The components, instantiated; ended and freed in every case."""
    parts: dict[str, RunningComponent] = {}
    try:
        for name, component in system.components.items():
            timeout = plan.timeout if name in plan.isolate else None
            parts[name] = run_source(component, plan.sources[name], timeout)
        yield parts
    finally:
        for part in reversed(parts.values()):
            part.close()


def _structure(
    components: Mapping[str, Source] | FileName, connections: Wires, folder: Path
) -> SystemStructure:
    """The files and connections of the system, from the arguments or from an SSP."""
    if isinstance(components, (str, os.PathLike)):
        if connections:
            raise ModelError(
                f"{components}: a file of a system brings its connections; found more of them, expected none"
            )
        return read_ssp(components, folder / "system")
    if not isinstance(components, Mapping) or not components:
        raise ModelError(
            f"components: found {components!r}, expected {{name: FMU file or model}} or the path of an .ssp file"
        )
    if isinstance(connections, str) or not isinstance(connections, Sequence):
        raise ModelError(f"connections: found {connections!r}, expected [('a.y', 'b.u'), ...]")
    return SystemStructure(dict(components), tuple(connections))


def _grid(told: SystemStructure, begin: float | None, stop: float | None, step: float | None) -> Grid:
    """The communication points; what is not given is as the file says."""
    begin = told.begin or 0.0 if begin is None else begin
    stop, step = told.stop if stop is None else stop, told.step if step is None else step
    check_times(begin, stop, step)
    return make_grid(*map(float, (begin, stop, step)))  # pyright: ignore[reportArgumentType]


def _system(
    parts: Mapping[str, Component],
    told: SystemStructure,
    start: Mapping[str, Any],
    inputs: Mapping[str, Any],
    grid: Grid,
) -> ConnectedSystem:
    """The components, connected; a warning of inputs that nothing drives."""
    values = {**matching(parts, told.start), **start}
    system = build_system(parts, told.connections, values, inputs, (grid.begin, grid.stop))
    if len(parts) > 1:
        warn_of(unconnected(system), stacklevel=3)
    return system


def _read(
    files: Mapping[str, Source], folder: Path, isolate: Sequence[str], tolerance: float | None = None
) -> dict[str, Component]:
    """Unpack and describe each component."""
    for name in isolate:
        if name not in files:
            raise ModelError(f"isolate: there is no component '{name}'{did_you_mean(str(name), files)}")
    found: dict[str, Component] = {}
    for count, (name, file) in enumerate(files.items()):
        if not isinstance(name, str) or not name.strip():
            raise ModelError(f"components: found the name {name!r}, expected a text that is not empty")
        found[name] = describe_source(name, file, folder / f"fmu{count}", tolerance)
    _check_alone(found, isolate)
    return found


def _check_functions(sources: Mapping[str, Any], isolate: Sequence[str] | bool, error_estimate: bool) -> None:
    """ModelError for what a Python function cannot do: run in another process, or once more from its beginning."""
    for name, source in sources.items():
        if not isinstance(source, PythonComponent):
            continue
        if isolate is True or (not isinstance(isolate, bool) and name in isolate):
            raise ModelError(
                f"isolate: {name} is a Python function, expected an FMU; name the others", argument="isolate"
            )
        if error_estimate:
            raise ModelError(
                f"error_estimate: {name} is a Python function, which a second run would find with what it remembers of "
                "the first; simulate twice yourself, with half the step"
            )


def _check_alone(components: Mapping[str, Component], isolate: Sequence[str]) -> None:
    """ModelError for an FMU that may be instantiated only once in a process but is there twice."""
    seen: dict[str, str] = {}
    for name, component in components.items():
        if not component.only_once or name in isolate:
            continue
        if component.token in seen:
            raise ModelError(
                f"{name}: {component.file} can be instantiated only once in a process, and {seen[component.token]} "
                f"is the same; run one of them in its own: isolate=['{name}']",
                argument="isolate",
            )
        seen[component.token] = name


def _wanted(system: ConnectedSystem, outputs: Sequence[str] | None) -> list[tuple[str, str]]:
    """Component and scalar of what the result shows."""
    if outputs is None:
        return [
            (owner, name) for owner, part in system.components.items() for name in part.of("output", "input")
        ]
    if isinstance(outputs, str) or not isinstance(outputs, Sequence):
        raise ModelError(f"outputs: found {outputs!r}, expected names in a list, ['a.y', 'b.u']")
    found = list(dict.fromkeys(place for name in outputs for place in locate(system.components, name)))
    for owner, name in found:
        scalar = system.components[owner].scalars[name]
        if not numeric(scalar):
            raise ModelError(f"outputs: {owner}.{name} is of type {scalar.type}, expected a number")
    return found


def _check_abilities(system: ConnectedSystem, plan: _Plan, grid: Grid, slow: set[str]) -> None:
    """ModelError for what a component cannot do but would have to."""
    for name, component in system.components.items():
        if plan.order == "iterate" and not component.can_save:
            raise ModelError(
                f"{name}: {component.file} cannot save and restore its state, which order='iterate' needs; "
                "take 'gauss-seidel', or export it with this ability"
            )
        if not grid.even and not component.variable_step:
            raise ModelError(
                f"{name}: {component.file} takes only equal steps, and {grid.step:g} s does not divide the span from "
                f"{grid.begin:g} to {grid.stop:g} s; choose a stop that is a multiple of the step"
            )
        multiple = round(plan.steps[name] / grid.step) if name in slow else 1
        if grid.count % multiple and not component.variable_step:
            raise ModelError(
                f"{name}: {component.file} takes only equal steps, and {plan.steps[name]:g} s does not divide the span "
                f"from {grid.begin:g} to {grid.stop:g} s; choose a stop that is a multiple of it"
            )
    if plan.order == "iterate" and slow:
        raise ModelError(
            f"steps: {', '.join(sorted(slow))} would step less often than others, which order='iterate' cannot repeat; "
            "take 'gauss-seidel', or the longest step for all and fractions of it"
        )


def _with_errors(result: Result, half: Result) -> Result:
    """The result with error(name) for every variable, from the run with half the steps."""
    places = np.minimum(
        2 * np.arange(result.time.size), half.time.size - 1
    )  # a short last step may not halve
    values = {name: result[name] for name in result.names}
    errors = {f"error({name})": 2 * abs(result[name] - half[name][places]) for name in result.names}
    units = {name: result.unit(name) for name in result.names}
    words = {name: result.description(name) for name in result.names}
    units |= {f"error({name})": unit for name, unit in units.items()}
    words |= {f"error({name})": f"estimated error of {name}" for name in values}
    return Result(
        result.time,
        {**values, **errors},
        units=units,
        descriptions=words,
        title=result.title,
        ended=result.ended,
    )


def check_times(begin: Any, stop: Any, step: Any) -> None:
    """ModelError unless these are times in s with begin < stop and 0 < step <= stop - begin."""
    for name, value in (("begin", begin), ("stop", stop), ("step", step)):
        if value is None:
            raise ModelError(
                f"cosimulate: found no {name}, expected a time in s, as {name}=0.1", argument=name
            )
        if (
            isinstance(value, bool)
            or not isinstance(value, (int, float, np.number))
            or not np.isfinite(value)
        ):
            raise ModelError(
                f"cosimulate: found {name}={value!r}, expected a finite number in s", argument=name
            )
    if not stop > begin:
        raise ModelError(
            f"cosimulate: found stop={stop:g}, expected a time after the beginning at {begin:g} s; choose a later one",
            argument="stop",
        )
    if not step > 0 or step > (stop - begin) * (1 + 1e-9):
        raise ModelError(
            f"cosimulate: found step={step:g}, expected more than 0 and at most the {stop - begin:g} s that are simulated; "
            "choose such a step",
            argument="step",
        )


def _check(order: Any, tolerance: Any, agreement: Any, iterations: Any) -> None:
    if order not in ORDERS:
        raise ModelError(
            f"cosimulate: found order={order!r}, expected one of {', '.join(ORDERS)}"
            f"{did_you_mean(str(order), ORDERS)}",
            argument="order",
        )
    for name, value in (("tolerance", tolerance), ("agreement", agreement)):
        good = isinstance(value, (float, np.floating)) and 0 < value < 1
        if not good and not (name == "tolerance" and value is None):
            raise ModelError(
                f"cosimulate: found {name}={value!r}, expected a number between 0 and 1, as 1e-8",
                argument=name,
            )
    if isinstance(iterations, bool) or not isinstance(iterations, int) or iterations < 1:
        raise ModelError(
            f"cosimulate: found iterations={iterations!r}, expected a whole number of at least 1"
        )
