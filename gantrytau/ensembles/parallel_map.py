"""One function for many arguments, as part of a longer call: the first here, the rest on all processors where that pays."""

from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from time import process_time
from typing import Any, TypeVar

from gantrytau.border.refusal import GantryTauError
from gantrytau.ensembles.cases import Case
from gantrytau.ensembles.workers.places import PROCESSES, outcomes
from gantrytau.ensembles.workers.worker import within_a_case

WORTH = 4.0  # s of a processor, twice what processes take to begin; by the wall a busy machine would begin more of them

Argument = TypeVar("Argument")
Value = TypeVar("Value")


def each(
    function: Callable[[Argument], Value], arguments: Iterable[Argument], count: int
) -> Iterator[tuple[int, Value]]:
    """The place of each argument and the value there, as they are finished; alike wherever they are computed.

    count: of arguments, at most. Raises what the function raises; errors that are not of the toolkit come from another
    process as a GantryTauError with their words.
    """
    left = iter(enumerate(arguments))
    begin = process_time()
    for place, argument in islice(left, 1):
        yield place, function(argument)
    if within_a_case() or (process_time() - begin) * (count - 1) < WORTH:
        for place, argument in left:
            yield place, function(argument)
        return
    cases = [Case(place, (place,), {"argument": argument}) for place, argument in left]
    for outcome in outcomes(_Called(function), cases, PROCESSES):
        if not outcome.good:
            raise GantryTauError(f"{outcome.kind}: {outcome.error}")
        value, error = outcome.value
        if error is not None:
            raise error
        yield outcome.number, value


class _Called:
    """A function of an argument as the task of a case, which gives the value or the error of the toolkit."""

    def __init__(self, function: Callable[[Any], Any]):
        self.function = function

    def __call__(self, case: Case) -> tuple[Any, GantryTauError | None]:
        try:
            return self.function(case.chosen["argument"]), None
        except GantryTauError as error:
            if getattr(error, "interrupted", False):
                raise
            return None, error
