"""The door of a package: a public name is imported from its file when it is first asked for."""

import ast
import sys
from collections.abc import Callable
from importlib import import_module
from typing import Any


def door(package: str) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """`__getattr__` and `__dir__` of a package, whose own file imports its public names `if TYPE_CHECKING`.

    Of that file only the lines are read, for the module of each name.
    """
    module = sys.modules[package]
    loader: Any = module.__loader__
    places = {
        name.name: statement.module or ""
        for block in ast.parse(loader.get_source(package)).body
        if isinstance(block, ast.If)
        for statement in block.body
        if isinstance(statement, ast.ImportFrom)
        for name in statement.names
    }

    def get(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module '{package}' has no attribute '{name}'", name=name, obj=module)
        found = getattr(import_module(places[name]), name)
        setattr(module, name, found)
        return found

    return get, lambda: sorted({*vars(module), *places})
