"""How the solution of a nonlinear program moves with unknowns that are held: the derivative of its conditions.

    minimise f(w), g(w) = 0, lower <= w <= upper; L = f + l g + z w; p: held unknowns; w: the others that are not at a limit
    A: rows of dg/dw that are equations, or limits that bind

    [ Lww + S   A' ] [ dw ]     [ Lwp ]
    [ A        -D  ] [ dl ] = - [ Ap  ] dp        df = (df/dp + l dg/dp) dp

Limits that bind with a multiplier are held, others are left out. A limit of which this cannot be told (both its
distance s and its multiplier z vanish) keeps the weight it has in the interior-point method: S = z / s, D = s / z.
Fiacco (1983), Introduction to Sensitivity and Stability Analysis in Nonlinear Programming, section 3.2; for the
weights Pirnay, Lopez-Negrete, Biegler (2012), Optimal sensitivity based on IPOPT, section 2.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, SuperLU, onenormest, splu

from gantrytau_optimica.solving.ipopt import Solution
from gantrytau_optimica.transcription.assemble import scipy_matrix
from gantrytau_optimica.transcription.program import Program

CLEAR = 100.0  # times larger than the other: a multiplier or a distance, both relative, that is told apart
LEAST = 1e-13  # distance from a limit, below which Ipopt's solutions do not go
TINY = 1e-30  # in place of zeros on the diagonal: pivots that vanish make SuperLU write to the console
SINGULAR = 1e14  # condition number from which on nothing is left of 16 digits


@dataclass(frozen=True, eq=False)
class ActiveSet:
    """Inequalities of unknowns or of rows: where they hold as equations, and where this cannot be told.

    weight: multiplier / distance, zero where there is no limit.
    """

    strong: np.ndarray
    weak: np.ndarray
    weight: np.ndarray


@dataclass(frozen=True, eq=False)
class Slopes:
    """Derivatives with respect to k held unknowns: objective (k,), unknowns (n, k) in their units, and the limits.

        defined: whether the binding limits determine the derivative of the unknowns; if not, it is that of the
    interior-point method, between those of both sides, or NaN where not even that one exists.
    """

    objective: np.ndarray
    unknowns: np.ndarray
    bounds: ActiveSet
    rows: ActiveSet
    defined: bool


def slopes(program: Program, solution: Solution, held: np.ndarray) -> Slopes:
    """Derivatives of the solution with respect to unknowns number `held` (k,), by one sparse factorisation."""
    scale = program.places.scale
    w, bound_multipliers = solution.w / scale, solution.bound_multipliers * scale
    gradient, jacobian, hessian = _derivatives(program, w, solution.multipliers)
    objective = (gradient + jacobian.T @ solution.multipliers)[held] / scale[held]
    fixed, equal = program.lbw == program.ubw, program.lbg == program.ubg
    of_bounds, of_rows = np.abs(bound_multipliers[~fixed]), np.abs(solution.multipliers[~equal])
    size = float(np.max(np.concatenate([of_bounds, of_rows]), initial=0.0))
    bounds = _limits(w, bound_multipliers, program.lbw, program.ubw, fixed, size)
    rows = _limits(solution.constraints, solution.multipliers, program.lbg, program.ubg, equal, size)
    unknowns = np.full((w.size, held.size), np.nan)
    for exact in (True, False):
        moving, matrix, right = _conditions(
            _Binding(fixed, equal, bounds, rows, exact), hessian, jacobian, held
        )
        moved = _solved(matrix, right, SINGULAR if exact else np.inf)
        if moved is not None:
            unknowns = np.zeros((w.size, held.size))
            unknowns[moving] = moved[: moving.size]
            break
    unknowns[held, np.arange(held.size)] = 1.0
    return Slopes(
        objective, unknowns * scale[:, None] / scale[held], bounds, rows, moved is not None and exact
    )


def objective_slopes(program: Program, solution: Solution, held: np.ndarray) -> np.ndarray:
    """Derivatives of the objective with respect to unknowns number `held`, (k,), from the multipliers."""
    scale = program.places.scale
    gradient, jacobian, _ = _derivatives(program, solution.w / scale, solution.multipliers)
    return (gradient + jacobian.T @ solution.multipliers)[held] / scale[held]


@dataclass(frozen=True, eq=False)
class _Binding:
    """Which unknowns and rows are fixed or equations, their limits, and whether strong ones are held exactly."""

    fixed: np.ndarray
    equal: np.ndarray
    bounds: ActiveSet
    rows: ActiveSet
    exact: bool


def _conditions(
    b: _Binding, hessian: Any, jacobian: Any, held: np.ndarray
) -> tuple[np.ndarray, Any, np.ndarray]:
    """Numbers of the unknowns that move, the matrix, and the right-hand sides."""
    outside, binding = b.fixed, b.equal
    soft, kept = b.bounds.weight, b.equal | (b.rows.weight > 0)
    if b.exact:
        outside, binding = outside | b.bounds.strong, binding | b.rows.strong
        soft, kept = np.where(b.bounds.weak, soft, 0.0), binding | b.rows.weak
    moving, kept = np.flatnonzero(~outside), np.flatnonzero(kept)
    # conditions that repeat each other leave a singular matrix unless they give a little
    give = np.where(binding, TINY if b.exact else LEAST, 1 / np.maximum(b.rows.weight, LEAST))[kept]
    border = jacobian[kept][:, moving]
    inner = hessian[moving][:, moving] + sparse.diags_array(soft[moving] + TINY)
    matrix = sparse.block_array([[inner, border.T], [border, -sparse.diags_array(give)]])
    right = -sparse.vstack([hessian[moving][:, held], jacobian[kept][:, held]]).toarray()
    return moving, matrix.tocsc(), right


def stationarity(program: Program, solution: Solution) -> float:
    """The largest entry of the gradient of the Lagrangian, of unknowns that are not fixed, relative to its terms."""
    scale = program.places.scale
    found = program.assembled.grad_f(solution.w / scale, [])[1]
    jacobian = scipy_matrix(program.assembled.jac_g(solution.w / scale, [])[1])
    gradient = np.array(found).ravel()
    terms = jacobian.T @ solution.multipliers
    total = gradient + terms + solution.bound_multipliers * scale
    size = max(float(np.max(np.abs(part), initial=0.0)) for part in (gradient, terms))
    return float(np.max(np.abs(total[program.lbw < program.ubw]), initial=0.0)) / (size or 1.0)


def _derivatives(program: Program, w: np.ndarray, multipliers: np.ndarray) -> tuple[np.ndarray, Any, Any]:
    """Gradient (n,) of the objective, Jacobian of the rows, Hessian of the Lagrangian, in scaled unknowns."""
    assembled = program.assembled
    gradient = np.array(assembled.grad_f(w, [])[1]).ravel()
    jacobian = scipy_matrix(assembled.jac_g(w, [])[1]).tocsr()
    upper = scipy_matrix(assembled.hess_lag(w, [], 1.0, multipliers)).tocsr()
    return gradient, jacobian, (upper + sparse.triu(upper, 1).T).tocsr()


def _limits(
    value: np.ndarray, multiplier: np.ndarray, lower: np.ndarray, upper: np.ndarray, equal: np.ndarray, size: float
) -> ActiveSet:  # fmt: skip
    bound = np.where(multiplier > 0, upper, lower)
    limited = ~equal & np.isfinite(bound)
    distance = np.where(limited, np.abs(value - np.where(limited, bound, 0.0)), np.inf)
    distance = np.maximum(distance, LEAST)
    weight = np.abs(multiplier) / distance
    relative = weight * np.maximum(1.0, np.abs(np.where(limited, bound, 0.0))) / (size or 1.0)
    weak = limited & (relative > 1 / CLEAR) & (relative < CLEAR)
    return ActiveSet(limited & (relative >= CLEAR), weak, np.where(limited, weight, 0.0))


def _solved(matrix: Any, right: np.ndarray, worst: float) -> np.ndarray | None:
    """The solution; None where the matrix is singular, or its condition number above `worst`."""
    if not matrix.shape[0]:
        return right
    try:
        factors = splu(matrix)
    except RuntimeError:  # exactly singular
        return None
    if np.isfinite(worst) and _condition(matrix, factors) > worst:
        return None
    found = factors.solve(right)
    return found + factors.solve(right - matrix @ found)  # one step of iterative refinement


def _condition(matrix: Any, factors: SuperLU) -> float:
    """An estimate of the condition number in the norm of sums of columns."""
    operator: Any = LinearOperator  # its stubs know only subclasses
    inverse = operator(
        matrix.shape,
        matvec=lambda b: factors.solve(np.ravel(b)),
        rmatvec=lambda b: factors.solve(np.ravel(b), "T"),
        dtype=np.float64,
    )
    estimate: Any = onenormest(inverse)
    return float(estimate) * float(abs(matrix).sum(axis=0).max())
