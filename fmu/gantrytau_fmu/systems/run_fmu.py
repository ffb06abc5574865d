"""One FMU of any tool, simulated by itself: Co-Simulation, or Model Exchange with FMPy's CVode."""

import os
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from gantrytau.border.refusal import GantryTauError, ModelError, SolveError
from gantrytau.inputs.input_signal import with_seeds
from gantrytau.results.result import Result
from gantrytau_fmu.reading.safety import unpack
from gantrytau_fmu.systems.component import read_component
from gantrytau_fmu.systems.connected_system import build_system, unconnected, warn_of
from gantrytau_fmu.systems.cosimulate import check_times, cosimulate
from gantrytau_fmu.systems.master import make_grid
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
    if model_exchange and isolate:
        raise ModelError(f"{path}: Model Exchange runs in this process, found isolate; leave one of them out")
    kind = "model-exchange" if model_exchange else "co-simulation"
    name = Path(path).name  # of the component, so that messages name the file
    with tempfile.TemporaryDirectory(prefix="fmu-", ignore_cleanup_errors=True) as folder, _plain(name):
        place = unpack(path, Path(folder) / "fmu")
        component = read_component(name, name, place, kind)
        stop = component.stop if stop is None else stop
        if stop is None:
            raise ModelError(
                f"{path}: found no stop time, in the file neither; expected one in s, as stop=1.0",
                argument="stop",
            )
        if step is None:
            check_times(0.0, stop, stop)
            step = min(component.step or stop / STEPS, stop)
        check_times(0.0, stop, step)
        starts = {f"{name}.{variable}": value for variable, value in (start or {}).items()}
        signals = {f"{name}.{variable}": value for variable, value in with_seeds(inputs or {}, seed).items()}
        system = build_system({name: component}, (), starts, signals, (0.0, stop))
        free = {free.removeprefix(f"{name}."): value for free, value in unconnected(system).items()}
        warn_of(free, stacklevel=2)
        if model_exchange:
            return integrate(component, system, make_grid(0.0, stop, step), tolerance)
    policy: dict[str, Any] = dict(stop=stop, step=step, start=starts, inputs=signals, tolerance=tolerance)
    with _plain(name):
        found = cosimulate({name: path}, **policy, isolate=[name] if isolate else (), progress=progress)
    return _bare(found, name)


@contextmanager
def _plain(name: str) -> Iterator[None]:
    """Messages and partial results in which variables have no prefix."""
    try:
        yield
    except GantryTauError as error:
        error.args = (re.sub(rf"(?<![\w./\\]){re.escape(name)}\.(?=\S)", "", str(error)),)
        if isinstance(error, SolveError) and error.result is not None:
            error.result = _bare(error.result, name)
        raise


def _bare(result: Result, name: str) -> Result:
    """The result with names that do not begin with that of the component."""
    names = {full.removeprefix(f"{name}."): full for full in result.names}
    return Result(
        result.time,
        {short: result[full] for short, full in names.items()},
        units={short: result.unit(full) for short, full in names.items()},
        descriptions={short: result.description(full) for short, full in names.items()},
        title=Path(name).stem,
        ended=result.ended,
    )
