"""Components one behind the other: what comes out of one goes into the next."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

from gantrytau import Model, connect

INTO = ("frame_a", "flange_a", "pin_a", "u", "flange", "frame_b", "pin")
OUT_OF = ("frame_b", "flange_b", "pin_b", "y", "flange", "frame_a", "pin")


def row(*parts: Any) -> Iterator[Any]:
    """Connections of neighbours, `yield from row(self.world, self.hinge, self.body)`.

    A part is a component, which is entered by the first of INTO that it has and left by the first of OUT_OF; or a connector
    or a signal itself, `self.hinge.axis`, where another one is meant.
    """
    for before, after in pairwise(parts):
        yield connect(_end(before, OUT_OF), _end(after, INTO))


def _end(part: Any, names: tuple[str, ...]) -> Any:
    if not isinstance(part, Model):
        return part
    return next(getattr(part, name) for name in names if hasattr(part, name))


def in_a_row(name: str, **parts: Any) -> type[Model]:
    """A model of components that are connected one behind the other, in the order in which they are given."""

    def equations(self: Any) -> Iterator[Any]:
        yield from row(*(getattr(self, part) for part in parts))

    return type(name, (Model,), {"__module__": __name__, **parts, "equations": equations})
