"""Co-simulation: a system of FMUs, stepped together, as one result by dotted names."""

import os
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gantrytau.border.checks import instance, number
from gantrytau.border.refusal import Given, ModelError, SolveError
from gantrytau.inputs.input_signal import with_seeds
from gantrytau.progress import Progress
from gantrytau.results.result import Result
from gantrytau_fmu.systems.component import Component, dotted, numeric
from gantrytau_fmu.systems.connected_system import (
    ConnectedSystem,
    SystemConnection,
    build_system,
    locate,
    unconnected,
    warn_of,
)
from gantrytau_fmu.systems.initialize import initialize
from gantrytau_fmu.systems.master import (
    Grid,
    Master,
    RunningComponent,
    RunningSystem,
    check_times,
    make_grid,
    no_component,
    paces_of,
)
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
    begin: float | None = None,
    inputs: Mapping[str, Any] | None = None,
    seed: int | None = None,
    outputs: Sequence[str] | None = None,
    master: Master | None = None,
) -> Result:
    """Simulate components together and return their variables at the communication points begin + k step.

    components: name -> .fmu file (FMI 2 or 3, Co-Simulation), model instance, which is compiled first, or `PythonComponent`;
        or one .ssp file, which also brings connections, start values and, if they are not given, stop and step. Variables
        are named 'component.variable'.
    connections: pairs (output, input), scalars or whole vectors; units are converted, dimensions have to match.
    stop, step, begin: s; if the step does not divide the span, the last one is shorter.
    start: name -> value of parameters, inputs and states before initialisation.
    inputs: name of an unconnected input -> number, function of time, `Samples` ((times, values) for short), or a signal as
        `prbs`; seed: of signals that have none. Where samples jump or bend, a component takes a step in parts, or gets
        their mean if it takes equal steps only. A warning (`UnconnectedInputs`) lists what nothing drives.
    outputs: names to keep (all outputs and inputs that are numbers).
    master: the master algorithm, by default Gauss-Seidel, `Master()`.

    A component that asks to end the run ends the result (`.ended` says why), there if it is alone, else at the point before.
    An input shows the output that drives it at that point; a sample is seen a step after it was taken.
    Raises ModelError for a system that does not fit, InitializationError if the components cannot begin, SolveError with
    `.time` and the partial `.result` when a component fails, gives values that are not finite, or on Ctrl-C.
    """
    times = {
        name: None if value is None else number("cosimulate", name, value, unit="s")
        for name, value in (("begin", begin), ("stop", stop), ("step", step))
    }
    driven = with_seeds(inputs or {}, seed)
    policy: Master = instance("cosimulate", "master", Master() if master is None else master, Master)
    with tempfile.TemporaryDirectory(prefix="cosimulation-", ignore_cleanup_errors=True) as folder:
        structure = _structure(components, connections, Path(folder))
        grid = _grid(structure, **times)
        _check_functions(structure.components, policy)
        parts = _read(structure.components, Path(folder), policy)
        system = _system(parts, structure, start or {}, driven, grid)
        return run_system(system, policy, grid, structure.components, outputs)


def run_system(
    system: ConnectedSystem,
    master: Master,
    grid: Grid,
    sources: Mapping[str, Source],
    outputs: Sequence[str] | None = None,
) -> Result:
    """Simulate over the grid, with an estimate of the error if the master is to make one."""
    wanted = _wanted(system, outputs)
    result = _run(system, master, grid, sources, wanted)
    if not master.error_estimate:
        return result
    halves = {name: own / 2 for name, own in (master.steps or {}).items()}
    finer = make_grid(grid.begin, grid.stop, grid.step / 2)
    return _with_errors(result, _run(system, replace(master, steps=halves), finer, sources, wanted))


def _run(
    system: ConnectedSystem,
    master: Master,
    grid: Grid,
    sources: Mapping[str, Source],
    wanted: Sequence[tuple[str, str]],
) -> Result:
    """Simulate over the grid; a failure carries what was computed until then."""
    paces = paces_of(system, grid.step, master.steps)
    _check_abilities(system, master, grid, {name for name, pace in paces.items() if pace.multiple > 1})
    recorder = Recorder(system, wanted, grid)
    sequence = sequence_of(system, master.sequence)
    with _instantiated(system, master, sources) as parts:
        running = RunningSystem(system, parts, sequence, paces, grid, recorder.wanted)
        try:
            for name, part in parts.items():
                part.begin(system.start[name], grid.begin, grid.stop, master.tolerance)
            initialize(running)
            for part in parts.values():
                part.started()
            running.read()
            recorder.begin(running)
            _advance(running, master, recorder)
        except RunEnded as ended:
            recorder.end(running, ended)
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


def _advance(running: RunningSystem, master: Master, recorder: Recorder) -> None:
    grid = running.grid
    with Progress("cosimulate", grid.begin, grid.stop, wanted=master.progress is None) as bar:
        tell = master.progress or bar.at
        for k in range(grid.count):
            running.advance(k, master)
            recorder.add(running)
            tell(grid.time(k + 1))


