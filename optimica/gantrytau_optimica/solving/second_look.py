"""Where the objective falls although it is stationary: a maximum or a saddle, which Ipopt does not leave.

What a first guess holds at a place of symmetry has no slope there and never moves. So only where something did not move is
the curvature looked at: its least value along directions that keep equations and limits that bind,

    d' H d,   A d = 0,   H: Hessian of the Lagrangian, A: rows that are equations or bind, unknowns at limits held,

by Lanczos' method on the projected Hessian. Nocedal and Wright (2006), section 12.5.
"""

from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import ArpackError, LinearOperator, eigsh, splu

from gantrytau_optimica.solving.ipopt import Solution
from gantrytau_optimica.transcription.program import Program

STILL = 1e-6  # of its size: what moved by less did not move
NEAR = 1e-6  # of its size or of a limit: what is closer is at the limit
FALLS = 1e-6  # of the terms of a curvature: what is less negative is rounding
ASIDE = 0.1  # of its size: how far what moves most along the direction is moved
FEW = 20  # unknowns up to which all directions are looked at
LEAST = 1e-10  # added to rows that may repeat each other


def moved_aside(program: Program, solution: Solution, first: np.ndarray) -> np.ndarray | None:
    """Unknowns beside a solution, where the objective is less; None where it is a minimum, or all moved from `first`."""
    still = _still(program, solution.w - first)
    if not np.any(still):
        return None
    direction = _falling(program, solution, still)
    if direction is None:
        return None
    scale = program.places.scale
    step = direction * ASIDE / np.max(np.abs(direction))
    return np.clip(solution.w / scale + step, program.lbw, program.ubw) * scale


def _still(program: Program, moved: np.ndarray) -> np.ndarray:
    """Unknowns of signals that are where they were in the whole, and of free numbers that are, (n,)."""
    places = program.places
    small = np.abs(moved) <= STILL * places.scale
    found = small.copy()
    for layout in places.layouts:
        for number in range(len(layout.phase.signals)):
            mine = layout.of(number)
            found[mine] = bool(np.all(small[mine]))
        found[layout.knots] = False
    return found & (program.lbw < program.ubw)


def _falling(program: Program, solution: Solution, still: np.ndarray) -> np.ndarray | None:
    """A direction (n,) of scaled unknowns in which the Lagrangian is curved downwards most, if there is one."""
    x = solution.w / program.places.scale
    near = NEAR * np.maximum(1.0, np.abs(x))
    free = np.flatnonzero((x - program.lbw > near) & (program.ubw - x > near))
    g = solution.constraints
    kept = np.flatnonzero(np.minimum(g - program.lbg, program.ubg - g) <= NEAR * np.maximum(1.0, np.abs(g)))
    if not np.any(still[free]):
        return None
    upper = program.assembled.hess_lag(x, [], 1.0, solution.multipliers).sparse().tocsr()
    hessian = (upper + sparse.triu(upper, 1).T).tocsr()[free][:, free]
    rows = program.assembled.jac_g(x, [])[1].sparse().tocsr()[kept][:, free]
    n = free.size
    if hessian.nnz == 0:
        return None
    matrix = sparse.block_array([[sparse.eye_array(n), rows.T], [rows, -LEAST * sparse.eye_array(kept.size)]])
    try:
        factors = splu(matrix.tocsc())
    except RuntimeError:  # rows that repeat each other to the last digit
        return None

    def projected(v: np.ndarray) -> np.ndarray:
        return factors.solve(np.concatenate([np.ravel(v), np.zeros(kept.size)]))[:n]

    kind: Any = LinearOperator  # its stubs know only subclasses
    operator = kind((n, n), matvec=lambda v: projected(hessian @ projected(v)), dtype=np.float64)
    look: Any = eigsh
    start = np.where(still[free], 1.0 + 0.1 * np.sin(1.0 + 7.3 * np.arange(n)), 0.0)
    try:
        if n <= FEW:
            direction = np.linalg.eigh(operator @ np.eye(n))[1][:, 0]
        else:
            direction = look(operator, k=1, which="SA", v0=start, tol=1e-2, maxiter=200)[1][:, 0]
    except ArpackError:
        return None
    direction = projected(direction)
    curvature = float(direction @ (hessian @ direction))
    if not curvature < -FALLS * float(np.abs(direction) @ (abs(hessian) @ np.abs(direction))):
        return None
    found = np.zeros(x.size)
    found[free] = direction
    return found
