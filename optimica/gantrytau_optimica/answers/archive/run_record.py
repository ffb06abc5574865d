"""A record of a run as JSON: what was asked, with which versions, and what came out."""

import inspect
import json
import os
import platform
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from itertools import count
from pathlib import Path
from types import CodeType
from typing import Any

import numpy as np

from gantrytau import ModelError, Result
from gantrytau.border.checks import instance, number
from gantrytau.border.refusal import Given
from gantrytau.interruption import uninterrupted
from gantrytau.whole_files import replacing
from gantrytau_optimica.answers.answer import Answer
from gantrytau_optimica.answers.archive.fingerprint import hash_of, hashes, plain, versions
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.control.control_problem import Phase
from gantrytau_optimica.problem.optimization import Optimization

ALIKE = 1e-9  # relative: numbers of two runs closer than this are the same
PLACE = "a folder or the name of a .json file"
PASSING = ("started", "durations")  # differ between any two runs


def run_record(
    optimum: Optimum,
    *,
    problem: Optimization | type[Optimization] | None = None,
    options: Mapping[str, Any] | None = None,
    started: datetime | None = None,
    read_time: float | None = None,
) -> dict[str, Any]:
    """The record of a run, solved or not (then of `error.optimum`), of plain values that JSON can hold.

    problem: the class or instance, for its source file; options: keywords of `optimize` as given; started: when;
    read_time: s spent on reading the problem. What is not given is None. Keys always come in the same order; numbers
    that JSON lacks are the words "inf", "-inf" and "nan".
    """
    if read_time is not None:
        read_time = number("run_record", "read_time", read_time, least=0.0)
    expected = "what optimize returned or its SolveError has as .optimum"
    instance("run_record", "optimum", optimum, Optimum, expected)
    program = optimum.program
    return plain(
        {
            "problem": _problem(optimum, problem),
            "parameters": _parameters(optimum),
            "options": {k: _as_given(v) for k, v in sorted((options or {}).items())},
            "transcription": [_transcription(phase) for phase in optimum.phases.values()],
            "unknowns": program.places.size,
            "conditions": program.assembled.rows,
            "versions": versions(),
            "platform": {"system": platform.system(), "machine": platform.machine()},
            "hashes": hashes(optimum),
            "started": None if started is None else started.astimezone(UTC).isoformat(timespec="seconds"),
            "durations": {"read": read_time, "build": optimum.build_time, "solve": optimum.solve_time},
            "iterations": optimum.iterations,
            "success": optimum.success,
            "status": optimum.status,
            "objective": optimum.objective,
            "horizon": [optimum.start_time, optimum.final_time],
            "free": dict(sorted(optimum.free.items())),
            "verdict": _verdict(optimum),
            "report": optimum.report().splitlines(),
        }
    )


def write_record(optimum: Optimum | Mapping[str, Any], path: str | os.PathLike[str], **details: Any) -> Path:
    """Write a record to a file, or to a new file in a folder, and return its path.

    optimum: an Optimum, with `details` as keywords of run_record, or a record. A file in a folder is named after
    the problem and the time, and never replaces another; a file that is named is replaced when the new one is complete.
    """
    if isinstance(optimum, Optimum):
        record = run_record(optimum, **details)
    else:
        record = _record("write_record", optimum)
    path = Path(instance("write_record", "path", path, (str, os.PathLike), PLACE))
    text = json.dumps(plain(record), indent=2, ensure_ascii=False, allow_nan=False)
    if path.is_dir():
        return _added(path, record, text)
    if path.suffix.lower() != ".json":
        raise ModelError(
            f"{path}: found neither a folder nor a name that ends in .json, expected one of them"
        )
    with replacing(path) as partial:
        partial.write_text(text + "\n", encoding="utf-8")
    return path


def require_place(path: Any) -> None:
    """ModelError for a place to which no record can be written; a name that ends in "/" becomes a folder."""
    place = Path(instance("optimize", "record", path, (str, os.PathLike), PLACE))
    if str(path).endswith(("/", os.sep)):
        place.mkdir(parents=True, exist_ok=True)
    if place.is_dir():
        return
    if place.suffix.lower() != ".json":
        raise ModelError(f"expected {PLACE}", place="optimize", found=Given("record", path))
    if not place.parent.is_dir():
        missing = f"there is no folder {place.parent}; make it first"
        raise ModelError(missing, place="optimize", found=Given("record", path))


def compare_records(a: Mapping[str, Any], b: Mapping[str, Any]) -> str:
    """What differs between two records, line by line: where, the first value and the second; "" if nothing does.

    Numbers within 1e-9 of each other are the same. Start times and durations are left out.
    """
    first, second = _record("compare_records", a), _record("compare_records", b)
    return "\n".join(f"{where}: {one} -> {other}" for where, one, other in _differences("", first, second))


def _record(verb: str, record: Any) -> dict[str, Any]:
    """A record as it was given; ModelError for what is none."""
    named = isinstance(record, Mapping) and isinstance(record.get("problem"), Mapping)
    if not named or not isinstance(record["problem"].get("name"), str):
        raise ModelError(
            f"{verb}: found {_short(record)[:80]}, expected a record: what run_record returns, or json.load reads of a file "
            "of write_record"
        )
    return dict(record)


def _problem(optimum: Optimum, problem: Any) -> dict[str, Any]:
    kind = problem if isinstance(problem, type) else type(problem)
    given = kind if issubclass(kind, Optimization) else None
    file = None if given is None else _source(given)
    return {
        "name": optimum.name,
        "class": None if given is None else f"{given.__module__}.{given.__qualname__}",
        "file": None if file is None else file.name,
        "file_hash": None if file is None else hash_of(file.read_bytes()),
    }


