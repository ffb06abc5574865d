"""What was read of the last problems, kept for a next call that says the same.

Methods of a problem are Python and may say something else each time: they are run in every call, and what they say is
compared whole, numbers to the last bit. What follows from it, the model translated first of all, is then the same.
"""

import hashlib
from io import BytesIO
from pickle import Pickler, PicklingError
from typing import Any

import casadi as ca

from gantrytau_optimica.problem.symbolic_problem import SymbolicProblem

MOST = 4  # problems that are kept, those that were asked for last
_KEPT: dict[str, SymbolicProblem] = {}  # by content


def kept_reading(content: str) -> SymbolicProblem | None:
    """What was read of a problem that said the same; "" is what cannot be compared."""
    found = _KEPT.pop(content, None)
    if found is not None:
        _KEPT[content] = found
    return found


def keep_reading(content: str, read: SymbolicProblem) -> None:
    """For a next call, in the place of what was not asked for longest."""
    if not content:
        return
    _KEPT[content] = read
    while len(_KEPT) > MOST:
        _KEPT.pop(next(iter(_KEPT)), None)


def content_of(*things: Any) -> str:
    """A hash of records, names and expressions of the same symbols; "" where something else is among them."""
    file = BytesIO()
    pickler = _WithoutExpressions(file, 5)
    try:
        pickler.dump(things)
    except (PicklingError, AttributeError, TypeError):
        return ""
    symbols = ca.symvar(ca.veccat(ca.SX(0, 1), *pickler.expressions))
    function = ca.Function("content", [ca.vertcat(ca.SX(0, 1), *symbols)], pickler.expressions)
    try:
        written = function.serialize()
    except RuntimeError:  # a function that is called inside has no written form
        return ""
    words = "\n".join([written, *(symbol.name() for symbol in symbols)])
    return hashlib.sha256(file.getvalue() + words.encode()).hexdigest()


class _WithoutExpressions(Pickler):
    """Writes all but expressions, which it collects in the order of their occurrence."""

    def __init__(self, file: BytesIO, protocol: int):
        super().__init__(file, protocol)
        self.expressions: list[ca.SX] = []

    def reducer_override(self, obj: Any) -> Any:
        """A constant as its value, another expression as the number that it has here."""
        if isinstance(obj, ca.SX):
            if obj.is_scalar() and obj.is_constant() and obj.nnz():
                return float, (float(obj),)
            self.expressions.append(obj)
            return int, (len(self.expressions),)
        if callable(obj) and not isinstance(obj, type):
            raise PicklingError("a function may say something else next time")
        return NotImplemented
