"""What an answer was computed from: versions, and hashes of equations and problem; values as JSON can hold them."""

import hashlib
import platform
from collections.abc import Iterator, Mapping
from importlib.metadata import version
from typing import Any

import numpy as np

from gantrytau_optimica.answers.program_answer import ProgramAnswer
from gantrytau_optimica.problem.symbolic_problem import SymbolicProblem

PACKAGES = ("gantrytau", "casadi", "numpy", "scipy")
DIGITS = 16  # of a hash: two different problems meet by chance in one of 10^19 pairs


def versions() -> dict[str, str]:
    """Of the packages that compute, and of Python."""
    return {**{name: version(name) for name in PACKAGES}, "python": platform.python_version()}


def hashes(answer: ProgramAnswer) -> dict[str, str]:
    """Of the model's equations as they are written, and of the whole problem: objective, constraints, horizon.

    Values of parameters and limits belong to the problem, guesses to neither.
    """
    read = answer.built.read
    equations = "\n".join(_equations(read))
    return {
        "equations": hash_of(equations),
        "problem": hash_of(f"{equations}\n" + "\n".join(_statements(read))),
    }


def plain(value: Any) -> Any:
    """A value of dictionaries, lists, strings, booleans, None and finite numbers; others become words."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [plain(v) for v in (sorted(value, key=str) if isinstance(value, (set, frozenset)) else value)]
    if isinstance(value, (np.ndarray, np.generic)):
        return plain(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else str(value)


def _equations(read: SymbolicProblem) -> Iterator[str]:
    """The flat model in lines: declarations without numbers, equations, initial equations."""
    flat = read.dae.flat
    for quantity in (*flat.variables, *flat.parameters):
        yield f"{quantity.kind} {quantity.name} {quantity.shape} [{quantity.unit}]"
    yield from (f"{name} := {expression}" for name, expression in flat.definitions.items())
    yield from (f"{equation.text}" for equation in flat.equations)
    yield from (f"initially {equation.text}" for equation in flat.initial_equations)
    yield f"known {', '.join(read.dae.inputs)}"


def _statements(read: SymbolicProblem) -> Iterator[str]:
    """Objective, constraints, horizon and values in lines."""
    yield f"minimise {read.objective}"
    for phase in read.phases:
        yield f"phase {phase.name} from {phase.start_time} to {phase.final_time}, integrand {phase.integrand}"
    yield from (f"point {p.symbol} of {p.expression} at {p.time}" for p in read.points)
    yield from (f"{c.lower} <= {c.expression} <= {c.upper}" for c in read.constraints)
    yield from (f"link {link.first} {link.second} {link.jump}" for link in read.links)
    for target in read.targets:
        yield f"samples {target.symbol} of {target.expression} {_samples(target.samples)} {target.integrated}"
    for name, course in sorted(read.courses.items(), key=lambda item: item[0]):
        words = f"{_samples(course[0])} column {course[1]}" if isinstance(course, tuple) else str(course)
        yield f"course {name} = {words}"
    for quantity in (*read.dae.flat.variables, *read.dae.flat.parameters):
        start = quantity.start if quantity.fixed else None
        yield f"{quantity.name} {quantity.fixed} {start} {quantity.min} {quantity.max} {quantity.free}"
    free = {n for p in read.dae.flat.parameters if p.free for n in p.elements}
    yield from (f"{n} = {x!r}" for n, x in sorted(read.dae.parameter_values.items()) if n not in free)


def _samples(samples: Any) -> str:
    return hash_of(b"".join(np.ascontiguousarray(a).tobytes() for a in (samples.times, samples.values)))


def hash_of(content: str | bytes) -> str:
    """A short hash of a text or of bytes."""
    data = content.encode() if isinstance(content, str) else content
    return hashlib.sha256(data).hexdigest()[:DIGITS]
