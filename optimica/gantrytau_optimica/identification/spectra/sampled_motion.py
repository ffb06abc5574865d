"""What was measured, checked: rows of numbers, and inputs with outputs that were sampled together."""

from typing import Any

import numpy as np

from gantrytau import ModelError
from gantrytau_optimica.fitting.finding import rows_in_words


def sampled_motion(
    place: str, u: Any, y: Any, *, least: int, columns: int | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Inputs u (N, m) and outputs y (N, k) as arrays; (N,) is one of them.

    least: N that is needed; columns: m and k where they are known. ModelError, with the rows, for what is no such pair.
    """
    u, y = (_samples(place, letter, values, columns) for letter, values in (("u", u), ("y", y)))
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
    try:
        found = np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise ModelError(
            f"{place}: found {name} that is no array of numbers ({error}), expected rows of numbers",
            argument=name,
        ) from None
    found = found[:, None] if found.ndim == 1 and name != "t" else found
    shape, wanted = found.shape, "(N,), times in s" if name == "t" else "(N, n), a row for each sample"
    if found.ndim != (1 if name == "t" else 2):
        raise ModelError(f"{place}: found {name} of shape {shape}, expected {wanted}", argument=name)
    found.flags.writeable = False
    return found


def _samples(place: str, letter: str, values: Any, columns: int | None) -> np.ndarray:
    found = rows_of(place, letter, values)
    if columns not in (None, found.shape[1]):
        raise ModelError(
            f"{place}: found {letter} of shape {found.shape}, expected (N, {columns}): one row for each sample",
            argument=letter,
        )
    bad = np.flatnonzero(~np.isfinite(found).all(axis=1))
    if bad.size:
        raise ModelError(
            f"{place}: found {letter} that is not finite in {rows_in_words(bad)}; take a part without such rows",
            argument=letter,
        )
    return found
