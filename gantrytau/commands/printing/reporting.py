"""How commands speak: results and errors as sentences or as JSON, exit codes, lines of the user's own file."""

import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

import typer

from gantrytau import GantryTauError
from gantrytau.border import NotLoaded, python_error, user_lines
from gantrytau.commands.printing.spelling import RUNNING, spelled, worded
from gantrytau.describing import Progress

FAULT = 1  # exit code: the model has a fault, or its simulation stopped
MISUSE = 2  # exit code: the command was called wrongly, or a file cannot be read or written
INTERRUPTED = 130  # exit code of a program stopped by Ctrl-C


class CommandError(GantryTauError):
    """The command was called with something that it cannot use."""


@contextmanager
def reporting(
    json: bool, source: Path | None = None, names: Mapping[str, str] | None = None
) -> Iterator[None]:
    """Errors inside become a message and an exit code instead of a traceback.

    json: print `{"error": ...}`; source: the user's file, of which the lines that failed are shown; names: options, or
    keys of a file, of arguments that have another name here. An argument that is wrong means that the command was called
    wrongly. An error that comes neither from the toolkit nor from `source` is a bug of the toolkit and passes.
    """
    spelling = RUNNING.get().with_names(names or {})
    token = RUNNING.set(spelling)
    try:
        yield
    except (CommandError, NotLoaded) as error:
        fail(str(error), MISUSE, json)
    except GantryTauError as error:
        place = "".join(f"\n  {line}" for line in user_lines(error, source)[-1:])
        code = MISUSE if error.argument in spelling.options else FAULT
        fail(f"{spelled(error)}{place}", code, json, kind=type(error).__name__)
    except KeyboardInterrupt:
        fail("Interrupted; nothing was written", INTERRUPTED, json)
    except (SystemExit, typer.Exit):
        raise
    except Exception as error:
        lines = user_lines(error, source)
        if not lines:
            raise
        fail(python_error(error, lines), FAULT, json, kind=type(error).__name__)
    finally:
        RUNNING.reset(token)


@contextmanager
def refusing(beginning: str = "") -> Iterator[None]:
    """Errors of the toolkit inside mean that the command was called with something that it cannot use."""
    try:
        yield
    except (CommandError, NotLoaded):
        raise
    except GantryTauError as error:
        raise CommandError(f"{beginning}{spelled(error)}") from error


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


def answered(
    json: bool, record: Mapping[str, Any], report: str | Callable[[], None] | None, files: Iterable[Any] = ()
) -> None:
    """The end of a command: the record with its files as JSON, or the report, as a text or printed, and the files."""
    written = [str(file) for file in files if file is not None]
    if json:
        typer.echo(as_json({**record, "files": written}))
        return
    if isinstance(report, str):
        typer.echo(report)
    elif report is not None:
        report()
    for file in written:
        typer.echo(f"Written: {file}")


def as_json(value: Any) -> str:
    """JSON text; numbers that are not finite become null, which JSON can say, arrays lists, and paths texts."""
    import json

    return json.dumps(_plain(value), indent=2, allow_nan=False)


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # of NumPy
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, Path) else value


def print_table(headings: Sequence[str], rows: Iterable[Sequence[str]], right: Sequence[int] = ()) -> None:
    """A table on the terminal; texts are no markup. right: columns of numbers, by default all but the first."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE, pad_edge=False)
    for k, heading in enumerate(headings):
        numbers = k in right if right else k > 0
        table.add_column(heading, justify="right" if numbers else "left", no_wrap=numbers, overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    Console().print(table)


def busy(words: str, quiet: bool = False) -> Progress:
    """A line on the terminal while something takes its time, none if quiet."""
    return Progress(words, wanted=not quiet)


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


def written(file: Path | None, write: Callable[[Path], Any]) -> list[Path]:
    """Write a file, if one is named; the files written."""
    if file is None:
        return []
    with writable(file):
        write(file)
    return [file]


@contextmanager
def noted(kind: type[Warning], told: list[str], json: bool) -> Iterator[None]:
    """While it lasts, warnings of a kind become lines of `told`, printed at once, or with the JSON."""

    def hear(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if not issubclass(category, kind):
            show(message, category, *where, **more)
            return
        told.append(worded(message.args[0] if isinstance(message, Warning) else message))
        if not json:
            note(f"Note: {told[-1]}")

    with warnings.catch_warnings():
        warnings.simplefilter("always", kind)
        show, warnings.showwarning = warnings.showwarning, hear
        yield
