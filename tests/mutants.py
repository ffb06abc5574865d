"""Mutants: small faults put into the sources one by one, to see whether the tests of their package notice.

`python -m tests.mutants 300 --seed 1 --save killed.json` in a clean checkout, which it changes and restores; hours.
With `--like killed.json` of another version, mutants are those of that file whose line still stands in the module.
"""

import argparse
import ast
import json
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PACKAGES = {  # folder of sources -> folder of tests
    "gantrytau": "tests",
    "models/gantrytau_models": "tests/models",
    "optimica/gantrytau_optimica": "tests/optimica",
    "fmu/gantrytau_fmu": "tests/fmu",
}
SWAPS: dict[type[ast.AST], str] = {
    ast.Lt: "<=",
    ast.LtE: "<",
    ast.Gt: ">=",
    ast.GtE: ">",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.Is: "is not",
    ast.IsNot: "is",
    ast.In: "not in",
    ast.NotIn: "in",
    ast.Add: "-",
    ast.Sub: "+",
    ast.Mult: "/",
    ast.Div: "*",
    ast.Pow: "*",
    ast.And: "or",
    ast.Or: "and",
}
MESSAGES = ("raise", 'f"', "Literal", "Error(")  # lines with one of these only word what is said
Fault = tuple[int, str, str, str]
PYTEST = ["-m", "pytest", "-x", "-q", "-n0", "--only=short", "-p", "no:cacheprovider", "-p", "no:randomly"]
# s that a run with a fault may take longer than twice one without; then it hangs, and is noticed
PATIENCE = 30.0


def mutated(node: ast.AST) -> Iterator[str]:
    """A node with an operator swapped, a number changed by one, a condition turned, as text."""
    match node:
        case ast.Compare(left, [operator], [right]):
            yield f"({ast.unparse(left)} {SWAPS[type(operator)]} {ast.unparse(right)})"
        case ast.BinOp(left, operator, right) if type(operator) in SWAPS:
            yield f"(({ast.unparse(left)}) {SWAPS[type(operator)]} ({ast.unparse(right)}))"
        case ast.BoolOp(operator, values):
            yield f"({f' {SWAPS[type(operator)]} '.join(f'({ast.unparse(value)})' for value in values)})"
        case ast.UnaryOp(ast.Not(), operand):
            yield f"bool({ast.unparse(operand)})"
        case ast.Constant(int() | float() as value) if not isinstance(value, bool):
            yield repr(value + 1)


def faults(file: Path) -> list[Fault]:
    """(line, its text, the written expression, the faulty one) of a file, of functions only, without messages."""
    text = file.read_text(encoding="utf-8")
    lines = text.splitlines()
    found = set()
    for function in (f for f in ast.walk(ast.parse(text)) if isinstance(f, ast.FunctionDef)):
        for node in (node for statement in function.body for node in ast.walk(statement)):
            if isinstance(node, ast.expr) and node.lineno == node.end_lineno:
                line = lines[node.lineno - 1]
                if line.isascii() and not any(word in line for word in MESSAGES):
                    written = line[node.col_offset : node.end_col_offset]
                    found.update((node.lineno, line, written, faulty) for faulty in mutated(node))
    return sorted(found)


def tests_of(file: Path) -> Path:
    """The folder of tests that belongs to a source file: of its room, else of the rooms above."""
    package = next(p for p in PACKAGES if file.is_relative_to(ROOT / p))
    room = file.relative_to(ROOT / package).parent
    while room.parts and not (ROOT / PACKAGES[package] / room).is_dir():
        room = room.parent
    return (
        ROOT / PACKAGES[package] / room if room.parts or package != "gantrytau" else ROOT / "tests/language"
    )


def passes(folder: Path, patience: float | None) -> bool:
    """Whether the short tests of a folder pass in time."""
    command = [sys.executable, *PYTEST, folder]
    try:
        done = subprocess.run(command, cwd=ROOT, capture_output=True, timeout=patience)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode in (0, 5)  # passed, or there are none


def chosen(count: int, seed: int, like: Path | None) -> Iterator[dict[str, Any]]:
    """Mutants spread over the files by their numbers of faults."""
    draw = random.Random(seed)
    files = sorted(f for p in PACKAGES for f in (ROOT / p).rglob("*.py"))
    there = {str(f.relative_to(ROOT)): faults(f) for f in files}
    kept = []
    for old in json.loads(like.read_text()) if like else ():
        wanted = (old["line"], old["written"], old["faulty"])
        same = [fault for fault in there.get(old["file"], ()) if fault[1:] == wanted]
        kept += [(old["file"], same[0])] if same else []
    fresh = [(file, fault) for file, found in there.items() for fault in found]
    for file, (number, line, written, faulty) in [*kept, *draw.sample(fresh, count)][:count]:
        yield {
            "file": file,
            "number": number,
            "line": line,
            "written": written,
            "faulty": faulty,
            "kept": len(kept),
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--save", type=Path, default=Path("mutants.json"))
    parser.add_argument("--like", type=Path)
    asked = parser.parse_args()
    usual: dict[Path, float] = {}
    done = []
    for mutant in chosen(asked.count, asked.seed, asked.like):
        file, folder = ROOT / mutant["file"], tests_of(ROOT / mutant["file"])
        if folder not in usual:
            start = time.monotonic()
            assert passes(folder, None), f"{folder} fails without a fault"
            usual[folder] = time.monotonic() - start
        text = file.read_text(encoding="utf-8")
        lines = text.splitlines(keepends=True)
        at = mutant["number"] - 1
        lines[at] = lines[at].replace(mutant["written"], mutant["faulty"], 1)
        try:
            file.write_text("".join(lines), encoding="utf-8")
            mutant["killed"] = not passes(folder, 2 * usual[folder] + PATIENCE)
        finally:
            file.write_text(text, encoding="utf-8")
        done.append(mutant)
        asked.save.write_text(json.dumps(done, indent=1))
        print(f"{sum(m['killed'] for m in done)} of {len(done)} noticed", end="\r", flush=True)


if __name__ == "__main__":
    main()
