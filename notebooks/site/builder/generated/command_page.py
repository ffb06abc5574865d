"""The page of the command line: every command with its arguments and options, as `--help` tells them."""

import enum
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from notebooks.site.builder.generated.component_tables import table
from notebooks.site.builder.reading.docstrings import escaped, summary

WORDS = {
    float: "NUMBER",
    int: "NUMBER",
    str: "TEXT",
    Path: "PATH",
}  # what an option takes, where it has no word for it


def command_page() -> str:
    """The page in Markdown."""
    import typer

    from gantrytau.cli import app

    held = list(_commands(typer.main.get_command(app), "gantrytau"))
    text = "# Command line\n\nFor models of the library and for classes in files of your own; `--help` tells it, too.\n\n"
    rows = [(f"[`{path}`](#{_place(path)})", summary(command.help)) for path, command in held]
    text += table("", ("command", "what it does"), rows)
    return text + "".join(f"\n\n{_command(path, command)}" for path, command in held) + "\n"


def _commands(group: Any, path: str) -> Iterator[tuple[str, Any]]:
    """All commands below a group, by what is typed."""
    for name in group.list_commands(None):
        command = group.get_command(None, name)
        if hasattr(command, "commands"):
            yield from _commands(command, f"{path} {name}")
        else:
            yield f"{path} {name}", command


def _place(path: str) -> str:
    return path.replace(" ", "-")


def _command(path: str, command: Any) -> str:
    arguments = [one for one in command.params if one.param_type_name == "argument" and not one.hidden]
    options = [one for one in command.params if one.param_type_name == "option" and not one.hidden]
    parts = [f"({_place(path)})=\n## {path}", escaped(" ".join((command.help or "").split()))]
    parts.append(
        table("Arguments", ("name", "what"), [(f"`{_name(one)}`", escaped(_words(one))) for one in arguments])
    )
    rows = [(f"`{_name(one)}`", _default(one), escaped(_words(one))) for one in options]
    parts.append(table("Options", ("name", "default", "what"), rows))
    if command.epilog:
        parts.append(f"```\n{' '.join(command.epilog.removeprefix('Example: ').split())}\n```")
    return "\n\n".join(part for part in parts if part)


def _name(one: Any) -> str:
    """An option in all its ways, with what it takes; an argument by its word."""
    if one.param_type_name == "argument":
        return one.metavar or one.name.upper()
    names = "/".join((", ".join(reversed(one.opts)), *one.secondary_opts))
    kind = getattr(getattr(one, "type_descriptor", None), "annotation", None)
    return names if one.is_flag else f"{names} {one.metavar or _choices(kind) or WORDS.get(kind, 'VALUE')}"


def _choices(kind: Any) -> str:
    """The words of an option that takes one of them."""
    parts = [part for one in (kind, *get_args(kind)) if get_origin(one) is Literal for part in get_args(one)]
    return "|".join(map(str, parts))


def _default(one: Any) -> str:
    value = one.default.value if isinstance(one.default, enum.Enum) else one.default
    plain = value is None or value is False or callable(value) or value in ("", (), [])
    return "" if plain else f"`{value}`"


def _words(one: Any) -> str:
    return " ".join((getattr(one, "help", "") or "").split())
