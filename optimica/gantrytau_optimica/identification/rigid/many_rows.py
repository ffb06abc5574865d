"""A function of scalars on many rows of numbers: instruction by instruction, each on a column of all rows.

The numbers are those of CasADi, which takes row by row, in half of the time or less where rows are thousands.
"""

import casadi as ca
import numpy as np

from gantrytau.language.instructions import computed

LEAST, MOST = 4096, 16384  # rows: below, calls cost more than columns gain; above, columns leave the caches
OPERATIONS = {
    ca.OP_ADD: np.add,
    ca.OP_SUB: np.subtract,
    ca.OP_MUL: np.multiply,
    ca.OP_DIV: np.divide,
    ca.OP_NEG: np.negative,
    ca.OP_SQ: np.square,
    ca.OP_SQRT: np.sqrt,
    ca.OP_INV: np.reciprocal,
    ca.OP_TWICE: lambda x: x + x,
    ca.OP_FABS: np.abs,
    ca.OP_SIN: np.sin,
    ca.OP_COS: np.cos,
    ca.OP_ATAN2: np.arctan2,
    ca.OP_EXP: np.exp,
    ca.OP_TANH: np.tanh,
    ca.OP_FMIN: np.fmin,
    ca.OP_FMAX: np.fmax,
    ca.OP_LT: np.less,
    ca.OP_LE: np.less_equal,
    ca.OP_EQ: np.equal,
    ca.OP_NE: np.not_equal,
    ca.OP_NOT: np.logical_not,
    ca.OP_AND: np.logical_and,
    ca.OP_OR: np.logical_or,
    ca.OP_IF_ELSE_ZERO: lambda condition, x: np.where(condition, x, 0.0),
}
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
