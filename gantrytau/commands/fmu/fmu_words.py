"""Errors of the package in the words of who called a command: options with two dashes instead of arguments."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from gantrytau.commands.printing.reporting import CommandError
from gantrytau.errors import GantryTauError

_BEGINNINGS = (  # an argument that was given wrongly is an option that was given wrongly
    (r"^(?:cosimulate|export_fmu): found no (\w+), ", r"--\1: found none, "),
    (r"^(?:cosimulate|export_fmu): found (\w+)=([^,]+), ", r"--\1 \2: "),
    (r"^start (\S+?)(?=:| is )", r"--set \1"),
    (r"^inputs (\S+?)(?=:| at | is )", r"--input \1"),
    (r"^(platforms|given|find|states|tolerance): ", r"--\1: "),
)
_INSIDE = (
    (r"start=\{'([^']+)': ([^}]+)\}", r"--set \1=\2"),
    (r"inputs= or start=", "--input or --set"),
    (r"with start=", "with --set"),
    (r"isolate=(True|\[[^]]*\])", "--isolate"),
    (r"\b(stop|step|order|tolerance)='?([\w.+-]*\w)'?", r"--\1 \2"),
)


def in_options(message: str) -> str:
    """A message on arguments as one on options."""
    for pattern, words in (*_BEGINNINGS, *_INSIDE):
        message = re.sub(pattern, words, message)
    return message


@contextmanager
def speaking_of_options() -> Iterator[None]:
    """Errors in these words; those that begin with an option are CommandErrors."""
    try:
        yield
    except GantryTauError as error:
        message = in_options(str(error))
        if message.startswith("--"):
            raise CommandError(message) from error
        error.args = (message,)
        raise
