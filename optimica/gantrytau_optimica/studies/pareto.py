"""`pareto`: a problem solved along a weight, each time from the answer before."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Unpack

import numpy as np

from gantrytau import ModelError, SolveError
from gantrytau.border.checks import array
from gantrytau.border.refusal import USERS_ERRORS, Given, did_you_mean
from gantrytau.progress import shows_progress
from gantrytau_optimica.answers.optimum import Optimum
from gantrytau_optimica.optimize import Problem, prepare_with
from gantrytau_optimica.policy import TranscriptionKeywords, policy_of
from gantrytau_optimica.prepared import Prepared
from gantrytau_optimica.studies.continuation import Continuation, follow
from gantrytau_optimica.studies.trade_off import TradeOff

Quantity = Callable[[Optimum], float]
EQUAL = 1e-6  # relative: quantities that differ by less are the same, a hundred times Ipopt's tolerance


@shows_progress
def pareto(
    problem: Problem,
    weight: str,
    values: Sequence[float],
    *,
    along: Sequence[str] | Mapping[str, str | Quantity] | None = None,
    **policy: Unpack[TranscriptionKeywords],
) -> TradeOff:
    """Solve a problem for several values of a weight, each from the one before; it is built once.

    weight: a scalar Parameter; along: what to record, all to be small: a free number, "final_time", "objective",
    "integral(x)", "final(x)", or {label: one of these or a function of an Optimum}; default: the two parts of the
    objective, "unweighed" and "weighed" (objective = unweighed + weight * weighed). Other keywords: those of `optimize`,
    but `refine`, `starts` and `record`. A value that is not reached is approached by smaller steps; if that fails too,
    it is told in `.failures`. Raises ModelError for what is written wrongly, SolveError if no value is solved.
    """
    keywords = policy_of("pareto", TranscriptionKeywords, policy)
    numbers = array("pareto", "values", values, (None,))
    if not numbers.size or np.unique(numbers).size < numbers.size:
        raise ModelError("expected each value once", place="pareto", found=Given("values", values))
    prepared = prepare_with(problem, [weight], keywords)
    _check_weight(prepared, weight)
    asked, units = _quantities(prepared, weight, along)
    course = follow(prepared, weight, numbers.tolist())
    if not course.optima:
        first = next(iter(course.failures.values()))
        raise SolveError(f"no value of {weight} was solved; the first said: {first}", optimum=first.optimum)
    return _recorded(prepared, weight, course, asked, units)


def _recorded(
    prepared: Prepared,
    weight: str,
    course: Continuation,
    asked: Mapping[str, Quantity],
    units: dict[str, str],
) -> TradeOff:
    found = list(course.optima)
    columns = {
        label: np.array([_value(label, quantity, course.optima[w]) for w in found])
        for label, quantity in asked.items()
    }
    findings = [*course.findings, *_dominated(weight, np.array(found), columns)]
    return TradeOff(
        name=prepared.built.read.name,
        weight=weight,
        weights=np.array(found),
        points=tuple(course.optima.values()),
        quantities=columns,
        failures={w: str(error) for w, error in course.failures.items()},
        findings=tuple(findings),
        units=units,
    )


def _dominated(weight: str, weights: np.ndarray, columns: Mapping[str, np.ndarray]) -> list[str]:
    """Points to which another one is better in one quantity and no worse in the others.

    The objective is none of them: it changes with the weight by itself.
    """
    columns = {name: column for name, column in columns.items() if name != "objective"}
    table, found = np.array(list(columns.values())), []
    if len(columns) < 2:
        return found
    margin = EQUAL * np.max(np.abs(table), axis=1)[:, None]
    for k, value in enumerate(weights):
        mine = table[:, k, None]
        better = np.all(table <= mine, axis=0) & np.any(table < mine - margin, axis=0)
        if np.any(better):
            which = weights[int(np.flatnonzero(better)[0])]
            found.append(
                f"{weight} = {value:g} is dominated by {weight} = {which:g}, which is no worse in {' and '.join(columns)}: "
                "a local minimum; try another guess= or order of the values"
            )
    return found


def _check_weight(prepared: Prepared, weight: str) -> None:
    held = [n.name for n in prepared.built.problem.free if n.held]
    if held != [weight]:
        why = f"has {len(held)} elements; name one of {held}" if held else "is chosen by the optimiser"
        expected = f"expected a Parameter with one value: {weight} {why}"
        raise ModelError(expected, place="pareto", found=Given("weight", weight))


def _quantities(prepared: Prepared, weight: str, along: Any) -> tuple[dict[str, Quantity], dict[str, str]]:
    """The quantities by label, and the units of those that are free numbers, or values at the end."""
    from gantrytau.simulation.to_result import labels

    if along is None:
        return {"unweighed": lambda o: _parts(o, weight)[0], "weighed": lambda o: _parts(o, weight)[1]}, {}
    if isinstance(along, str) or not isinstance(along, (Sequence, Mapping)) or not len(along):
        expected = "expected a list of quantities or {label: quantity}"
        raise ModelError(expected, place="pareto", found=Given("along", along))
    pairs = dict(along) if isinstance(along, Mapping) else {text: text for text in along}
    known, found, units = labels(prepared.built.read.dae)[0], {}, {}
    for label, what in pairs.items():
        if callable(what):
            found[label] = what
            continue
        found[label], unit = _quantity(prepared, str(label), what, known)
        if unit:
            units[str(label)] = unit
    return found, units


def _quantity(prepared: Prepared, label: str, what: Any, known: Mapping[str, str]) -> tuple[Quantity, str]:
    name, dae = prepared.built.read.name, prepared.built.read.dae
    if not isinstance(what, str):
        raise ModelError(
            f"{label}: found {what!r}, expected a name or a function of an Optimum",
            place="along",
            argument="along",
        )
    free = {n.name for n in prepared.built.problem.free if not n.held}
    if what in free:
        return (lambda o: o.free[what]), known.get(what, "")
    if what in ("objective", "start_time", "final_time"):
        return (lambda o: float(getattr(o, what))), "" if what == "objective" else "s"
    kind, _, inner = what.removesuffix(")").partition("(")
    if kind in ("integral", "final") and what == f"{kind}({inner})":
        elements = dae.expand(inner)
        if len(elements) != 1:
            raise ModelError(
                f"{label}: {inner} has {len(elements)} elements, expected one; name it",
                place="along",
                argument="along",
            )
        if kind == "integral":
            return (lambda o: o.integral(elements[0])), f"{known[inner]}.s" if inner in known else ""
        return (lambda o: float(o.final(elements[0]))), known.get(inner, "")
    if what in dae.variables or what in dae.vectors:
        raise ModelError(
            f"{label}: {what} varies over time, expected a number; write 'final({what})' or 'integral({what})'",
            place="along",
            argument="along",
        )
    over_time = (f"{k}({n})" for n in dae.variables for k in ("integral", "final"))
    choices = [*free, "final_time", "objective", *over_time]
    raise ModelError(
        f"{label}: {name} has no quantity '{what}'{did_you_mean(what, choices)}",
        place="along",
        argument="along",
    )


def _value(label: str, quantity: Quantity, optimum: Optimum) -> float:
    try:
        value = float(quantity(optimum))
    except USERS_ERRORS as error:  # of a function that is not ours
        raise ModelError(
            f"{label}: {type(error).__name__}: {error}; expected a function from an Optimum to a number",
            place="along",
            argument="along",
        ) from error
    return value


def _parts(optimum: Optimum, weight: str) -> tuple[float, float]:
    """The objective without its weighed part, and what the weight weighs: its partial derivative."""
    program, scale = optimum.program, optimum.program.places.scale
    place = {n.name: p for n, p in zip(program.problem.free, program.places.free, strict=True)}[weight]
    gradient = np.array(program.assembled.grad_f(optimum.solution.w / scale, [])[1]).ravel()
    weighed = float(gradient[place] / scale[place])
    return optimum.objective - float(optimum.solution.w[place]) * weighed, weighed
