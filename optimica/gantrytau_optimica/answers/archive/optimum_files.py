"""Optima on file: one zip archive of a header in JSON and of plain arrays, without anything that could run.

header.json                       names, numbers and texts; "version" counts changes of this format
w, multipliers, bound_multipliers the solution as the solver left it
phases/0/time, borders, nodes     of the first phase, see SavedPhase
phases/0/signals/3/nodes, unknowns  the polynomials of its fourth signal: values w[unknowns] at nodes
phases/0/affine/row, column, value, offset    variables that are sums of signals
phases/0/grid                     all other variables (variables, elements, nodes)
"""

import json
import os
import zipfile
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy import sparse

from gantrytau import ModelError
from gantrytau.language.symbols import derivative_name, split_derivative
from gantrytau.simulation.to_result import labels
from gantrytau.whole_files import replacing
from gantrytau_optimica.answers.archive.fingerprint import hashes, plain, versions
from gantrytau_optimica.answers.archive.saved_optimum import SavedOptimum, SavedPhase
from gantrytau_optimica.answers.program_answer import ProgramAnswer
from gantrytau_optimica.transcription.assemble import scipy_matrix
from gantrytau_optimica.transcription.layout import Track, lagrange
from gantrytau_optimica.transcription.trajectory import Trajectory

FORMAT, VERSION, SUFFIX = "gantrytau optimum", 1, ".optimum"
Arrays = dict[str, np.ndarray]


def save_optimum(optimum: ProgramAnswer, path: str | os.PathLike[str]) -> Path:
    """Write all that is known of an optimum to a file `*.optimum`, and return its path.

    An existing file is replaced only when the new one is complete. Raises ModelError for another suffix or a folder
    that does not exist.
    """
    path = Path(path)
    if path.suffix.lower() != SUFFIX:
        raise ModelError(
            f"{path}: found the suffix '{path.suffix}', expected '{SUFFIX}'; optimum.save(...) writes the variables over "
            "time in other formats"
        )
    header, arrays = _content(optimum)
    with replacing(path) as partial, zipfile.ZipFile(partial, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr("header.json", json.dumps(header, indent=1, allow_nan=False))
        for name, values in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, np.ascontiguousarray(values), allow_pickle=False)
    return path


def load_optimum(path: str | os.PathLike[str]) -> SavedOptimum:
    """Read what `save_optimum` wrote. Nothing in a file is ever run.

    Raises ModelError for a missing, foreign, damaged or cut file, and for one of a newer version.
    """
    path = Path(path)
    try:
        with zipfile.ZipFile(path) as archive:
            header = _header(path, archive)
            return _optimum(header, {i.filename[:-4]: i for i in archive.infolist()}, archive)
    except FileNotFoundError:
        raise ModelError(
            f"{path}: there is no such file, expected one written by save_optimum; name another"
        ) from None
    except (OSError, zipfile.BadZipFile) as error:
        if isinstance(error, OSError) and error.errno is not None:
            raise ModelError(f"{path}: {error.strerror}; expected a file that can be read") from error
        raise ModelError(_damaged(path, error)) from error
    except (ArithmeticError, AttributeError, LookupError, MemoryError, RuntimeError, TypeError, ValueError,
            EOFError) as error:  # fmt: skip
        if isinstance(error, ModelError):
            raise
        raise ModelError(_damaged(path, error)) from error


def _damaged(path: Path, error: Exception) -> str:
    return (
        f"{path}: found no whole saved optimum ({type(error).__name__}: {error}); the file is cut, damaged or of another "
        "kind, expected one written by save_optimum; take a copy, or solve again"
    )


def _header(path: Path, archive: zipfile.ZipFile) -> dict[str, Any]:
    if "header.json" not in archive.namelist():
        raise ModelError(
            f"{path}: found an archive without header.json, expected one written by save_optimum"
        )
    header = json.loads(archive.read(_stored(archive.getinfo("header.json"))))
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise ModelError(f"{path}: found an archive of another kind, expected one written by save_optimum")
    version = header["version"]
    if not isinstance(version, int) or version > VERSION:
        written = header.get("versions", {}).get("gantrytau", "?")
        raise ModelError(
            f"{path}: found format {version}, written by gantrytau {written}; expected at most {VERSION}; update gantrytau"
        )
    return header


