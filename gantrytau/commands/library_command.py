"""`gantrytau library`: models, components and prototypes by name."""

import importlib
import pkgutil
from collections.abc import Mapping
from typing import Any

import typer

from gantrytau import Declared
from gantrytau.commands.arguments import model_choice
from gantrytau.commands.arguments.options import Json
from gantrytau.commands.printing.reporting import as_json


def library(json: Json = False) -> None:
    """List what the library holds: complete models, components to build your own, and measures of real robots."""
    parts = model_choice.parts()
    whole = {name: found for name, found in model_choice.library().items() if name not in parts}
    held = {
        "models": _explained(whole),
        "components": {**components(), "gantrytau_models": _explained(parts)},
        "prototypes": model_choice.sources(),
    }
    if json:
        typer.echo(as_json(held))
        return
    _show("Models (gantrytau_models), for `gantrytau check`, `simulate` and `equations`", held["models"])
    for module, classes in held["components"].items():
        _show(f"Components of {module}", classes)
    _show("Prototypes (gantrytau_models.prototypes), for --prototype", held["prototypes"])


def components() -> dict[str, dict[str, str]]:
    """Module of gantrytau.mechanics, and the packages of one list -> class -> first line of its docstring."""
    return {module: _explained(classes) for module, classes in component_classes().items()}


def component_classes() -> dict[str, dict[str, type]]:
    """Module of gantrytau.mechanics, and the packages of one list -> its components by name."""
    from gantrytau import blocks, electrical, mechanics

    found: dict[str, dict[str, type]] = {}
    below = [info.name for info in pkgutil.iter_modules(mechanics.__path__, f"{mechanics.__name__}.")]
    for path in (*below, blocks.__name__, electrical.__name__):
        if path.rpartition(".")[2].startswith("_"):
            continue
        module = importlib.import_module(path)
        classes = {
            name: value
            for name, value in vars(module).items()
            if isinstance(value, type) and issubclass(value, Declared) and _belongs(name, value, module)
        }
        if classes:
            found[path] = classes
    return found


def _explained(classes: Mapping[str, type]) -> dict[str, str]:
    return {name: model_choice.first_sentence(found.__doc__) for name, found in classes.items()}


def _belongs(name: str, value: type, module: Any) -> bool:
    """Whether a module offers a class: it lists it, or the class is written in it or in a module below."""
    if hasattr(module, "__all__"):
        return name in module.__all__
    return not name.startswith("_") and f"{value.__module__}.".startswith(f"{module.__name__}.")


def _show(title: str, lines: dict[str, str]) -> None:
    width = max((len(name) for name in lines), default=0)
    typer.echo(f"\n{title}")
    for name, words in lines.items():
        typer.echo(f"  {name:{width}}  {words}".rstrip())
