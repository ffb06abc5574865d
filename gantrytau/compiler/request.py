"""What a translation is asked for, by the names of the model."""

from collections.abc import Sequence
from dataclasses import dataclass

from gantrytau.border.refusal import ModelError


@dataclass(frozen=True)
class Request:
    """given: known instead of the declared inputs, or parameters that stay symbols; find: names and derivatives that
    must be available; states: preferred as states.
    """

    given: tuple[str, ...] = ()
    find: tuple[str, ...] = ()
    states: tuple[str, ...] = ()


def names(found: Sequence[str]) -> tuple[str, ...]:
    """A list of names as a tuple; ModelError for a text, which Python would take for a list of letters."""
    if isinstance(found, str):
        raise ModelError(f"found the text '{found}', expected a list of names; write ['{found}']")
    return tuple(found)
