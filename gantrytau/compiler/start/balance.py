"""Sizes of rows and columns of a matrix that bring its entries near to one, whatever units and sizes they come from.

The squares of the logarithms of all entries are made small (Curtis and Reid, IMA J. Appl. Math. 10, 1972). Sizes are
whole thousands, so that models of usual sizes are treated as they are.
"""

from typing import Any

import numpy as np

from gantrytau.compiler.start.newton import Matrix

NOISE = 1e-13  # of the largest entry of a row and of a column, below which an entry counts as rounding
ROUNDS = 30


def balance(matrix: Matrix, certainty: Matrix | int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Factors of rows and of columns, (m, 1) and (n,); certainty: -1 of rounding, 1 of what is none."""
    m, n = matrix.shape
    sure: Any = certainty
    if isinstance(matrix, np.ndarray):
        i, j = np.nonzero(matrix)
        size, sure = np.abs(np.nan_to_num(matrix[i, j])), sure if np.isscalar(sure) else sure[i, j]
    else:  # both have the same entries
        i, j = np.repeat(np.arange(m), np.diff(matrix.indptr)), matrix.indices
        size, sure = np.abs(np.nan_to_num(matrix.data)), sure if np.isscalar(sure) else sure.data
    in_row, in_column = np.zeros(m), np.zeros(n)
    np.maximum.at(in_row, i, size)
    np.maximum.at(in_column, j, size)
    there = (size > NOISE * in_column[j]) & (size > NOISE * in_row[i])
    there = ((there & (sure >= 0)) | (sure > 0)) & (size > 0)
    i, j, logs = i[there], j[there], np.log10(size[there])
    in_row, in_column = np.bincount(i, minlength=m), np.bincount(j, minlength=n)
    rows, columns = np.zeros(m), np.zeros(n)
    for _ in range(ROUNDS):
        rows = -np.bincount(i, logs + columns[j], m) / np.maximum(in_row, 1)
        columns = -np.bincount(j, logs + rows[i], n) / np.maximum(in_column, 1)
    middle = np.median(columns[in_column > 0]) if logs.size else 0.0
    return 10.0 ** (3 * np.round((rows[:, None] + middle) / 3)), 10.0 ** (
        3 * np.round((columns - middle) / 3)
    )
