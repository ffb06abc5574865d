"""What is said of an answer of an optimisation: how it ended, its free numbers, its phases and variables."""

from typing import Any

from gantrytau import Description
from gantrytau.describing.described import Listing
from gantrytau.describing.short_values import number, short
from gantrytau.results.described_result import series_described


def answer_described(answer: Any, name: str = "") -> Description:
    """What is said of an answer, or of one variable or free number of it; ModelError for a name that is not there."""
    if name:
        return _of_name(answer, name)
    kind = type(answer).__name__
    facts = (
        ("ended", f"{answer.status}{'' if answer.success else ', which is no success'}"),
        ("objective", f"{answer.objective:.8g}"),
        ("horizon", f"{number(answer.start_time)} to {number(answer.final_time)} s"),
        (
            "work",
            f"{answer.iterations} iterations, {answer.build_time:.2g} s to build, {answer.solve_time:.2g} s to solve",
        ),
    )
    units, words = answer.labels
    free = [
        (name, number(value), _plain(units.get(name, "")), words.get(name, ""))
        for name, value in answer.free.items()
    ]
    tables = [Listing.of("Free numbers", ("name", "value", "unit", "description"), free)]
    if len(answer.phases) > 1:
        rows = [(n, number(p.start_time), number(p.final_time)) for n, p in answer.phases.items()]
        tables.append(Listing.of("Phases", ("name", "from s", "to s"), rows))
    for path, result in answer.by_phase.items():
        (listing,) = series_described(result).tables
        heading = f"{listing.heading} of {path}" if path else listing.heading
        tables.append(Listing(heading, listing.columns, listing.rows))
    return Description(answer.name, kind, "", facts, tuple(tables))


def _plain(unit: str) -> str:
    return "" if unit == "1" else unit


def _of_name(answer: Any, name: str) -> Description:
    values = answer[name]  # an unknown name raises
    for result in answer.by_phase.values():
        if name in result:
            return series_described(result, name)
    units, words = answer.labels
    facts = (("value", short(values)), ("unit", units.get(name, "") or "1"))
    kind = "free number" if name in answer.free else "variable"
    return Description(name, f"{kind} of {answer.name}", words.get(name, ""), facts)
