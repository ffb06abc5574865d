"""The words of a message, read from the expression that makes it: what is fixed as it is, what varies as ⟨its name⟩."""

import ast
from collections.abc import Mapping
from dataclasses import dataclass, replace

WRAPPERS = {
    "repr",
    "str",
    "shown",
    "short",
    "float",
    "int",
    "round",
    "sorted",
    "list",
    "tuple",
    "plural",
    "map",
}
DEEP = 4  # calls and names that are followed into each other
KNOWN = {"did_you_mean": "; did you mean '⟨nearest name⟩'?"}

Functions = Mapping[str, ast.FunctionDef]  # those of the packages that one name stands for


@dataclass(frozen=True)
class Scope:
    """Where names of an expression are looked up: the assignments of its function and module, and functions by name."""

    assigned: Mapping[str, ast.expr]
    functions: Functions
    depth: int = 0

    def deeper(self) -> "Scope":
        """The same, one step further from the message."""
        return replace(self, depth=self.depth + 1)


def words(node: ast.expr, scope: Scope) -> str:
    """What an expression says as text."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, str) else str(node.value)
    if isinstance(node, ast.JoinedStr):
        return "".join(
            words(v.value, scope) if isinstance(v, ast.FormattedValue) else words(v, scope)
            for v in node.values
        )
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return words(node.left, scope) + words(node.right, scope)
    if isinstance(node, ast.IfExp):
        return _either(words(node.body, scope), words(node.orelse, scope))
    if isinstance(node, ast.Name) and scope.depth < DEEP:
        found = scope.assigned.get(node.id)
        if found is not None and is_text(found):
            return words(found, scope.deeper())
    if isinstance(node, ast.Call):
        return _called(node, scope)
    return f"⟨{spoken(node)}⟩"


def is_text(node: ast.expr) -> bool:
    """Whether an expression is certainly text."""
    if isinstance(node, ast.BinOp):
        return isinstance(node.op, ast.Add) and (is_text(node.left) or is_text(node.right))
    if isinstance(node, ast.IfExp):
        return is_text(node.body) and is_text(node.orelse)
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _either(one: str, other: str) -> str:
    """Two ways to say it: what is optional in brackets, else both."""
    if not one or not other:
        return f"[{one or other}]"
    return f"{one}|{other}" if len(one) < 12 and len(other) < 12 else f"[{one} | {other}]"


def _called(node: ast.Call, scope: Scope) -> str:
    name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
    if name in KNOWN:
        return KNOWN[name]
    if name == "Given" and node.args:
        value = _literal(node.args[1], scope) if len(node.args) > 1 else ""
        return f"{words(node.args[0], scope)}={value}"
    function = scope.functions.get(name)
    if function is not None and scope.depth < DEEP:
        returned = [n.value for n in ast.walk(function) if isinstance(n, ast.Return) and n.value is not None]
        if len(returned) == 1 and is_text(returned[0]):
            return words(returned[0], replace(scope.deeper(), assigned=assignments(function)))
    return f"⟨{spoken(node)}⟩"


def _literal(node: ast.expr, scope: Scope) -> str:
    """A value as Python writes it, where it is written down."""
    return repr(node.value) if isinstance(node, ast.Constant) else words(node, scope)


def spoken(node: ast.expr) -> str:
    """A word for a value in a message."""
    if isinstance(node, ast.Name):
        return node.id.replace("_", " ").strip()
    if isinstance(node, ast.Attribute):
        return "class" if node.attr == "__name__" else node.attr.replace("_", " ").strip()
    if isinstance(node, ast.Subscript | ast.Starred):
        return spoken(node.value)
    if isinstance(node, ast.UnaryOp):
        return spoken(node.operand)
    if isinstance(node, ast.Call):
        return _spoken_call(node)
    if isinstance(node, ast.Constant):
        return str(node.value)
    if isinstance(node, ast.IfExp):
        return spoken(node.body)
    if isinstance(node, ast.BoolOp):
        return spoken(node.values[0])
    if isinstance(node, ast.JoinedStr):
        return next((spoken(v.value) for v in node.values if isinstance(v, ast.FormattedValue)), "...")
    if isinstance(node, ast.BinOp):
        return spoken(node.right if isinstance(node.left, ast.Constant) else node.left)
    if isinstance(node, ast.GeneratorExp | ast.ListComp | ast.SetComp):
        return spoken(node.generators[0].iter)
    return "..."


def _spoken_call(node: ast.Call) -> str:
    name = node.func.id if isinstance(node.func, ast.Name) else getattr(node.func, "attr", "")
    if name == "len" and node.args:
        return f"number of {spoken(node.args[0])}"
    if name == "type" and node.args:
        return f"class of {spoken(node.args[0])}"
    if name == "join" and node.args:
        return spoken(node.args[0])
    if isinstance(node.func, ast.Attribute) and not node.args:
        return spoken(node.func.value)
    if name in WRAPPERS and node.args:
        return spoken(node.args[-1] if name == "map" else node.args[0])
    return name.replace("_", " ").strip() or "..."


def assignments(node: ast.AST) -> dict[str, ast.expr]:
    """Names that are assigned once below a node, with what they are assigned."""
    found: dict[str, ast.expr] = {}
    often = set[str]()
    for each in ast.walk(node):
        targets = each.targets if isinstance(each, ast.Assign) else ()
        for target in targets:
            if isinstance(target, ast.Name) and isinstance(each, ast.Assign):
                if target.id in found:
                    often.add(target.id)
                found[target.id] = each.value
        if isinstance(each, ast.AugAssign) and isinstance(each.target, ast.Name):
            often.add(each.target.id)
    return {name: value for name, value in found.items() if name not in often}
