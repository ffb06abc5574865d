"""Booleans that are true at instants only, `b = sample(start, period)`, as two branches of a `when`."""

from collections.abc import Iterable, Iterator

from gantrytau.modelica import tree


def with_pulses(items: Iterable[tree.EquationOrStatement]) -> Iterator[tree.EquationOrStatement]:
    """Equations, those of samples as a `when` that sets the Boolean at each instant and takes it back there."""
    for item in items:
        if not isinstance(item, tree.SimpleEquation) or not _is_sample(item.right):
            yield item
            continue
        at, name = item.at, item.left
        on, off = (
            tree.SimpleEquation(at, None, None, "=", name, tree.BooleanLiteral(at, true))
            for true in (True, False)
        )
        yield tree.Branching(at, None, None, "when", ((item.right, (on,)), (name, (off,))), None)


def _is_sample(e: tree.Expression) -> bool:
    return isinstance(e, tree.Call) and e.function.parts == (("sample", ()),)
