"""Options of the command line from the arguments of the function that a command serves."""

import functools
import inspect
import re
from collections.abc import Callable
from pathlib import Path
from types import NoneType
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import typer

SIMPLE = (bool, int, float, str, Path)  # what one option can hold


def serves(
    function: Callable[..., Any], **options: Any
) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """A decorator: the command gets an option for each argument of `function` that is named, as its keywords.

    options: argument -> help, a `typer.Option`, or ... for what the function's docstring says of it. The type, words and
    default are those of the function; `None` among words is written "none".
    """
    served = inspect.signature(function).parameters

    def decorated(command: Callable[..., Any]) -> Callable[..., Any]:
        own = inspect.signature(command).parameters
        words = {name: _words(served[name]) for name in options}
        made = [_option(function, served[name], asked) for name, asked in options.items()]
        kept = [
            p.replace(kind=p.KEYWORD_ONLY)
            for name, p in own.items()
            if p.kind is not p.VAR_KEYWORD and name not in options
        ]
        parameters = sorted([*made, *kept], key=lambda p: p.default is not p.empty)  # those required first

        @functools.wraps(command)
        def call(**values: Any) -> Any:
            return command(
                **{n: words[n].get(value, value) if n in words else value for n, value in values.items()}
            )

        vars(call)["__signature__"] = inspect.Signature(parameters)
        call.__annotations__ = {p.name: p.annotation for p in parameters}
        return call

    return decorated


def _option(function: Callable[..., Any], served: inspect.Parameter, asked: Any) -> inspect.Parameter:
    """The parameter of a command for an argument of a function."""
    words = _words(served)
    kind: Any = Literal[tuple(words)] if words else _simple(served.annotation)
    default = next((text for text, word in words.items() if word == served.default), served.default)
    if isinstance(asked, typer.models.OptionInfo):
        info = asked
    else:
        says = described(function, served.name) if asked is ... else asked
        info = typer.Option(help=says, show_default=default is not None and default is not served.empty)
    if kind is bool and info.default is ...:
        flag = served.name.replace("_", "-")
        info.default = f"--{flag}/--no-{flag}" if default is True else f"--{flag}"
    if default is None:
        kind = kind | None
    return served.replace(kind=served.KEYWORD_ONLY, annotation=Annotated[kind, info], default=default)


def _members(hint: Any) -> tuple[Any, ...]:
    """The alternatives of an annotation."""
    return get_args(hint) if get_origin(hint) in (Union, type(int | str)) else (hint,)


def _words(served: inspect.Parameter) -> dict[str, Any]:
    """The words of an argument as they stand on the command line, with their values; none where it takes no words."""
    members = _members(served.annotation)
    words = [word for one in members if get_origin(one) is Literal for word in get_args(one)]
    if words and NoneType in members and served.default is not None:
        words.append(None)
    return {str(word).lower(): word for word in words}


def _simple(hint: Any) -> Any:
    """What an option can hold of what an argument takes."""
    kinds = [one for one in _members(hint) if one in SIMPLE]
    assert kinds, hint
    return kinds[0]


def described(function: Callable[..., Any], argument: str) -> str:
    """What a docstring says of an argument: `name: words`, up to the next sentence or argument."""
    text = " ".join((inspect.getdoc(function) or "").split())
    found = re.search(rf"(?:^|[.;,] )(?:\w+, )*{argument}(?:, \w+)*: (.*?)(?:[.;] |\.?$)", text)
    assert found, (function, argument)
    return f"{found[1][:1].upper()}{found[1][1:]}."


def printing(text: str) -> Callable[[bool], None]:
    """The callback of a flag that prints a text and ends the command, before anything is asked for."""

    def show(wanted: bool) -> None:
        if wanted:
            typer.echo(text, nl=False)
            raise typer.Exit

    return show
