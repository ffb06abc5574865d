"""One model on five ways: function, evaluate, simulate, C and FMU. A refusal is the error."""

import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import casadi as ca
import numpy as np

from gantrytau import Dae, GantryTauError, SolveError, c_source, simulate
from tests.fmu.exported import Exported, export
from tests.fmu.runtime.raw_calls import OK

COMPILER = shutil.which("cc") or shutil.which("gcc")

T = TypeVar("T")
Point = Mapping[str, np.ndarray]  # values by name
Answer = np.ndarray | GantryTauError
Answers = dict[str, list[Answer]]  # by route, one for each point


def answers(
    dae: Dae, points: Sequence[Point], find: Sequence[str], folder: Path, *, fmu: bool = True
) -> Answers:
    """What `find` is at points that name all inputs; fmu: compile one, too."""
    given = list(points[0])
    function = attempted(dae.function, given, list(find))
    routes: dict[str, Callable[[Point], np.ndarray]] = {
        "function": lambda p: called(function, given, p),
        "evaluate": lambda p: flat([dae.evaluate(p)[n] for n in find]),
        "simulate": lambda p: _simulated(dae, p, find),
    }
    if COMPILER is not None and isinstance(function, ca.Function):
        binary = compiled(function, folder)
        routes["C"] = lambda p: called(binary, given, p)
    if COMPILER is not None and fmu:
        exported = attempted(export, dae, folder / "model.fmu")
        routes["FMU"] = lambda p: initialised(exported, dae, p, find)
    return {name: [attempted(route, p) for p in points] for name, route in routes.items()}


def attempted(make: Callable[..., T], *arguments: Any, **more: Any) -> T | GantryTauError:
    """What is made, or the refusal."""
    try:
        return make(*arguments, **more)
    except GantryTauError as refusal:
        return refusal


def flat(values: Sequence[object]) -> np.ndarray:
    """All values in one row; NaN, by which functions refuse, as an error."""
    found = np.concatenate([np.asarray(v, dtype=float).ravel(order="F") for v in values])
    if not np.all(np.isfinite(found)):
        raise SolveError("NaN")
    return found


def called(function: ca.Function | GantryTauError, given: Sequence[str], point: Point) -> np.ndarray:
    if isinstance(function, GantryTauError):
        raise function
    results = function.call([ca.DM(np.asarray(point[n], dtype=float).ravel(order="F")) for n in given])
    return flat([np.array(r) for r in results])


def compiled(function: ca.Function, folder: Path) -> ca.Function:
    assert COMPILER is not None
    path, library = folder / "routes.c", folder / "routes.so"
    path.write_text(c_source(function, name="routes"))
    flags = ["-std=c99", "-O0", "-shared", "-fPIC"]
    subprocess.run([COMPILER, *flags, "-o", str(library), str(path), "-lm"], check=True, timeout=120)
    return ca.external("routes", str(library))


def _simulated(dae: Dae, point: Point, find: Sequence[str]) -> np.ndarray:
    """At the end of a straight way of all inputs from their start values to a point."""
    ways = {}
    for name, there in point.items():
        here = np.atleast_1d(np.array([dae.start[n] for n in dae.expand(name)]))
        ways[name] = ([0.0, 1.0], np.stack([here, np.ravel(there, order="F")]))
    result = simulate(dae, stop=1.0, inputs=ways, points=11)
    return flat([result.final(n) for n in find])


def initialised(
    exported: Exported | GantryTauError, dae: Dae, point: Point, find: Sequence[str]
) -> np.ndarray:
    """What an FMU computes when its inputs are set before it starts."""
    if isinstance(exported, GantryTauError):
        raise exported
    with exported.new() as running:
        running.enter()
        for name, value in point.items():
            for scalar, number in zip(dae.expand(name), np.ravel(value, order="F"), strict=True):
                running[scalar] = number
        if running.instance("ExitInitializationMode") != OK:
            raise SolveError(running.instance.message)
        status, values = running.instance.get(*(exported.references[s] for n in find for s in dae.expand(n)))
        if status != OK:
            raise SolveError(running.instance.message)
        return flat([values])
