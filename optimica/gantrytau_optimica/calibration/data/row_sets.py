"""Sets of rows as marks: hash tables for as many numbers take a hundred times longer."""

from collections.abc import Sequence

import numpy as np

Rows = np.ndarray | Sequence[int]


def rows_of(*parts: Rows, without: Rows = ()) -> np.ndarray:
    """All rows of the parts but those `without`, each once, in order; rows count from 0."""
    count = 1 + max((int(np.max(part)) for part in (*parts, without) if len(part)), default=-1)
    marked = np.zeros(count, dtype=bool)
    for part in parts:
        marked[np.asarray(part, dtype=int)] = True
    marked[np.asarray(without, dtype=int)] = False
    return np.flatnonzero(marked)
