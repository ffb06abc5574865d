"""The page of the sources: every module with the first line of its docstring, by package and folder."""

import ast
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

from notebooks.site.builder.places import PACKAGES, ROOT

OPENING = """# The sources, module by module

What stands in which file, as the file says itself. The pages of the manual have the order in which folders are read.
"""


def source_page() -> str:
    """The page in Markdown."""
    return OPENING + "".join(f"\n## {package}\n{_folders(place)}" for package, place in PACKAGES.items())


def _folders(package: Path) -> str:
    files = sorted(
        package.rglob("*.py"), key=lambda path: (path.parent, path.name != "__init__.py", path.name)
    )
    return "".join(_folder(folder, within) for folder, within in groupby(files, key=lambda path: path.parent))


def _folder(folder: Path, files: Iterator[Path]) -> str:
    lines = {path.stem: first_line(path) for path in files}
    about = lines.pop("__init__", "")
    rows = "".join(f"- `{name}`: {line}\n" for name, line in lines.items() if line)
    return f"\n### {folder.relative_to(ROOT).as_posix()}\n\n{about}\n\n{rows}" if about or rows else ""


def first_line(path: Path) -> str:
    """The first line of the docstring of a module."""
    return (ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").partition("\n")[0]