def _stored(info: zipfile.ZipInfo) -> zipfile.ZipInfo:
    """A member that cannot grow when it is read."""
    if info.compress_type != zipfile.ZIP_STORED or info.file_size != info.compress_size:
        raise ValueError(f"{info.filename} is compressed")
    return info


def _content(optimum: ProgramAnswer) -> tuple[dict[str, Any], Arrays]:
    dae, solution = optimum.dae, optimum.solution
    units, words = labels(dae)
    arrays: Arrays = {
        "w": solution.w,
        "multipliers": solution.multipliers,
        "bound_multipliers": solution.bound_multipliers,
    }
    first = next(iter(optimum.phases.values()))
    header = {
        "format": FORMAT,
        "version": VERSION,
        "versions": versions(),
        "hashes": hashes(optimum),
        "name": optimum.name,
        "scheme": first.layout.scheme.scheme,
        "points": int(first.layout.scheme.points.size),
        "objective": optimum.objective,
        "success": optimum.success,
        "status": optimum.status,
        "iterations": optimum.iterations,
        "build_time": optimum.build_time,
        "solve_time": optimum.solve_time,
        "text": optimum.report(),
        "free": dict(optimum.free),
        "parameters": optimum.parameters,
        "units": units,
        "displays": dict(optimum.displays),
        "descriptions": words,
        "vectors": {n: v.elements for n, v in dae.vectors.items() if tuple(v.elements) != (n,)},
        "phases": [
            _phase_content(
                optimum, phase, f"phases/{i}", [*dae.variables, *_derivatives(optimum, words)], arrays
            )
            for i, phase in enumerate(optimum.phases.values())
        ],
    }
    return plain(header), arrays


def _derivatives(optimum: ProgramAnswer, words: dict[str, str]) -> list[str]:
    """Names of derivatives that the model has, and of rates of inputs that the problem has."""
    dae, chosen = (
        optimum.dae,
        [split_derivative(u.name) for p in optimum.phases.values() for u in p.phase.inputs],
    )
    orders = dict(chosen)
    found = [name for name in words if split_derivative(name)[1]]
    for name in dae.variables:
        alias = dae.root(name)
        order = orders.get(alias.root or "", 0) if alias is not None and not alias.order else 0
        found += [derivative_name(name, k) for k in range(1, order + 1)]
    return list(dict.fromkeys(found))


def _phase_content(
    optimum: ProgramAnswer, phase: Trajectory, place: str, names: list[str], arrays: Arrays
) -> dict[str, Any]:
    """The header of one phase; its arrays are added to `arrays`."""
    own = phase.phase.name
    names = [n for n in names if not own or split_derivative(n)[0].startswith(f"{own}.")]
    names, expressions = _determined(optimum, phase, names)
    affine, matrix, offsets = _affine(phase, expressions)
    others = np.flatnonzero(~affine)
    nodes = _nodes(phase.layout.scheme.points)
    arrays |= {
        f"{place}/time": phase.time,
        f"{place}/borders": phase.mesh.borders,
        f"{place}/nodes": nodes,
        f"{place}/grid": _grid(phase, expressions, others, nodes),
        f"{place}/affine/row": matrix.row.astype(np.int64),
        f"{place}/affine/column": matrix.col.astype(np.int64),
        f"{place}/affine/value": matrix.data,
        f"{place}/affine/offset": offsets,
    }
    for i, track in enumerate(phase.layout.tracks):
        nodes, unknowns = _polynomials(track, phase, arrays)
        arrays[f"{place}/signals/{i}/nodes"] = nodes
        arrays[f"{place}/signals/{i}/unknowns"] = unknowns.astype(np.int64)
    start, final = phase.horizon
    return {
        "name": own,
        "start_time": start,
        "final_time": final,
        **{part: [s.name for s in getattr(phase.phase, part)] for part in ("states", "algebraics", "inputs")},
        "names": names,
        "affine": [names[i] for i in np.flatnonzero(affine)],
        "others": [names[i] for i in others],
    }


