"""What an answer was computed from: versions, and hashes of equations and problem; values as JSON can hold them."""

import hashlib
import platform
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import version
from typing import Any

import casadi as ca
import numpy as np

from gantrytau import Samples
from gantrytau_optimica.answers.program_answer import ProgramAnswer
from gantrytau_optimica.problem.symbolic_problem import SymbolicProblem

PACKAGES = ("gantrytau", "casadi", "numpy", "scipy")
DIGITS = 16  # of a hash: two different problems meet by chance in one of 10^19 pairs


def versions() -> dict[str, str]:
    """Of the packages that compute, and of Python."""
    return {**{name: version(name) for name in PACKAGES}, "python": platform.python_version()}


def hashes(answer: ProgramAnswer) -> dict[str, str]:
    """Of the model's equations, and of the whole problem: objective, constraints, horizon, samples, values.

    Numbers count to their last bit. Values of parameters (held ones as they were for this solve) and limits belong to the
    problem, guesses to neither.
    """
    read = answer.built.read
    held = {n.name: n.guess for n in answer.program.problem.free if n.held}
    equations = _hash_of_lines(_equations(read))
    statements = _hash_of_lines(_statements(read, {**read.dae.parameter_values, **held}))
    return {"equations": equations, "problem": hash_of(equations + statements)}


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


Line = tuple[str, *tuple[Any, ...]]  # words, and expressions


def _equations(read: SymbolicProblem) -> Iterator[Line]:
    """The flat model: declarations without numbers, equations, initial equations."""
    flat = read.dae.flat
    for quantity in (*flat.variables, *flat.parameters):
        yield (f"{quantity.kind} {quantity.name} {quantity.shape} [{quantity.unit}]",)
    for name, expression in flat.definitions.items():
        yield f"{name} :=", expression
    for equation in flat.equations:
        yield "0 =", equation.residual
    for equation in flat.initial_equations:
        yield "initially 0 =", equation.residual
    yield (f"known {', '.join(read.dae.inputs)}",)


def _statements(read: SymbolicProblem, values: Mapping[str, float]) -> Iterator[Line]:
    """Objective, constraints, horizon and values."""
    yield "minimise", read.objective
    for phase in read.phases:
        yield f"phase {phase.name}", phase.start_time, phase.final_time, phase.integrand
    for point in read.points:
        words = point.time if isinstance(point.time, str) else "at"
        yield words, point.symbol, point.expression, *(() if isinstance(point.time, str) else (point.time,))
    for c in read.constraints:
        yield "equal" if c.lower is c.upper else "within", c.lower, c.expression, c.upper
    yield from ((f"link {link.first} {link.second} {link.jump}",) for link in read.links)
    for target in read.targets:
        words = f"samples {_samples(target.samples)} integrated {target.integrated}"
        yield words, target.symbol, target.expression
    for name, course in sorted(read.courses.items(), key=lambda item: item[0]):
        if isinstance(course, tuple):
            yield (f"course {name} = {_samples(course[0])} column {course[1]}",)
        else:
            yield f"course {name} =", course
    for quantity in (*read.dae.flat.variables, *read.dae.flat.parameters):
        start = quantity.start if quantity.fixed else None
        numbers = (start, quantity.min, quantity.max, quantity.nominal)
        words = f"{quantity.name} {quantity.fixed} {quantity.free} {quantity.prefer}"
        yield f"{words} {[n is not None for n in numbers]}", *(x for n in numbers for x in n or ())
    free = {n for p in read.dae.flat.parameters if p.free for n in p.elements}
    yield from ((f"{n} = {float(x).hex()}",) for n, x in sorted(values.items()) if n not in free)


def _hash_of_lines(lines: Iterable[Line]) -> str:
    """Words, and all expressions as one function of their symbols, which CasADi writes with whole numbers and tables."""
    words: list[str] = []
    expressions: list[ca.SX] = []
    for text, *found in lines:
        vectors = [ca.vec(ca.densify(ca.SX(e))) for e in found]
        words.append(f"{text} {[v.numel() for v in vectors]}")
        expressions += vectors
    whole = ca.vertcat(ca.SX(0, 1), *expressions)
    function = ca.Function("statements", [ca.vertcat(ca.SX(0, 1), *ca.symvar(whole))], [whole])
    return hash_of("\n".join([*words, function.serialize()]))


def _samples(samples: Samples) -> str:
    arrays = (samples.times, samples.values, samples.deviations)
    inside = b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)
    return f"{samples.kind} {samples.values.shape} {samples.largest_gap} {samples.weighted} {hash_of(inside)}"


def hash_of(content: str | bytes) -> str:
    """A short hash of a text or of bytes."""
    data = content.encode() if isinstance(content, str) else content
    return hashlib.sha256(data).hexdigest()[:DIGITS]
