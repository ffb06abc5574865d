"""A group of commands: each is imported when it is called, and what goes wrong before it begins is told as it tells."""

import ast
import errno
import os
import re
import sys
from collections.abc import Mapping
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from gantrytau import heeding_interrupts
from gantrytau.border import meant
from gantrytau.commands.printing.help_pages import tidy
from gantrytau.commands.printing.reporting import MISUSE, fail, note
from gantrytau.commands.printing.spelling import RUNNING, Spelling

USAGE_ERROR: Any = typer.BadParameter.__mro__[1]  # of Click, which some versions of Typer bring along
MISSING: Any = next(c for c in typer.BadParameter.__subclasses__() if c.__name__ == "MissingParameter")
NAMED = ("MODEL", "PROBLEM")  # what has its name in an argument or option may stand in Modelica text
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)  # an output that takes no more
PLAINLY = {
    "Input should be a valid number, unable to parse string as a number": "expected a number, as 0.5",
    "Input should be a valid integer, unable to parse string as an integer": "expected a whole number",
    "Input should be a valid integer, got a number with a fractional part": "expected a whole number",
    "Input should be greater than or equal to": "expected at least",
    "Input should be less than or equal to": "expected at most",
    "Value error, ": "",
}


class Commands(TyperGroup):
    """Commands by name; an output that takes no more, as a full disk, ends them with a message instead of a traceback.

    Arguments and options that do not exist or are missing are told as JSON where `--json` is among them.
    places: name -> the module below `gantrytau.commands` with the function of that name, or a group, `app`; and an example.
    """

    places: Mapping[str, tuple[str, str]] = {}
    listing = False  # whether first lines of modules will do

    def list_commands(self, ctx: Any) -> list[str]:
        """The names, in the order of the list."""
        return [*self.places]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """A command by its name, with a help page for readers; None where there is none."""
        if cmd_name not in self.places:
            return None
        if self.listing:
            return TyperCommand(cmd_name, help=_first_line(cmd_name, self.places[cmd_name][0]))
        if cmd_name not in self.commands:
            self.commands[cmd_name] = _loaded(cmd_name, *self.places[cmd_name])
        return self.commands[cmd_name]

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """The command that the arguments begin with, in whose words errors are told from now on."""
        if args and args[0] not in self.places:
            self.commands = dict.fromkeys(self.places)  # one of them may have been meant
        found = super().resolve_command(ctx, args)
        RUNNING.set(Spelling.of(found[1]))
        return found

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The page of all commands."""
        tidy(self)
        self.listing = True
        super().format_help(ctx, formatter)
        self.listing = False

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """Names of commands that begin so."""
        self.listing = True
        found = super().shell_complete(ctx, incomplete)
        self.listing = False
        return found

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
            begins = any(p.name == "example" for p in error.ctx.command.params) if error.ctx else False
            if begins and isinstance(error, MISSING) and error.param.param_type_name == "argument":
                error.message = f"`{error.ctx.command_path} --example` prints one to begin with"
            for said, here in PLAINLY.items():
                error.message = error.message.replace(said, here)
            if (
                " is not one of " in error.message and "did you mean" not in error.message
            ):  # a group in a group
                found, *words = re.findall("'([^']*)'", error.message)
                error.message = error.message.rstrip(".") + (meant(found, words) or ".")
            if not json:
                raise
            fail(error.format_message(), MISUSE, json)
        except OSError as error:
            if error.filename is not None or error.errno not in FULL:
                raise
            _drop_output()
            note(f"Cannot write: {error.strerror}; make room, or send the output to another place")
            raise typer.Exit(MISUSE) from None


def group(words: str, places: Mapping[str, tuple[str, str]]) -> typer.Typer:
    """Commands under one name."""
    app = typer.Typer(
        cls=type("Group", (Commands,), {"places": places}),
        help=words,
        no_args_is_help=True,
        pretty_exceptions_show_locals=False,
    )
    app.callback()(_nothing)
    return app


def _nothing() -> None:
    pass


def _loaded(name: str, place: str, example: str) -> Any:
    """The command, or the group of commands, in a module."""
    module = import_module(f"gantrytau.commands.{place}")
    if hasattr(module, "app"):
        found = typer.main.get_group(module.app)
    else:
        alone = typer.Typer(add_completion=False)
        alone.command(name, epilog=f"Example: {example}")(getattr(module, name))
        found = typer.main.get_command(alone)
        if any(one.metavar in NAMED for one in found.params):
            found.params.append(_library_option())
    tidy(found)
    return found


def _look_in(
    context: typer.Context,
    library: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FOLDER",
            help="Look here for packages that Modelica text needs, before MODELICAPATH. Repeatable.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """`--library`: load_modelica, here and in the processes of this command, looks in some folders first while it runs."""
    old = os.environ.get("MODELICAPATH")
    for folder in library or ():
        if not Path(folder).is_dir():
            raise typer.BadParameter(f"found no folder '{folder}', expected one that holds packages")
    if library:
        os.environ["MODELICAPATH"] = os.pathsep.join([*library, *filter(None, [old])])
        back = os.environ.pop if old is None else os.environ.__setitem__
        context.call_on_close(lambda: back("MODELICAPATH", old or ""))


def _library_option() -> Any:
    """`--library` of a command that takes a model by its name."""
    alone = typer.Typer(add_completion=False)
    alone.command()(_look_in)
    (option,) = (one for one in typer.main.get_command(alone).params if one.name == "library")
    option.expose_value = False
    option.callback = lambda ctx, parameter, folders: _look_in(ctx, folders)
    return option


def _first_line(name: str, place: str) -> str:
    """The first line of the docstring of a command, or the words of a group; its module is read, not imported."""
    path = Path(__file__).parents[1].joinpath(*place.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for one in tree.body:
        if isinstance(one, ast.FunctionDef) and one.name == name:
            return (ast.get_docstring(one) or "").partition("\n")[0]
        if isinstance(one, ast.Assign) and isinstance(one.value, ast.Call):  # app = group(words, ...)
            return ast.literal_eval(one.value.args[0])
    raise AssertionError(name)


def _drop_output() -> None:
    """Let what is left in the buffer of stdout vanish; Python would complain of it at its end."""
    with suppress(OSError, ValueError, AttributeError):  # stdout need not be a file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