def _polynomials(track: Track, phase: Trajectory, arrays: Arrays) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and unknowns of a signal; one that is no polynomial through its unknowns becomes one through new values."""
    if type(track) is Track:
        return track.nodes, track.unknowns
    n = phase.mesh.elements
    nodes = np.tile(np.linspace(0.0, 1.0, 4), (n, 1))  # those of shooting are cubic at most
    values = track.values(phase.w, np.repeat(np.arange(n), 4), nodes.ravel())
    unknowns = arrays["w"].size + np.arange(values.size).reshape(n, 4)
    arrays["w"] = np.append(arrays["w"], values)
    return nodes, unknowns


def _determined(optimum: ProgramAnswer, phase: Trajectory, names: list[str]) -> tuple[list[str], ca.SX]:
    """The names whose values the solution determines (the derivative of an input is none), and their expressions."""
    symbols = [s.symbol for s in (*phase.phase.signals, *phase.phase.courses, *phase.problem.free)]
    known = {s.element_hash() for s in (*symbols, phase.problem.time)}
    expressions = optimum.built.expressed(names).elements()
    pairs = [
        (name, e)
        for name, e in zip(names, expressions, strict=True)
        if all(leaf.element_hash() in known for leaf in ca.symvar(e))
    ]
    column = ca.vertcat(ca.SX(0, 1), *(e for _, e in pairs))
    if phase.problem.free:
        column = ca.substitute(column, phase.problem.numbers, ca.DM(phase.numbers))
    return [name for name, _ in pairs], column


def _affine(phase: Trajectory, expressions: ca.SX) -> tuple[np.ndarray, Any, np.ndarray]:
    """Which expressions are sums of signals, and for these coefficients (rows, signals) and offsets (rows,)."""
    signals = ca.vertcat(ca.SX(0, 1), *(s.symbol for s in phase.phase.signals))
    outer = ca.vertcat(phase.problem.time, *(c.symbol for c in phase.phase.courses))
    if not expressions.numel():
        return np.zeros(0, bool), sparse.coo_matrix((0, signals.numel())), np.zeros(0)
    bent = np.array(ca.which_depends(expressions, outer, 1, True))
    if signals.numel():
        bent |= np.array(ca.which_depends(expressions, signals, 2, True))
    rows = expressions[np.flatnonzero(~bent).tolist()] if not bent.all() else ca.SX(0, 1)
    evaluate = ca.Function("affine", [signals], [ca.jacobian(rows, signals), ca.densify(rows)])
    coefficients, offsets = evaluate(ca.DM.zeros(signals.numel()))
    matrix = (
        scipy_matrix(coefficients).tocoo()
        if coefficients.numel()
        else sparse.coo_matrix((rows.numel(), signals.numel()))
    )
    return ~bent, matrix, np.array(offsets).ravel()


def _nodes(points: np.ndarray) -> np.ndarray:
    """Ends and points of an element, and the middles between them: squares of inputs are exact, too."""
    nodes = np.unique(np.concatenate([[0.0], points, [1.0]]))
    return np.sort(np.concatenate([nodes, (nodes[:-1] + nodes[1:]) / 2]))


def _grid(phase: Trajectory, expressions: ca.SX, rows: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Values (rows, elements, nodes); those not finite between the points follow from their values."""
    n, m = phase.mesh.elements, nodes.size
    if not rows.size:
        return np.zeros((0, n, m))
    element, place = np.repeat(np.arange(n), m), np.tile(nodes, n)
    times = phase.times(phase.mesh.borders[element] + place * phase.mesh.widths[element])
    function = phase.function(expressions[rows.tolist()])
    found = np.array(function(times[None, :], phase.at(element, place, times)))
    found = found if found.shape[1] == times.size else np.repeat(found, times.size, axis=1)
    grid = found.reshape(rows.size, n, m)
    inside = np.isin(nodes, phase.layout.scheme.points)
    for k in np.flatnonzero(~inside):
        weights = lagrange(nodes[None, inside], nodes[[k]])[0]
        grid[:, :, k] = np.where(np.isfinite(grid[:, :, k]), grid[:, :, k], grid[:, :, inside] @ weights)
    return grid