@contextmanager
def _instantiated(
    system: ConnectedSystem, master: Master, sources: Mapping[str, Source]
) -> Iterator[dict[str, RunningComponent]]:
    """The components, instantiated; ended and freed in every case."""
    parts: dict[str, RunningComponent] = {}
    isolated = master.isolated(system.components)
    try:
        for name, component in system.components.items():
            parts[name] = run_source(component, sources[name], master.timeout if name in isolated else None)
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
                "found connections beside a file of a system, which brings its own; leave them out",
                place=os.fspath(components),
                argument="connections",
            )
        return read_ssp(components, folder / "system")
    if not isinstance(components, Mapping) or not components:
        expected = "expected {name: FMU file or model} or the path of an .ssp file"
        raise ModelError(expected, place="cosimulate", found=Given("components", components))
    if isinstance(connections, str) or not isinstance(connections, Sequence):
        expected = "expected [('a.y', 'b.u'), ...]"
        raise ModelError(expected, place="cosimulate", found=Given("connections", connections))
    return SystemStructure(dict(components), tuple(connections))


def _grid(structure: SystemStructure, begin: float | None, stop: float | None, step: float | None) -> Grid:
    """The communication points; what is not given is as the file says."""
    begin = (structure.begin or 0.0) if begin is None else begin
    stop = structure.stop if stop is None else stop
    step = structure.step if step is None else step
    for name, value in (("stop", stop), ("step", step)):
        if value is None:
            words = (f"found no {name}, expected a time in s, as ", Given(name, 0.1))
            raise ModelError(*words, place="cosimulate", argument=name)
    assert stop is not None
    assert step is not None
    check_times("cosimulate", begin, stop, step)
    return make_grid(begin, stop, step)


def _system(
    parts: Mapping[str, Component],
    structure: SystemStructure,
    start: Mapping[str, Any],
    inputs: Mapping[str, Any],
    grid: Grid,
) -> ConnectedSystem:
    """The components, connected; a warning of inputs that nothing drives."""
    values = {**matching(parts, structure.start), **start}
    system = build_system(parts, structure.connections, values, inputs, (grid.begin, grid.stop))
    if len(parts) > 1:
        warn_of(unconnected(system), stacklevel=3)
    return system


def _read(files: Mapping[str, Source], folder: Path, master: Master) -> dict[str, Component]:
    """Unpack and describe each component."""
    isolated = master.isolated(files)
    for name in isolated:
        if name not in files:
            raise no_component("isolate", name, files)
    found: dict[str, Component] = {}
    for count, (name, file) in enumerate(files.items()):
        if not isinstance(name, str) or not name.strip():
            raise ModelError(f"components: found the name {name!r}, expected a text that is not empty")
        found[name] = describe_source(name, file, folder / f"fmu{count}", master.tolerance)
    _check_alone(found, isolated)
    return found


def _check_functions(sources: Mapping[str, Any], master: Master) -> None:
    """ModelError for what a Python function cannot do: run in another process, or once more from its beginning."""
    for name, source in sources.items():
        if not isinstance(source, PythonComponent):
            continue
        if name in master.isolated(sources):
            raise ModelError(
                f"isolate: {name} is a Python function, expected an FMU; name the others", argument="isolate"
            )
        if master.error_estimate:
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
                f"{component.file} can be instantiated only once in a process, and {seen[component.token]} is the same; "
                "run one of them in its own: ",
                Given("isolate", [name]),
                place=name,
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
        expected = "expected names in a list, ['a.y', 'b.u']"
        raise ModelError(expected, place="cosimulate", found=Given("outputs", outputs))
    found = list(dict.fromkeys(place for name in outputs for place in locate(system.components, name)))
    for owner, name in found:
        scalar = system.components[owner].scalars[name]
        if not numeric(scalar):
            raise ModelError(f"outputs: {dotted(owner, name)} is of type {scalar.type}, expected a number")
    return found


def _check_abilities(system: ConnectedSystem, master: Master, grid: Grid, slow: set[str]) -> None:
    """ModelError for what a component cannot do but would have to."""
    iterate, remedy = master.order == "iterate", "choose a stop that is a multiple of it"
    for name, component in system.components.items():
        if iterate and not component.can_save:
            raise ModelError(
                f"{component.file} cannot save and restore its state, which ",
                Given("order", "iterate"),
                " needs; take 'gauss-seidel', or export it with this ability",
                place=component.title,
                argument="order",
            )
        own = (master.steps or {})[name] if name in slow else grid.step
        even = grid.even and grid.count % round(own / grid.step) == 0
        if not even and not component.variable_step:
            raise ModelError(
                f"{component.file} takes only equal steps, and {own:g} s does not divide the span from {grid.begin:g} to "
                f"{grid.stop:g} s; {remedy}",
                place=component.title,
                argument="step",
            )
    if iterate and slow:
        raise ModelError(
            f"steps: {', '.join(sorted(slow))} would step less often than others, which ",
            Given("order", "iterate"),
            " cannot repeat; take 'gauss-seidel', or the longest step for all and fractions of it",
            place="Master",
            argument="steps",
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
