"""How commands speak: results and errors as sentences or as JSON, exit codes, lines of the user's own file."""

import errno
import math
import os
import sys
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

import typer
from typer.core import TyperGroup

from gantrytau import GantryTauError, heeding_interrupts
from gantrytau.border import NotLoaded, python_error, user_lines
from gantrytau.commands.printing.help_pages import tidy
from gantrytau.commands.printing.spelling import Spelling

FAULT = 1  # exit code: the model has a fault, or its simulation stopped
MISUSE = 2  # exit code: the command was called wrongly, or a file cannot be read or written
INTERRUPTED = 130  # exit code of a program stopped by Ctrl-C

USAGE_ERROR: Any = typer.BadParameter.__mro__[1]  # of Click, which some versions of Typer bring along
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # an output that takes no more


_PLAINLY = {
    "Input should be a valid number, unable to parse string as a number": "expected a number, as 0.5",
    "Input should be a valid integer, unable to parse string as an integer": "expected a whole number",
    "Input should be a valid integer, got a number with a fractional part": "expected a whole number",
    "Input should be greater than or equal to": "expected at least",
    "Input should be less than or equal to": "expected at most",
}
PLAIN = Spelling((), {})


class CommandError(GantryTauError):
    """The command was called with something that it cannot use."""


class Commands(TyperGroup):
    """All commands; an output that takes no more, as a full disk, ends them with a message instead of a traceback.

    Arguments and options that do not exist or are missing are told as JSON where `--json` is among them.
    """

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """A command by its name, with a help page for readers."""
        command = super().get_command(ctx, cmd_name)
        if command is not None:
            tidy(command)
            for below in getattr(command, "commands", {}).values():
                tidy(below)
        return command

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The page of all commands."""
        tidy(self)
        super().format_help(ctx, formatter)

    def invoke(self, ctx: Any) -> Any:
        """Run a command, and see to it that all it printed has arrived."""
        json = "--json" in [*getattr(ctx, "_protected_args", ()), *ctx.args]
        try:
            try:
                with heeding_interrupts():
                    return super().invoke(ctx)
            finally:
                if sys.stdout is not None:  # it may be closed
                    sys.stdout.flush()
        except USAGE_ERROR as error:
            error.message = in_plain_words(error.message)
            if not json:
                raise
            fail(error.format_message(), MISUSE, json)
        except OSError as error:
            if error.filename is not None or error.errno not in FULL:
                raise
            _drop_output()
            note(f"Cannot write: {error.strerror}; make room, or send the output to another place")
            raise typer.Exit(MISUSE) from None


def in_plain_words(message: str) -> str:
    """What Typer says of a value that is none, without the parsing of strings."""
    for said, here in _PLAINLY.items():
        message = message.replace(said, here)
    return message


def _drop_output() -> None:
    """Let what is left in the buffer of stdout vanish; Python would complain of it at its end."""
    with suppress(OSError, ValueError, AttributeError):  # stdout need not be a file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def reporting(json: bool, source: Path | None = None, spelling: Spelling = PLAIN) -> Iterator[None]:
    """Errors inside become a message and an exit code instead of a traceback.

    json: print `{"error": ...}`; source: the user's file, of which the lines that failed are shown; spelling: how
    arguments are written here, of which one that is wrong means that the command was called wrongly.
    An error that comes neither from the toolkit nor from `source` is a bug of the toolkit and passes.
    """
    try:
        yield
    except (CommandError, NotLoaded) as error:
        told = isinstance(error.__cause__, GantryTauError)  # in the words of the library
        fail(spelling.words(str(error)) if told else str(error), MISUSE, json)
    except GantryTauError as error:
        place = "".join(f"\n  {line}" for line in user_lines(error, source)[-1:])
        code = MISUSE if error.argument in spelling.options else FAULT
        fail(f"{spelling.of(error)}{place}", code, json, kind=type(error).__name__)
    except KeyboardInterrupt:
        fail("Interrupted; nothing was written", INTERRUPTED, json)
    except (SystemExit, typer.Exit):
        raise
    except Exception as error:
        lines = user_lines(error, source)
        if not lines:
            raise
        fail(python_error(error, lines), FAULT, json, kind=type(error).__name__)


@contextmanager
def refusing(beginning: str = "") -> Iterator[None]:
    """Errors of the toolkit inside mean that the command was called with something that it cannot use."""
    try:
        yield
    except (CommandError, NotLoaded):
        raise
    except GantryTauError as error:
        raise CommandError(f"{beginning}{error}") from error


def fail(message: str, code: int, json: bool, **more: Any) -> NoReturn:
    """Say what is wrong, on stdout as JSON or else on stderr, and leave with an exit code."""
    if json:
        typer.echo(as_json({"error": message, **more}))
    else:
        typer.echo(message, err=True)
    raise typer.Exit(code) from None


def note(message: str) -> None:
    """Something worth knowing beside the output, on stderr."""
    typer.echo(message, err=True)


def as_json(value: Any) -> str:
    """JSON text; numbers that are not finite become null, which JSON can say."""
    import json

    return json.dumps(_finite(value), indent=2, allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(item) for item in value]
    return value


@contextmanager
def busy(words: str) -> Iterator[None]:
    """A turning sign on the terminal while something takes its time."""
    from rich.console import Console

    with Console(file=sys.stderr).status(words):
        yield


def write_text(text: str, file: Path) -> None:
    """Write a text file whole; CommandError if that is not possible."""
    from gantrytau import replacing

    with writable(file), replacing(file) as partial:
        partial.write_text(text, encoding="utf-8")


def writable_place(option: str, file: Path | None, *suffixes: str) -> None:
    """CommandError, before the work, for a file of another suffix or in a folder that is not there; None is none."""
    if file is None:
        return
    if file.is_dir():
        raise CommandError(f"{option} {file} is a folder, expected the name of a file in it")
    if file.suffix.lower() not in suffixes:
        raise CommandError(
            f"{option} {file}: found the suffix '{file.suffix}', expected {' or '.join(suffixes)}"
        )
    if not file.absolute().parent.is_dir():
        raise CommandError(f"{option} {file}: the folder '{file.parent}' does not exist; create it first")


@contextmanager
def writable(file: Path) -> Iterator[None]:
    """Whatever prevents writing `file` becomes a CommandError with a remedy."""
    try:
        if file.is_dir():
            raise CommandError(f"{file} is a folder, expected the name of a file in it")
        with refusing():  # from the writers of results: folder, suffix, extra
            yield
    except OSError as error:
        raise CommandError(f"Cannot write {file}: {error.strerror}; name another place") from error


@contextmanager
def noted(kind: type[Warning], told: list[str], json: bool, spelling: Spelling = PLAIN) -> Iterator[None]:
    """While it lasts, warnings of a kind become lines of `told`, printed at once, or with the JSON."""

    def hear(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if not issubclass(category, kind):
            show(message, category, *where, **more)
            return
        told.append(spelling.words(str(message)))
        if not json:
            note(f"Note: {told[-1]}")

    with warnings.catch_warnings():
        warnings.simplefilter("always", kind)
        show, warnings.showwarning = warnings.showwarning, hear
        yield
