"""A function of scalars on many rows of numbers: instruction by instruction, each on a column of all rows.

The numbers are those of CasADi, which takes row by row, in half of the time or less where rows are thousands.
"""

import casadi as ca
import numpy as np

from gantrytau.answers.many_points.array_program import OPERATIONS
from gantrytau.language.instructions import computed

LEAST, MOST = 4096, 16384  # rows: below, calls cost more than columns gain; above, columns leave the caches
READ = {ca.OP_INPUT, ca.OP_OUTPUT, ca.OP_CONST, *OPERATIONS}


def takes_columns(function: ca.Function) -> bool:
    """Whether all instructions of a function are known here."""
    if not function.is_a("SXFunction"):
        return False
    return all(function.instruction_id(k) in READ for k in range(function.n_instructions()))


def of_columns(function: ca.Function, *arguments: np.ndarray) -> list[list[np.ndarray]]:
    """Columns (rows,) of the nonzeros of each result, or scalars; arguments: (elements, rows), scalars (elements,)."""
    with np.errstate(all="ignore"):  # what is not a number is not chosen, or is told by who asks
        return computed(
            function,
            lambda argument, k: np.asarray(arguments[argument][k]),
            np.asarray,
            lambda operator, x: OPERATIONS[operator](*x),
        )
