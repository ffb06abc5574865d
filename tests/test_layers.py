"""The layers: models, optimica and fmu stand on gantrytau and do not know each other."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = {
    "gantrytau": ROOT / "gantrytau",
    "gantrytau_models": ROOT / "models" / "gantrytau_models",
    "gantrytau_optimica": ROOT / "optimica" / "gantrytau_optimica",
    "gantrytau_fmu": ROOT / "fmu" / "gantrytau_fmu",
}
FILES = [(package, file) for package, folder in PACKAGES.items() for file in sorted(folder.rglob("*.py"))]
COMMAND_LINE = ROOT / "gantrytau" / "cli.py"
COMMANDS = ROOT / "gantrytau" / "commands"  # the two are the composition root


def imports(tree: ast.AST, inside_function: bool = False) -> Iterator[tuple[str, bool]]:
    """The packages that a module imports, and whether it does so inside a function, or for type checkers only."""
    for node in ast.iter_child_nodes(tree):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            names = [node.module]
        yield from ((name.split(".")[0], inside_function) for name in names)
        for_types = isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        yield from imports(node, inside_function or for_types or isinstance(node, ast.FunctionDef))


def offences(package: str, file: Path) -> list[str]:
    """The packages that a file imports against the rule."""
    may_join = file == COMMAND_LINE or COMMANDS in file.parents
    return [
        name
        for name, inside_function in imports(ast.parse(file.read_text(encoding="utf-8")))
        if name in PACKAGES and name not in {package, "gantrytau"} and not (may_join and inside_function)
    ]


def test_the_source_is_found():
    assert {package for package, _ in FILES} >= {"gantrytau", "gantrytau_models"}


@pytest.mark.parametrize(("package", "file"), FILES, ids=lambda value: Path(value).name)
def test_a_module_imports_only_what_its_layer_may(package, file):
    assert offences(package, file) == []


def test_an_offence_is_noticed(tmp_path):
    wrong = tmp_path / "wrong.py"
    wrong.write_text("import gantrytau\ndef f():\n    from gantrytau_optimica.problem import at\n")
    assert offences("gantrytau_models", wrong) == ["gantrytau_optimica"]
    assert offences("gantrytau_optimica", wrong) == []