def _source(kind: type) -> Path | None:
    """The file that holds a class; None for one typed into a session."""
    try:
        path = Path(inspect.getsourcefile(kind) or "")
    except TypeError:
        return None
    return path if path.is_file() else None


def _parameters(optimum: Optimum) -> dict[str, Any]:
    """Values of all parameters that are not free, held ones as they were for this solve."""
    held = {n.name: n.guess for n in optimum.program.problem.free if n.held}
    values = {**optimum.dae.parameter_values, **held}
    return {name: values[name] for name in sorted(values) if name not in optimum.free}


def _transcription(phase: Any) -> dict[str, Any]:
    layout = phase.layout
    return {
        "phase": layout.phase.name,
        "scheme": layout.scheme.scheme,
        "points": int(layout.scheme.points.size),
        "elements": layout.mesh.elements,
        "borders": phase.mesh.borders if layout.mesh.moving or not _equal(layout.mesh.borders) else "equal",
        "controls": _controls(layout.phase),
    }


def _equal(borders: np.ndarray) -> bool:
    return bool(np.allclose(np.diff(borders), 1 / (borders.size - 1), rtol=1e-9))


def _controls(phase: Phase) -> dict[str, Any]:
    return {
        u.name: {
            "kind": u.pieces.kind,
            "elements": u.pieces.elements,
            "max_step": u.pieces.max_step,
            "step_penalty": u.pieces.step_penalty,
        }
        for u in phase.inputs
        if u.pieces.kind != "free"
    }


def _verdict(optimum: Optimum) -> dict[str, Any]:
    """Solved or not, what failed, and what a playback found between the points where there is one."""
    failed = (
        [] if optimum.success else [line.strip() for line in optimum.report().splitlines() if " is " in line]
    )
    return {"solved": optimum.success, "failed": failed, "between_points": _between(optimum)}


def _between(optimum: Optimum) -> float | None:
    """The largest violation between the points, where the optimum can be played back."""
    return float(optimum.playback.violation) if optimum.success and optimum.playback.complete else None


def _as_given(value: Any) -> Any:
    """An option as it was given, long or living things by what they are."""
    if isinstance(value, Mapping):
        return {str(k): _as_given(v) for k, v in value.items()}
    if isinstance(value, np.ndarray) and value.size > 32:
        return f"array of shape {value.shape}, hash {hash_of(np.ascontiguousarray(value).tobytes())}"
    if isinstance(value, (Result, Answer)):
        results = [value] if isinstance(value, Result) else [*value.by_phase.values()]
        return (
            f"{value!r}, hash {hash_of(b''.join(_bytes(r[n]) for r in results for n in ('time', *r.names)))}"
        )
    if callable(value):
        name, code = getattr(value, "__qualname__", type(value).__name__), getattr(value, "__code__", None)
        return f"function {name}" + (f", hash {hash_of(_written(value, code))}" if code else "")
    return value if isinstance(value, (str, np.ndarray, list, tuple)) else plain(value)


def _bytes(values: Any) -> bytes:
    return np.ascontiguousarray(values, dtype=float).tobytes()


def _written(function: Any, code: CodeType) -> str:
    """What a function of Python does, wherever it stands: instructions, constants, defaults, and what it closes over."""
    constants = [_written(None, c) if isinstance(c, CodeType) else repr(c) for c in code.co_consts]
    cells = [cell.cell_contents for cell in getattr(function, "__closure__", None) or ()]
    outer = [_as_given(value) for value in (*(getattr(function, "__defaults__", None) or ()), *cells)]
    return f"{code.co_code.hex()} {code.co_names} {constants} {outer}"


def _added(folder: Path, record: Mapping[str, Any], text: str) -> Path:
    """A new file in the folder, whole from its first moment on: problem, time of the start or of now, and a number if
    others run as well.
    """
    moment = str(record.get("started") or datetime.now(UTC).isoformat(timespec="seconds"))
    stem = f"{record['problem']['name']}-{moment[:19].replace(':', '')}"
    names = (folder / f"{stem}{f'-{k}' if k else ''}.json" for k in count())
    partial = folder / f".{stem}.{os.getpid()}.json"
    try:
        with uninterrupted():
            partial.write_text(text + "\n", encoding="utf-8")
            return next(path for path in names if _linked(partial, path))
    finally:
        partial.unlink(missing_ok=True)


def _linked(partial: Path, path: Path) -> bool:
    """Whether a file got this second name, which none had."""
    try:
        os.link(partial, path)
    except FileExistsError:
        return False
    except OSError:  # a file system without second names
        if path.exists():
            return False
        os.replace(partial, path)
    return True


def _differences(where: str, a: Any, b: Any) -> Iterator[tuple[str, str, str]]:
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        for key in dict.fromkeys((*a, *b)):
            if where or key not in PASSING:
                inner = f"{where}.{key}" if where else str(key)
                yield from _differences(inner, a.get(key), b.get(key))
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for k, (first, second) in enumerate(zip(a, b, strict=True)):
            yield from _differences(f"{where}[{k}]", first, second)
    elif not _same(a, b):
        yield where, _short(a), _short(b)


def _same(a: Any, b: Any) -> bool:
    numbers = [isinstance(x, (int, float)) and not isinstance(x, bool) for x in (a, b)]
    return abs(a - b) <= ALIKE * max(abs(a), abs(b)) if all(numbers) else a == b


def _short(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.10g}"
    if isinstance(value, list):
        return f"{len(value)} entries"
    return "nothing" if value is None else str(value)
