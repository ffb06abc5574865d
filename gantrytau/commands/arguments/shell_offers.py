"""What a shell offers behind Tab: models of the library, prototypes, files, classes in them, words of options.

Nothing of the user is executed for it: files are read, not imported. Where nothing is offered, shells offer files.
"""

import ast
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import typer

from gantrytau import Declared, Model, Parameter
from gantrytau.border import NamedObject
from gantrytau.commands.arguments import model_choice

Offers = list[tuple[str, str]]


def words(*choices: str) -> Callable[[str], list[str]]:
    """For an option that takes one of a few words."""

    def offered(incomplete: str) -> list[str]:
        return [word for word in choices if word.startswith(incomplete)]

    return offered


def models(incomplete: str) -> Offers:
    """Models by name, with prototypes in parentheses once these are opened, and classes in Python files."""
    library = model_choice.library()
    name, opened, begun = incomplete.partition("(")
    if opened:
        found = library.get(name)
        names = (
            model_choice.fitting_prototypes(found) if found and model_choice.takes_prototype(found) else ()
        )
        return [(f"{name}({one})", "") for one in names if one.startswith(begun)]
    parts = model_choice.parts()
    offers = [
        (key, model_choice.first_sentence(found.__doc__))
        for key, found in library.items()
        if key.startswith(incomplete) and key not in parts
    ]
    return [*offers, *classes(incomplete)]


def classes(incomplete: str) -> Offers:
    """Python files and folders, and behind the colon the classes of a file."""
    file, colon, begun = incomplete.rpartition(":")
    if colon and file.endswith(".py"):
        return [(f"{file}:{name}", words) for name, words in _classes(Path(file)) if name.startswith(begun)]
    folder, name = Path(incomplete).parent, "" if incomplete.endswith("/") else Path(incomplete).name
    folder = Path(incomplete) if incomplete.endswith("/") else folder
    return [
        (f"{path}/" if path.is_dir() else str(path), "")
        for path in sorted(folder.iterdir() if folder.is_dir() else ())
        if path.name.startswith(name) and not path.name.startswith((".", "_")) and _shown(path)
    ]


def _shown(path: Path) -> bool:
    return path.suffix == ".py" or (path.is_dir() and any(path.glob("*.py")))


def _classes(file: Path) -> Iterator[tuple[str, str]]:
    """Classes of a file with their first lines; none of a file that cannot be read."""
    try:
        tree = ast.parse(file.read_text(encoding="utf-8"))
    except (OSError, SyntaxError, ValueError):
        return
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield node.name, model_choice.first_sentence(ast.get_docstring(node))


def prototypes(ctx: typer.Context, incomplete: str) -> Offers:
    """Prototypes that the model of the command line takes, all where it is none of the library."""
    found = _model(ctx)
    names = model_choice.fitting_prototypes(found) if found else model_choice.prototype_names()
    return [(name, "") for name in names if name.startswith(incomplete)]


def settings(ctx: typer.Context, incomplete: str) -> Offers:
    """Parameters and components of a model of the library, as `m=`, and files of values."""
    found = _model(ctx)
    members: dict[str, Any] = dict(found.members()) if found else {}
    offers = [
        (f"{name}=", getattr(member, "description", ""))
        for name, member in members.items()
        if isinstance(member, Parameter) and name.startswith(incomplete)
    ]
    offers += [
        (f"{name}.", "")
        for name, member in members.items()
        if isinstance(member, Declared) and name.startswith(incomplete)
    ]
    return [
        *offers,
        *((str(path), "") for path in sorted(Path().glob("*.toml")) if path.name.startswith(incomplete)),
    ]


def _model(ctx: typer.Context) -> type[Model] | None:
    """The class of the library that is on the command line already; an unfinished option leaves it among the rest."""
    library = model_choice.library()
    texts = [text for text in (ctx.params.get("model"), *ctx.args) if isinstance(text, str)]
    return next((library[name] for text in texts if (name := NamedObject.read(text).name) in library), None)
