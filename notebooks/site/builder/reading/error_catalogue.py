"""The catalogue of messages, collected from the sources: each place where an error or a finding is made.

A message says what was found and what was expected, and behind the last semicolon what to do.
"""

import ast
import re
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

from notebooks.site.builder.places import modules
from notebooks.site.builder.reading.message_words import Functions, Scope, assignments, words

ROOTS = {"GantryTauError", "UserWarning"}
FINDINGS = {"FmuFinding": 1, "Mistake": 1, "Finding": 1}  # class -> place of its words among the arguments
CALLS = {"require": 1}  # function -> place of its words


@dataclass(frozen=True)
class Message:
    """One message: its class, the module and line that make it, its words, what to do, and the argument that is wrong."""

    kind: str
    module: str
    line: int
    said: str
    remedy: str
    argument: str = ""


@cache
def messages() -> tuple[Message, ...]:
    """All messages of the packages, in the order of modules and lines."""
    trees = _trees()
    kinds = _kinds(trees)
    functions = _functions(trees)
    found = [m for name, tree in trees.items() for m in _of_module(name, tree, kinds, functions)]
    return tuple(dict.fromkeys(found))


@cache
def _trees() -> dict[str, ast.Module]:
    return {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in modules().items()}


def error_classes() -> dict[str, str]:
    """Classes of errors and warnings, and the first sentences of their documentation."""
    trees = _trees()
    kinds = _kinds(trees)
    return {
        node.name: " ".join((ast.get_docstring(node) or "").partition("\n\n")[0].split())
        for tree in trees.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef) and node.name in kinds
    }


def _kinds(trees: dict[str, ast.Module]) -> set[str]:
    """Names of classes of errors and warnings, below `ROOTS`."""
    bases = {
        node.name: {ast.unparse(base) for base in node.bases}
        for tree in trees.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ClassDef)
    }
    found = {"GantryTauError"}
    while more := {name for name, above in bases.items() if above & (found | ROOTS)} - found:
        found |= more
    return found


def _functions(trees: dict[str, ast.Module]) -> Functions:
    """Functions that are the only one of their name."""
    nodes = [n for tree in trees.values() for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)]
    count = Counter(node.name for node in nodes)
    return {node.name: node for node in nodes if count[node.name] == 1}


def _of_module(name: str, tree: ast.Module, kinds: set[str], functions: Functions) -> Iterator[Message]:
    top = assignments(ast.Module([n for n in tree.body if isinstance(n, ast.Assign)], []))
    for owner, node in _calls(tree):
        called = node.func.id if isinstance(node.func, ast.Name) else ""
        place = FINDINGS.get(called, CALLS.get(called, 0 if called in kinds else None))
        if place is None:
            continue
        text = _argument(node, place, ("message", "words"))
        if text is None:
            continue
        scope = Scope(top | (assignments(owner) if owner else {}), functions)
        said, remedy = split(_sentence(node, place, scope) if called in kinds else words(text, scope))
        said = said if called != "require" else f"⟨path⟩: {said}"
        if not re.search(r"[a-z]{3}", re.sub("⟨.*?⟩", "", said + remedy)):
            continue  # a message that was made elsewhere, passed on
        wrong = _argument(node, 99, ("argument",))
        kind = "ModelError" if called == "require" else called
        asked = wrong.value if isinstance(wrong, ast.Constant) and isinstance(wrong.value, str) else ""
        yield Message(kind, name, node.lineno, said, remedy, asked)


def _sentence(node: ast.Call, place: int, scope: Scope) -> str:
    """The words of an error: its place, what was found, and the parts of its message."""
    facts = {keyword.arg: words(keyword.value, scope) for keyword in node.keywords if keyword.arg}
    where = f"{facts['place']}: " if "place" in facts else ""
    found = f"found {facts['found']}, " if "found" in facts else ""
    parts = [words(part, scope) for part in node.args[place:]] or [facts.get("message", "")]
    return where + found + "".join(parts)


def _calls(tree: ast.Module) -> Iterator[tuple[ast.FunctionDef | None, ast.Call]]:
    """All calls, with the function that they stand in."""

    def below(
        node: ast.AST, owner: ast.FunctionDef | None
    ) -> Iterator[tuple[ast.FunctionDef | None, ast.Call]]:
        for child in ast.iter_child_nodes(node):
            inner = child if isinstance(child, ast.FunctionDef) else owner
            if isinstance(child, ast.Call):
                yield inner, child
            yield from below(child, inner)

    return below(tree, None)


def _argument(node: ast.Call, place: int, names: tuple[str, ...]) -> ast.expr | None:
    if place < len(node.args) and not any(isinstance(arg, ast.Starred) for arg in node.args[: place + 1]):
        return node.args[place]
    return next((keyword.value for keyword in node.keywords if keyword.arg in names), None)


def split(text: str) -> tuple[str, str]:
    """What a message says, and what it says to do: behind its last semicolon that is not within brackets, in a sentence of
    its own at the end, or as what was expected.
    """
    text = " ".join(text.split())
    depth, cut = 0, -1
    for k, letter in enumerate(text):
        depth += (letter in "([⟨") - (letter in ")]⟩")
        if letter == ";" and depth <= 0:
            cut = k
    if cut >= 0:
        return text[:cut].strip(), text[cut + 1 :].strip()
    sentence = re.fullmatch(r"(.*[a-z0-9)\]⟩]\.) ([A-Z][a-z]+ .{8,})", text)
    if sentence:
        return sentence[1], sentence[2]
    expected = re.fullmatch(r".*\bexpected (.+)", text)
    return text, f"expected: {expected[1]}" if expected else ""
