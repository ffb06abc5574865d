"""Everything the toolkit raises on purpose. Each message says path, found, expected, remedy."""

import difflib
import linecache
import re
import traceback
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

HINTS = {
    "truth value": "Python's if, and, or, max, chained comparisons and lists cannot work on symbols; use if_else, between, "
    "logic_and, logic_or, logic_not, casadi.fmax, casadi.vertcat",
    "Dimension mismatch": "the two operands have different shapes",
    "not iterable": "a method yields its equations one by one: `yield a == b`",
    "Wrong number or type of arguments": "found something that is no number or expression among symbols; join lists with "
    "casadi.vertcat(*list)",
}


USERS_ERRORS = (
    Exception,
    SystemExit,
)  # what code of users raises: its sys.exit ends the call, not the caller


class GantryTauError(Exception):
    """Base class of all errors of this toolkit.

    argument: the argument of the called function that is wrong, by name, where it is one. Messages write arguments as
    Python does, `loss='robust'`; a command line, which has options instead, names its own by these.
    """

    def __init__(self, message: str = "", *, argument: str | None = None):
        super().__init__(message)
        self.argument = argument


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

    @property
    def interrupted(self) -> bool:
        """Whether it stopped because Ctrl-C was pressed."""
        status = getattr(self.optimum, "status", "")
        pressed = isinstance(self.__cause__ or self.__context__, KeyboardInterrupt)
        return pressed or status == "interrupted"


class DoubtfulResult(UserWarning):
    """A result holds values that are no numbers, or beyond all measure; the message names them and their first time."""


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


def in_words(error: BaseException) -> str:
    """What an error of Python or CasADi says, in one line, with a remedy where one is known."""
    if isinstance(error, AttributeError) and error.obj is not None and error.name:
        names = [n for n in dir(error.obj) if not n.startswith("_")]
        owner = getattr(error.obj, "__name__", type(error.obj).__name__)
        return f"{owner} has no '{error.name}'{did_you_mean(error.name, names)}"
    if isinstance(error, (IndexError, RuntimeError)) and re.search("out of (range|bounds)", str(error), re.I):
        return _index_in_words(error)
    lines = [line for line in str(error).splitlines() if line.strip()] or [repr(error)]
    if "Assertion" in lines[0] and len(lines) > 1:
        lines = lines[1:]
    words = lines[0].split(": ", 1)[-1] if ".cpp:" in lines[0] or ".hpp:" in lines[0] else lines[0]
    return "; ".join([words.rstrip("."), *(text for key, text in HINTS.items() if key in str(error))][:2])


def _index_in_words(error: BaseException) -> str:
    """An index out of an array: as the array and the index are written, and what there is."""
    sliced = re.search(r"start=(-?\d+), stop=(-?\d+).*supplied length of (\d+)", str(error))
    words = "out of bounds; expected an index below the length, from 0"
    if sliced:
        start, stop, length = map(int, sliced.groups())
        index = f"{start}" if stop == start + 1 else f"{start}:{stop}"
        words = f"out of bounds with supplied length of {length}: found the index {index}, expected 0 to {length - 1}"
    for frame in reversed(traceback.extract_tb(error.__traceback__)):
        line = linecache.getline(frame.filename, frame.lineno or 0).encode()  # columns are those of bytes
        written = line[frame.colno or 0 : frame.end_colno or 0].decode(errors="replace")
        if "site-packages" not in frame.filename and written.endswith("]"):
            return f"`{written}` is {words}"
    return words


def user_lines(error: BaseException | None, source: Path | None) -> list[str]:
    """The lines of the user's file through which an error, or its cause, came: `robot.py, line 3: ...`."""
    found: list[str] = []
    while error is not None and source is not None:
        if isinstance(error, SyntaxError) and error.filename == str(source):
            found.append(f"{source.name}, line {error.lineno}: {(error.text or '').strip()}")
        for frame in traceback.extract_tb(error.__traceback__):
            if frame.filename == str(source):
                found.append(f"{source.name}, line {frame.lineno}: {frame.line}")
        error = error.__cause__
    return list(dict.fromkeys(found))


def python_error(error: BaseException, lines: list[str]) -> str:
    """The class and the message of a Python error, then the user's lines on the way to it, outermost first."""
    message = error.msg if isinstance(error, SyntaxError) else str(error)
    return "\n  ".join([f"{type(error).__name__}: {message}".removesuffix(": "), *lines])


def told(place: str, evaluate: Callable[[], Any], within: str | None = None) -> Any:
    """The value of `evaluate()`; what is raised there is told with the place where it happened.

    within: the path of a component; an error of the toolkit that names it or a part of it says its place itself.
    """
    try:
        return evaluate()
    except GantryTauError as error:
        if within is not None and str(error).startswith((f"{within} (", f"{within}:", f"{within}.")):
            raise
        raise type(error)(f"{place}: {error}") from error
    except USERS_ERRORS as error:  # of statements that are not ours
        raise ModelError(f"{place}: {in_words(error)}") from error