def _optimum(
    header: dict[str, Any], members: dict[str, zipfile.ZipInfo], archive: zipfile.ZipFile
) -> SavedOptimum:
    def read(name: str, kind: str, *shape: int | None) -> np.ndarray:
        with archive.open(_stored(members[name])) as member:
            found = np.lib.format.read_array(member, allow_pickle=False)
            member.read()  # to its end, where the checksum is compared
        fits = len(shape) == found.ndim and all(
            s in (None, k) for s, k in zip(shape, found.shape, strict=True)
        )
        if found.dtype.kind != kind or not fits:
            raise ValueError(f"{name} holds {found.dtype} of shape {found.shape}")
        return found

    w = read("w", "f", None)
    phases = [_phase(part, f"phases/{i}", w, read) for i, part in enumerate(header["phases"])]
    if not phases:
        raise ValueError("there is no phase")

    def table(key: str, kind: Any) -> dict[str, Any]:
        return {name: kind(value) for name, value in header[key].items()}

    return SavedOptimum(
        name=str(header["name"]),
        scheme=str(header["scheme"]),
        points=int(header["points"]),
        objective=float(header["objective"]),
        success=bool(header["success"]),
        status=str(header["status"]),
        iterations=int(header["iterations"]),
        build_time=float(header["build_time"]),
        solve_time=float(header["solve_time"]),
        text=str(header["text"]),
        free=table("free", float),
        parameters=table("parameters", float),
        units=table("units", str),
        descriptions=table("descriptions", str),
        versions=table("versions", str),
        hashes=table("hashes", str),
        vectors=table("vectors", lambda elements: tuple(str(e) for e in elements)),
        phases={phase.name: phase for phase in phases},
        display_units={str(name): str(unit) for name, unit in header.get("displays", {}).items()},
        multipliers=read("multipliers", "f", None),
        bound_multipliers=read("bound_multipliers", "f", None),
    )


def _phase(part: dict[str, Any], place: str, w: np.ndarray, read: Any) -> SavedPhase:
    lists = {
        k: tuple(str(n) for n in part[k])
        for k in ("states", "algebraics", "inputs", "names", "affine", "others")
    }
    count = sum(len(lists[k]) for k in ("states", "algebraics", "inputs"))
    if sorted(lists["names"]) != sorted((*lists["affine"], *lists["others"])):
        raise ValueError(f"{place} has names without values")
    borders, nodes = read(f"{place}/borders", "f", None), read(f"{place}/nodes", "f", None)
    n = borders.size - 1
    start, final, time = (
        float(part["start_time"]),
        float(part["final_time"]),
        read(f"{place}/time", "f", None),
    )
    rising = start < final and time.size and np.all(np.diff(time) >= 0) and np.all(np.diff(borders) > 0)
    if not rising or (borders[0], borders[-1]) != (0.0, 1.0) or not np.isfinite([start, final]).all():
        raise ValueError(f"{place} has times that do not rise from a start to an end")
    tracks = []
    for i in range(count):
        at = read(f"{place}/signals/{i}/nodes", "f", n, None)
        tracks.append(Track(at, read(f"{place}/signals/{i}/unknowns", "i", *at.shape)))
        if not np.all((tracks[-1].unknowns >= 0) & (tracks[-1].unknowns < w.size)):
            raise ValueError(f"{place}/signals/{i}/unknowns names values that are not there")
    row, column = (read(f"{place}/affine/{k}", "i", None) for k in ("row", "column"))
    value = read(f"{place}/affine/value", "f", row.size)
    return SavedPhase(
        name=str(part["name"]),
        start_time=start,
        final_time=final,
        time=time,
        borders=borders,
        tracks=tuple(tracks),
        w=w,
        coefficients=sparse.coo_matrix((value, (row, column)), shape=(len(lists["affine"]), count)).tocsr(),
        offsets=read(f"{place}/affine/offset", "f", len(lists["affine"])),
        nodes=nodes,
        grid=read(f"{place}/grid", "f", len(lists["others"]), n, nodes.size),
        **lists,
    )
