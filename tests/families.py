"""Families of cases of which one stands for all in an ordinary run."""

import os
from collections.abc import Iterable
from typing import Any

import pytest

NIGHTLY = bool(os.environ.get("GANTRYTAU_NIGHTLY"))  # whole families, of which else a member stands for all


def first_of(cases: Iterable[Any], count: int = 1) -> list[Any]:
    """Cases for `parametrize`: the first `count` run always, the others with GANTRYTAU_NIGHTLY=1.

    A case of several arguments is a tuple, or a `pytest.param` already.
    """
    every = list(cases)
    return [*every[:count], *(_nightly(case) for case in every[count:])]


def _nightly(case: Any) -> Any:
    values = case if isinstance(case, tuple) else (case,)
    marks, identity = getattr(case, "marks", ()), getattr(case, "id", None)
    return pytest.param(*getattr(case, "values", values), marks=(*marks, pytest.mark.nightly), id=identity)
