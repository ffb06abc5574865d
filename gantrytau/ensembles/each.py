"""One function for many arguments, as part of a longer call: the first here, the rest on all processors where that pays."""

from collections.abc import Callable, Iterator, Sequence
from time import perf_counter
from typing import Any, TypeVar

from gantrytau.ensembles.cases import Case
from gantrytau.ensembles.workers.places import PROCESSES, outcomes
from gantrytau.ensembles.workers.worker import within_a_case
from gantrytau.errors import GantryTauError

WORTH = 4.0  # s, twice what processes take to begin

Argument = TypeVar("Argument")
Value = TypeVar("Value")


def each(function: Callable[[Argument], Value], arguments: Sequence[Argument]) -> Iterator[tuple[int, Value]]:
    """The place of each argument and the value there, as they are finished; alike wherever they are computed.

    Raises what the function raises here, and GantryTauError with its words where it is raised in another process.
    """
    begin = perf_counter()
    for place, argument in enumerate(arguments[:1]):
        yield place, function(argument)
    left = range(1, len(arguments))
    if within_a_case() or (perf_counter() - begin) * len(left) < WORTH:
        for place in left:
            yield place, function(arguments[place])
        return
    cases = [Case(place, (place,), {"argument": arguments[place]}) for place in left]
    for outcome in outcomes(_Called(function), cases, PROCESSES):
        if not outcome.good:
            raise GantryTauError(f"{outcome.kind}: {outcome.error}")
        yield outcome.number, outcome.value


class _Called:
    """A function of an argument as the task of a case."""

    def __init__(self, function: Callable[[Any], Any]):
        self.function = function

    def __call__(self, case: Case) -> Any:
        return self.function(case.chosen["argument"])
