"""Everything the toolkit raises on purpose. Each message says path, found, expected, remedy."""

import difflib
from collections.abc import Iterable, Mapping
from typing import Any


class GantryTauError(Exception):
    """Base class of all errors of this toolkit."""


class ModelError(GantryTauError):
    """A model, a name or a value is written wrongly."""


class StructureError(GantryTauError):
    """The equations of a model cannot determine its unknowns."""


class InitializationError(GantryTauError):
    """No consistent start was found; the message lists the worst residuals by name.

    residuals: what is left of the equations that do not hold, by name.
    """

    def __init__(self, message: str, *, residuals: Mapping[str, float] | None = None):
        super().__init__(message)
        self.residuals = dict(residuals or {})


class SolveError(GantryTauError):
    """A simulation or optimisation stopped before its end.

    time: where it stopped in s, or None; equations: the names of the equations that degenerated;
    result: the partial result, or None; optimum: the unfinished optimum of an optimisation, or None.
    """

    def __init__(self, message: str, *, time=None, equations=(), result=None, optimum=None):
        super().__init__(message)
        self.time: Any = time
        self.equations = tuple(equations)
        self.result: Any = result
        self.optimum: Any = optimum


def did_you_mean(wrong: str, names: Iterable[str], describe=None) -> str:
    """The closest of `names` as a question that ends a message, or what there is if none is close.

    describe: a function from a name to words set in parentheses behind it.
    """
    names = list(names)
    close = difflib.get_close_matches(wrong, names, n=1, cutoff=0.5)
    if close:
        words = describe(close[0]) if describe else ""
        return f"; did you mean '{close[0]}'{f' ({words})' if words else ''}?"
    shown = ", ".join(names[:12]) + (", ..." if len(names) > 12 else "")
    return f"; there is {shown}." if names else "."
