"""One model on five ways: function, evaluate, simulate, C and FMU. A refusal is NaN."""

import shutil
import subprocess
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Dae, GantryTauError, c_source, simulate
from tests.fmu.exported import Exported, export
from tests.fmu.runtime.raw_calls import OK

COMPILER = shutil.which("cc") or shutil.which("gcc")

Point = Mapping[str, np.ndarray]  # values by name
Answers = dict[str, np.ndarray]  # by route, (points, values)


def answers(
    dae: Dae, points: Sequence[Point], find: Sequence[str], folder: Path, *, fmu: bool = True
) -> Answers:
    """What `find` is at points that name all inputs, one below the other; fmu: compile one, too."""
    size = sum(len(dae.expand(n)) for n in find)
    given = list(points[0])
    function = or_none(dae.function, given, list(find))
    found = {
        "function": _each(points, size, lambda p: called(function, given, p)),
        "evaluate": _each(points, size, lambda p: flat([dae.evaluate(p)[n] for n in find])),
        "simulate": _each(points, size, lambda p: _simulated(dae, p, find)),
    }
    if COMPILER is not None and function is not None:
        binary = compiled(function, folder)
        found["C"] = _each(points, size, lambda p: called(binary, given, p))
    if COMPILER is not None and fmu:
        exported = or_none(export, dae, folder / "model.fmu")
        found["FMU"] = _each(points, size, lambda p: initialised(exported, dae, p, find))
    return found


def or_none(make: Callable[..., Any], *arguments: Any, **more: Any) -> Any:
    try:
        return make(*arguments, **more)
    except GantryTauError:
        return None


def _each(points: Sequence[Point], size: int, answer: Callable[[Point], np.ndarray]) -> np.ndarray:
    found = np.full((len(points), size), np.nan)
    for k, point in enumerate(points):
        try:
            found[k] = answer(point)
        except GantryTauError:
            continue
    return found


def flat(values: Sequence[object]) -> np.ndarray:
    return np.concatenate([np.asarray(v, dtype=float).ravel(order="F") for v in values])


def called(function: ca.Function | None, given: Sequence[str], point: Point) -> np.ndarray:
    if function is None:
        return np.array(np.nan)
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


def initialised(exported: Exported | None, dae: Dae, point: Point, find: Sequence[str]) -> np.ndarray:
    """What an FMU computes when its inputs are set before it starts."""
    size = sum(len(dae.expand(n)) for n in find)
    if exported is None:
        return np.full(size, np.nan)
    with exported.new() as running:
        running.enter()
        for name, value in point.items():
            for scalar, number in zip(dae.expand(name), np.ravel(value, order="F"), strict=True):
                running[scalar] = number
        if running.instance("ExitInitializationMode") != OK:
            return np.full(size, np.nan)
        status, values = running.instance.get(*(exported.references[s] for n in find for s in dae.expand(n)))
        return np.array(values) if status == OK else np.full(size, np.nan)
