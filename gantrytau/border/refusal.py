"""Everything the toolkit raises on purpose. Each message says path, found, expected, remedy."""

import difflib
import linecache
import re
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

HINTS = {
    "truth value": "Python's if, and, or, max, chained comparisons and lists cannot work on symbols; use if_else, between, "
    "logic_and, logic_or, logic_not, casadi.fmax, casadi.vertcat",
    "Dimension mismatch": "the two operands have different shapes",
    "not iterable": "a method yields its equations one by one: `yield a == b`",
    "Wrong number or type of arguments": "found something that is no number or expression among symbols; join lists with "
    "casadi.vertcat(*list)",
}

# what code of users raises: its sys.exit ends the call, not the caller
USERS_ERRORS = (Exception, SystemExit)
LONGEST = 60  # characters of a value in a message


@dataclass(frozen=True)
class Given:
    """An argument of a function with its value, or without: `loss='robust'` or `loss=` in Python, `--robust` in a shell."""

    name: str
    value: Any = ...

    def __str__(self) -> str:
        return f"{self.name}=" if self.value is ... else f"{self.name}={short(self.value)}"


class Sentence(str):
    """A text that keeps its parts: an argument of the called function in it is a `Given`, as in an error."""

    parts: tuple[str | Given, ...]

    def __new__(cls, *parts: str | Given) -> Self:
        made = super().__new__(cls, "".join(map(str, parts)))
        made.parts = parts
        return made


class GantryTauError(Exception):
    """Base class of all errors of this toolkit.

    parts: the message, in which an argument of the called function is a `Given`; place: the function or the path that is
    wrong; found: the wrong argument with its value; argument: its name alone. The message is put together when it is
    printed, `place: found loss='robst', expected 'linear' or 'robust'`, so that a command line can write its options.
    """

    def __init__(
        self, *parts: str | Given, place: str = "", found: Given | None = None, argument: str | None = None
    ):
        super().__init__(*parts)
        self.parts = parts
        self.place = place
        self.found = found
        self.argument = argument if found is None else found.name

    def __str__(self) -> str:
        place = f"{self.place}: " if self.place else ""
        found = f"found {self.found}, " if self.found else ""
        return place + found + self.words(str)

    def words(self, write: Callable[[Given], str]) -> str:
        """The parts of the message as text; `write` gives the text of an argument."""
        return "".join(write(part) if isinstance(part, Given) else str(part) for part in self.parts)

    def within(self, place: str) -> Self:
        """The same error at a place that lies around its own."""
        around = copy(self)
        around.place = f"{place}: {self.place}" if self.place else place
        return around

    def _render_traceback_(self) -> list[str]:
        """What IPython prints: the user's frames alone, of its causes as well; `raise` keeps all of them."""
        from IPython.core.getipython import get_ipython

        shell: Any = get_ipython()
        whole = {error: error.__traceback__ for error in _chain(self)}
        try:
            for error, trace in whole.items():
                error.__traceback__ = _of_users(trace)
            trace, offset = self.__traceback__, shell.InteractiveTB.tb_offset
            return shell.InteractiveTB.structured_traceback(type(self), self, trace, tb_offset=offset)
        finally:
            for error, trace in whole.items():
                error.__traceback__ = trace


class ModelError(GantryTauError):
    """A model, a name or a value is written wrongly."""


class StructureError(GantryTauError):
    """The equations of a model cannot determine its unknowns."""


class InitializationError(GantryTauError):
    """No consistent start was found; the message lists the worst residuals by name.

    residuals: what is left of the equations that do not hold, by name.
    """

    def __init__(self, *parts: str | Given, residuals: Mapping[str, float] | None = None, **facts: Any):
        super().__init__(*parts, **facts)
        self.residuals = dict(residuals or {})


class SolveError(GantryTauError):
    """A simulation or optimisation stopped before its end.

    time: where it stopped in s, or None; equations: the names of the equations that degenerated;
    result: the partial result, or None; optimum: the unfinished optimum of an optimisation, or None.
    """

    def __init__(self, *parts: str | Given, time=None, equations=(), result=None, optimum=None, **facts: Any):
        super().__init__(*parts, **facts)
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


def short(value: Any) -> str:
    """The `repr` of a value in one line, at most 60 characters; the class of an object without a `repr` of its own."""
    text = " ".join(repr(value.tolist() if hasattr(value, "tolist") else value).split())
    text = re.sub(r"<(?:[\w<>]+\.)*([\w<>]+) (?:object )?at 0x[0-9a-fA-F]+>", r"<\1>", text)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."


def did_you_mean(wrong: str, names: Iterable[str], describe=None) -> str:
    """The closest of `names` as a question that ends a message, or what there is if none is close.

    describe: a function from a name to words set in parentheses behind it.
    """
    names = list(dict.fromkeys(names))
    close = [name for name in names if name.lower() == wrong.lower()]
    close = close or difflib.get_close_matches(wrong, names, n=1, cutoff=0.5)
    if close:
        words = describe(close[0]) if describe else ""
        return f"; did you mean '{close[0]}'{f' ({words})' if words else ''}?"
    shown = ", ".join(names[:12]) + (", ..." if len(names) > 12 else ".")
    return f"; there is {shown}" if names else "."


def meant(wrong: str, words: Iterable[str]) -> str:
    """The closest of a few words as a question for the end of a message; "" if none is close."""
    asked = did_you_mean(wrong, words)
    return asked if "did you mean" in asked else ""


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


def _chain(error: BaseException | None) -> Iterator[BaseException]:
    """An error and what led to it, as Python tells them."""
    while error is not None:
        yield error
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)


def _of_users(trace: TracebackType | None) -> TracebackType | None:
    """A traceback without the frames of this toolkit, and of the context managers in which it tells errors."""
    if trace is None:
        return None
    rest = _of_users(trace.tb_next)
    package = str(trace.tb_frame.f_globals.get("__name__")).split(".")[0]
    if package.startswith("gantrytau") or package == "contextlib":
        return rest
    return TracebackType(rest, trace.tb_frame, trace.tb_lasti, trace.tb_lineno)


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
        raise error.within(place) from error
    except USERS_ERRORS as error:  # of statements that are not ours
        raise ModelError(f"{place}: {in_words(error)}") from error
