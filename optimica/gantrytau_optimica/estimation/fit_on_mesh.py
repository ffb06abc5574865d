"""Least squares on one mesh, from an answer nearby: Gauss-Newton on the manifold of the equations.

    minimise |V (r + J dp)|^2 over dp within limits;   p + share dp, and the motion to it by Newton's method

V: weights of the residuals. Ipopt continues where a limit of the model's variables is active. `fitting/least_squares.py` has
neither manifold nor limits, and this iteration ends by standard deviations: hence its own loop.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gantrytau_optimica.estimation.residuals import Residuals, residuals
from gantrytau_optimica.estimation.weights import Weighing, Weights
from gantrytau_optimica.fitting.linear import column_norms, linear_least_squares
from gantrytau_optimica.solving.ipopt import Solution
from gantrytau_optimica.transcription.program import Program

STEPS = 25
SETTLED = 1e-5  # of a standard deviation, or
ROUGH, FIRM = 1e-3, 1e-2  # of it, that rounding may leave, and that limits of the model must cost to bind
FINE = 1e-11  # of its size: a negligible step of a parameter
SHARES = 0.5 ** np.arange(12)
RANK = 1e-11  # of the largest singular value of the normed Jacobian: directions in which no step is taken
LIMIT = 1e-7  # of typical sizes, by which a limit of the model may be passed
AT_BOUND = 1e-6  # of its size, closer than this a parameter stands at a limit
REWEIGHED = 40
MOST_STALLED = 2  # of them without a way by steps, as on a mesh that is too coarse for weights that settle
SAME = 1e-4  # relative: a change of the weights that changes nothing more

Solve = Callable[[Residuals, np.ndarray, Weights], np.ndarray | None]
Step = Callable[[float], None]  # told of the sum of squares before every step; may raise


@dataclass(frozen=True, eq=False)
class MeshFit:
    """Parameters and motion on one mesh: unknowns w (n,), residuals (N,) and Jacobian (N, k), over standard deviations.

    limited: whether limits of the model's variables are active.
    """

    residuals: Residuals
    w: np.ndarray
    errors: np.ndarray
    jacobian: np.ndarray
    weights: Weights
    limited: bool

    @property
    def numbers(self) -> np.ndarray:
        """Free parameters, (k,)."""
        return self.w[self.residuals.program.places.free]

    @property
    def sizes(self) -> np.ndarray:
        """Typical sizes of the free parameters, (k,)."""
        scale = self.residuals.program.places.scale[self.residuals.program.places.free]
        return np.maximum(np.abs(self.numbers), 1e-3 * scale)

    @property
    def inner(self) -> np.ndarray:
        """Mask of the free parameters without an active limit, (k,)."""
        free = self.residuals.program.problem.free
        low, high = np.array([n.min for n in free]), np.array([n.max for n in free])
        near = AT_BOUND * np.array([n.nominal or 1.0 for n in free])
        return (np.abs(self.numbers - low) > near) & (np.abs(self.numbers - high) > near)


def fit_on_mesh(
    found: Residuals,
    w: np.ndarray,
    weighing: Weighing,
    weights: Weights,
    solve: Solve,
    step: Step,
) -> MeshFit | None:
    """The best fit on the mesh of `found` from unknowns w near it; None where it is not found.

    solve: Ipopt's answer from unknowns with weights, for where limits of the model bind.
    """
    limited, stalled, fit = False, 0, None
    for _ in range(REWEIGHED):
        moved = None if limited else descended(found, w, weights, step)
        if moved is None:
            moved = solve(found, w, weights)
            if moved is None:
                return None
            _, gained, size = _change(found, moved, weights.roots)
            limited = gained > FIRM * size and not _inside(found, moved, -LIMIT)
            stalled += not limited
        w = moved
        errors, jacobian = found.values(w), found.jacobian(w)
        fit = MeshFit(found, w, errors, jacobian, weights, limited)
        if weighing.steady or stalled == MOST_STALLED:
            break
        before, weights = weights, weighing.weights(errors, jacobian, weights)
        if np.max(np.abs(weights.roots / before.roots - 1)) < SAME:
            break
    return fit


def descended(found: Residuals, w: np.ndarray, weights: Weights, step: Step) -> np.ndarray | None:
    """Unknowns of the least sum of squares; None if limits are passed or steps do not lead to it."""
    program, roots = found.program, weights.roots
    free, scale = program.places.free, program.places.scale[program.places.free]
    low, high = program.lbw[free] * scale, program.ubw[free] * scale
    at = found.on_manifold(w, np.clip(w[free], low, high))
    if at is None:
        return None
    cost = np.linalg.norm(found.values(at) * roots)
    for _ in range(STEPS):
        step(float(cost**2))
        change, gained, size = _change(found, at, roots)
        still = np.abs(change) <= FINE * np.maximum(np.abs(at[free]), 1e-3 * scale)
        if gained <= SETTLED * size or np.all(still):
            return at if _inside(found, at, LIMIT) else None
        moved, after = None, np.inf
        for share in SHARES:
            moved = found.on_manifold(at, at[free] + share * change)
            after = np.inf if moved is None else np.linalg.norm(found.values(moved) * roots)
            if after < cost:
                break
        if moved is None or not after < cost:
            # what is left to be gained is lost in the rounding of the residuals
            return at if gained <= ROUGH * size and _inside(found, at, LIMIT) else None
        at, cost = moved, after
    return None


def _change(found: Residuals, at: np.ndarray, roots: np.ndarray) -> tuple[np.ndarray, float, float]:
    """Next step of the free parameters, its gain, and the standard deviation of the weighted residuals."""
    program = found.program
    free = program.places.free
    scale = program.places.scale[free]
    low, high = program.lbw[free] * scale - at[free], program.ubw[free] * scale - at[free]
    errors, jacobian = found.values(at) * roots, found.jacobian(at) * roots[:, None]
    change = bounded_step(jacobian, errors, scale, low, high)
    size = np.linalg.norm(errors) / np.sqrt(max(errors.size - free.size, 1))
    return change, float(np.linalg.norm(jacobian @ change)), float(size)


def bounded_step(
    jacobian: np.ndarray, errors: np.ndarray, sizes: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """The step (k,) within low and high that makes |errors + jacobian step| least; of several the smallest."""
    from scipy.optimize import lsq_linear

    scaled = jacobian * sizes
    step = sizes * linear_least_squares(scaled, -errors, RANK)
    if np.all((step >= low) & (step <= high)):
        return step
    norms, low, high = sizes / column_norms(scaled), np.minimum(low, 0.0), np.maximum(high, 0.0)
    open_ = high - low > 0
    inside = lsq_linear(
        jacobian[:, open_] * norms[open_], -errors, ((low / norms)[open_], (high / norms)[open_]), "bvls"
    )
    step = np.zeros(sizes.size)
    step[open_] = np.clip(norms[open_] * inside.x, low[open_], high[open_])
    return step


def _inside(found: Residuals, w: np.ndarray, room: float) -> bool:
    """Whether the motion keeps the limits of the model, but for `room` of typical sizes (below 0: stays off them)."""
    program = found.program
    x = (w / program.places.scale)[found.others]
    low, high = program.lbw[found.others], program.ubw[found.others]
    rows = np.array(program.assembled.nlp(w / program.places.scale, [])[1]).ravel()
    unequal = program.lbg != program.ubg
    rows, lower, upper = rows[unequal], program.lbg[unequal], program.ubg[unequal]
    passed = [(low, low - x), (high, x - high), (lower, lower - rows), (upper, rows - upper)]
    return all(np.all(by <= room * np.maximum(1.0, np.abs(limit))) for limit, by in passed)


def solution_at(program: Program, w: np.ndarray, before: Solution) -> Solution:
    """Unknowns w of a fit as a solution of its program, with its multipliers.

    Equations: G_y^T lambda = -f_y; limits: the remaining gradient by the free parameters.
    """
    found = residuals(program)
    x, free, scale = w / program.places.scale, program.places.free, program.places.scale
    objective, rows = program.assembled.nlp(x, [])
    gradient = np.array(program.assembled.grad_f(x, [])[1]).ravel()
    multipliers, bounds = np.zeros(program.assembled.rows), np.zeros(w.size)
    equations, own = found.multipliers(w, gradient)
    multipliers[found.equations] = equations
    bounds[free] = own / scale[free]
    return replace(
        before, w=w, multipliers=multipliers, bound_multipliers=bounds, constraints=np.array(rows).ravel(),
        objective=float(objective),
    )  # fmt: skip
