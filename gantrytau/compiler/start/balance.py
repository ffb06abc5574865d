"""Sizes of rows and columns of a matrix that bring its entries near to one, whatever units and sizes they come from.

The squares of the logarithms of all entries are made small (Curtis and Reid, IMA J. Appl. Math. 10, 1972). Sizes are
whole thousands, so that models of usual sizes are treated as they are.
"""

import numpy as np

NOISE = 1e-13  # of the largest entry of a row and of a column, below which an entry counts as rounding
ROUNDS = 30


def balance(matrix: np.ndarray, certainty: np.ndarray | int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Factors of rows and of columns, (m, 1) and (n,); certainty: -1 of rounding, 1 of what is none."""
    size = np.abs(np.nan_to_num(matrix))
    there = (size > NOISE * size.max(axis=0, initial=0.0)) & (
        size > NOISE * size.max(axis=1, keepdims=True, initial=0.0)
    )
    there = ((there & (certainty >= 0)) | (certainty > 0)) & (size > 0)
    logs = np.where(there, np.log10(np.where(there, size, 1.0)), 0.0)
    rows, columns = np.zeros((len(matrix), 1)), np.zeros(matrix.shape[1])
    in_row, in_column = np.maximum(there.sum(axis=1, keepdims=True), 1), np.maximum(there.sum(axis=0), 1)
    for _ in range(ROUNDS):
        rows = -((logs + there * columns).sum(axis=1, keepdims=True)) / in_row
        columns = -((logs + there * rows).sum(axis=0)) / in_column
    middle = np.median(columns[there.any(axis=0)]) if there.any() else 0.0
    return 10.0 ** (3 * np.round((rows + middle) / 3)), 10.0 ** (3 * np.round((columns - middle) / 3))
