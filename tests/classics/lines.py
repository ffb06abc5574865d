"""How long a problem is in the toolkit's words."""

import ast
import inspect
import sys
import textwrap
from collections.abc import Iterator
from typing import Any


def lines_of(model: Any) -> int:
    """Lines of a class and of what it names of the tests: without docstrings, comments, empty lines and tables of data."""
    lines = set[tuple[str, int]]()
    for one in _named(model, set()):
        text, first = inspect.getsourcelines(one)
        tree = ast.parse(textwrap.dedent("".join(text)))
        told = {
            k
            for node in ast.walk(tree)
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node)
            for k in range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1)
        }
        lines |= {
            (inspect.getsourcefile(one) or "", first + k)
            for k, line in enumerate(text, 1)
            if k not in told and line.strip() and not line.strip().startswith("#")
        }
    return len(lines)


def _named(one: Any, seen: set[Any]) -> Iterator[Any]:
    """The class or function, its bases and what it names, as far as they are written in the tests."""
    if one in seen or not one.__module__.startswith("tests."):
        return
    seen.add(one)
    yield one
    there = vars(sys.modules[one.__module__])
    for node in ast.walk(ast.parse(textwrap.dedent(inspect.getsource(one)))):
        if isinstance(node, ast.Name):
            other = there.get(node.id)
            if inspect.isclass(other) or inspect.isfunction(other):
                yield from _named(other, seen)
