"""Rows and columns of a covariance by the names of what was fitted."""

from collections.abc import Sequence

import numpy as np

from gantrytau import ModelError


def named_covariance(
    owner: str, known: Sequence[str], matrix: np.ndarray, names: Sequence[str] | None
) -> np.ndarray:
    """Covariance (k, k) of some of the known names in their order, None for all. ModelError for others, by their owner."""
    wanted = list(known if names is None else names)
    strange = [name for name in wanted if name not in known]
    if strange:
        raise ModelError(
            f"{owner}.covariance: found {strange[0]!r}, expected names among {', '.join(known)}",
            argument="names",
        )
    rows = [known.index(name) for name in wanted]
    return matrix[np.ix_(rows, rows)]
