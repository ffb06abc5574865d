"""Help pages as people read them: words for what options take instead of Python's types, paragraphs that wrap."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args, get_origin

WORDS = {bool: "", str: "TEXT", float: "NUMBER", int: "WHOLE NUMBER", Path: "FILE"}  # of what an option takes


def tidy(command: Any) -> None:
    """Change a command of Typer in place, once: what its options take, and paragraphs of its help as one line each."""
    for parameter in command.params:
        if parameter.param_type_name == "argument":
            parameter.display_type_rich = lambda ctx: None  # its name and its help say what it is
        elif parameter.metavar is None:
            parameter.metavar = _word(parameter)
    if command.help:
        paragraphs = command.help.replace("\r", "").split("\n\n")
        command.help = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
    if not isinstance(command.get_help_option, _HelpOption):
        command.get_help_option = _HelpOption(command.get_help_option)


class _HelpOption:
    """Makes the option --help of a command, which takes nothing."""

    def __init__(self, made: Callable[[Any], Any]):
        self.made = made

    def __call__(self, ctx: Any) -> Any:
        option = self.made(ctx)
        if option is not None:
            option.metavar = ""
        return option


def _word(parameter: Any) -> str | None:
    """What a parameter takes, in a word; "" of a flag, None where nothing is known of it."""
    kind = getattr(getattr(parameter, "type_descriptor", None), "annotation", None)
    if get_origin(kind) is list:
        kind = get_args(kind)[0]
    return WORDS.get(kind) if isinstance(kind, type) else None
