"""`Record`: the base of frozen records that are shown to people, in a console in one line, in a notebook as a table."""

from dataclasses import is_dataclass
from typing import Any

from gantrytau.describing.describe import describe
from gantrytau.describing.short_values import record_words


def _in_a_line(self: Any) -> str:
    return record_words(self) if is_dataclass(self) else f"<{type(self).__name__}>"


class Record:
    """Base of a dataclass whose `repr` is one line with arrays by shape and range; notebooks show a table of its fields.

    A `__repr__` that a class has of its own remains, and what it prints (`__str__`) opens what notebooks show.
    """

    __slots__ = ()

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        if "__repr__" not in vars(cls):  # where the class has one, the decorator `dataclass` writes none
            inherited = cls.__repr__
            written = hasattr(inherited, "__wrapped__")  # by `dataclass`
            words = _in_a_line if written or inherited is object.__repr__ else inherited
            setattr(cls, "__repr__", words)  # noqa: B010 - the type checker takes an assignment for another method

    def _repr_html_(self) -> str:
        return describe(self).html()
