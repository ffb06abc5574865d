"""Values given for quantities: one rule of shapes for starts, parameters, inputs, points and guesses.

An array has the shape of the quantity: () or a number, (n,), (rows, columns). A column (n, 1), as of CasADi, and a vector
(n,) are the same. Elements run column after column, as `element_names` does.
"""

from typing import Any

import casadi as ca
import numpy as np

from gantrytau.border.refusal import ModelError

Shape = tuple[int, ...]


def elements_of(
    place: str,
    value: Any,
    shape: Shape,
    expected: str = "a number or an array of numbers",
    finite: str = "finite numbers",
) -> list[float]:
    """The elements of numbers given for a quantity of that shape.

    expected, finite: in words, for what is no number, and for one that is not finite. Raises ModelError for these, and
    for another shape.
    """
    try:
        found = np.asarray(value, dtype=float)
    except (TypeError, ValueError, RuntimeError):
        raise ModelError(f"{place}: found {value!r}, expected {expected}") from None
    check_shape(place, found.shape, shape)
    if not np.all(np.isfinite(found)):
        raise ModelError(f"{place}: found {found.tolist()}, expected {finite}")
    return found.ravel(order="F").tolist()


def fits(found: Shape, shape: Shape) -> bool:
    """Whether an array of the shape that was found is a value of a quantity of `shape`."""
    single = int(np.prod(found)) == int(np.prod(shape)) == 1
    return single or found == shape or found == (*shape, 1)[:2] or (*found, 1) == shape


def check_shape(place: str, found: Shape, shape: Shape) -> None:
    """ModelError, with both shapes, unless they fit."""
    if fits(found, shape):
        return
    count, size = int(np.prod(found)), int(np.prod(shape))
    if count == size:
        words = f"found shape {found}, expected {shape}"
    else:
        words = f"found {count} values, expected {size}: shape {found} for {shape}"
    raise ModelError(f"{place}: {words}" + ("; give rows of columns" if len(shape) == 2 else ""))


def joined(value: Any) -> ca.SX:
    """Numbers, symbols, lists of these, or lists of rows of these, as one dense expression."""
    if isinstance(value, np.ndarray):
        value = value.tolist() if value.dtype == object else ca.DM(value)
    if isinstance(value, (list, tuple)):
        rows = any(isinstance(item, (list, tuple, np.ndarray)) for item in value)
        if any(isinstance(item, (ca.SX, ca.DM)) for row in value for item in (row if rows else (row,))):
            value = ca.vertcat(*(ca.horzcat(*row) for row in value)) if rows else ca.vertcat(*value)
        else:
            value = ca.DM(np.asarray(value, dtype=float))
    found = value if isinstance(value, ca.SX) else ca.SX(value)
    return found if found.is_dense() else ca.densify(found)


def numpy_shape(expression: ca.SX) -> Shape:
    """The shape that NumPy would give an expression, of which CasADi says (1, 1) of a number and (n, 1) of a vector."""
    rows, columns = expression.shape
    return (rows, columns) if columns != 1 else (rows,) if rows != 1 else ()
