"""Refusals of one argument, known by its name."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from gantrytau import ModelError


@contextmanager
def refused(argument: str) -> Iterator[None]:
    """What is done inside raises ModelError for an argument."""
    with pytest.raises(ModelError) as refusal:
        yield
    assert refusal.value.argument == argument, str(refusal.value)
