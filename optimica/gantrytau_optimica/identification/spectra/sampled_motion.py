"""What was measured, checked: rows of numbers, and inputs with outputs that were sampled together."""

from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau.border.checks import array


def sampled_motion(
    place: str, u: Any, y: Any, *, least: int, columns: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Inputs u (N, m) and outputs y (N, k) as arrays; (N,) is one of them.

    least: N that is needed; columns: m and k where they are known. ModelError, with the rows, for what is no such pair.
    """
    u, y = (
        array(place, letter, rows_of(place, letter, values), (None, columns))
        for letter, values in (("u", u), ("y", y))
    )
    if len(u) != len(y) or len(y) < least:
        raise ModelError(
            f"{place}: found {len(u)} samples of u and {len(y)} of y, expected as many of both, {least} at least",
            argument="y",
        )
    for letter, values in (("u", u), ("y", y)):
        still = np.flatnonzero(np.ptp(values, axis=0) == 0)
        if still.size:
            raise ModelError(
                f"{place}: found that {letter}[{still[0]}] never changes, expected motion; leave it out, or excite it",
                argument=letter,
            )
    return u, y


def rows_of(place: str, name: str, values: Any) -> np.ndarray:
    """A read-only array: times t (N,), else rows (N, n); (N,) becomes one column. Raises ModelError for other shapes."""
    shapes = [(None,)] if name == "t" else [(None,), (None, None)]
    found = array(place, name, values, *shapes, finite=False)
    found = found[:, None] if found.ndim == 1 and name != "t" else found
    found.flags.writeable = False
    return found
